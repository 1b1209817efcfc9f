//! Table 1: what it takes to make the files, and how large they are.

use meta_node::BuildOptions;

use crate::subject::{inputs, kept, log, meta_nodes, open, processor_time};

pub fn table() {
    println!(
        "mesh          triangles  log s  meta s  input MB  log MB  meta MB  bytes/tri  levels  pages  largest  nodes/page"
    );
    for name in ["bunny", "horse", "lucy_100k", "turbineblade_200k", "dragon", "happy", "sierra"] {
        let Some((log, took)) = log(name) else { continue };
        let start = processor_time();
        let file = meta_nodes(name, &log, &BuildOptions::default());
        let meta = processor_time() - start;
        let megabytes =
            |file: &std::path::Path| std::fs::metadata(file).map_or(0.0, |m| m.len() as f64 / 1e6);
        let input: f64 = inputs(name).iter().flatten().map(|file| megabytes(file)).sum();
        let facts: std::collections::HashMap<_, _> = open(&file).facts().into_iter().collect();
        open(&file).verify().expect("just written");
        println!(
            "{name:18} {:8}  {}  {meta:6.2}  {input:8.1}  {:6.1}  {:7.1}  {:>9}  {:>6}  {:>5}  {:>7}  {:>10}",
            log.mesh.triangles.len(),
            took.map_or("  -  ".to_owned(), |took| format!("{took:5.1}")),
            megabytes(&kept(&format!("{name}.log"))),
            megabytes(&file),
            facts["bytes a triangle"],
            facts["levels of a block"],
            facts["pages"],
            facts["largest page, bytes"],
            facts["nodes a page"],
        );
        if name == "dragon" {
            for (levels, page_bytes) in
                [(3, 4096), (4, 4096), (5, 4096), (6, 4096), (7, 4096), (6, 8192), (7, 16384), (5, 0), (6, 0)]
            {
                let options = BuildOptions { levels: Some(levels), page_bytes };
                let file = kept("other.meta");
                let report = meta_node::write(&file, &log, &options).expect("target is writable");
                let holders = report.pages * report.largest_page;
                println!(
                    "  {levels} levels, pages of {page_bytes:5}: {:6} blocks on {:6} pages, largest {:5}, {:5.1} bytes a \
                     triangle, {:4.0} % of a place holder used",
                    report.blocks,
                    report.pages,
                    report.largest_page,
                    report.bytes as f64 / log.mesh.triangles.len() as f64,
                    100.0 * report.bytes as f64 / holders as f64
                );
            }
        }
    }
}
