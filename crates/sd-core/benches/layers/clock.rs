//! CPU time of this thread, independent of other programs on the machine.

use rustix::time::{ClockId, clock_gettime};
use std::time::Duration;

/// CPU time of this thread since its start.
#[derive(Clone, Copy)]
pub(crate) struct Moment(Duration);

impl Moment {
    pub(crate) fn now() -> Self {
        let time = clock_gettime(ClockId::ThreadCPUTime);
        let seconds = u64::try_from(time.tv_sec).unwrap_or(0);
        let nanoseconds = u64::try_from(time.tv_nsec).unwrap_or(0);
        Self(Duration::from_secs(seconds) + Duration::from_nanos(nanoseconds))
    }

    /// CPU time since then, in seconds.
    pub(crate) fn seconds(self) -> f64 {
        Self::now().0.saturating_sub(self.0).as_secs_f64()
    }
}
