//! How far a validation has come: a bar on a terminal, plain lines elsewhere.

use indicatif::{ProgressBar, ProgressStyle};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// One bar over all work, drawn on standard error. It may be shared between threads.
pub struct Progress {
    bar: ProgressBar,
    section: Mutex<String>,
}

impl Progress {
    /// For so many cases in all.
    pub fn new(cases: usize) -> Self {
        let bar = ProgressBar::new(cases as u64);
        // The template is ours and valid; a bar without it would still count.
        let template = "{elapsed} [{bar:30}] {pos} of {len}  {wide_msg}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        if !bar.is_hidden() {
            // The clock moves during a long case, too.
            bar.enable_steady_tick(Duration::from_millis(500));
        }
        Self { bar, section: Mutex::default() }
    }

    /// Says that a case begins; it counts as done when the returned value goes out of scope.
    #[must_use = "the case ends when this is dropped"]
    pub fn case(&self, name: &str) -> CaseInProgress<'_> {
        self.bar.set_message(format!("{}: {name}", self.section_name()));
        CaseInProgress(&self.bar)
    }

    /// Cases that are done.
    pub fn done(&self) -> usize {
        self.bar.position() as usize
    }

    /// Carries out a section and reports it.
    pub(crate) fn section<T>(&self, name: &str, run: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        name.clone_into(&mut self.section.lock().unwrap_or_else(|e| e.into_inner()));
        let result = run();
        if self.bar.is_hidden() {
            eprintln!("{name}: {:.1} s", start.elapsed().as_secs_f64());
        }
        result
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn section_name(&self) -> String {
        self.section.lock().unwrap_or_else(|e| e.into_inner()).clone()
    }
}

/// A case that is being computed.
pub struct CaseInProgress<'a>(&'a ProgressBar);

impl Drop for CaseInProgress<'_> {
    fn drop(&mut self) {
        self.0.inc(1);
    }
}
