//! Stores that fail at one read: a frame that waits for its pages ends in an error that names the place, or in the right mesh.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use detail_block::XfmFile;
use foldfront::CollapseLog;
use foldfront::experiment::compare::{Options, Subject};
use foldfront::experiment::path::{Path, around};
use foldfront::experiment::store::Store;
use foldfront::page_store::source::{MemorySource, PageSource};
use meta_node::MetaNodeFile;
use mt_partition::MtFile;
use rand::SeedableRng;
use rand_pcg::Pcg64;

use crate::common::{backends, data, meshes};

/// What happens at a read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Failure {
    /// Nothing: the control.
    None,
    /// It fails, once.
    Once,
    /// It fails, and so does the next.
    Twice,
    /// It fails, and so does everything after it.
    ForGood,
    /// It brings a bit that is not what was written, once.
    Bit,
    /// The same, and every time from then on.
    BitForGood,
    /// It is late.
    Late,
}

/// A store that fails at its n-th read.
struct FailsAt {
    source: MemorySource,
    failure: Failure,
    at: u64,
    reads: AtomicU64,
}

impl PageSource for FailsAt {
    fn name(&self) -> &str {
        "a store"
    }

    fn len(&self) -> u64 {
        self.source.len()
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> std::io::Result<()> {
        let since = self.reads.fetch_add(1, Ordering::SeqCst).checked_sub(self.at);
        self.source.read_at(offset, buffer)?;
        let is_hit = match (self.failure, since) {
            (Failure::None, _) | (_, None) => false,
            (Failure::ForGood | Failure::BitForGood, _) | (_, Some(0)) | (Failure::Twice, Some(1)) => true,
            _ => false,
        };
        match self.failure {
            _ if !is_hit => Ok(()),
            Failure::Bit | Failure::BitForGood => {
                let middle = buffer.len() / 2;
                buffer[middle] ^= 4;
                Ok(())
            }
            Failure::Late => {
                std::thread::sleep(Duration::from_millis(2));
                Ok(())
            }
            _ => Err(std::io::Error::other("the store does not answer")),
        }
    }
}

/// A backend's file of a log, and how it is opened.
type Backend = (&'static str, Vec<u8>, fn(Arc<dyn PageSource>) -> Result<Store, String>);

fn all(log: &CollapseLog) -> [Backend; 3] {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    let bytes = |write: &dyn Fn()| {
        write();
        std::fs::read(&path).unwrap()
    };
    let options = meta_node::BuildOptions { levels: Some(3), ..Default::default() };
    let meta_node = backends::meta_node_bytes(log, &options);
    let detail_block =
        bytes(&|| _ = detail_block::write(&path, log, &detail_block::BuildOptions::default()).unwrap());
    let mt_partition =
        bytes(&|| _ = mt_partition::write(&path, log, &mt_partition::BuildOptions::default()).unwrap());
    [
        ("meta-node", meta_node, |source| {
            MetaNodeFile::open(source).map(|file| Store::MetaNode(Arc::new(file))).map_err(|e| e.to_string())
        }),
        ("detail-block", detail_block, |source| {
            XfmFile::open(source).map(|file| Store::DetailBlock(Arc::new(file))).map_err(|e| e.to_string())
        }),
        ("mt-partition", mt_partition, |source| {
            MtFile::open(source).map(|file| Store::MtPartition(Arc::new(file))).map_err(|e| e.to_string())
        }),
    ]
}

/// Triangles by the bits of their corners.
fn frame(store: Store, path: &Path, frame: usize) -> Result<Vec<[[u32; 3]; 3]>, String> {
    let subject = Subject::of_store("a scan", store);
    let mesh = subject.frame(path, frame, &Options::default()).map_err(|error| error.to_string())?;
    let corner = |v: u32| mesh.positions[v as usize].map(f32::to_bits);
    let mut triangles: Vec<_> = mesh
        .triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.map(corner);
            [a, b, c].min([b, c, a]).min([c, a, b])
        })
        .collect();
    triangles.sort_unstable();
    Ok(triangles)
}

#[test]
fn a_frame_is_right_or_an_error() {
    let log = data::log(meshes::scan(6, &mut Pcg64::seed_from_u64(5)));
    let path = around(&log.mesh).unwrap();
    let at = path.frames.len() / 2;
    for (name, bytes, open) in all(&log) {
        let source = |failure, at| {
            let source = MemorySource::new("a store", bytes.clone());
            Arc::new(FailsAt { source, failure, at, reads: AtomicU64::new(0) })
        };
        let control = source(Failure::None, 0);
        let expected = frame(open(control.clone()).unwrap(), &path, at).unwrap();
        let reads = control.reads.load(Ordering::SeqCst);
        assert!(reads > 8 && expected.len() > 100, "{name}: {reads} reads, {} triangles", expected.len());
        let mut errors = [0_u64; 2];
        for failure in [
            Failure::Once,
            Failure::Twice,
            Failure::ForGood,
            Failure::Bit,
            Failure::BitForGood,
            Failure::Late,
        ] {
            for n in 0..reads {
                let outcome = open(source(failure, n)).and_then(|store| frame(store, &path, at));
                let is_for_good = matches!(failure, Failure::ForGood | Failure::BitForGood);
                match outcome {
                    Ok(triangles) => {
                        assert!(triangles == expected, "{name}, {failure:?} at read {n}: another mesh");
                        assert!(
                            !is_for_good,
                            "{name}, {failure:?} at read {n}: what was never read is displayed"
                        );
                    }
                    Err(error) => {
                        assert!(error.contains("a store"), "{name}, {failure:?} at read {n}: {error}");
                        assert_ne!(failure, Failure::Late, "{name}, read {n}: {error}");
                        errors[usize::from(is_for_good)] += 1;
                    }
                }
            }
        }
        assert_eq!(errors[1], 2 * reads, "{name}");
        // What fails once is tried again, unless it is read to open the file.
        assert!(errors[0] < 3 * reads, "{name}: {} of {reads} reads", errors[0]);
    }
}
