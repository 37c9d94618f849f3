//! One thread for little work, all for much.

use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::OnceLock;

/// Cells below which one thread is sooner done than others have woken up. Unit tests hold different numbers of threads against
/// each other with small pools.
const FEW_CELLS: usize = if cfg!(test) { 1 } else { 48 << 10 };

/// Runs work on so many cells. What it does must come out the same on any number of threads.
pub(super) fn for_cells<R: Send>(cells: usize, work: impl FnOnce() -> R + Send) -> R {
    static ALONE: OnceLock<Option<ThreadPool>> = OnceLock::new();
    if cells < FEW_CELLS
        && let Some(alone) = ALONE.get_or_init(|| ThreadPoolBuilder::new().num_threads(1).build().ok())
    {
        return alone.install(work);
    }
    // Once into the threads' pool, and not at each of the many passes.
    rayon::scope(|_| work())
}
