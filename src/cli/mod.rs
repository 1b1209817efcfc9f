//! The command line: arguments, and what each command does with the library.
//!
//! It may use every other room. What must never be in it: anything that a user of the library would miss.
//!
//! Errors are one line on standard error that starts with `foldfront: `. Exit code 1 says that something failed, 2
//! that the command was not understood, 130 that it was interrupted. A command that fails leaves the files that it would have written as they
//! were.

mod arguments;
mod compare;
mod destination;
mod frame;
mod hierarchy;
mod input;
mod interrupt;
mod path;
mod progress;
mod say;
mod threads;
mod values;

use std::process::ExitCode;

use clap::Parser;
use clap::error::ErrorKind;

use arguments::{Arguments, Command};
use say::{Misunderstood, complain};

/// Runs the program with the process's arguments.
#[must_use]
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version also arrive here, and are no failure.
            if !error.use_stderr() {
                let _ = error.print();
                return ExitCode::SUCCESS;
            }
            match error.kind() {
                // Nothing was asked for: the way to find out what can be.
                ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => drop(error.print()),
                _ => complain(&usage_line(&error)),
            }
            return ExitCode::from(2);
        }
    };
    interrupt::listen();
    threads::take_what_there_is();
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
            complain(&failure_line(&error));
            if interrupt::is_raised() {
                return ExitCode::from(interrupt::EXIT_CODE);
            }
            if error.is::<Misunderstood>() { ExitCode::from(2) } else { ExitCode::FAILURE }
        }
    }
}

/// An error and its causes, but for those that it names itself.
fn failure_line(error: &anyhow::Error) -> String {
    let mut line = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !line.ends_with(&cause) {
            line = format!("{line}: {cause}");
        }
    }
    line
}

/// What the argument parser has to say, without its page of advice.
fn usage_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let text = text.strip_prefix("error: ").unwrap_or(&text);
    let paragraphs = text
        .split("\n\n")
        .take_while(|paragraph| !paragraph.starts_with("Usage:") && !paragraph.starts_with("For more"))
        .map(|paragraph| paragraph.split_whitespace().collect::<Vec<_>>().join(" "));
    paragraphs.collect::<Vec<_>>().join("; ")
}

fn is_broken_pipe(cause: &(dyn std::error::Error + 'static)) -> bool {
    cause.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
}
