//! An allocator that counts, for tests of what asks for memory and how much is kept.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

thread_local! {
    /// Requests of this thread to the allocator; tests run side by side, each on its own thread.
    static REQUESTS: Cell<usize> = const { Cell::new(0) };
    /// Bytes taken by this thread less those it gave back.
    static BYTES: Cell<isize> = const { Cell::new(0) };
    /// The most of those at a time, since it was last set back.
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

/// Requests of all threads.
static ALL_REQUESTS: AtomicUsize = AtomicUsize::new(0);

/// The system's allocator, counting; make it the global one.
pub struct Counting;

fn count(taken: usize, given_back: usize) {
    ALL_REQUESTS.fetch_add(1, Ordering::Relaxed);
    // While a thread ends its counters may be gone already; nothing is measured then.
    let _ = REQUESTS.try_with(|requests| requests.set(requests.get() + 1));
    let change = taken as isize - given_back as isize;
    let _ = BYTES.try_with(|bytes| {
        bytes.set(bytes.get() + change);
        let _ = PEAK.try_with(|peak| peak.set(peak.get().max(bytes.get())));
    });
}

// SAFETY: every call goes to the system's allocator unchanged; the counters are constant-initialised
// and without destructor, so that counting itself never allocates.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 0);
        // SAFETY: the caller keeps the contract, which is the system allocator's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(0, layout.size());
        // SAFETY: `pointer` came from the system allocator with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size, layout.size());
        // SAFETY: `pointer` came from the system allocator with this layout.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

/// How often `action` asks the allocator for anything, on this thread.
pub fn requests_of(action: impl FnOnce()) -> usize {
    let before = REQUESTS.with(Cell::get);
    action();
    REQUESTS.with(Cell::get) - before
}

/// How often all threads together ask the allocator for anything meanwhile.
pub fn requests_of_all_threads(action: impl FnOnce()) -> usize {
    let before = ALL_REQUESTS.load(Ordering::SeqCst);
    action();
    ALL_REQUESTS.load(Ordering::SeqCst) - before
}

/// What `action` makes, and the bytes that this thread has taken for it and not given back.
pub fn bytes_of<T>(action: impl FnOnce() -> T) -> (T, usize) {
    let before = BYTES.with(Cell::get);
    let made = action();
    let kept = BYTES.with(Cell::get) - before;
    (made, usize::try_from(kept).expect("more was given back than taken"))
}

/// What `action` makes, and the most bytes that this thread holds for it at a time.
pub fn peak_of<T>(action: impl FnOnce() -> T) -> (T, usize) {
    let before = BYTES.with(Cell::get);
    PEAK.with(|peak| peak.set(before));
    let made = action();
    (made, (PEAK.with(Cell::get) - before) as usize)
}
