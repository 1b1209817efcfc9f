//! Folders that go with the process that made them, or with the next one.
//!
//! A process that is killed removes nothing. So each folder here holds a file that is locked as long as the process lives:
//! whoever makes another one beside it removes those that nobody holds. What is written whole or not at all
//! ([`output`](crate::output)) is written into such a folder first, and so is what a process keeps on disk for itself.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use fs4::FileExt;
use tempfile::TempDir;

/// How the names of such folders begin.
pub const PREFIX: &str = ".foldfront-";

/// The file that is locked.
const LOCK: &str = "lock";

/// Those of this process.
static OWN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A folder for as long as this is there.
#[derive(Debug)]
pub struct Temporary {
    // Goes before the folder, which some systems do not remove while a file in it is open. Whoever finds the lock free then
    // removes what would be removed anyway.
    _lock: File,
    folder: TempDir,
}

impl Temporary {
    /// Makes a folder within another one, for its owner alone, and removes those there that dead processes have left.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn new_in(within: &Path) -> io::Result<Self> {
        clear(within);
        loop {
            let folder = tempfile::Builder::new().prefix(PREFIX).tempdir_in(within)?;
            // Until it is locked, another process may take this for the folder of a dead one.
            match File::create_new(folder.path().join(LOCK)) {
                Ok(lock) => {
                    FileExt::lock(&lock)?;
                    if folder.path().join(LOCK).exists() {
                        own(|all| all.push(folder.path().to_owned()));
                        return Ok(Self { _lock: lock, folder });
                    }
                }
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Makes it where the system has its temporary files.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn new() -> io::Result<Self> {
        Self::new_in(&std::env::temp_dir())
    }

    /// Where a file of a name is, within the folder.
    #[must_use]
    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        own(|all| all.retain(|folder| folder != self.folder.path()));
    }
}

fn own(change: impl FnOnce(&mut Vec<PathBuf>)) {
    change(&mut OWN.lock().unwrap_or_else(PoisonError::into_inner));
}

/// Removes all such folders of this process: for one that is about to end without a chance to drop them. What is in them
/// is lost, and whoever still writes there fails.
pub fn remove_all() {
    own(|all| all.drain(..).for_each(|folder| drop(std::fs::remove_dir_all(folder))));
}

/// Removes what dead processes have left in a folder. What can not be removed, as it belongs to somebody else, stays.
fn clear(within: &Path) {
    let Ok(entries) = std::fs::read_dir(within) else { return };
    for entry in entries.flatten() {
        if entry.file_name().to_str().is_none_or(|name| !name.starts_with(PREFIX)) {
            continue;
        }
        let folder = entry.path();
        match File::open(folder.join(LOCK)) {
            Ok(lock) if FileExt::try_lock(&lock).is_ok() => drop(std::fs::remove_dir_all(&folder)),
            // Its process has died before, or is about to lock it: then it makes another one.
            Err(error) if error.kind() == io::ErrorKind::NotFound => drop(std::fs::remove_dir(&folder)),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_holds_goes_and_what_somebody_holds_stays() {
        let within = tempfile::tempdir().unwrap();
        let names =
            || std::fs::read_dir(&within).unwrap().map(|entry| entry.unwrap().path()).collect::<Vec<_>>();
        let held = Temporary::new_in(within.path()).unwrap();
        std::fs::write(held.file("content"), "of a living process").unwrap();
        // As processes leave them that are killed at one moment or another.
        for (name, files) in [("a", vec![]), ("b", vec![LOCK]), ("c", vec![LOCK, "content", "more"])] {
            let folder = within.path().join(format!("{PREFIX}{name}"));
            std::fs::create_dir(&folder).unwrap();
            files.iter().for_each(|file| std::fs::write(folder.join(file), "").unwrap());
        }
        std::fs::create_dir(within.path().join("of somebody else")).unwrap();
        assert_eq!(names().len(), 5);
        let other = Temporary::new_in(within.path()).unwrap();
        assert_eq!(names().len(), 3);
        assert!(held.file("content").exists());
        drop((held, other));
        assert_eq!(names(), [within.path().join("of somebody else")]);
    }

    /// Many at once in one folder: each keeps its own.
    #[test]
    fn nobody_removes_what_another_is_about_to_lock() {
        let within = tempfile::tempdir().unwrap();
        std::thread::scope(|scope| {
            for number in 0..4 {
                let within = within.path();
                scope.spawn(move || {
                    for turn in 0..50 {
                        let own = Temporary::new_in(within).unwrap();
                        std::fs::write(own.file("own"), format!("{number} {turn}")).unwrap();
                        assert_eq!(
                            std::fs::read_to_string(own.file("own")).unwrap(),
                            format!("{number} {turn}")
                        );
                    }
                });
            }
        });
        assert_eq!(std::fs::read_dir(&within).unwrap().count(), 0);
    }
}
