//! Work shared with an idle thread.

/// Executes both closures, in parallel if allowed and a thread of this pool is idle.
pub(crate) fn join(share: bool, a: impl FnOnce() + Send, b: impl FnOnce() + Send) {
    if share && rayon::current_thread_index().is_some() {
        rayon::join(a, b);
    } else {
        a();
        b();
    }
}

#[cfg(test)]
pub(crate) mod tests {
    /// Asserts that shared work has the same result for any number of threads.
    #[track_caller]
    pub(crate) fn assert_same_with_any_threads<R: PartialEq + Send>(work: impl Fn() -> R + Sync) {
        let alone = work();
        for threads in [1, 2, 3] {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            assert!(pool.install(&work) == alone, "{threads} threads");
        }
    }
}
