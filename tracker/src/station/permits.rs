//! Limit on the number of stations of this process that work at the same time.

use std::sync::{Arc, Condvar, Mutex, PoisonError};

/// A counting semaphore: a station holds a permit while it decodes and observes, not while it waits.
#[derive(Debug, Clone)]
pub struct Permits(Arc<(Mutex<usize>, Condvar)>);

/// A permit; it is returned when dropped.
#[derive(Debug)]
pub struct Permit(Permits);

impl Permits {
    /// A semaphore of `count` permits, at least one.
    pub fn new(count: usize) -> Self {
        Self(Arc::new((Mutex::new(count.max(1)), Condvar::new())))
    }

    /// Waits for a permit.
    pub fn acquire(&self) -> Permit {
        let (free, freed) = &*self.0;
        let free = free.lock().unwrap_or_else(PoisonError::into_inner);
        let mut free = freed.wait_while(free, |free| *free == 0).unwrap_or_else(PoisonError::into_inner);
        *free -= 1;
        Permit(self.clone())
    }
}

impl Drop for Permit {
    fn drop(&mut self) {
        let (free, freed) = &*self.0.0;
        *free.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        freed.notify_one();
    }
}
