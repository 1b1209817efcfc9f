//! Real files of meshes and heights: as many vertices and triangles as are known to be in them.

use libtest_mimic::Trial;

use crate::kit::{self, needs};
use crate::reading::{assert_well_formed, counts, read};

/// Files, vertices and triangles.
const MESHES: [(&str, usize, usize); 11] = [
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
];

/// A tile without voids.
const FULL: (usize, usize) = (1201 * 1201, 2 * 1200 * 1200);

fn meshes() -> impl Iterator<Item = Trial> {
    MESHES.into_iter().map(|(file, vertices, triangles)| {
        needs(&format!("mesh_io::counts::{}", kit::stem(file)), [file], move |path| {
            let mesh = read(&path).unwrap();
            assert_eq!(counts(&mesh), (vertices, triangles));
            assert_well_formed(&mesh);
        })
    })
}

fn tiles() -> impl Iterator<Item = Trial> {
    ["N36W118", "N36W119", "N37W118", "N37W119", "N47E009"].into_iter().map(|tile| {
        needs(&format!("mesh_io::tile::{tile}"), [&format!("terrain/{tile}.hgt")], |path| {
            assert_eq!(counts(&read(&path).unwrap()), FULL);
        })
    })
}

fn tiles_with_voids() -> impl Iterator<Item = Trial> {
    [("N27E086", 130_953), ("N46W122", 9_033)].into_iter().map(|(tile, voids)| {
        needs(&format!("mesh_io::tile_with_voids::{tile}"), [&format!("terrain/{tile}.hgt")], move |path| {
            let mesh = read(&path).unwrap();
            let (vertices, triangles) = counts(&mesh);
            assert!(vertices <= FULL.0 - voids && vertices > FULL.0 - 2 * voids, "{vertices}");
            assert!(triangles < FULL.1 && triangles > FULL.1 - 6 * voids, "{triangles}");
            assert_well_formed(&mesh);
        })
    })
}

/// Without a word about the scale, the relief is near the true one, in units of the spacing.
fn height_maps() -> impl Iterator<Item = Trial> {
    [
        ("terrain/alps_montblanc_647_16bit.png", 647, 4356.0 * 646.0 / 60_000.0),
        ("terrain/gcanyon_elev_1200_8bit.png", 1200, 152.0 * 0.2334),
    ]
    .into_iter()
    .map(|(file, side, relief)| {
        needs(&format!("mesh_io::height_map::{}", kit::stem(file)), [file], move |path| {
            let mesh = read(&path).unwrap();
            assert_eq!(counts(&mesh), (side * side, 2 * (side - 1) * (side - 1)));
            let (low, high) = mesh.bounding_box().unwrap();
            let ratio = (high[2] - low[2]) / relief;
            assert!((0.7..1.3).contains(&ratio), "{ratio}");
        })
    })
}

pub fn trials() -> Vec<Trial> {
    let bunny = needs("mesh_io::the_box_of_the_bunny", ["meshes/bunny.ply"], |path| {
        let (low, high) = read(&path).unwrap().bounding_box().unwrap();
        let listed = [-0.09469, 0.03299, -0.06187, 0.06101, 0.18732, 0.0588];
        for (found, listed) in low.into_iter().chain(high).zip(listed) {
            assert!((found - listed).abs() < 1e-5, "{found} {listed}");
        }
    });
    let tiles_of_mosaic =
        ["terrain/N36W118.hgt", "terrain/N36W119.hgt", "terrain/N37W118.hgt", "terrain/N37W119.hgt"];
    let mosaic = needs("mesh_io::mosaic", tiles_of_mosaic, |paths| {
        let mesh = read(&paths).unwrap();
        assert_eq!(counts(&mesh), (2401 * 2401, 2 * 2400 * 2400));
        let (low, high) = mesh.bounding_box().unwrap();
        assert_eq!((low[2], high[2]), (-80.0, 4404.0));
        // Two degrees of latitude, and as many of longitude at 37 north.
        assert!((high[1] - low[1] - 222_390.0).abs() < 1.0 && (high[0] - low[0] - 177_608.0).abs() < 10.0);
    });
    let all = meshes().chain(tiles()).chain(tiles_with_voids()).chain(height_maps());
    all.chain([bunny, mosaic]).collect()
}
