//! What is said to the user.

use std::io::Write;

/// An argument that is none beside what it is about, such as a tolerance for the lens of a path.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct Misunderstood(pub String);

/// Says on standard error what went wrong, in one line.
pub(super) fn complain(what: &str) {
    let _ = writeln!(std::io::stderr(), "foldfront: {}", what.replace(['\n', '\r'], " "));
}

/// Says on standard error, in one line, what the user should know although nothing has failed.
pub(super) fn warn(what: &str) {
    complain(&format!("warning: {what}"));
}

/// Writes to standard output, whose reader may have gone.
pub(super) fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()?;
    Ok(())
}
