//! Progress bars of one look.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// A bar that says what goes on, then `tail` (indicatif's template), then how long it will take.
pub fn bar(length: u64, what: &str, tail: &str) -> ProgressBar {
    let bar = ProgressBar::new(length);
    let template = format!("{what} [{{bar:30}}] {tail}, {{eta}} left");
    // The template is ours and valid; a bar without it would still count.
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar
}

/// For work whose length nobody knows: says what goes on, and for how long it has.
pub fn spinner(what: String) -> ProgressBar {
    let spinner = ProgressBar::new_spinner().with_message(what);
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}, {elapsed}") {
        spinner.set_style(style);
    }
    spinner.enable_steady_tick(Duration::from_millis(200));
    spinner
}
