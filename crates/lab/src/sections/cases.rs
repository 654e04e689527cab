//! Independent cases on all cores, with results in order.

use super::progress::Progress;
use anyhow::{Context, Result, anyhow};
use std::any::Any;
use std::fmt::Display;
use std::num::NonZero;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Computes every case. Results do not depend on the number of cores; an error names its case, and
/// a panic is an error.
pub(super) fn run_cases<C: Display + Sync, T: Send>(
    progress: &Progress,
    cases: &[C],
    run: impl Fn(&C) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    let next = AtomicUsize::new(0);
    let failed = AtomicBool::new(false);
    let results: Vec<Mutex<Option<Result<T>>>> = cases.iter().map(|_| Mutex::default()).collect();
    let work = || {
        // After a failure the rest would only be waited for.
        while !failed.load(Ordering::Relaxed) {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let (Some(case), Some(slot)) = (cases.get(at), results.get(at)) else { break };
            let name = case.to_string();
            let in_progress = progress.case(&name);
            let result = run_named(&name, || run(case));
            drop(in_progress);
            failed.fetch_or(result.is_err(), Ordering::Relaxed);
            *slot.lock().unwrap_or_else(|e| e.into_inner()) = Some(result);
        }
    };
    let workers = std::thread::available_parallelism().map_or(1, NonZero::get).min(cases.len());
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(work);
        }
    });
    let mut values = Vec::with_capacity(cases.len());
    let mut skipped = None;
    for (slot, case) in results.into_iter().zip(cases) {
        match slot.into_inner().unwrap_or_else(|e| e.into_inner()) {
            Some(result) => values.push(result.with_context(|| format!("case `{case}`"))?),
            None => skipped = Some(case),
        }
    }
    match skipped {
        None => Ok(values),
        // Only failures skip cases, and failures have been returned.
        Some(case) => Err(anyhow!("case `{case}` was not computed")),
    }
}

/// Runs in a thread that has the case's name: a program that is built to end at a panic names it
/// in its last words, too.
fn run_named<T: Send>(name: &str, run: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    std::thread::scope(|scope| {
        let builder = std::thread::Builder::new().name(name.replace('\0', " "));
        let thread = builder.spawn_scoped(scope, run).context("cannot start a thread")?;
        thread.join().unwrap_or_else(|panic| Err(anyhow!("panicked: {}", panic_text(&*panic))))
    })
}

fn panic_text(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without a message")
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::bail;

    #[test]
    fn results_are_in_the_order_of_the_cases() {
        let cases: Vec<u64> = (0..40).collect();
        let progress = Progress::new(cases.len());
        let squares = run_cases(&progress, &cases, |case| {
            // The first ones take longest.
            std::thread::sleep(std::time::Duration::from_micros(400 - 10 * case));
            Ok(case * case)
        });
        let squares = squares.expect("no case fails");
        assert_eq!(squares, cases.iter().map(|case| case * case).collect::<Vec<_>>());
        assert_eq!(progress.done(), cases.len());
    }

    #[test]
    fn a_failure_or_a_panic_names_its_case() {
        let progress = Progress::new(3);
        let failed = run_cases(&progress, &["calm", "wild"], |case| {
            if *case == "wild" { bail!("no convergence") } else { Ok(()) }
        });
        assert_eq!(format!("{:#}", failed.unwrap_err()), "case `wild`: no convergence");
        let panicked = run_cases(&progress, &["brittle"], |case| -> Result<()> {
            panic!("{case} glass");
        });
        let text = format!("{:#}", panicked.unwrap_err());
        assert_eq!(text, "case `brittle`: panicked: brittle glass");
    }
}
