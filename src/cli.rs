//! The command line: arguments, and what each command does with the library.
//!
//! Errors are one line on standard error. Exit code 1 says that something failed, 2 that the command was not
//! understood.

mod arguments;
mod compare;
mod frame;
mod hierarchy;
mod input;
mod path;
mod progress;

use std::io::Write;
use std::process::ExitCode;

use anyhow::Context;
use clap::Parser;

use arguments::{Arguments, Command};

/// Runs the program with the process's arguments.
#[must_use]
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version also arrive here, and are no failure.
            let _ = error.print();
            return if error.use_stderr() { ExitCode::from(2) } else { ExitCode::SUCCESS };
        }
    };
    let result = match arguments.command {
        Command::Build(command) => hierarchy::build(&command),
        Command::Info(command) => hierarchy::info(&command),
        Command::Verify(command) => hierarchy::verify(&command),
        Command::Compare(command) => compare::compare(&command),
        Command::Path(command) => path::path(&command),
        Command::Export(command) => frame::export(&command),
        Command::Render(command) => frame::render(&command),
        Command::Deviation(command) => frame::deviation(&command),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // A reader that has seen enough is no failure either.
            if error.chain().any(is_broken_pipe) {
                return ExitCode::SUCCESS;
            }
            let line = format!("{error:#}").replace('\n', " ");
            let _ = writeln!(std::io::stderr(), "foldfront: {line}");
            ExitCode::FAILURE
        }
    }
}

fn is_broken_pipe(cause: &(dyn std::error::Error + 'static)) -> bool {
    cause.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
}

/// Whether a file could be written there: said before the work, not after it.
fn check_writable(file: &std::path::Path) -> anyhow::Result<()> {
    let folder = match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => std::path::Path::new("."),
    };
    anyhow::ensure!(!file.is_dir(), "{}: is a folder", file.display());
    tempfile::tempfile_in(folder).with_context(|| file.display().to_string())?;
    Ok(())
}

/// Writes to standard output, whose reader may have gone.
fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()?;
    Ok(())
}
