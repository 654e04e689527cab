//! Work on all processors whose results are taken in order.

use anyhow::Result;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::sync_channel;
use std::thread;

/// Makes `0..count` on all processors, and takes what is made in this order, here. Few results wait at a time. Returns
/// false where `take` does: it wants no more.
pub fn make_in_order<T: Send>(
    count: usize,
    make: impl Fn(usize) -> T + Sync,
    mut take: impl FnMut(T) -> Result<bool>,
) -> Result<bool> {
    let threads = thread::available_parallelism().map_or(1, usize::from).clamp(1, count.max(1));
    let (next, over) = (&AtomicUsize::new(0), &AtomicBool::new(false));
    let make = &make;
    thread::scope(|scope| {
        let (sender, receiver) = sync_channel(threads);
        for _ in 0..threads {
            let sender = sender.clone();
            scope.spawn(move || {
                while !over.load(Ordering::Relaxed) {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= count || sender.send((number, make(number))).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        let (mut early, mut wanted) = (BTreeMap::new(), 0);
        for (number, made) in receiver {
            early.insert(number, made);
            while let Some(made) = early.remove(&wanted) {
                wanted += 1;
                let taken = take(made);
                if !matches!(taken, Ok(true)) {
                    // What is being made is finished, and nobody takes it.
                    over.store(true, Ordering::Relaxed);
                    return taken;
                }
            }
        }
        Ok(true)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn results_are_taken_in_order_until_no_more_are_wanted() {
        let made = AtomicUsize::new(0);
        let make = |number: usize| {
            made.fetch_add(1, Ordering::Relaxed);
            // The first are the slowest.
            thread::sleep(Duration::from_millis(8_u64.saturating_sub(number as u64)));
            number
        };
        let mut taken = Vec::new();
        let whole = make_in_order(20, make, |number| {
            taken.push(number);
            Ok(true)
        });
        assert!(whole.expect("no error") && taken.iter().copied().eq(0..20));
        assert_eq!(made.load(Ordering::Relaxed), 20);
        assert!(make_in_order(0, make, |_| Ok(false)).expect("no error"));
        assert!(!make_in_order(5, make, |number| Ok(number < 2)).expect("no error"));
        let error = make_in_order(9, make, |number| match number {
            3 => Err(anyhow::anyhow!("no room")),
            _ => Ok(true),
        });
        assert_eq!(error.expect_err("an error").to_string(), "no room");
    }
}
