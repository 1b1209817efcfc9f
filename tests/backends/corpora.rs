//! The corpora of the fuzz targets, replayed with the same checks; and of what has been found by fuzzing, what is said of it now.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use foldfront::collapse_log;
use foldfront::construction::mesh_io;
use foldfront::experiment::path::{self, import};
use foldfront::experiment::store::{self, Backend, BuildOptions, Store};
use foldfront::experiment::stored_scene::read_scene;

#[path = "../../fuzz/src/targets/mod.rs"]
pub mod targets;

fn corpora() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpora")
}

/// In parts, so that they run beside each other: those of one class.
fn replay(class: targets::Class) {
    let folder = tempfile::tempdir().unwrap();
    let desk = targets::Desk::new(folder.path());
    for target in targets::ALL.iter().filter(|target| target.class == class) {
        let (mut taken, mut refused) = (0, 0);
        for entry in fs::read_dir(corpora().join(target.name)).unwrap() {
            let file = entry.unwrap().path();
            let bytes = fs::read(&file).unwrap();
            let outcome = catch_unwind(AssertUnwindSafe(|| (target.run)(&bytes, &desk)));
            let was_taken = outcome.unwrap_or_else(|_| panic!("{}", file.display()));
            *(if was_taken { &mut taken } else { &mut refused }) += 1;
        }
        assert!(taken > 0, "{}: nothing in the corpus is read, {refused} files are refused", target.name);
    }
}

#[test]
fn the_corpora_of_meshes_paths_and_logs() {
    replay(targets::Class::Plain);
}

#[test]
fn the_corpora_of_hierarchies_that_page() {
    replay(targets::Class::Paging);
}

#[test]
fn the_corpora_of_archives() {
    replay(targets::Class::Archive);
}

#[test]
fn every_corpus_has_a_target() {
    for entry in fs::read_dir(corpora()).unwrap() {
        let name = entry.unwrap().file_name();
        assert!(targets::ALL.iter().any(|target| *target.name == *name), "{name:?}");
    }
}

/// What is said of a file of the corpora that is wrong, without its folder.
fn said(name: &str) -> String {
    let file = corpora().join(name);
    let text = match file.extension().unwrap().to_str().unwrap() {
        "fold" | "meta" | "xfm" | "mt" => {
            Store::open(&file).and_then(|store| store.verify()).unwrap_err().to_string()
        }
        "path" => path::Path::read(&file).unwrap_err().to_string(),
        "txt" => {
            let ground = crate::common::bumpy_grid(5, &mut crate::common::seeded(1));
            import::import(&file, &ground, &import::Options::default()).unwrap_err().to_string()
        }
        "scene" => read_scene(&file).unwrap_err().to_string(),
        _ => mesh_io::read(&[&file], &mut |_, _| ()).unwrap_err().to_string(),
    };
    assert!(text.len() < 400 && !text.contains(char::is_control), "{text}");
    text.replace(&format!("{}/", file.parent().unwrap().display()), "")
}

fn says(name: &str, text: &str) {
    let said = said(name);
    assert!(said.contains(text), "{name}: {said}");
}

/// `verify` passed them, and a front that fetched around the page above came upon them.
#[test]
fn pages_below_that_nothing_leads_to_are_found() {
    says("meta/pages-below-that-nothing-leads-to.meta", "nothing leads to a page below");
}

#[test]
fn root_pages_are_those_of_the_roots() {
    says("meta/root-pages-unlike-the-roots.meta", "offset 48: the number of root pages");
}

/// A bit for each of them would have been made room for.
#[test]
fn there_is_room_for_all_collapses_of_meta_nodes() {
    says("meta/more-collapses-than-there-is-room-for.meta", "offset 20: the number of collapses");
}

#[test]
fn initial_vertices_have_faces() {
    says("xfm/initial-vertex-without-a-face.xfm", "which no face has");
}

#[test]
fn faces_around_an_initial_vertex_are_one_fan() {
    says("xfm/initial-vertex-in-several-fans.xfm", "around which faces are several fans");
}

#[test]
fn words_without_use_are_zero() {
    says("xfm/word-without-use.xfm", "offset 132: a word without use is 1, expected 0");
}

/// Unfolded and folded again, it lay where it had not been before.
#[test]
fn a_vertex_has_one_place_in_all_records() {
    says("mt/vertex-in-two-places.mt", "another place of vertex");
}

/// With the least memory, the cut was never reached.
#[test]
fn the_largest_change_is_as_large_as_the_header_says() {
    says("mt/largest-change-too-small.mt", "offset 104: bytes of the largest change");
    says("mt/largest-change-smaller-than-a-node.mt", "offset 104: bytes of the largest change");
}

/// `verify` passed it, and no engine took it.
#[test]
fn an_origin_is_where_a_camera_can_be() {
    says(
        "fold/origin-beyond-any-camera.fold",
        "z of the origin of the georeference is -8.98846567431158e307",
    );
}

#[test]
fn numbers_of_a_georeference_are_said_in_few_digits() {
    says("fold/move-of-300-digits.fold", "the largest move of the georeference is -1e308");
}

/// Room was made for 9 million frames.
#[test]
fn two_samples_are_not_worth_days_of_frames() {
    says("import/two-samples-days-apart.txt", "160000.0 s at 60 frames a second are more than 302000 frames");
}

#[test]
fn no_word_of_a_path_is_said_whole() {
    says("path/field-of-view-of-many-words.path", ":1: fov \"1.0# fov");
    says("path/number-of-many-digits.path", ":3: \"7777");
    says("path/times-of-300-digits.path", ":4: the time -1e308 is not after 1e308");
    said("import/unit-of-many-words.txt");
    says("scene/word-of-many-digits.scene", "line 1: \"7777");
    says("scene/numbers-of-300-digits.scene", "line 1: the matrix");
}

#[test]
fn what_libraries_say_is_one_line() {
    says("ply/type-with-a-control-character.ply", "Unknown scalar type: fl\u{fffd}at");
    says("ply/type-of-a-thousand-characters.ply", "Unknown scalar type");
    says(
        "zip/name-with-zeros.zip",
        "name-with-zeros.zip/\u{fffd}\u{fffd}\u{fffd}W119.hgt: the name of a height tile",
    );
}

/// Room was made for 128 MiB.
#[test]
fn a_tag_is_no_longer_than_its_file() {
    says("tif/tag-longer-than-the-file.tif", "more than the file");
}

#[test]
fn a_map_lies_at_a_longitude() {
    says("tif/longitude-that-is-no-number.tif", "the middle of the map is at a longitude of NaN degrees");
}

#[test]
fn corners_of_base_triangles_are_at_three_vertices() {
    says("meta/base-triangle-with-a-doubled-corner.meta", "of which two are at one vertex");
}

/// The file of partitions that was made of it could not be opened.
#[test]
fn spheres_without_one_around_them_are_refused() {
    let log = collapse_log::read_log(&corpora().join("fold/spheres-too-far-apart-for-one.fold")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let built = folder.path().join("built.mt");
    let error = store::write(Backend::MtPartition, &built, &log, &BuildOptions::default()).unwrap_err();
    assert!(error.to_string().contains("radius: inf"), "{error}");
    assert!(!built.exists());
}

#[test]
fn a_warning_says_places_in_few_digits() {
    let file = corpora().join("import/height-of-300-digits.csv");
    let mut ground = crate::common::bumpy_grid(5, &mut crate::common::seeded(1));
    let metres_per_degree = [75_000.0, 111_000.0];
    ground.georeference.degrees =
        Some(foldfront::container::DegreeMap { longitude: 8.0, latitude: 47.0, metres_per_degree });
    let options = import::Options { rate: 1.0, fit: false, ..import::Options::default() };
    let mut warnings = Vec::new();
    import::import_warning(&file, &ground, &options, &mut |warning| warnings.push(warning.to_string()))
        .unwrap();
    assert!(warnings.iter().any(|warning| warning.contains("no camera is near the mesh")), "{warnings:?}");
    assert!(warnings.iter().all(|warning| warning.len() < 400), "{warnings:?}");
}
