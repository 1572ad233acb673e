//! Work shared with an idle thread.

/// Does both pieces of work, at once if they may be shared and a thread of this pool is idle.
pub(crate) fn join(share: bool, a: impl FnOnce() + Send, b: impl FnOnce() + Send) {
    if share && rayon::current_thread_index().is_some() {
        rayon::join(a, b);
    } else {
        a();
        b();
    }
}
