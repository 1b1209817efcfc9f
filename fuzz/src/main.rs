//! Runs every reader of foldfront over damaged files: `fuzz help` says how.

mod allocator;
mod driver;
mod inputs;
mod mutate;
mod packed;
mod sealed;
mod seeds;
mod targets;
mod values;

use std::path::Path;
use std::process::ExitCode;

const HELP: &str = "\
fuzz list                        names the targets
fuzz run TARGET [OPTIONS]        runs a target; `.ci/fuzz` runs each in turn
    --runs N                     so many runs, at most
    --minutes M                  so long, at most
    --seed S                     other inputs (1)
    --finds FOLDER               where inputs that are finds are written (finds)
fuzz replay FILE...              runs inputs again; the name of a file's folder says the target
fuzz seeds                       writes what is made of the corpora, but for finds
";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let outcome = match arguments[..] {
        ["list"] => {
            targets::ALL.iter().for_each(|target| println!("{:8} {:?}", target.name, target.class));
            Ok(true)
        }
        ["run", name, ref options @ ..] => {
            driver::Options::parse(options).and_then(|options| driver::run(name, &options))
        }
        ["replay", ref files @ ..] => driver::replay(files.iter().map(Path::new)),
        ["seeds"] => seeds::write(),
        _ => {
            print!("{HELP}");
            return if arguments == ["help"] { ExitCode::SUCCESS } else { ExitCode::from(2) };
        }
    };
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(2)
        }
    }
}
