//! Sections that this version does not know, in every format: skipped, but for those that are necessary.

use std::path::Path;
use std::sync::Arc;

use foldfront::experiment::store::{Store, StoreError};
use foldfront::page_store::source::MemorySource;

use super::{EXTENSIONS, frozen, germany};

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

fn put(bytes: &mut [u8], at: usize, value: u32) {
    bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
}

fn add(bytes: &mut [u8], at: usize, more: u32) {
    let sum = word(bytes, at) + more;
    put(bytes, at, sum);
}

/// Where the tables of sections are.
fn table(extension: &str) -> usize {
    match extension {
        "fold" => 48,
        "meta" => 80,
        "xfm" => 152,
        _ => 160,
    }
}

/// A file with a section more at its end, of kind `LATE`: what comes after the table moves by an entry.
fn with_section(extension: &str, flags: u32) -> Vec<u8> {
    const CONTENT: &[u8] = b"what somebody will think of";
    let mut bytes = std::fs::read(frozen(&format!("v2.{extension}"))).unwrap();
    let at = table(extension);
    let count = word(&bytes, at) as usize;
    let end = at + 8 + 32 * count;
    for entry in (at + 8..end).step_by(32) {
        add(&mut bytes, entry + 8, 32);
    }
    bytes.splice(end..end, [0; 32]);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    let offset = bytes.len() as u32;
    bytes.extend(CONTENT);
    bytes[end..end + 4].copy_from_slice(b"LATE");
    put(&mut bytes, end + 4, flags);
    put(&mut bytes, end + 8, offset);
    put(&mut bytes, end + 16, CONTENT.len() as u32);
    put(&mut bytes, end + 24, crc32fast::hash(CONTENT));
    put(&mut bytes, at, count as u32 + 1);
    if extension == "xfm" {
        // Its block index says where blocks are in the file, and its header how long that is.
        let index = (at + 8..end).step_by(32).find(|&entry| bytes[entry..entry + 4] == *b"PAGT").unwrap();
        let (start, length) = (word(&bytes, index + 8) as usize, word(&bytes, index + 16) as usize);
        for entry in (start..start + length).step_by(8) {
            add(&mut bytes, entry, 32);
        }
        let sum = crc32fast::hash(&bytes[start..start + length]);
        put(&mut bytes, index + 24, sum);
        let length = bytes.len() as u32;
        put(&mut bytes, 136, length);
        let sum = crc32fast::hash(&bytes[..144]);
        put(&mut bytes, 144, sum);
    }
    let entries = [&bytes[at..at + 4], &bytes[at + 8..end + 32]].concat();
    put(&mut bytes, at + 4, crc32fast::hash(&entries));
    bytes
}

/// Opens and verifies a file: a log by its path, others from memory.
fn verified(folder: &Path, extension: &str, bytes: &[u8]) -> Result<Store, StoreError> {
    let store = if extension == "fold" {
        let path = folder.join("file");
        std::fs::write(&path, bytes).unwrap();
        Store::open(&path)?
    } else {
        Store::from_source(Arc::new(MemorySource::new("file", bytes)))?
    };
    store.verify()?;
    Ok(store)
}

#[test]
fn what_is_not_known_is_skipped_unless_it_is_necessary() {
    let folder = tempfile::tempdir().unwrap();
    for (_, extension) in EXTENSIONS {
        let mut bytes = with_section(extension, 0);
        assert_eq!(verified(folder.path(), extension, &bytes).unwrap().georeference(), germany());
        *bytes.last_mut().unwrap() ^= 1;
        let error = verified(folder.path(), extension, &bytes).err().unwrap().to_string();
        assert!(error.ends_with("checksum of section \"LATE\" does not match"), "{extension}: {error}");
        // Nobody can check the pages of what is not known, and checksums of such a section are none.
        let error =
            verified(folder.path(), extension, &with_section(extension, 2)).err().unwrap().to_string();
        assert!(error.contains("the checksum of section \"LATE\""), "{extension}: {error}");
        let bytes = with_section(extension, 1);
        let error = verified(folder.path(), extension, &bytes).err().unwrap().to_string();
        let said = format!("offset {}: section \"LATE\" is necessary, and not known", bytes.len() - 27);
        assert!(error.ends_with(&said), "{extension}: {error}");
    }
}

#[test]
fn any_changed_byte_is_found() {
    let folder = tempfile::tempdir().unwrap();
    for (_, extension) in EXTENSIONS {
        for name in [format!("v1.{extension}"), format!("v2.{extension}")] {
            let bytes = std::fs::read(frozen(&name)).unwrap();
            // Logs go through a file, which takes its time, and have a test of their own.
            let step = if extension == "fold" { 7 } else { 1 };
            for at in (0..bytes.len()).step_by(step) {
                let mut damaged = bytes.clone();
                damaged[at] ^= 1 << (at % 8);
                assert!(verified(folder.path(), extension, &damaged).is_err(), "{name}: byte {at}");
            }
            for length in (0..bytes.len()).step_by(3 * step) {
                assert!(verified(folder.path(), extension, &bytes[..length]).is_err(), "{name}: {length}");
            }
        }
    }
}
