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

/// Whose CPU time is measured.
#[derive(Clone, Copy)]
enum Processor {
    Thread,
    /// All threads of the pool that this thread belongs to.
    Pool,
    Process,
}

/// A clock that starts when created.
pub(crate) struct Clock {
    begun: Instant,
    processor: Processor,
    processor_at_start_s: f64,
}

impl Clock {
    /// CPU time of this thread.
    pub(crate) fn of_thread() -> Self {
        Self::of(Processor::Thread)
    }

    /// CPU time of all threads of the pool that this one belongs to.
    pub(crate) fn of_pool() -> Self {
        Self::of(Processor::Pool)
    }

    /// CPU time of all threads of this process.
    pub(crate) fn of_process() -> Self {
        Self::of(Processor::Process)
    }

    fn of(processor: Processor) -> Self {
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

/// CPU seconds so far.
fn seconds(processor: Processor) -> f64 {
    let read = |clock| {
        let time = clock_gettime(clock);
        time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
    };
    match processor {
        Processor::Thread => read(ClockId::ThreadCPUTime),
        Processor::Pool => rayon::broadcast(|_| read(ClockId::ThreadCPUTime))
            .iter()
            .sum(),
        Processor::Process => read(ClockId::ProcessCPUTime),
    }
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
