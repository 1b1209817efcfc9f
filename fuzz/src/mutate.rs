//! Changes that damage an input, all of them by chance and the same for the same seed.

use rand::{Rng, RngExt};

use crate::values::{self, NUMBERS};

/// No input becomes longer.
pub const MOST_BYTES: usize = 1 << 15;

/// Changes bytes, whatever they mean.
pub fn bytes(input: &mut Vec<u8>, other: &[u8], random: &mut impl Rng) {
    let length = input.len();
    if length == 0 {
        input.extend_from_slice(other);
        return;
    }
    let at = random.random_range(0..length);
    let span = values::one_of(random, &[2, 8, 64, 512]);
    let span = random.random_range(1..=span).min(length - at);
    match random.random_range(0..14) {
        0 | 1 => input[at] ^= 1 << random.random_range(0..8),
        2 => input[at] = [0, 1, 0x7f, 0x80, 0xff, b'\n', b' ', b'0'][random.random_range(0..8)],
        3 => input[at] = input[at].wrapping_add([1, 255][random.random_range(0..2)]),
        4..=6 => word(input, at, random),
        7 => half_word(input, at, random),
        8 => drop(input.drain(at..at + span)),
        9 => {
            let copy = input[at..at + span].to_vec();
            let to = random.random_range(0..=length);
            input.splice(to..to, copy);
        }
        10 => {
            let junk: Vec<u8> = (0..span.min(16)).map(|_| random.random()).collect();
            input.splice(at..at, junk);
        }
        11 => input.truncate(at),
        12 => splice(input, other, random),
        _ => {
            let from = random.random_range(0..length);
            let span = span.min(length - from);
            input.copy_within(from..from + span, at.min(length - span));
        }
    }
}

/// A word of 32 bits, in either order of bytes, mostly where words lie.
fn word(input: &mut [u8], at: usize, random: &mut impl Rng) {
    if input.len() < 4 {
        return;
    }
    let most = input.len() - 4;
    let place = |at: usize, random: &mut dyn Rng| {
        if random.random_ratio(3, 4) { at.min(most) & !3 } else { at.min(most) }
    };
    let elsewhere = place(random.random_range(0..input.len()), random);
    let at = place(at, random);
    let get = |at: usize| [input[at], input[at + 1], input[at + 2], input[at + 3]];
    let (old, elsewhere) = (get(at), get(elsewhere));
    let new = if random.random_ratio(3, 4) {
        values::word(random, u32::from_le_bytes(old), u32::from_le_bytes(elsewhere)).to_le_bytes()
    } else {
        values::word(random, u32::from_be_bytes(old), u32::from_be_bytes(elsewhere)).to_be_bytes()
    };
    input[at..at + 4].copy_from_slice(&new);
}

fn half_word(input: &mut [u8], at: usize, random: &mut impl Rng) {
    if input.len() < 2 {
        return;
    }
    let at = at.min(input.len() - 2);
    let old = u16::from_le_bytes([input[at], input[at + 1]]);
    let value = match random.random_range(0..6) {
        0 => 0,
        1 => u16::MAX,
        2 => old.wrapping_add(1),
        3 => old.wrapping_sub(1),
        4 => 1 << random.random_range(0..16),
        _ => random.random(),
    };
    let value = if random.random_ratio(1, 2) { value.to_le_bytes() } else { value.to_be_bytes() };
    input[at..at + 2].copy_from_slice(&value);
}

/// The beginning of one and the end of another.
fn splice(input: &mut Vec<u8>, other: &[u8], random: &mut impl Rng) {
    let (from, to) = (random.random_range(0..=input.len()), random.random_range(0..=other.len()));
    input.truncate(from);
    input.extend_from_slice(&other[to..]);
}

/// Changes text: its words, lines and what is between them.
pub fn text(input: &mut Vec<u8>, other: &[u8], words: &[&str], random: &mut impl Rng) {
    match random.random_range(0..16) {
        0..=6 => token(input, words, random),
        7..=10 => line(input, other, random),
        11 => breaks(input, random),
        12 => marks(input, random),
        13 => splice(input, other, random),
        _ => bytes(input, other, random),
    }
}

/// Puts something else in the place of a word, behind it, or takes it out.
fn token(input: &mut Vec<u8>, words: &[&str], random: &mut impl Rng) {
    let start = random.random_range(0..=input.len());
    let is_space = |byte: &u8| byte.is_ascii_whitespace() || b",;/".contains(byte);
    let Some(begin) = input[start..].iter().position(|byte| !is_space(byte)).map(|at| start + at) else {
        return;
    };
    let begin = input[..begin].iter().rposition(is_space).map_or(0, |at| at + 1);
    let end = input[begin..].iter().position(is_space).map_or(input.len(), |at| begin + at);
    let old = String::from_utf8_lossy(&input[begin..end]).into_owned();
    let new = match random.random_range(0..12) {
        0..=3 => NUMBERS[random.random_range(0..NUMBERS.len())].to_owned(),
        4 if !words.is_empty() => words[random.random_range(0..words.len())].to_owned(),
        5 => String::new(),
        6 => format!("{old} {}", NUMBERS[random.random_range(0..NUMBERS.len())]),
        7 => format!("{old}{old}"),
        8 => format!("{}.{}", "7".repeat(random.random_range(1..300)), random.random_range(0..10)),
        9 => {
            old.parse::<i64>().map_or(old, |n| n.wrapping_add([1, -1][random.random_range(0..2)]).to_string())
        }
        10 => old.to_uppercase(),
        _ => format!("{old}e{}", random.random_range(-400..400)),
    };
    input.splice(begin..end, new.into_bytes());
}

/// Removes, doubles, swaps and moves lines, and takes some from elsewhere.
fn line(input: &mut Vec<u8>, other: &[u8], random: &mut impl Rng) {
    let mut lines: Vec<&[u8]> = input.split_inclusive(|&byte| byte == b'\n').collect();
    if lines.is_empty() {
        return;
    }
    let (a, b) = (random.random_range(0..lines.len()), random.random_range(0..lines.len()));
    match random.random_range(0..5) {
        0 => drop(lines.remove(a)),
        1 => lines.insert(b, lines[a]),
        2 => lines.swap(a, b),
        3 => {
            let repeated = vec![lines[a]; random.random_range(1..40)];
            lines.splice(b..b, repeated);
        }
        _ => {
            let others: Vec<&[u8]> = other.split_inclusive(|&byte| byte == b'\n').collect();
            if let Some(line) = others.get(random.random_range(0..others.len().max(1))) {
                lines.insert(b, line);
            }
        }
    }
    *input = lines.concat();
}

/// Other ends of lines.
fn breaks(input: &mut Vec<u8>, random: &mut impl Rng) {
    match random.random_range(0..4) {
        0 => *input = input.split(|&byte| byte == b'\n').collect::<Vec<_>>().join(&b"\r\n"[..]),
        1 => input.iter_mut().filter(|byte| **byte == b'\n').for_each(|byte| *byte = b'\r'),
        2 => {
            while input.last().is_some_and(u8::is_ascii_whitespace) {
                input.pop();
            }
        }
        _ => {
            let at = random.random_range(0..=input.len());
            input.splice(
                at..at,
                [b"\n\n\n".as_slice(), b" \\\n", b"\t", b"\x0b\x0c"][random.random_range(0..4)].to_vec(),
            );
        }
    }
}

/// Bytes that say how others are to be read, or that are in no text.
fn marks(input: &mut Vec<u8>, random: &mut impl Rng) {
    let marks = [
        "\u{feff}".as_bytes(),
        b"\xff\xfe",
        b"\xfe\xff",
        b"\0",
        b"#",
        b"# ",
        b"\"",
        b"\x1b[2J",
        "\u{2028}".as_bytes(),
        b"\xe4",
        "\u{e9}".as_bytes(),
    ];
    let mark = marks[random.random_range(0..marks.len())];
    let at = if random.random_ratio(1, 2) { 0 } else { random.random_range(0..=input.len()) };
    input.splice(at..at, mark.iter().copied());
}
