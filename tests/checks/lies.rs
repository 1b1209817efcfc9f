//! Files that lie with checksums that agree: pages that contradict themselves or each other. A front over them may stay coarse, or end
//! in an error that says so; it never panics, hangs, shows what can not be, or grows without end.

use rand::RngExt;
use rand_pcg::Pcg64;

pub fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

pub fn put(bytes: &mut [u8], at: usize, value: u32) {
    bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
}

/// Start and length of a section of an intact file, whose table is at `table`.
pub fn section(bytes: &[u8], table: usize, kind: &[u8; 4]) -> (usize, usize) {
    let entries = (0..word(bytes, table) as usize).map(|i| table + 8 + 32 * i);
    let entry = entries.into_iter().find(|&at| bytes[at..at + 4] == *kind).unwrap();
    (word(bytes, entry + 8) as usize, word(bytes, entry + 16) as usize)
}

/// Changes some words of some pages, given by start and length, and makes their checksums right again: CRC-32 of all but
/// the first word, which it is in. Half of the lies are true elsewhere.
pub fn tell_lies(bytes: &mut [u8], pages: &[(usize, usize)], random: &mut Pcg64) {
    for _ in 0..random.random_range(1..5) {
        let (start, length) = pages[random.random_range(0..pages.len())];
        let at = start + 4 * (1 + random.random_range(0..length / 4 - 1));
        let other = pages[random.random_range(0..pages.len())];
        let elsewhere = word(bytes, other.0 + 4 * random.random_range(0..other.1 / 4));
        let value = match random.random_range(0..12) {
            0 => 0,
            1 => u32::MAX,
            2 => word(bytes, at) ^ 1 << random.random_range(0..32),
            3 => word(bytes, at).wrapping_add(1),
            4 => word(bytes, at).wrapping_sub(1),
            5 => random.random_range(0..pages.len()) as u32,
            _ => elsewhere,
        };
        put(bytes, at, value);
        let sum = crc32fast::hash(&bytes[start + 4..start + length]);
        put(bytes, start, sum);
    }
}
