//! Sorting of more records than fit in memory: ours beside two crates that are kept for that, extsort and ext-sort.
//!
//! ```text
//! cargo run --release --manifest-path benches/external_sort/Cargo.toml [-- MILLIONS ROUNDS MIB]
//! ```
//!
//! The records are those that a construction within a given memory sorts: of 20 bytes (`simplify::out_of_core::prepare`,
//! triangles by their blocks), 28 (`mt-partition`, triangles by their arcs) and 16 (`meta-node`, places by their leaves), the first
//! word anywhere, the others following from it. Each sort is a process of its own, so that its largest memory is its own;
//! rounds take the contenders in turns. The sums of what comes out have to agree, and its order has to be right.
//!
//! With less memory than a MiB, one sort at a time, which prints seconds, bytes beyond those of the start, and the sum:
//!
//! ```text
//! cargo run --release --manifest-path benches/external_sort/Cargo.toml -- sort ours|extsort|ext-sort 4|5|7 COUNT BYTES FOLDER
//! ```
//!
//! Both crates count records, not bytes, and their buffers grow to the next power of two: they are given the largest number for
//! which that is within the memory. ext-sort writes records by way of serde, unless one writes a chunk oneself as is done
//! here. Both sort on as many threads as there are processors; ours on two.

use std::convert::Infallible;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Take, Write};
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use foldfront_collapse_log::external::{Scratch, Sorter};
use ext_sort::{ExternalChunk, ExternalSorterBuilder, LimitedBufferBuilder};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const CONTENDERS: [&str; 3] = ["ours", "extsort", "ext-sort"];

/// Words of a record.
const WORDS: [usize; 3] = [4, 5, 7];

/// A record, as others sort it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Record<const N: usize>([u32; N]);

impl<const N: usize> Record<N> {
    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        out.write_all(bytemuck::cast_slice(&self.0))
    }

    fn read(from: &mut impl Read) -> io::Result<Self> {
        let mut words = [0; N];
        from.read_exact(bytemuck::cast_slice_mut(&mut words))?;
        Ok(Self(words))
    }
}

impl<const N: usize> extsort::Sortable for Record<N> {
    fn encode<W: Write>(&self, writer: &mut W) -> io::Result<()> {
        self.write(writer)
    }

    fn decode<R: Read>(reader: &mut R) -> io::Result<Self> {
        Self::read(reader)
    }
}

/// A run of records as ext-sort has it.
struct Run<const N: usize>(Take<BufReader<File>>);

impl<const N: usize> ExternalChunk<Record<N>> for Run<N> {
    type SerializationError = io::Error;
    type DeserializationError = io::Error;

    fn new(reader: Take<BufReader<File>>) -> Self {
        Self(reader)
    }

    fn dump(out: &mut BufWriter<File>, items: impl IntoIterator<Item = Record<N>>) -> io::Result<()> {
        items.into_iter().try_for_each(|record| record.write(out))
    }
}

impl<const N: usize> Iterator for Run<N> {
    type Item = io::Result<Record<N>>;

    fn next(&mut self) -> Option<Self::Item> {
        (self.0.limit() > 0).then(|| Record::read(&mut self.0))
    }
}

/// The records to be sorted.
fn records<const N: usize>(count: u64) -> impl Iterator<Item = [u32; N]> {
    let mut random = Pcg64::seed_from_u64(0);
    (0..count).map(move |_| {
        let [first, next]: [u32; 2] = random.random();
        std::array::from_fn(|word| if word == 0 { first } else { next.wrapping_add(word as u32) })
    })
}

/// What comes out of a sort, and whether it is in order.
struct Sorted<const N: usize> {
    last: [u32; N],
    count: u64,
    sum: u64,
}

impl<const N: usize> Sorted<N> {
    fn take(&mut self, record: [u32; N]) {
        assert!(self.last <= record, "record {}", self.count);
        self.last = record;
        self.count += 1;
        self.sum =
            self.sum.wrapping_mul(31).wrapping_add(u64::from(record[0]) << 32 | u64::from(record[N - 1]));
    }
}

/// The most bytes that the process has had in memory at a time; 0 where nobody knows.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kib: u64 = line.and_then(|line| line.split_whitespace().next()?.parse().ok()).unwrap_or(0);
    kib << 10
}

/// Sorts, and prints seconds, bytes of memory beyond those of the start, and the sum.
fn sort<const N: usize>(contender: &str, count: u64, bytes: usize, folder: &Path) {
    let before = peak();
    let start = Instant::now();
    let mut sorted = Sorted::<N> { last: [0; N], count: 0, sum: 0 };
    // The largest power of two of records that fits.
    let segment = 1 << (bytes / (4 * N)).ilog2();
    match contender {
        "ours" => {
            let mut sorter = Sorter::<N>::new(&Scratch { folder: folder.to_owned() }, bytes);
            records(count).try_for_each(|record| sorter.push(record)).unwrap();
            let take = |record| {
                sorted.take(record);
                Ok(())
            };
            sorter.finish(take).unwrap();
        }
        "extsort" => {
            let sorter = extsort::ExternalSorter::new()
                .with_segment_size(segment - 1)
                .with_sort_dir(folder.to_owned())
                .with_parallel_sort();
            for record in sorter.sort(records(count).map(Record::<N>)).unwrap() {
                sorted.take(record.unwrap().0);
            }
        }
        _ => {
            let sorter = ExternalSorterBuilder::<Record<N>, Infallible, LimitedBufferBuilder, Run<N>>::new()
                .with_buffer(LimitedBufferBuilder::new(segment, false))
                .with_tmp_dir(folder)
                .build()
                .unwrap();
            for record in sorter.sort(records(count).map(|record| Ok(Record(record)))).unwrap() {
                sorted.take(record.unwrap().0);
            }
        }
    }
    assert_eq!(sorted.count, count);
    println!("{} {} {}", start.elapsed().as_secs_f64(), peak() - before, sorted.sum);
}

/// Sorts in a process of its own: seconds, bytes and the sum.
fn measure(contender: &str, words: usize, count: u64, bytes: usize) -> (f64, u64, u64) {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["sort", contender, &words.to_string(), &count.to_string(), &bytes.to_string()])
        .arg(folder.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{contender}: {}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let mut parts = text.split_whitespace();
    let mut next = || parts.next().unwrap();
    (next().parse().unwrap(), next().parse().unwrap(), next().parse().unwrap())
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [sort_, contender, words, count, bytes, folder] = &arguments[..]
        && sort_ == "sort"
    {
        let (count, bytes, folder) = (count.parse().unwrap(), bytes.parse().unwrap(), Path::new(folder));
        return match words.as_str() {
            "4" => sort::<4>(contender, count, bytes, folder),
            "5" => sort::<5>(contender, count, bytes, folder),
            _ => sort::<7>(contender, count, bytes, folder),
        };
    }
    let number =
        |at: usize, otherwise: u64| arguments.get(at).map_or(otherwise, |text| text.parse().unwrap());
    let (count, rounds, bytes) = (number(0, 20) * 1_000_000, number(1, 5), number(2, 64) << 20);
    println!("{count} records, {rounds} rounds, {} MiB", bytes >> 20);
    println!("bytes  contender    median s   ratio  least..most s    MiB");
    for words in WORDS {
        let mut seconds = CONTENDERS.map(|_| Vec::new());
        let mut memory = CONTENDERS.map(|_| 0);
        let mut sum = None;
        for _ in 0..rounds {
            for (i, contender) in CONTENDERS.into_iter().enumerate() {
                let (time, peak, found) = measure(contender, words, count, bytes as usize);
                seconds[i].push(time);
                memory[i] = peak.max(memory[i]);
                assert_eq!(*sum.get_or_insert(found), found, "{contender}");
            }
        }
        let ours = median(&mut seconds[0]);
        for (i, contender) in CONTENDERS.into_iter().enumerate() {
            let middle = median(&mut seconds[i]);
            println!(
                "{:5}  {contender:9}  {middle:10.2}  {:6.2}  {:5.2}..{:5.2}  {:5.0}",
                4 * words,
                middle / ours,
                seconds[i][0],
                seconds[i][seconds[i].len() - 1],
                memory[i] as f64 / f64::from(1 << 20)
            );
        }
    }
}
