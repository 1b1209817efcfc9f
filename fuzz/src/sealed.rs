//! Files with checksums, taken apart, changed and put together again, with checksums that are right for what is there then.
//!
//! Of files of version 2 the sections and pages are known, so that they can become longer, shorter, more and fewer. In files of version 1
//! words are changed where they lie.

use rand::{Rng, RngExt};

use crate::mutate;
use crate::values;

/// What differs between the formats.
pub struct Format {
    /// Bytes of the header; the table of sections follows at the next multiple of 8.
    header: usize,
    /// Where the header's checksum is, of all before it.
    sum: usize,
    pages: Pages,
    /// Where the header counts records, how wide that count is, the section, and bytes of a record.
    counts: &'static [(usize, usize, &'static [u8; 4], usize)],
}

/// What lies in the section of pages, and which section says how long each is.
#[derive(Clone, Copy, PartialEq)]
enum Pages {
    None,
    MetaNode,
    DetailBlock,
    MtPartition,
}

pub const LOG: Format = Format {
    header: 44,
    sum: 40,
    pages: Pages::None,
    counts: &[(16, 8, b"POSI", 12), (24, 8, b"TRIA", 12), (32, 8, b"COLL", 28)],
};
pub const META_NODE: Format = Format {
    header: 80,
    sum: 76,
    pages: Pages::MetaNode,
    counts: &[(32, 4, b"ROOT", 28), (36, 4, b"BASV", 16), (40, 4, b"BAST", 12), (44, 4, b"PAGT", 4)],
};
pub const DETAIL_BLOCK: Format = Format {
    header: 148,
    sum: 144,
    pages: Pages::DetailBlock,
    counts: &[(24, 8, b"BASV", 24), (32, 8, b"BAST", 24), (40, 8, b"ROOT", 24), (48, 8, b"PAGT", 8)],
};
pub const MT_PARTITION: Format = Format {
    header: 156,
    sum: 152,
    pages: Pages::MtPartition,
    counts: &[(56, 8, b"ROOT", 24), (48, 8, b"PART", 4), (96, 8, b"BASE", 1), (40, 8, b"NODE", 8)],
};

const BY_PAGE: u32 = 2;

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let word = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes([word[0], word[1], word[2], word[3]]))
}

fn long(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from(word(bytes, at)?) | u64::from(word(bytes, at + 4)?) << 32)
}

fn put(bytes: &mut [u8], at: usize, value: u32) {
    if let Some(place) = bytes.get_mut(at..at + 4) {
        place.copy_from_slice(&value.to_le_bytes());
    }
}

fn put_long(bytes: &mut [u8], at: usize, value: u64) {
    put(bytes, at, value as u32);
    put(bytes, at + 4, (value >> 32) as u32);
}

#[derive(Clone)]
struct Section {
    kind: [u8; 4],
    flags: u32,
    bytes: Vec<u8>,
}

/// A file taken apart.
#[derive(Clone)]
struct Parts {
    header: Vec<u8>,
    sections: Vec<Section>,
    /// What is in the section of pages.
    pages: Vec<Vec<u8>>,
}

impl Format {
    fn table(&self) -> usize {
        self.header.next_multiple_of(8)
    }

    /// Takes an intact file of version 2 apart.
    fn parts(&self, bytes: &[u8]) -> Option<Parts> {
        if word(bytes, 8)? != 2 {
            return None;
        }
        let count = word(bytes, self.table())?.min(64) as usize;
        let mut sections = Vec::new();
        for number in 0..count {
            let at = self.table() + 8 + 32 * number;
            let (start, length) = (long(bytes, at + 8)? as usize, long(bytes, at + 16)? as usize);
            let body = bytes.get(start..start.checked_add(length)?)?.to_vec();
            let kind = [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
            sections.push(Section { kind, flags: word(bytes, at + 4)?, bytes: body });
        }
        let find = |kind: &[u8; 4]| sections.iter().find(|section| section.kind == *kind);
        let lengths: Vec<usize> = match self.pages {
            Pages::None => Vec::new(),
            Pages::MetaNode => words(find(b"PAGT")?).map(|words| 4 * words as usize).collect(),
            Pages::MtPartition => words(find(b"NODE")?).step_by(2).map(|bytes| bytes as usize).collect(),
            Pages::DetailBlock => {
                words(find(b"PAGT")?).skip(1).step_by(2).map(|high| high as usize >> 16).collect()
            }
        };
        let mut pages = Vec::new();
        if self.pages != Pages::None {
            let mut rest = find(b"PAGE")?.bytes.as_slice();
            for length in lengths {
                let (page, behind) = rest.split_at_checked(length)?;
                pages.push(page.to_vec());
                rest = behind;
            }
        }
        Some(Parts { header: bytes.get(..self.header)?.to_vec(), sections, pages })
    }

    /// Puts a file together, with right checksums; with what follows from the parts made right too, if that is wanted.
    fn whole(&self, mut parts: Parts, consistent: bool) -> Vec<u8> {
        for (number, page) in (0_u32..).zip(&mut parts.pages) {
            self.seal_page(number, page);
        }
        if consistent {
            self.count(&mut parts);
        }
        if self.pages != Pages::None
            && let Some(section) = parts.sections.iter_mut().find(|section| section.kind == *b"PAGE")
        {
            section.bytes = parts.pages.concat();
        }
        let mut at = self.table() + 8 + 32 * parts.sections.len();
        let mut places = Vec::new();
        for section in &parts.sections {
            at = at.next_multiple_of(8);
            places.push(at);
            at += section.bytes.len();
        }
        if consistent && self.pages == Pages::DetailBlock {
            put_long(&mut parts.header, 136, at as u64);
            let pages_at =
                parts.sections.iter().position(|section| section.kind == *b"PAGE").map(|i| places[i]);
            let index = parts.sections.iter_mut().find(|section| section.kind == *b"PAGT");
            if let (Some(mut at), Some(index)) = (pages_at, index) {
                index.bytes.clear();
                for page in &parts.pages {
                    index.bytes.extend((at as u64 | (page.len() as u64) << 48).to_le_bytes());
                    at += page.len();
                }
            }
        }
        let mut bytes = parts.header;
        bytes.resize(self.table(), 0);
        let mut table = (parts.sections.len() as u32).to_le_bytes().to_vec();
        for (section, &at) in parts.sections.iter().zip(&places) {
            table.extend(section.kind);
            table.extend(section.flags.to_le_bytes());
            table.extend((at as u64).to_le_bytes());
            table.extend((section.bytes.len() as u64).to_le_bytes());
            let sum = if section.flags & BY_PAGE == 0 { crc32fast::hash(&section.bytes) } else { 0 };
            table.extend(sum.to_le_bytes());
            table.extend([0; 4]);
        }
        bytes.extend(&table[..4]);
        bytes.extend(crc32fast::hash(&table).to_le_bytes());
        bytes.extend(&table[4..]);
        for (section, &at) in parts.sections.iter().zip(&places) {
            bytes.resize(at, 0);
            bytes.extend(&section.bytes);
        }
        self.seal_header(&mut bytes);
        bytes
    }

    /// Counts and lengths that follow from the parts.
    fn count(&self, parts: &mut Parts) {
        let lengths: Vec<u32> = parts.pages.iter().map(|page| page.len() as u32).collect();
        let header = &mut parts.header;
        let find =
            |sections: &mut Vec<Section>, kind: &[u8; 4]| sections.iter().position(|s| s.kind == *kind);
        match self.pages {
            Pages::None => {}
            Pages::MetaNode => {
                if let Some(at) = find(&mut parts.sections, b"PAGT") {
                    parts.sections[at].bytes =
                        lengths.iter().flat_map(|length| (length / 4).to_le_bytes()).collect();
                }
                put(header, 60, lengths.iter().max().map_or(0, |length| length / 4));
                put_long(header, 64, lengths.iter().map(|&length| u64::from(length)).sum());
            }
            Pages::DetailBlock => {
                if let Some(at) = find(&mut parts.sections, b"PAGT") {
                    parts.sections[at].bytes.resize(8 * lengths.len(), 0);
                }
            }
            Pages::MtPartition => {
                if let Some(at) = find(&mut parts.sections, b"NODE") {
                    let table = &mut parts.sections[at].bytes;
                    table.resize(8 * lengths.len(), 0);
                    for (node, &length) in lengths.iter().enumerate() {
                        put(table, 8 * node, length);
                    }
                }
                if let Some(at) = find(&mut parts.sections, b"BASE") {
                    seal_start(&mut parts.sections[at].bytes);
                }
            }
        }
        for &(at, width, kind, bytes) in self.counts {
            let Some(section) = parts.sections.iter().find(|section| section.kind == *kind) else { continue };
            let count = (section.bytes.len() / bytes) as u64;
            if width == 4 { put(header, at, count as u32) } else { put_long(header, at, count) }
        }
    }

    fn seal_page(&self, number: u32, page: &mut [u8]) {
        match self.pages {
            Pages::None => {}
            Pages::MetaNode | Pages::MtPartition => seal_start(page),
            Pages::DetailBlock => {
                if let Some(end) = page.len().checked_sub(4) {
                    let sum = crc32fast::hash(&[&number.to_le_bytes(), &page[..end]].concat());
                    put(page, end, sum);
                }
            }
        }
    }

    fn seal_header(&self, bytes: &mut [u8]) {
        if let Some(header) = bytes.get(..self.sum) {
            let sum = crc32fast::hash(header);
            put(bytes, self.sum, sum);
        }
    }

    /// Makes the checksums of a file of version 1 right, as far as its counts lead to them.
    fn seal_version_1(&self, bytes: &mut [u8]) -> Option<()> {
        let counts: Vec<u64> = self
            .counts
            .iter()
            .map(|&(at, width, ..)| if width == 4 { word(bytes, at).map(u64::from) } else { long(bytes, at) })
            .collect::<Option<_>>()?;
        let lengths: Vec<usize> = counts
            .iter()
            .zip(self.counts)
            .map(|(&count, &(.., each))| {
                usize::try_from(count).ok()?.checked_mul(each).filter(|&n| n <= bytes.len())
            })
            .collect::<Option<_>>()?;
        self.seal_header(bytes);
        match self.pages {
            Pages::None => {
                let (mut at, sums) = (self.header, self.header + lengths.iter().sum::<usize>());
                for (number, length) in lengths.into_iter().enumerate() {
                    let sum = crc32fast::hash(bytes.get(at..at + length)?);
                    put(bytes, sums + 4 * number, sum);
                    at += length;
                }
            }
            Pages::MetaNode => {
                let pages_at = self.header + lengths.iter().sum::<usize>();
                let sum = crc32fast::hash(bytes.get(self.header..pages_at)?);
                put(bytes, 72, sum);
                self.seal_header(bytes);
                let mut at = pages_at;
                for place in (pages_at - lengths[3]..pages_at).step_by(4) {
                    let length = 4 * word(bytes, place)? as usize;
                    seal_start(bytes.get_mut(at..at.checked_add(length)?)?);
                    at += length;
                }
            }
            Pages::DetailBlock => {
                let ends = self.seal_tables(bytes, &lengths)?;
                let index = ends[3] - 4 - lengths[3];
                for (number, place) in (0_u32..).zip((index..index + lengths[3]).step_by(8)) {
                    let entry = long(bytes, place)?;
                    let (at, length) = ((entry & ((1 << 48) - 1)) as usize, (entry >> 48) as usize);
                    self.seal_page(number, bytes.get_mut(at..at.checked_add(length)?)?);
                }
            }
            Pages::MtPartition => {
                // Roots, partitions and nodes; the source behind them has a checksum as any record.
                let ends = self.seal_tables(bytes, &[lengths[0], lengths[1], lengths[3]])?;
                let base = ends[2];
                seal_start(bytes.get_mut(base..base + lengths[2])?);
                let mut at = base + lengths[2];
                for place in (base - 4 - lengths[3]..base - 4).step_by(8) {
                    let length = word(bytes, place)? as usize;
                    seal_start(bytes.get_mut(at..at.checked_add(length)?)?);
                    at += length;
                }
            }
        }
        Some(())
    }

    /// Tables behind the header, each with its checksum behind it; where these end.
    fn seal_tables(&self, bytes: &mut [u8], lengths: &[usize]) -> Option<Vec<usize>> {
        let mut at = self.header;
        let mut ends = Vec::new();
        for length in lengths {
            let sum = crc32fast::hash(bytes.get(at..at + length)?);
            put(bytes, at + length, sum);
            at += length + 4;
            ends.push(at);
        }
        Some(ends)
    }

    /// Damages a file.
    pub fn mutate(&self, input: &mut Vec<u8>, other: &[u8], random: &mut impl Rng) {
        // Now and then what a disk does, which no checksum agrees with.
        if random.random_ratio(1, 30) {
            mutate::bytes(input, other, random);
            return;
        }
        let changes = values::few(random, 6);
        let Some(mut parts) = self.parts(input) else {
            for _ in 0..changes {
                if random.random_ratio(1, 20) {
                    mutate::bytes(input, other, random);
                } else {
                    let most = input.len();
                    change_word(input, 8..most, random);
                }
            }
            self.seal_version_1(input);
            return;
        };
        for _ in 0..changes {
            self.change(&mut parts, random);
        }
        *input = self.whole(parts, random.random_ratio(9, 10));
    }

    fn change(&self, parts: &mut Parts, random: &mut impl Rng) {
        let sections = parts.sections.len();
        match random.random_range(0..40) {
            0..=3 => {
                let end = self.sum;
                change_word(&mut parts.header, 8..end, random);
            }
            4..=9 if sections > 0 => {
                let section = &mut parts.sections[random.random_range(0..sections)].bytes;
                let most = section.len();
                change_word(section, 0..most, random);
            }
            10 | 11 if sections > 0 => self.resize_section(parts, random),
            12 if sections > 0 => self.change_table(parts, random),
            13 | 14 if parts.pages.len() > 1 => {
                let (a, b) =
                    (random.random_range(0..parts.pages.len()), random.random_range(0..parts.pages.len()));
                match random.random_range(0..4) {
                    0 => parts.pages.swap(a, b),
                    1 => drop(parts.pages.remove(a)),
                    2 => parts.pages.insert(b, parts.pages[a].clone()),
                    _ => parts.pages[a] = parts.pages[b].clone(),
                }
            }
            15..=17 if !parts.pages.is_empty() => {
                let number = random.random_range(0..parts.pages.len());
                resize_page(&mut parts.pages[number], random);
            }
            _ if !parts.pages.is_empty() => {
                // What is elsewhere is from another page half of the time.
                let number = random.random_range(0..parts.pages.len());
                let from = random.random_range(0..parts.pages.len());
                let elsewhere = any_word(&parts.pages[from], random);
                let page = &mut parts.pages[number];
                let most = page.len();
                change_word_to(page, 0..most, elsewhere, random);
            }
            _ if sections > 0 => {
                let section = &mut parts.sections[random.random_range(0..sections)].bytes;
                let most = section.len();
                change_word(section, 0..most, random);
            }
            _ => {}
        }
    }

    /// A record more or fewer.
    fn resize_section(&self, parts: &mut Parts, random: &mut impl Rng) {
        let section = random.random_range(0..parts.sections.len());
        let section = &mut parts.sections[section];
        let each =
            self.counts.iter().find(|(_, _, kind, _)| **kind == section.kind).map_or(4, |&(.., each)| each);
        let records = section.bytes.len() / each;
        let at = each * random.random_range(0..=records);
        if random.random_ratio(1, 2) && at + each <= section.bytes.len() {
            section.bytes.drain(at..at + each);
        } else {
            let from = each * random.random_range(0..records.max(1));
            let record = section.bytes.get(from..from + each).map_or(vec![0; each], <[u8]>::to_vec);
            section.bytes.splice(at..at, record);
        }
    }

    /// Sections that are missing, there twice, unknown, out of order or flagged otherwise.
    fn change_table(&self, parts: &mut Parts, random: &mut impl Rng) {
        let (a, b) =
            (random.random_range(0..parts.sections.len()), random.random_range(0..parts.sections.len()));
        match random.random_range(0..7) {
            0 => drop(parts.sections.remove(a)),
            1 => {
                let copy = parts.sections[a].clone();
                parts.sections.insert(b, copy);
            }
            2 => parts.sections.swap(a, b),
            3 => parts.sections[a].flags ^= 1 << random.random_range(0..3),
            4 => {
                parts.sections[a].kind =
                    [*b"ATTR", *b"INPV", *b"GEOR", *b"\0\n\xffX"][random.random_range(0..4)]
            }
            5 => {
                let kind = [*b"GEOR", *b"ATTR"][random.random_range(0..2)];
                let bytes = vec![0; random.random_range(0..120)];
                parts.sections.insert(b, Section { kind, flags: random.random_range(0..4), bytes });
            }
            _ => {
                let end = random.random_range(0..=parts.sections[a].bytes.len());
                parts.sections[a].bytes.truncate(end);
            }
        }
    }
}

fn words(section: &Section) -> impl Iterator<Item = u32> + '_ {
    section.bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]))
}

/// The checksum of all behind it.
fn seal_start(bytes: &mut [u8]) {
    if bytes.len() >= 4 {
        let sum = crc32fast::hash(&bytes[4..]);
        put(bytes, 0, sum);
    }
}

fn any_word(bytes: &[u8], random: &mut impl Rng) -> u32 {
    let words = bytes.len() / 4;
    if words == 0 { 0 } else { word(bytes, 4 * random.random_range(0..words)).unwrap_or(0) }
}

fn change_word(bytes: &mut [u8], within: std::ops::Range<usize>, random: &mut impl Rng) {
    let elsewhere = any_word(bytes, random);
    change_word_to(bytes, within, elsewhere, random);
}

/// Mostly a whole word where words lie; records that are not made of words have some that lie otherwise.
fn change_word_to(bytes: &mut [u8], within: std::ops::Range<usize>, elsewhere: u32, random: &mut impl Rng) {
    if within.len() < 4 {
        return;
    }
    let mut at = random.random_range(within.start..=within.end - 4);
    match random.random_range(0..12) {
        0 => {
            bytes[at] ^= 1 << random.random_range(0..8);
            return;
        }
        1 | 2 => {}
        _ => at = (at & !3).max(within.start),
    }
    let old = word(bytes, at).unwrap_or(0);
    put(bytes, at, values::word(random, old, elsewhere));
}

/// Words more or fewer within a page, or a copy of some.
fn resize_page(page: &mut Vec<u8>, random: &mut impl Rng) {
    let words = page.len() / 4;
    let at = 4 * random.random_range(0..=words);
    let span = values::one_of(random, &[1, 4, 14]);
    let span = 4 * random.random_range(1..=span);
    if random.random_ratio(1, 2) {
        let end = (at + span).min(page.len());
        page.drain(at..end);
    } else {
        let from = (4 * random.random_range(0..words.max(1))).min(page.len());
        let copy = page[from..(from + span).min(page.len())].to_vec();
        page.splice(at..at, copy);
    }
    // Counts stand in the first words of pages and records.
    if random.random_ratio(2, 3) {
        let end = page.len().min(56);
        change_word(page, 0..end, random);
    }
}
