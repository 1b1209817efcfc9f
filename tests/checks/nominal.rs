//! A nominal pixel is a measured pixel.

use foldfront::Mesh;
use foldfront::experiment::compare::{Options, Subject};
use foldfront::experiment::deviation::Reference;
use foldfront::experiment::path::Path;
use foldfront::testing::cut::{Displayed, uniform_cut};

use crate::common::data;

const LINES: u32 = 1080;

/// At nominal 1 pixel, in frames spread over the path, one triangle inside the view's border, both ways: 99 % of the
/// surface within 1 pixel, all of it within 3; and a uniform cut through the same hierarchy that shows at most two
/// thirds of the adaptive cut's triangles in that view is worse than it.
pub fn nominal_is_measured(mesh: Mesh, path: &Path, frames: usize) {
    let log = data::log(mesh);
    let forest = log.forest().unwrap();
    let subject = Subject::new("", &log).unwrap();
    let reference = Reference::new(&log.mesh);
    let options = Options::default();
    for n in 0..frames {
        let frame = (2 * n + 1) * path.frames.len() / (2 * frames);
        let camera = path.camera(frame).unwrap();
        let mesh = subject.frame(path, frame, &options).unwrap();
        let adaptive = reference.deviation(&mesh, &camera, LINES);
        let (forward, reverse) = (adaptive.forward.inner, adaptive.reverse.inner);
        assert!(forward.count > 1000 && reverse.count > 1000, "frame {frame} shows nothing: {adaptive}");
        let p99 = forward.p99.max(reverse.p99);
        assert!(p99 <= 1.0 && forward.max.max(reverse.max) <= 3.0, "frame {frame}: {adaptive}");

        // The finest uniform cut with at most two thirds of the triangles in view.
        let uniform =
            |eps: f64| Displayed::new(&log, &uniform_cut(&log, &forest, eps as f32)).compact_mesh(&log.mesh);
        let most = adaptive.triangles_in_view * 2 / 3;
        let (mut fine, mut coarse) = (log.mesh.extent() * 1e-9, log.mesh.extent());
        while coarse / fine > 1.01 {
            let eps = (fine * coarse).sqrt();
            if reference.triangles_in_view(&uniform(eps), &camera) > most {
                fine = eps;
            } else {
                coarse = eps;
            }
        }
        let uniform = reference.deviation(&uniform(coarse), &camera, LINES);
        assert!(
            uniform.forward.inner.p99.max(uniform.reverse.inner.p99) > p99,
            "frame {frame}: {} triangles in view give {p99} pixels, and a uniform cut: {uniform}",
            adaptive.triangles_in_view,
        );
    }
}
