//! Values that are often wrong.

use rand::{Rng, RngExt};

/// A word: near the ends of a range, what stands elsewhere, a number of something, or one that is none.
pub fn word(random: &mut impl Rng, old: u32, elsewhere: u32) -> u32 {
    match random.random_range(0..20) {
        0 => 0,
        1 => 1,
        2 => u32::MAX,
        3 => u32::MAX - 1,
        4 => 1 << 31,
        5 => (1 << 31) - 1,
        6 => 1 << random.random_range(0..32),
        7 | 8 => old ^ 1 << random.random_range(0..32),
        9 | 10 => old.wrapping_add(1),
        11 | 12 => old.wrapping_sub(1),
        13 => random.random_range(0..64),
        14 => {
            let floats = [f32::NAN, f32::INFINITY, -1.0, -0.0, f32::MAX, f32::MIN_POSITIVE, 1e-45, 1e30, 0.5];
            floats[random.random_range(0..floats.len())].to_bits()
        }
        15 => random.random(),
        _ => elsewhere,
    }
}

/// A number of changes from 1 on: rather few than many.
pub fn few(random: &mut impl Rng, most: usize) -> usize {
    let most = random.random_range(1..most);
    random.random_range(1..=most)
}

/// One of some.
pub fn one_of<T: Copy>(random: &mut impl Rng, all: &[T]) -> T {
    all[random.random_range(0..all.len())]
}

/// Numbers and what is taken for numbers in text.
pub const NUMBERS: [&str; 40] = [
    "0",
    "1",
    "-1",
    "2",
    "3",
    "4",
    "7",
    "0.5",
    "-0",
    "1e-320",
    "1e308",
    "-1e308",
    "1e309",
    "1e39",
    "3.5e38",
    "1e30",
    "1e24",
    "nan",
    "-nan",
    "inf",
    "-inf",
    "infinity",
    "255",
    "256",
    "65535",
    "65536",
    "2147483647",
    "2147483648",
    "-2147483649",
    "4294967295",
    "4294967296",
    "9007199254740993",
    "9223372036854775807",
    "18446744073709551615",
    "18446744073709551616",
    "1e5",
    "+5",
    "0x10",
    "1_0",
    "\u{0663}",
];
