//! Files written whole or not at all.
//!
//! What is written goes to a [temporary folder](crate::temporary) beside its place, is synced, and is renamed; then the folder that
//! it is in now is synced too. Where its place is a link, it goes to where that leads, and it keeps the mode of what was
//! there before.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::temporary::Temporary;

/// Writes a file whole or not at all.
///
/// # Errors
/// What the operating system says; nothing is left behind then.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write_with(path, |out| out.write_all(bytes))
}

/// Writes a file piece by piece, whole or not at all.
///
/// # Errors
/// What the operating system or `content` says; nothing is left behind then.
pub fn write_with(path: &Path, content: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
    Written::new(path, content)?.rename()
}

/// Writes several files: all of them, or none. Only where renaming fails or the process ends between two renames, when all of
/// them are on disk already, are some new and others old.
///
/// # Errors
/// Which file could not be written, and what the operating system says.
pub fn write_all<'a>(
    files: impl IntoIterator<Item = (&'a Path, &'a [u8])>,
) -> Result<(), (PathBuf, io::Error)> {
    let write = |(path, bytes): (&'a Path, &[u8])| {
        let written = Written::new(path, |out| out.write_all(bytes));
        written.map(|written| (path, written)).map_err(|error| (path.to_owned(), error))
    };
    let written: Vec<_> = files.into_iter().map(write).collect::<Result<_, _>>()?;
    for (path, written) in written {
        written.rename().map_err(|error| (path.to_owned(), error))?;
    }
    Ok(())
}

/// A file that is on disk, and not at its place yet.
struct Written {
    place: PathBuf,
    temporary: Temporary,
}

const NAME: &str = "content";

impl Written {
    fn new(path: &Path, content: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<Self> {
        let place = followed(path)?;
        let temporary = Temporary::new_in(folder_of(&place))?;
        let mut file =
            OpenOptions::new().read(true).write(true).create_new(true).open(temporary.file(NAME))?;
        if let Ok(before) = std::fs::metadata(&place) {
            file.set_permissions(before.permissions())?;
        }
        content(&mut file)?;
        file.sync_all()?;
        Ok(Self { place, temporary })
    }

    fn rename(self) -> io::Result<()> {
        std::fs::rename(self.temporary.file(NAME), &self.place)?;
        // Elsewhere a folder can not be opened, and its entries are the file system's own business.
        #[cfg(unix)]
        File::open(folder_of(&self.place))?.sync_all()?;
        Ok(())
    }
}

/// The folder that a file is in, or would be.
#[must_use]
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// As many links as Linux follows.
const MOST_LINKS: usize = 40;

/// Where a path leads that may be a link, to something that may not be there.
fn followed(path: &Path) -> io::Result<PathBuf> {
    let mut place = path.to_owned();
    for _ in 0..MOST_LINKS {
        match std::fs::read_link(&place) {
            Ok(target) => place = folder_of(&place).join(target),
            // It is no link, or nothing.
            Err(_) => return Ok(place),
        }
    }
    Err(io::Error::other("too many links"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let name = |entry: io::Result<std::fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
        let mut names: Vec<String> = std::fs::read_dir(folder).unwrap().map(name).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_replaced_or_left_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        write(&path, b"first").unwrap();
        write(&path, b"second").unwrap();
        let failed = write_with(&path, |out| {
            out.write_all(b"third, and then")?;
            Err(io::Error::other("no more"))
        });
        assert_eq!(failed.unwrap_err().to_string(), "no more");
        assert_eq!(std::fs::read(&path).unwrap(), b"second");
        assert_eq!(names(folder.path()), ["file"]);
    }

    #[test]
    fn all_are_written_or_none() {
        let folder = tempfile::tempdir().unwrap();
        let [one, other] = ["one", "other"].map(|name| folder.path().join(name));
        write_all([(&*one, &b"1"[..]), (&*other, b"2")]).unwrap();
        let nowhere = folder.path().join("nowhere/file");
        let (file, _) = write_all([(&*one, &b"3"[..]), (&*nowhere, b"4")]).unwrap_err();
        assert_eq!(file, nowhere);
        assert_eq!([one, other].map(|path| std::fs::read(path).unwrap()), [b"1", b"2"]);
        assert_eq!(names(folder.path()), ["one", "other"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_modes_kept() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("below")).unwrap();
        write(&at("below/file"), b"before").unwrap();
        std::fs::set_permissions(at("below/file"), std::fs::Permissions::from_mode(0o640)).unwrap();
        symlink("below/file", at("link")).unwrap();
        symlink("link", at("link to a link")).unwrap();
        symlink("below/nothing", at("link to nothing")).unwrap();
        symlink("round", at("round")).unwrap();
        write(&at("link to a link"), b"after").unwrap();
        write(&at("link to nothing"), b"new").unwrap();
        assert_eq!(write(&at("round"), b"").unwrap_err().to_string(), "too many links");
        assert_eq!(std::fs::read(at("below/file")).unwrap(), b"after");
        assert_eq!(std::fs::read(at("below/nothing")).unwrap(), b"new");
        assert!(at("link").is_symlink() && at("link to a link").is_symlink());
        let mode = std::fs::metadata(at("below/file")).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o640);
        assert_eq!(names(&at("below")), ["file", "nothing"]);
    }
}
