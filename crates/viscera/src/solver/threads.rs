//! Who does the work: threads and instructions, and what they may share.
//!
//! Work is cut into pieces whose number does not depend on the threads, every place is written by one
//! piece, and sums go over pieces in order. So the bits are the same for any number of threads.
#![allow(unsafe_code)]

use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;

use crate::scalar::lanes::Instructions;
use crate::settings::{MOST_THREADS, Threads};

/// Threads pay from this many tetrahedra on: below, waking them costs what they save.
const WORTH_THREADS: usize = 16_000;

/// Threads and instructions of one solver.
#[derive(Clone, Debug)]
pub(super) struct Workers {
    pool: Option<Arc<rayon::ThreadPool>>,
    pub instructions: Instructions,
}

impl Workers {
    /// As many threads as wanted, where a mesh of this size makes use of them. Where the system
    /// refuses to start them, one does all the work: slower, and the same bits.
    pub fn new(wanted: Threads, tet_count: usize) -> Self {
        let count = match wanted {
            Threads::Auto if tet_count < WORTH_THREADS => 1,
            Threads::Auto => std::thread::available_parallelism().map_or(1, usize::from),
            Threads::Count(count) => count.min(MOST_THREADS) as usize,
        };
        let build = || rayon::ThreadPoolBuilder::new().num_threads(count).build().ok();
        let pool = if count > 1 { build().map(Arc::new) } else { None };
        Self { pool, instructions: Instructions::detect() }
    }

    /// The thread that is here, alone.
    pub fn one() -> Self {
        Self { pool: None, instructions: Instructions::detect() }
    }

    /// How many threads work.
    pub fn count(&self) -> usize {
        self.pool.as_ref().map_or(1, |pool| pool.current_num_threads())
    }

    /// Goes over to the threads for the whole of `work`: crossing costs more than a stage.
    pub fn enter<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }

    /// `work` on all of `0..count`, in pieces of about `grain`.
    pub fn each(&self, count: usize, grain: usize, work: impl Fn(Range<usize>) + Sync) {
        if self.pool.is_some() {
            halve(0..count, grain, &work);
        } else if count > 0 {
            work(0..count);
        }
    }

    /// Combines what `map` makes of pieces of `0..count`, `piece` long each, in order. `partial`
    /// has room for one value per piece.
    pub fn reduce<T: Copy + Send>(
        &self,
        (count, piece): (usize, usize),
        partial: &mut [T],
        map: impl Fn(Range<usize>) -> T + Sync,
        combine: impl Fn(T, T) -> T,
    ) -> Option<T> {
        let pieces = count.div_ceil(piece);
        let shared = Shared::new(&mut partial[..pieces]);
        self.each(pieces, 1, |range| {
            for i in range {
                let value = map(i * piece..((i + 1) * piece).min(count));
                // SAFETY: every piece is worked on once.
                unsafe { *shared.at(i) = value };
            }
        });
        partial[..pieces].iter().copied().reduce(combine)
    }
}

/// Halves a range among threads until pieces are small.
fn halve(range: Range<usize>, grain: usize, work: &(impl Fn(Range<usize>) + Sync)) {
    if range.len() <= grain {
        if !range.is_empty() {
            work(range);
        }
        return;
    }
    let middle = range.start + range.len() / 2;
    let (left, right) = (range.start..middle, middle..range.end);
    rayon::join(|| halve(left, grain, work), || halve(right, grain, work));
}

/// A slice of which several threads write different places.
#[derive(Clone, Copy)]
pub(super) struct Shared<'a, T> {
    start: *mut T,
    len: usize,
    slice: PhantomData<&'a mut [T]>,
}

// SAFETY: whoever goes through the pointer promises that no two threads meet at one place.
unsafe impl<T: Send> Sync for Shared<'_, T> {}
// SAFETY: as above.
unsafe impl<T: Send> Send for Shared<'_, T> {}

impl<'a, T> Shared<'a, T> {
    /// Shares a slice for as long as it is borrowed.
    pub fn new(slice: &'a mut [T]) -> Self {
        Self { start: slice.as_mut_ptr(), len: slice.len(), slice: PhantomData }
    }

    /// Number of places.
    pub fn len(&self) -> usize {
        self.len
    }

    /// For gathers and scatters.
    #[inline(always)]
    pub fn pointer(&self) -> *mut T {
        self.start
    }

    /// One place.
    ///
    /// # Safety
    /// Nobody else is at this place meanwhile.
    #[inline(always)]
    #[allow(clippy::mut_from_ref)]
    pub unsafe fn at(&self, i: usize) -> &mut T {
        assert!(i < self.len);
        // SAFETY: within the slice; alone there by the caller's promise.
        unsafe { &mut *self.start.add(i) }
    }

    /// Several places in a row.
    ///
    /// # Safety
    /// Nobody else is at these places meanwhile.
    #[inline(always)]
    #[allow(clippy::mut_from_ref)]
    pub unsafe fn range(&self, range: Range<usize>) -> &mut [T] {
        assert!(range.start <= range.end && range.end <= self.len);
        // SAFETY: within the slice; alone there by the caller's promise.
        unsafe { std::slice::from_raw_parts_mut(self.start.add(range.start), range.len()) }
    }
}
