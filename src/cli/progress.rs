//! Progress bars on a terminal, a line a stage elsewhere.

use std::io::IsTerminal;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};

/// Runs `work` under a progress bar that names it.
pub(super) fn stage<T>(name: &str, work: impl FnOnce(&mut dyn FnMut(u64, u64)) -> T) -> T {
    let start = Instant::now();
    let terminal = std::io::stderr().is_terminal();
    let bar = if terminal { ProgressBar::new(0) } else { ProgressBar::hidden() };
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
    eprintln!("{name:44} {:8.2} s", start.elapsed().as_secs_f64());
    result
}
