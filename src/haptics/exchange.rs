//! Passing the newest of something from one thread to another without either ever waiting.
//!
//! Three slots: one that is written, one that is read, and one in the middle. Publishing exchanges the written slot with the
//! middle, taking exchanges the middle with the read one, each by one atomic swap. So a slot has one owner at any time, and the
//! lock that the language wants around it is never contended. Nothing is freed by the reader: what it is done with goes back through
//! the middle, and [`Publisher::publish`] returns it to the side that made it.

use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};

/// Set where the middle slot was published and not taken yet.
const FRESH: u8 = 4;
const SLOT: u8 = 3;

struct Slots<T> {
    slots: [Mutex<T>; 3],
    /// Index of the middle slot, and [`FRESH`].
    middle: AtomicU8,
}

impl<T> Slots<T> {
    /// The slot of its owner. A panic of an owner leaves a whole value behind: it is only ever exchanged as a whole.
    fn own(&self, index: u8) -> Option<MutexGuard<'_, T>> {
        match self.slots[usize::from(index)].try_lock() {
            Ok(guard) => Some(guard),
            Err(TryLockError::Poisoned(guard)) => Some(guard.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        }
    }
}

/// The side that writes.
pub struct Publisher<T> {
    shared: Arc<Slots<T>>,
    back: u8,
}

/// The side that reads.
pub struct Subscriber<T> {
    shared: Arc<Slots<T>>,
    front: u8,
}

/// Both sides of an exchange; until something is published the reader sees the default.
pub fn exchange<T: Default>() -> (Publisher<T>, Subscriber<T>) {
    let slots = std::array::from_fn(|_| Mutex::new(T::default()));
    let shared = Arc::new(Slots { slots, middle: AtomicU8::new(1) });
    (Publisher { shared: shared.clone(), back: 0 }, Subscriber { shared, front: 2 })
}

impl<T> Publisher<T> {
    /// Hands a value over, and returns one that nobody looks at any more: to be freed, or filled again.
    pub fn publish(&mut self, value: T) -> T {
        let old = match self.shared.own(self.back) {
            Some(mut slot) => std::mem::replace(&mut *slot, value),
            None => return value,
        };
        self.back = self.shared.middle.swap(self.back | FRESH, Ordering::AcqRel) & SLOT;
        old
    }
}

impl<T> Subscriber<T> {
    /// Takes the newest value, if one was published since; says whether it did.
    pub fn take_newest(&mut self) -> bool {
        if self.shared.middle.load(Ordering::Relaxed) & FRESH == 0 {
            return false;
        }
        self.front = self.shared.middle.swap(self.front, Ordering::AcqRel) & SLOT;
        true
    }

    /// What was taken last.
    pub fn read<R>(&self, look: impl FnOnce(&T) -> R) -> Option<R> {
        self.shared.own(self.front).map(|slot| look(&slot))
    }
}
