//! Progress for whoever watches: bars and times of stages on a terminal, and nothing at all elsewhere, so that what
//! a program or a log file finds on standard error is what went wrong.

use std::io::{IsTerminal, Write};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};

/// Runs `work` under a progress bar that names it, and leaves a line with the time that it took, unless it failed.
pub(super) fn stage<T, E>(
    name: &str,
    work: impl FnOnce(&mut dyn FnMut(u64, u64)) -> Result<T, E>,
) -> Result<T, E> {
    if !std::io::stderr().is_terminal() {
        return work(&mut |_, _| ());
    }
    let start = Instant::now();
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{msg:44} {wide_bar} {percent:>3}%  {eta:>4}") {
        bar.set_style(style.progress_chars("##-"));
    }
    bar.set_message(name.to_owned());
    let mut drawn = Instant::now();
    let result = work(&mut |done, total| {
        // The bar has a lock and a clock of its own, too slow to ask every time.
        if drawn.elapsed().as_millis() >= 50 || done == total {
            bar.set_length(total);
            bar.set_position(done);
            drawn = Instant::now();
        }
    });
    bar.finish_and_clear();
    if result.is_ok() {
        // Nobody is left to tell where this fails.
        let _ = writeln!(std::io::stderr(), "{name:44} {:8.2} s", start.elapsed().as_secs_f64());
    }
    result
}
