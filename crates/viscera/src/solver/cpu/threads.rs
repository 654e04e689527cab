//! Threads and instructions that do the work, and the memory that threads may share.
//!
//! Work is cut into pieces whose number does not depend on the threads, every place is written by one
//! piece, and sums go over pieces in order. So the bits are the same for any number of threads.
#![allow(unsafe_code)]

use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;

use super::team::Team;
use crate::scalar::lanes::Instructions;
use crate::settings::{MOST_THREADS, Threads};

/// Threads pay from this many tetrahedra on: below, waking them costs what they save.
const WORTH_THREADS: usize = 16_000;

/// Threads and instructions of one solver.
#[derive(Debug)]
pub struct Workers {
    crew: Option<Arc<Crew>>,
    pub instructions: Instructions,
}

#[derive(Debug)]
struct Crew {
    pool: Arc<rayon::ThreadPool>,
    team: Team,
}

impl Clone for Workers {
    /// The same threads, at the service of another solver.
    fn clone(&self) -> Self {
        let crew =
            |crew: &Arc<Crew>| Arc::new(Crew { pool: Arc::clone(&crew.pool), team: Team::new() });
        Self { crew: self.crew.as_ref().map(crew), instructions: self.instructions }
    }
}

/// See [`Workers::entrance`].
pub struct Entrance(Option<Arc<Crew>>);

impl Entrance {
    /// Goes over to the threads for the whole of `work`: crossing costs more than a stage.
    pub fn enter<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match &self.0 {
            Some(crew) => crew.team.lead(&crew.pool, crew.pool.current_num_threads() - 1, work),
            None => work(),
        }
    }
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
        let pool = if count > 1 { build() } else { None };
        let crew = pool.map(|pool| Arc::new(Crew { pool: Arc::new(pool), team: Team::new() }));
        Self { crew, instructions: Instructions::detect() }
    }

    /// The thread that is here, alone.
    pub fn one() -> Self {
        Self { crew: None, instructions: Instructions::detect() }
    }

    /// How many threads work.
    pub fn count(&self) -> usize {
        self.crew.as_ref().map_or(1, |crew| crew.pool.current_num_threads())
    }

    /// The way to the threads, apart from what they will work on.
    pub fn entrance(&self) -> Entrance {
        Entrance(self.crew.clone())
    }

    /// `work` on all of `0..count`, in pieces of at least `grain`. Only the thread that has entered may
    /// call it.
    pub fn each(&self, count: usize, grain: usize, work: impl Fn(Range<usize>) + Sync) {
        match &self.crew {
            Some(crew) => crew.team.run(count, grain, &work),
            None => work(0..count),
        }
    }

    /// `work` on each of `all` with its place, in pieces of at least `grain`.
    pub fn each_of<T: Send>(
        &self,
        all: &mut [T],
        grain: usize,
        work: impl Fn(usize, &mut T) + Sync,
    ) {
        let shared = Shared::new(all);
        self.each(shared.len(), grain, |range| {
            // SAFETY: pieces do not overlap.
            let piece = unsafe { shared.range(range.clone()) };
            range.zip(piece).for_each(|(place, one)| work(place, one));
        });
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

/// A slice of which several threads write different places.
#[derive(Clone, Copy)]
pub struct Shared<'a, T> {
    start: *mut T,
    len: usize,
    slice: PhantomData<&'a mut [T]>,
}

// SAFETY: callers that go through the pointer promise that no two threads meet at one place.
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
    /// No other thread uses this place meanwhile.
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
    /// No other thread uses these places meanwhile.
    #[inline(always)]
    #[allow(clippy::mut_from_ref)]
    pub unsafe fn range(&self, range: Range<usize>) -> &mut [T] {
        assert!(range.start <= range.end && range.end <= self.len);
        // SAFETY: within the slice; alone there by the caller's promise.
        unsafe { std::slice::from_raw_parts_mut(self.start.add(range.start), range.len()) }
    }
}
