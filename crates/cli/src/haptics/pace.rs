//! Ticks at a steady rate, and how well they kept it.

use std::time::{Duration, Instant};

use serde::Serialize;

/// The rest of a wait [s] that is spent awake: sleeping threads wake up late.
const AWAKE: Duration = Duration::from_micros(150);

/// Times of ticks.
#[derive(Debug)]
pub struct Pace {
    tick: Duration,
    begin: Instant,
    count: u32,
    /// How late each tick began [s].
    late: Vec<f32>,
    /// The processor's time of each [s].
    work: Vec<f32>,
    /// Ticks that were not done when the next was due.
    missed: u64,
    cpu: f64,
}

/// Shares of many values, and the largest.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Spread {
    /// Half of all are below [ms].
    pub median: f64,
    /// 99 % are.
    pub p99: f64,
    /// 99.9 % are.
    pub p999: f64,
    /// All are.
    pub most: f64,
}

impl Pace {
    /// For so many ticks of so many seconds.
    pub fn new(tick: f64, count: u64) -> Self {
        let room = usize::try_from(count).unwrap_or(0);
        Self {
            tick: Duration::from_secs_f64(tick),
            begin: Instant::now(),
            count: 0,
            late: Vec::with_capacity(room),
            work: Vec::with_capacity(room),
            missed: 0,
            cpu: 0.0,
        }
    }

    fn due(&self, count: u32) -> Instant {
        self.begin + self.tick * count
    }

    /// Waits until the next tick is due.
    pub fn wait(&mut self) {
        let due = self.due(self.count);
        loop {
            let left = due.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            match left.checked_sub(AWAKE) {
                Some(asleep) => std::thread::sleep(asleep),
                None => std::hint::spin_loop(),
            }
        }
        self.late.push(due.elapsed().as_secs_f32());
        self.cpu = cpu_time();
    }

    /// The tick's work is done.
    pub fn done(&mut self) {
        self.work.push((cpu_time() - self.cpu) as f32);
        self.count += 1;
        let next = self.due(self.count);
        if Instant::now() > next {
            self.missed += 1;
            // Ticks that are over are left out: a loop that runs after them comes late for ever.
            let over = next.elapsed();
            if over > self.tick {
                self.begin += over;
            }
        }
    }

    /// Ticks that were not done in time.
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// How late ticks began.
    pub fn late(&self) -> Spread {
        Spread::of(&self.late)
    }

    /// The processor's time of a tick.
    pub fn work(&self) -> Spread {
        Spread::of(&self.work)
    }
}

impl Spread {
    /// Of seconds.
    fn of(seconds: &[f32]) -> Self {
        let mut sorted = seconds.to_vec();
        sorted.sort_by(f32::total_cmp);
        let Some(last) = sorted.len().checked_sub(1) else { return Self::default() };
        let at = |share: f64| 1e3 * f64::from(sorted[(share * last as f64).ceil() as usize]);
        Self { median: at(0.5), p99: at(0.99), p999: at(0.999), most: at(1.0) }
    }
}

/// The processor's time of this thread [s]; elsewhere than on Unix the time that has gone by.
fn cpu_time() -> f64 {
    #[cfg(unix)]
    {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
    }
    #[cfg(not(unix))]
    {
        static BEGIN: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
        BEGIN.get_or_init(Instant::now).elapsed().as_secs_f64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_that_are_late_are_counted() {
        let mut pace = Pace::new(2e-3, 10);
        for tick in 0..10 {
            pace.wait();
            if tick == 4 {
                std::thread::sleep(Duration::from_millis(9));
            }
            pace.done();
        }
        assert!(pace.missed() >= 1);
        assert_eq!((pace.late.len(), pace.work.len()), (10, 10));
    }

    #[test]
    fn shares_are_those_of_sorted_values() {
        let values: Vec<f32> = (0..=1000).rev().map(|value| value as f32 * 1e-3).collect();
        let spread = Spread::of(&values);
        let wanted = [500.0, 990.0, 999.0, 1000.0];
        for (found, wanted) in
            [spread.median, spread.p99, spread.p999, spread.most].iter().zip(wanted)
        {
            assert!((found - wanted).abs() < 1e-3, "{spread:?}");
        }
        assert_eq!(Spread::of(&[]).most, 0.0);
    }
}
