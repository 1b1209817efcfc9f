//! Meta-node trees against the in-memory tree and against virtual memory: the tables of El-Sana & Chiang (2000).
//!
//! `cargo bench --bench meta_node -- [construction] [selection] [working-set] [misses] [frames] [MESH...]`; all of
//! them without a word. Meshes choose among those of `misses` and `frames`.
//!
//! * `construction`: their Table 1, processor time of the collapse log and of the meta-nodes, sizes of the files, and the
//!   place holders that levels and pages of other sizes would make.
//! * `selection`: with memory for everything, against the in-memory tree.
//! * `working-set`: how many pages recorded paths need at a time, and what fetching on demand misses at least.
//! * `misses`: along recorded paths, with place holders for shares of the file; every frame lets the pager finish, or
//!   frames come at 60 a second.
//! * `frames`: their Table 2, frames against the arrays of the in-memory tree mapped into memory, each in a process of
//!   its own in a control group with little memory. It needs the right to make one, and says so where it has not.
//!
//! Real meshes are looked for in `shared/data` beside the repository. Hierarchies are kept in `target/tmp/strategies`.

mod construction;
mod frames;
mod misses;
mod selection;
mod subject;
mod virtual_memory;
mod working_set;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    if words.first().is_some_and(|word| word == "child") {
        frames::child(&words[1..]);
        return;
    }
    let is_chosen = |name: &str| words.is_empty() || words.iter().any(|word| word == name);
    if is_chosen("construction") {
        construction::table();
    }
    if is_chosen("selection") {
        selection::table();
    }
    if is_chosen("working-set") {
        working_set::table();
    }
    if is_chosen("misses") {
        misses::table(&words);
    }
    if is_chosen("frames") {
        frames::table(&words);
    }
}
