//! Applies a function to many items on several threads, with results in the order of the items.

use crate::ensemble::processors;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Number of threads, and an optional cancel flag.
#[derive(Debug, Clone, Copy)]
pub struct Workers<'c> {
    threads: usize,
    cancel: Option<&'c AtomicBool>,
}

/// The caller cancelled the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cancelled;

impl<'c> Workers<'c> {
    /// This many threads, without a cancel flag.
    pub fn new(threads: usize) -> Self {
        Workers { threads, cancel: None }
    }

    /// One thread per processor.
    pub fn all() -> Self {
        Workers::new(processors())
    }

    /// The same threads with a cancel flag, which stops them before the next item.
    pub fn stopped_by(self, cancel: &'c AtomicBool) -> Self {
        Workers { cancel: Some(cancel), ..self }
    }

    /// Number of threads.
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// The cancel flag.
    pub(crate) fn cancel(&self) -> Option<&'c AtomicBool> {
        self.cancel
    }

    /// Whether the cancel flag is set.
    pub fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed))
    }
}

/// Applies a function to every item. Threads take items in any order. The results do not depend on it if the function
/// depends on its item only.
///
/// # Errors
/// [`Cancelled`].
pub fn map<T: Sync, R: Send>(
    items: &[T],
    workers: Workers,
    function: impl Fn(&T) -> R + Sync,
) -> Result<Vec<R>, Cancelled> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(items.len()));
    let work = || {
        while !workers.is_cancelled() {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(index) else {
                return;
            };
            let result = function(item);
            let mut done = done.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            done.push((index, result));
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..workers.threads.clamp(1, items.len().max(1)) {
            scope.spawn(work);
        }
        work();
    });
    let mut results = done.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    if results.len() < items.len() {
        return Err(Cancelled);
    }
    results.sort_by_key(|(index, _)| *index);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_stand_in_the_order_of_the_items() {
        let items: Vec<u64> = (0..100).collect();
        let squares = map(&items, Workers::new(3), |item| item * item).unwrap();
        assert!(squares.iter().zip(&items).all(|(square, item)| *square == item * item));
        assert!(map(&[] as &[u8], Workers::new(2), |item| *item).unwrap().is_empty());
    }

    #[test]
    fn a_set_flag_stops_the_work() {
        let cancel = AtomicBool::new(true);
        let workers = Workers::new(2).stopped_by(&cancel);
        assert_eq!(map(&[1, 2, 3], workers, |item| item + 1), Err(Cancelled));
    }
}
