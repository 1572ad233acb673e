//! Wall time and CPU time of runs.

use rustix::time::{ClockId, clock_gettime};
use std::ops::Add;
use std::time::Instant;

/// Seconds spent on a run.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct ElapsedTime {
    /// Wall time.
    pub(crate) wall_s: f64,
    /// CPU time.
    pub(crate) cpu_s: f64,
}

impl Add for ElapsedTime {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            wall_s: self.wall_s + other.wall_s,
            cpu_s: self.cpu_s + other.cpu_s,
        }
    }
}

/// A clock that starts when created.
pub(crate) struct Clock {
    begun: Instant,
    processor: ClockId,
    processor_at_start_s: f64,
}

impl Clock {
    /// CPU time of this thread.
    pub(crate) fn of_thread() -> Self {
        Self::of(ClockId::ThreadCPUTime)
    }

    /// CPU time of all threads of this process.
    pub(crate) fn of_process() -> Self {
        Self::of(ClockId::ProcessCPUTime)
    }

    fn of(processor: ClockId) -> Self {
        Self {
            begun: Instant::now(),
            processor,
            processor_at_start_s: seconds(processor),
        }
    }

    /// Wall seconds.
    pub(crate) fn wall_s(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    /// CPU seconds.
    pub(crate) fn cpu_s(&self) -> f64 {
        seconds(self.processor) - self.processor_at_start_s
    }

    /// Both.
    pub(crate) fn spent(&self) -> ElapsedTime {
        ElapsedTime {
            wall_s: self.wall_s(),
            cpu_s: self.cpu_s(),
        }
    }
}

/// Reads a clock.
fn seconds(clock: ClockId) -> f64 {
    let time = clock_gettime(clock);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleep_takes_no_cpu_time_and_work_does() {
        let clock = Clock::of_thread();
        std::thread::sleep(std::time::Duration::from_millis(50));
        let asleep = clock.spent();
        assert!(asleep.wall_s >= 0.05 && asleep.cpu_s < 0.02, "{asleep:?}");
        let mut sum = 0.0_f64;
        while clock.cpu_s() < asleep.cpu_s + 0.02 {
            sum += (0..1000).map(f64::from).sum::<f64>();
        }
        assert!(sum > 0.0 && clock.cpu_s() > 0.02);
    }
}
