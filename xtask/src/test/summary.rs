//! Where the time of a run went.

use std::fmt::Write;
use std::time::Duration;

use super::programs::Outcome;

/// How many of the slowest tests are listed.
const SLOWEST: usize = 10;

/// Times of steps, programs and the slowest tests, and what failed.
pub fn tables(outcome: &Outcome, steps: &[(&'static str, Duration)]) -> String {
    let mut text = String::new();
    let mut tests: Vec<_> = outcome.tests.iter().collect();
    tests.sort_by_key(|(_, time)| std::cmp::Reverse(*time));
    let mut row = |name: &str, note: &str, time: Duration| {
        // Writing to a string does not fail.
        let _ = writeln!(text, "  {name:<64}{note:>12}{:>9.1} s", time.as_secs_f64());
    };
    for (name, time) in steps {
        row(name, "", *time);
    }
    for (name, count, time) in &outcome.programs {
        row(name, &format!("{count} tests"), *time);
    }
    for (name, time) in tests.into_iter().take(SLOWEST) {
        row(name, "", *time);
    }
    for failure in &outcome.failures {
        let _ = writeln!(text, "  failed: {}", failure.name);
    }
    text
}
