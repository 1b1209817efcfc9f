//! The backends that page, as their users meet them: built, described, verified, compared, and damaged.

use std::collections::BTreeMap;

use foldfront::construction::mesh_io;
use serde_json::Value;

use crate::workplace::{Workplace, grid};

const PAGING: [&str; 3] = ["meta-node", "detail-block", "mt-partition"];

#[test]
fn a_file_of_every_backend_is_built_described_and_verified() {
    let place = Workplace::new();
    for backend in PAGING {
        place.succeed(&format!("build grid.ply --backend {backend} -o grid.{backend}"));
        place.succeed(&format!("build grid.ply --backend {backend} -o again.{backend}"));
        let bytes = place.read(&format!("grid.{backend}"));
        assert!(bytes == place.read(&format!("again.{backend}")), "{backend}: the same mesh, other bytes");
        let info = place.succeed(&format!("info grid.{backend}"));
        assert!(info.contains(&bytes.len().to_string()), "{backend}: no {} bytes in {info}", bytes.len());
        let json: Value =
            serde_json::from_str(&place.succeed(&format!("info grid.{backend} --json"))).unwrap();
        assert_eq!(json.as_object().unwrap().len(), info.lines().count(), "{backend}");
        let verified = place.succeed(&format!("verify grid.{backend}"));
        assert_eq!(verified, format!("grid.{backend}: every page of {backend} is in order\n"));
    }
}

#[test]
fn how_a_backend_arranges_a_hierarchy_can_be_chosen() {
    let place = Workplace::new();
    let sizes = |options: &str| {
        place.succeed(&format!("build grid.ply {options} -o out"));
        place.succeed("verify out");
        place.read("out").len()
    };
    assert!(sizes("--backend detail-block --quantize") < sizes("--backend detail-block") * 3 / 4);
    assert_ne!(sizes("--backend detail-block --levels 2"), sizes("--backend detail-block --levels 5"));
    assert_ne!(sizes("--backend meta-node --levels 2"), sizes("--backend meta-node --levels 6"));
    assert_ne!(
        sizes("--backend mt-partition --patch 4 --partition 5"),
        sizes("--backend mt-partition --patch 20 --partition 50")
    );
}

/// The hashes of the cuts, by backend.
fn hashes(frames: &str) -> BTreeMap<String, Vec<String>> {
    let mut hashes: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for cells in frames.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>()) {
        assert_eq!((cells[14], cells[15]), ("0", "0"), "misses, or wrong nodes: {cells:?}");
        hashes.entry(cells[2].to_owned()).or_default().push(cells[22].to_owned());
    }
    hashes
}

#[test]
fn backends_are_compared_with_each_other_and_with_brute_force() {
    let place = Workplace::new();
    let exact = "--strategy top-down,front,event --path descent.path --check --out results";
    let all = "--backend in-memory,meta-node,detail-block,mt-partition";
    place.succeed(&format!("compare grid.ply {all} {exact} --pixels 20"));
    let hashes = hashes(&place.text("results/frames.csv"));
    assert_eq!(hashes.len(), 4, "{hashes:?}");
    assert!(hashes.values().all(|hashes| hashes.len() == 3 * 3));
    assert_eq!(hashes["in-memory"], hashes["meta-node"], "the same bounds, another cut");
    let curves = ["in-memory", "meta-node", "detail-block", "mt-partition"];
    for backend in curves {
        assert!(place.names("results").contains(&format!("selection-grid-{backend}.svg")));
    }

    // What `build` wrote is taken as it is, within little memory as well.
    for backend in PAGING {
        place.succeed(&format!("build grid.ply --backend {backend} -o grid.{backend}"));
        place.succeed(&format!("compare grid.{backend} {exact} --pixels 20 --page-memory 64K"));
        let own = self::hashes(&place.text("results/frames.csv"));
        assert_eq!(own[backend], hashes[backend], "{backend}");
    }
}

#[test]
fn frames_are_exported_drawn_and_measured_from_every_file() {
    let place = Workplace::new();
    place.succeed("export grid.ply --path descent.path --frame 2 -o grid.out.ply");
    let read = |name: &str| mesh_io::read(&[place.file(name)], &mut |_, _| ()).unwrap();
    let expected = read("grid.out.ply").triangles.len();
    for backend in PAGING {
        place.succeed(&format!("build grid.ply --backend {backend} -o grid.{backend}"));
        place.succeed(&format!("export grid.{backend} --path descent.path --frame 2 -o out.ply"));
        let triangles = read("out.ply").triangles.len();
        assert!(triangles >= expected * 9 / 10, "{backend}: {triangles} triangles, in memory {expected}");
        // So near that everything is shown.
        let finest =
            format!("export grid.{backend} --path descent.path --frame 2 --pixels 0.0001 -o out.ply");
        place.succeed(&finest);
        assert_eq!(read("out.ply").triangles.len(), grid().triangles.len(), "{backend}");
        place.succeed(&format!("render grid.{backend} --path descent.path --frame 2 -o out.png --width 64"));
        let measured = format!("deviation grid.{backend} --path descent.path --frames 2 --json");
        let measured: Value = serde_json::from_str(&place.succeed(&measured)).unwrap();
        assert_eq!(measured[0]["frame"], 2);
    }
}

#[test]
fn damage_and_contradictions_are_told_in_a_line() {
    let place = Workplace::new();
    for backend in PAGING {
        let name = format!("grid.{backend}");
        place.succeed(&format!("build grid.ply --backend {backend} -o {name}"));
        place.fail(&format!("build {name} -o other.log"), 1, &[&name, "is a hierarchy already"]);
        place.fail(&format!("compare {name} --backend in-memory"), 1, &[&name, "not for in-memory"]);
        let said = [&*name, "1 bytes of page memory are too few: a single change needs "];
        place.fail(&format!("compare {name} --page-memory 1 --out results"), 1, &said);
        let whole = place.read(&name);
        for at in [9, whole.len() / 3, whole.len() - 9] {
            let mut bytes = whole.clone();
            bytes[at] ^= 16;
            place.write("damaged", &bytes);
            place.fail("verify damaged", 1, &["damaged"]);
            place.write("damaged", &whole[..at]);
            place.fail("verify damaged", 1, &["damaged"]);
        }
    }
    place.fail("build grid.ply --backend disk -o out", 2, &["disk"]);
    place.fail("build grid.ply --backend mt-partition --partition 0 -o out", 2, &["partition"]);
    place.fail("compare grid.ply --cache everything", 2, &["p-cc"]);
    place.fail("compare grid.ply --page-memory 12X", 2, &["12X"]);
}

/// What of a frame does not depend on the machine, by backend, prefetch, strategy and frame.
fn repeatable(frames: &str) -> BTreeMap<[String; 4], Vec<String>> {
    let rows = frames.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let key = |cells: &[String]| [&cells[2], &cells[4], &cells[3], &cells[5]].map(Clone::clone);
    rows.map(|cells| (key(&cells), [&cells[9..15], &cells[16..]].concat())).collect()
}

#[test]
fn real_time_is_repeatable_and_checked() {
    let place = Workplace::new();
    let backends = PAGING.join(",");
    let command = format!(
        "compare grid.ply --backend {backends} --strategy top-down,front,event --prefetch paper,schedule,none \
         --path descent.path --pixels 20 --fps 60 --store-latency 20ms --store-bandwidth 4M --check"
    );
    let said = place.succeed(&format!("{command} --out once"));
    place.succeed(&format!("{command} --out twice"));
    let (once, twice) = (place.text("once/frames.csv"), place.text("twice/frames.csv"));
    let (once, twice) = (repeatable(&once), repeatable(&twice));
    assert_eq!(once, twice, "virtual time is the same every time");
    let misses = |row: &[String]| row[5].parse::<u64>().unwrap();
    for backend in PAGING {
        for prefetch in ["paper", "schedule", "none"] {
            let of = |strategy: &str| -> Vec<(String, Vec<String>)> {
                let is_it = |key: &[String; 4]| key[..3] == [backend, prefetch, strategy];
                once.iter()
                    .filter(|(key, _)| is_it(key))
                    .map(|(key, row)| (key[3].clone(), row.clone()))
                    .collect()
            };
            let event = of("event");
            assert_eq!(event.len(), 3, "{backend}, {prefetch}");
            for (other, event) in of("top-down").iter().zip(&event) {
                // Misses, and the cut.
                assert_eq!((&other.1[5], &other.1[12]), (&event.1[5], &event.1[12]), "{backend}, {prefetch}");
            }
            assert!(said.lines().any(|line| line.starts_with(backend) && line.contains(prefetch)), "{said}");
        }
        if backend == "mt-partition" {
            // All of it is one partition, which the first frame has waited for.
            continue;
        }
        let late: u64 = once.iter().filter(|(key, _)| key[0] == backend).map(|(_, row)| misses(row)).sum();
        assert!(late > 0, "{backend}: a store of 20 ms was never late");
    }
    let page = place.text("once/report.html");
    assert!(page.contains("a latency of 20ms") && page.contains("misses a frame"));
    place.fail("compare grid.ply --store-latency 5ms", 2, &["--fps"]);
    place.fail("compare grid.ply --fps 60 --wall-clock --store-latency 5ms", 2, &["--wall-clock"]);
    place.fail("compare grid.ply --prefetch oracle", 2, &["paper, printed, blocking, schedule, none"]);
}

/// A hundred objects side by side, in too little memory for all of them.
#[test]
fn a_scene_of_many_objects_is_compared() {
    let place = Workplace::new();
    place.succeed("build grid.ply --backend mt-partition --patch 4 --partition 4 -o grid.mt");
    let object = |i: u32| format!("grid.mt 1 0 0 {} 0 1 0 {} 0 0 1 0\n", 2 * (i % 10), 2 * (i / 10));
    place.write("many.scene", (0..100).map(object).collect::<String>());
    let command = "compare many.scene --path descent.path --strategy top-down,front,event --check";
    place.succeed(&format!("{command} --out results"));
    assert!(place.text("results/report.html").contains("least memory"));
    let hashes = hashes_of_strategies(&place.text("results/frames.csv"));
    assert_eq!(hashes.len(), 3);
    assert!(hashes.values().all(|cuts| cuts == &hashes["event"] && cuts.len() == 3), "{hashes:?}");
    let real_time = format!("{command} --prefetch schedule,none --fps 60 --out real");
    place.succeed(&real_time);
    let lines = place.text("real/frames.csv").lines().count();
    assert_eq!(lines, 1 + 3 * 3 * 2, "frames, strategies, ways to prefetch");

    place.fail("compare many.scene", 1, &["many.scene", "--path"]);
    place.fail(
        "compare many.scene --path descent.path --backend meta-node",
        1,
        &["many.scene", "mt-partition"],
    );
    place.fail("build many.scene -o new", 1, &["many.scene", "several objects"]);
    place.write("broken.scene", "grid.mt 1 0 0\n");
    place.fail("compare broken.scene --path descent.path", 1, &["broken.scene", "1"]);
}

fn hashes_of_strategies(frames: &str) -> BTreeMap<String, Vec<String>> {
    let mut hashes: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for cells in frames.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>()) {
        hashes.entry(cells[3].to_owned()).or_default().push(cells[22].to_owned());
    }
    hashes
}
