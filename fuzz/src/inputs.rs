//! What makes the inputs of each target: a corpus, and the changes that are made to it.

use std::fs;
use std::path::{Path, PathBuf};

use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::{mutate, packed, sealed, values};

/// The corpora that are part of the repository.
pub fn corpora() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("corpora")
}

/// Inputs of a target, without end.
pub struct Inputs {
    name: &'static str,
    corpus: Vec<Vec<u8>>,
    seed: u64,
}

impl Inputs {
    /// What is in the corpus, in the order of its names.
    pub fn new(name: &'static str, seed: u64) -> std::io::Result<Self> {
        let mut files: Vec<PathBuf> = fs::read_dir(corpora().join(name))?
            .map(|entry| Ok(entry?.path()))
            .collect::<std::io::Result<_>>()?;
        files.sort();
        let corpus = files.iter().map(fs::read).collect::<std::io::Result<Vec<_>>>()?;
        assert!(!corpus.is_empty(), "{name}: nothing in the corpus");
        Ok(Self { name, corpus, seed })
    }

    /// The input of a run: the corpus itself at first, then changes of it. Each can be had without those before it.
    pub fn get(&self, run: u64) -> Vec<u8> {
        if let Some(input) = self.corpus.get(run as usize) {
            return input.clone();
        }
        let mut random = Pcg64::new(u128::from(self.seed) << 64 | u128::from(run), 0x0a02_bdbf_7bb3_c0a7);
        // Neighbouring states begin alike.
        let mut random = Pcg64::seed_from_u64(random.random());
        let mut input = self.corpus[random.random_range(0..self.corpus.len())].clone();
        let other = &self.corpus[random.random_range(0..self.corpus.len())];
        self.mutate(&mut input, other, &mut random);
        input.truncate(mutate::MOST_BYTES);
        input
    }

    fn mutate(&self, input: &mut Vec<u8>, other: &[u8], random: &mut impl Rng) {
        match self.name {
            "fold" => return sealed::LOG.mutate(input, other, random),
            "meta" => return sealed::META_NODE.mutate(input, other, random),
            "xfm" => return sealed::DETAIL_BLOCK.mutate(input, other, random),
            "mt" => return sealed::MT_PARTITION.mutate(input, other, random),
            "png" => return packed::png(input, other, random),
            "zip" => return packed::zip(input, other, random),
            _ => {}
        }
        let words = words(self.name);
        let changes = values::few(random, 8);
        for _ in 0..changes {
            let is_text = match self.name {
                "tif" => false,
                // Some are text, some have a text in front, and some are binary.
                "ply" | "stl" | "hgt" => random.random_ratio(1, 2),
                _ => random.random_ratio(15, 16),
            };
            if is_text {
                mutate::text(input, other, words, random)
            } else {
                mutate::bytes(input, other, random)
            }
        }
    }
}

/// Words that mean something to a reader.
fn words(name: &str) -> &'static [&'static str] {
    match name {
        "obj" => &["v", "f", "vn", "vt", "l", "p", "o", "g", "#", "\\", "1/1/1", "2//1", "-1", "curv"],
        "ply" => &[
            "ply",
            "format",
            "ascii",
            "binary_little_endian",
            "binary_big_endian",
            "1.0",
            "comment",
            "element",
            "vertex",
            "face",
            "tristrips",
            "property",
            "list",
            "uchar",
            "char",
            "short",
            "ushort",
            "int",
            "uint",
            "float",
            "double",
            "int8",
            "float64",
            "x",
            "y",
            "z",
            "vertex_index",
            "vertex_indices",
            "end_header",
        ],
        "stl" => {
            &["solid", "facet", "normal", "outer", "loop", "vertex", "endloop", "endfacet", "endsolid", "#"]
        }
        "off" => &["OFF", "COFF", "NOFF", "CNOFF", "STOFF", "4OFF", "nOFF", "BINARY", "#"],
        "hgt" => &["N36W119", "S90W180", "N00E000", "s07e110.SRTMGL1", "2884802", "25934402", "2884803"],
        "path" => &[
            "#",
            "# name",
            "# units m",
            "# fov 60",
            "# fov 1 rad",
            "# aspect",
            "# aspect 2",
            "rad",
            "fov",
            "aspect",
        ],
        "import" => &[
            "#",
            "%",
            "//",
            "t",
            "time",
            "timestamp",
            "t[ns]",
            "time_ms",
            "x",
            "y",
            "z",
            "px",
            "tx",
            "east",
            "north",
            "up",
            "lat",
            "lon",
            "alt",
            "alt (ft)",
            "height",
            "qx",
            "qy",
            "qz",
            "qw",
            "w",
            "F",
            "F 0",
            "# fov 60",
            "# aspect 1.5",
            ",",
            ";",
            ";;",
            "euroc",
            "kitti",
            "optical",
            "y up",
            "2014-01-01T00:00:00Z",
            "1700000000123456789",
        ],
        "scene" => &["#", "bunny.ply", "a b.ply", "../x.meta", "/", "."],
        _ => &[],
    }
}
