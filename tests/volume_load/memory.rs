//! Watches how much memory a piece of work takes at most, so that no reader reserves what a header merely claims.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

#[global_allocator]
static WATCHED: Watched = Watched;

/// The system's allocator, which counts what each thread holds.
struct Watched;

thread_local! {
    /// Bytes that this thread holds, and the most that it ever held.
    static HELD: Cell<[isize; 2]> = const { Cell::new([0; 2]) };
}

fn count(bytes: isize) {
    // A thread that ends has no counter any more.
    let _ = HELD.try_with(|held| {
        let [now, most] = held.get();
        held.set([now + bytes, most.max(now + bytes)]);
    });
}

// SAFETY: everything is passed on to the system's allocator; counting allocates nothing.
unsafe impl GlobalAlloc for Watched {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, old: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as isize - layout.size() as isize);
        unsafe { System.realloc(old, layout, size) }
    }

    unsafe fn dealloc(&self, old: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { System.dealloc(old, layout) }
    }
}

/// What a piece of work gives back, and the most bytes that it held at one time beside what there was before. All of it runs
/// on this thread, also what it would share with others.
pub fn peak<T: Send>(work: impl FnOnce() -> T + Send) -> (T, usize) {
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
    let run = || {
        let before = HELD.with(|held| {
            let [now, _] = held.get();
            held.set([now; 2]);
            now
        });
        let done = work();
        (done, (HELD.with(Cell::get)[1] - before) as usize)
    };
    // A thread belongs to one pool for good: the second time it is in its own already.
    match alone {
        Ok(alone) => alone.install(run),
        Err(_) => run(),
    }
}

#[test]
fn memory_is_counted_at_its_peak() {
    let (length, most) = peak(|| {
        let gone = vec![1_u8; 3 << 20];
        drop(gone);
        let grown: Vec<u8> = (0..(1 << 20)).map(|byte| byte as u8).collect();
        grown.len()
    });
    assert_eq!(length, 1 << 20);
    assert!((3 << 20..4 << 20).contains(&most), "{most}");
    let (_, shared) = peak(|| {
        use rayon::prelude::*;
        (0..8).into_par_iter().map(|_| vec![0_u8; 1 << 20]).collect::<Vec<_>>().len()
    });
    assert!(shared >= 8 << 20, "{shared}");
}
