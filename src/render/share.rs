//! Work shared out to all threads piece by piece: none waits while there are pieces that no other
//! has begun.

use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Lets every thread of the pool take items in their order, one by one, together with what it has
/// `begun` for itself; what all of them have made of that. Jobs of a divided range would be taken
/// as a whole, and the last of them be waited for.
pub(super) fn share<T: Send, L: Send>(
    items: impl Iterator<Item = T> + Send,
    begun: impl Fn() -> L + Sync,
    work: impl Fn(&mut L, T) + Sync,
) -> Vec<L> {
    let queue = Mutex::new(items);
    // a poisoned lock means that another thread is already unwinding
    let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
    let of_thread = |_| {
        let mut local = begun();
        while let Some(item) = next() {
            work(&mut local, item);
        }
        local
    };
    let threads = (0..rayon::current_num_threads()).into_par_iter();
    threads.with_max_len(1).map(of_thread).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_taken_once() {
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let taken = pool
                .expect("threads")
                .install(|| share(0..1000, Vec::new, Vec::push));
            assert_eq!(taken.len(), threads);
            let mut all = taken.concat();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..1000));
        }
    }
}
