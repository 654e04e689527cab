//! Threads that wait for the length of a step and take pieces of one job after the other.
//!
//! A step has hundreds of jobs of some ten microseconds, one per colour and pass. Handing each to a
//! thread pool costs about as much as half of it; here the thread that steps announces a job by one
//! store, every waiting thread claims pieces, and the thread that steps goes on when all are done.
//! It never waits for a thread that has not come: pieces that no other claims it does itself.
#![allow(unsafe_code)]

use std::cell::UnsafeCell;
use std::fmt;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};

/// The most pieces of a job: sixteen bits count them.
const MOST_PIECES: usize = u16::MAX as usize;

/// Looks for a job before a thread offers its processor to others: about ten microseconds.
const PATIENCE: u32 = 20_000;

/// Where a thread takes pieces from. The thread that steps begins at the front, the others at the back:
/// so each finds in its cache what it had there in the job before.
#[derive(Clone, Copy)]
enum End {
    Front,
    Back,
}

/// A job: pieces of `0..count`.
#[derive(Clone, Copy)]
struct Job {
    work: *const (dyn Fn(Range<usize>) + Sync),
    count: usize,
    pieces: usize,
}

/// Alone in its cache lines, so that looking at one does not slow the others down.
#[repr(align(128))]
struct Apart<T>(T);

/// Memory that waiting threads share.
pub struct Team {
    /// Number of the job (32 bits), first open piece (16), end of the open pieces (16).
    claims: Apart<AtomicU64>,
    /// Pieces that are done.
    done: Apart<AtomicUsize>,
    /// Written while no piece is open, read by the thread that has claimed one.
    job: UnsafeCell<Option<Job>>,
    /// A piece has panicked on another thread.
    failed: AtomicBool,
    /// The step is over: waiting threads may go.
    over: Apart<AtomicBool>,
}

// SAFETY: `job` is written by the thread that steps alone, and only while no piece is open; others read
// it between the claim of a piece and its end, for which the thread that steps waits.
unsafe impl Sync for Team {}
// SAFETY: the pointer in `job` is followed only as said above.
unsafe impl Send for Team {}

impl fmt::Debug for Team {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Team").finish_non_exhaustive()
    }
}

impl Team {
    /// Without a job.
    pub fn new() -> Self {
        Self {
            claims: Apart(AtomicU64::new(0)),
            done: Apart(AtomicUsize::new(0)),
            job: UnsafeCell::new(None),
            failed: AtomicBool::new(false),
            over: Apart(AtomicBool::new(true)),
        }
    }

    /// Runs `step` with `helpers` waiting threads of the pool, if they come.
    pub fn lead<R: Send>(
        &self,
        pool: &rayon::ThreadPool,
        helpers: usize,
        step: impl FnOnce() -> R + Send,
    ) -> R {
        self.over.0.store(false, Ordering::Release);
        pool.install(|| {
            let lead = || {
                let _over = Over(self);
                step()
            };
            rayon::join(lead, || self.gather(helpers)).0
        })
    }

    /// Waits for jobs with so many threads.
    fn gather(&self, helpers: usize) {
        match helpers {
            0 => {}
            1 => self.help(),
            _ => {
                rayon::join(|| self.help(), || self.gather(helpers - 1));
            }
        }
    }

    fn help(&self) {
        let mut idle = 0;
        while !self.over.0.load(Ordering::Acquire) {
            if let Some(piece) = self.claim(End::Back) {
                self.execute(piece);
                idle = 0;
            } else {
                wait(&mut idle);
            }
        }
    }

    /// `work` on all of `0..count` in pieces of at least `grain`; returns when all is done. Only the
    /// thread that steps may call it.
    pub fn run(&self, count: usize, grain: usize, work: &(dyn Fn(Range<usize>) + Sync)) {
        let pieces = (count / grain).clamp(1, MOST_PIECES);
        if pieces == 1 {
            return work(0..count);
        }
        // SAFETY: only lengthens the life of the reference, which `Finish` outlives.
        let work: &'static (dyn Fn(Range<usize>) + Sync) = unsafe { std::mem::transmute(work) };
        // SAFETY: no piece is open, so that no other thread reads it.
        unsafe { *self.job.get() = Some(Job { work, count, pieces }) };
        self.done.0.store(0, Ordering::Relaxed);
        let number = (self.claims.0.load(Ordering::Relaxed) >> 32).wrapping_add(1);
        self.claims.0.store(number << 32 | pieces as u64, Ordering::Release);
        let finish = Finish { team: self, pieces };
        while let Some(piece) = self.claim(End::Front) {
            self.execute(piece);
        }
        drop(finish);
        assert!(!self.failed.swap(false, Ordering::AcqRel), "a thread of the solver panicked");
    }

    /// An open piece.
    fn claim(&self, end: End) -> Option<usize> {
        let mut word = self.claims.0.load(Ordering::Acquire);
        loop {
            let (front, back) = (word >> 16 & 0xffff, word & 0xffff);
            if front >= back {
                return None;
            }
            let (piece, left) = match end {
                End::Front => (front, word + (1 << 16)),
                End::Back => (back - 1, word - 1),
            };
            let order = (Ordering::AcqRel, Ordering::Acquire);
            match self.claims.0.compare_exchange_weak(word, left, order.0, order.1) {
                Ok(_) => return Some(piece as usize),
                Err(now) => word = now,
            }
        }
    }

    fn execute(&self, piece: usize) {
        let _done = Done(self);
        // SAFETY: the piece is open until `_done` is dropped, so the job and what it points to live.
        let job = unsafe { *self.job.get() };
        if let Some(Job { work, count, pieces }) = job {
            // SAFETY: as above.
            unsafe { (*work)(piece * count / pieces..(piece + 1) * count / pieces) };
        }
    }
}

fn wait(idle: &mut u32) {
    *idle += 1;
    if *idle < PATIENCE {
        // Not `spin_loop`: a virtual machine may take a processor away that pauses in a loop.
        std::hint::black_box(());
    } else {
        std::thread::yield_now();
    }
}

/// Counts a piece as done, even where it panics.
struct Done<'a>(&'a Team);

impl Drop for Done<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.failed.store(true, Ordering::Release);
        }
        self.0.done.0.fetch_add(1, Ordering::Release);
    }
}

/// Waits until no thread works on the job any more, even where a piece of this thread panics.
struct Finish<'a> {
    team: &'a Team,
    pieces: usize,
}

impl Drop for Finish<'_> {
    fn drop(&mut self) {
        // Pieces are left open by a panic only; no thread shall do them.
        while self.team.claim(End::Front).is_some() {
            self.team.done.0.fetch_add(1, Ordering::Release);
        }
        let mut idle = 0;
        while self.team.done.0.load(Ordering::Acquire) < self.pieces {
            wait(&mut idle);
        }
    }
}

/// Lets the threads go, even where the step panics.
struct Over<'a>(&'a Team);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.over.0.store(true, Ordering::Release);
    }
}
