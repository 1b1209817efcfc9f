//! One soup, all around.

use std::path::Path;

use super::check::{Fault, backends, construction, same_within_little_memory};
use super::follow::views;
use crate::soup::soup;

/// Checks all that must hold of a soup, with every backend if `everywhere`; files are made in `folder`. Components are merged as
/// well, and some soups are also built within little memory.
pub fn check_soup(seed: u64, everywhere: bool, folder: &Path) -> Result<(), Fault> {
    let mesh = soup(seed).mesh;
    let views = views(&mesh, [1.0, 20.0, 200.0][seed as usize % 3]);
    let (log, _) = construction(&mesh, false, &views)?;
    if seed.is_multiple_of(16) {
        same_within_little_memory(&mesh, &log, folder)?;
    }
    if everywhere {
        backends(&log, folder, &views)?;
    }
    let (merged, _) = construction(&mesh, true, &views)?;
    if everywhere && seed.is_multiple_of(4) {
        backends(&merged, folder, &views)?;
    }
    Ok(())
}
