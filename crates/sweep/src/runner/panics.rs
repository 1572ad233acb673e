//! A panic in a run becomes the failure of that run, with its message, and prints nothing.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

thread_local! {
    /// `Some` while panics of this thread are captured: the message of the last one.
    static KEPT: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Suppresses the output of panics inside [`catch`]; all others are printed as usual.
pub(super) fn capture_in_workers() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let usual = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            let kept = KEPT.with_borrow_mut(|kept| {
                kept.as_mut()
                    .map(|message| *message = panic.to_string().replace('\n', " "))
                    .is_some()
            });
            if !kept {
                usual(panic);
            }
        }));
    });
}

/// Calls a function; returns the message if it panics.
pub(super) fn catch<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    KEPT.set(Some(String::new()));
    let result = catch_unwind(AssertUnwindSafe(work));
    let message = KEPT.take().unwrap_or_default();
    result.map_err(|_| message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_its_message() {
        capture_in_workers();
        let message = catch(|| panic!("two spheres in one place")).unwrap_err();
        assert!(message.contains("two spheres in one place"), "{message}");
        assert_eq!(catch(|| 3), Ok(3));
    }
}
