//! scratch
use foldfront::active_mesh::ActiveMesh;
use foldfront::engine::*;
use foldfront::oracle::Oracle;
use foldfront::refine::Strategy;
use foldfront::*;
use glam::*;
use in_memory::*;
use std::sync::Arc;
use std::time::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let mesh = mesh_io::read(&[std::path::PathBuf::from(&a[1])], &mut |_, _| {}).unwrap();
    let n = mesh.triangles.len();
    let t = Instant::now();
    let (log, rep) = simplify::build(mesh, &Default::default(), &mut |_, _| {}).unwrap();
    println!("build {:.2} us/tri {rep:?}", t.elapsed().as_secs_f64() * 1e6 / n as f64);
    let (lo, hi) = log.mesh.bounding_box().unwrap();
    let c = (DVec3::from(lo.map(f64::from)) + DVec3::from(hi.map(f64::from))) / 2.0;
    let ext = log.mesh.extent();
    let h = Arc::new(Hierarchy::new(&log).unwrap());
    let mut oracle = Oracle::new(&log).unwrap();
    let dist: f64 = a[2].parse().unwrap();
    let pix: f64 = a[3].parse().unwrap();
    let speed: f64 = a[4].parse().unwrap();
    let theta = view::theta_of_pixels(pix, 1080);
    let cams: Vec<view::View> = (0..300)
        .map(|i| {
            let ang = i as f64 * 0.01 * speed;
            let eye = c + DVec3::new(ang.cos(), 0.2, ang.sin()) * ext * dist;
            let dir = (c - eye).normalize();
            let q = {
                let r = dir.cross(DVec3::Y).normalize();
                DQuat::from_mat3(&DMat3::from_cols(r, r.cross(dir), -dir))
            };
            view::View::new(
                &view::Camera { position: eye, orientation: q, fov_y: 1.0, aspect: 16.0 / 9.0 },
                theta,
            )
        })
        .collect();
    for s in [Strategy::TopDown, Strategy::Front, Strategy::Event, Strategy::EventPublished] {
        let tree = InMemoryTree::new(h.clone());
        let m = ActiveMesh::new(&tree);
        let mut e = Engine::new(
            tree,
            m,
            Settings {
                strategy: s,
                rho: ext * dist * 0.01 * speed.max(0.1) * 1.05,
                omega: 0.0105 * speed.max(0.1),
                ..Settings::default()
            },
        )
        .unwrap();
        let mut sel = vec![];
        let mut find = vec![];
        let mut ap = vec![];
        let (mut tests, mut ch) = (0, 0);
        let mut last = None;
        for (i, v) in cams.iter().enumerate() {
            let r = e.advance(std::slice::from_ref(v)).unwrap();
            e.mesh_mut().clear_changes();
            if i > 0 {
                sel.push(r.select);
                find.push(r.select - r.apply);
                ap.push(r.apply);
                tests += r.tests;
                ch += r.unfolds + r.folds;
            }
            last = Some(r);
            if a.len() > 5 {
                if let Some(d) = oracle.compare(&e) {
                    println!("{s:?} frame {i} {d:?}");
                    break;
                }
            }
        }
        sel.sort();
        find.sort();
        ap.sort();
        let r = last.unwrap();
        let k = sel.len();
        println!(
            "{:16} select {:?} find {:?} apply {:?} tests {} changes {} ns/test {:.1} ns/change {:.1} active {} tris {}",
            s.name(),
            sel[k / 2],
            find[k / 2],
            ap[k / 2],
            tests / k as u64,
            ch / k as u64,
            find.iter().sum::<Duration>().as_nanos() as f64 / tests as f64,
            ap.iter().sum::<Duration>().as_nanos() as f64 / ch as f64,
            r.active_nodes,
            r.triangles
        );
    }
}
