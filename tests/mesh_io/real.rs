//! The real data, where they are.

use super::*;

/// The folder of real files, where it is there.
fn data() -> Option<PathBuf> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data"));
    folder.is_dir().then(|| folder.to_owned())
}

#[test]
fn real_meshes() {
    let Some(data) = data() else { return };
    for (name, vertices, triangles) in [
        ("meshes/armadillo_100k.ply", 49_990, 99_976),
        ("meshes/beast.ply", 32_311, 64_618),
        ("meshes/bunny.ply", 34_834, 69_451),
        ("meshes/dragon.ply", 437_645, 871_414),
        ("meshes/happy.ply", 543_652, 1_087_716),
        ("meshes/horse.ply", 48_485, 96_966),
        ("meshes/lucy_100k.ply", 49_987, 99_970),
        ("meshes/ogre.ply", 62_194, 124_008),
        ("meshes/turbineblade_200k.ply", 99_519, 199_034),
        ("city/boston_blocks.obj", 436_528, 610_365),
        ("city/denhaag01_lod2_terrain.obj", 24_835, 41_183),
    ] {
        let mesh = read(&[data.join(name)]).unwrap();
        assert_eq!(counts(&mesh), (vertices, triangles), "{name}");
        assert_well_formed(&mesh);
    }
    let mesh = read(&[data.join("meshes/bunny.ply")]).unwrap();
    let (low, high) = mesh.bounding_box().unwrap();
    for (found, listed) in
        low.into_iter().chain(high).zip([-0.09469, 0.03299, -0.06187, 0.06101, 0.18732, 0.0588])
    {
        assert!((found - listed).abs() < 1e-5, "{found} {listed}");
    }
}

#[test]
fn real_terrain() {
    let Some(data) = data() else { return };
    let terrain = |name: &str| data.join("terrain").join(name);
    let full = (1201 * 1201, 2 * 1200 * 1200);
    for name in ["N36W118.hgt", "N36W119.hgt", "N37W118.hgt", "N37W119.hgt", "N47E009.hgt"] {
        assert_eq!(counts(&read(&[terrain(name)]).unwrap()), full, "{name}");
    }
    for (name, voids) in [("N27E086.hgt", 130_953), ("N46W122.hgt", 9_033)] {
        let mesh = read(&[terrain(name)]).unwrap();
        assert!(
            mesh.positions.len() <= full.0 - voids && mesh.positions.len() > full.0 - 2 * voids,
            "{name}"
        );
        assert!(mesh.triangles.len() < full.1 && mesh.triangles.len() > full.1 - 6 * voids, "{name}");
        assert_well_formed(&mesh);
    }
    for (name, side, relief) in [
        ("alps_montblanc_647_16bit.png", 647, 4356.0 * 646.0 / 60_000.0),
        ("gcanyon_elev_1200_8bit.png", 1200, 152.0 * 0.2334),
    ] {
        let mesh = read(&[terrain(name)]).unwrap();
        assert_eq!(counts(&mesh), (side * side, 2 * (side - 1) * (side - 1)), "{name}");
        // Without a word about the scale, the relief is near the true one, in units of the spacing.
        let (low, high) = mesh.bounding_box().unwrap();
        let ratio = (high[2] - low[2]) / relief;
        assert!((0.7..1.3).contains(&ratio), "{name}: {ratio}");
    }
}

#[test]
fn real_mosaic() {
    let Some(data) = data() else { return };
    let tiles = ["N36W118", "N36W119", "N37W118", "N37W119"].map(|n| data.join(format!("terrain/{n}.hgt")));
    let mesh = read(&tiles).unwrap();
    assert_eq!(counts(&mesh), (2401 * 2401, 2 * 2400 * 2400));
    let (low, high) = mesh.bounding_box().unwrap();
    assert_eq!((low[2], high[2]), (-80.0, 4404.0));
    // Two degrees of latitude, and as many of longitude at 37 north.
    assert!((high[1] - low[1] - 222_390.0).abs() < 1.0 && (high[0] - low[0] - 177_608.0).abs() < 10.0);
}
