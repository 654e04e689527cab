//! The latest of what one thread tells another. Neither ever waits.

use std::sync::atomic::{AtomicU64, Ordering, fence};

/// Some numbers that one thread writes and others read, all of one moment.
///
/// A count is odd while the numbers change; who has read between two equal even counts has numbers of one moment.
#[derive(Debug)]
pub struct Latest<const N: usize> {
    count: AtomicU64,
    bits: [AtomicU64; N],
}

/// Who reads while the numbers change tries again so often.
const TRIES: u32 = 64;

impl<const N: usize> Latest<N> {
    /// Nothing written yet.
    pub fn new() -> Self {
        Self { count: AtomicU64::new(0), bits: std::array::from_fn(|_| AtomicU64::new(0)) }
    }

    /// By one thread only.
    pub fn write(&self, numbers: &[f64; N]) {
        let count = self.count.load(Ordering::Relaxed);
        self.count.store(count + 1, Ordering::Relaxed);
        // What follows is not seen before the odd count.
        fence(Ordering::Release);
        for (bits, number) in self.bits.iter().zip(numbers) {
            bits.store(number.to_bits(), Ordering::Relaxed);
        }
        self.count.store(count + 2, Ordering::Release);
    }

    /// The numbers of the last time, if there was one; nothing as well where they change all the time.
    pub fn read(&self) -> Option<[f64; N]> {
        for _ in 0..TRIES {
            let before = self.count.load(Ordering::Acquire);
            if before == 0 {
                return None;
            }
            let numbers =
                self.bits.each_ref().map(|bits| f64::from_bits(bits.load(Ordering::Relaxed)));
            // What came before is read before the count.
            fence(Ordering::Acquire);
            if before.is_multiple_of(2) && self.count.load(Ordering::Relaxed) == before {
                return Some(numbers);
            }
            std::hint::spin_loop();
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_of_one_moment() {
        let latest = Latest::<8>::new();
        assert_eq!(latest.read(), None);
        std::thread::scope(|scope| {
            let writer = scope.spawn(|| {
                for number in 1..200_000 {
                    latest.write(&[f64::from(number); 8]);
                }
            });
            let (mut last, mut reads) = (0.0, 0);
            while !writer.is_finished() || reads == 0 {
                let Some(numbers) = latest.read() else { continue };
                reads += 1;
                assert!(numbers.iter().all(|number| *number == numbers[0]), "{numbers:?}");
                assert!(numbers[0] >= last);
                last = numbers[0];
            }
        });
        assert_eq!(latest.read(), Some([199_999.0; 8]));
    }
}
