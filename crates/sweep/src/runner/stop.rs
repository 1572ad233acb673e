//! Signals: the first requests a stop after a checkpoint, the second aborts. While no case is
//! running the first aborts too. Signals within a second of the first are duplicates: programs such
//! as `timeout` send their signal to the process and to its group.

use super::RunnerError;
use crate::system::exit;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};
use signal_hook::iterator::Signals;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Signals within this time after the first are duplicates.
const ECHO: Duration = Duration::from_secs(1);

/// A stop request, with its signal.
#[derive(Debug, Clone, Default)]
pub struct Stop(Arc<StopRequest>);

/// State shared by the signal thread and the others.
#[derive(Debug, Default)]
struct StopRequest {
    /// The first signal, 0 before.
    signal: AtomicI32,
    /// Whether there is anything to checkpoint.
    is_running: AtomicBool,
    /// Whether signals other than INT never end the process.
    patient: bool,
    /// Whether the process belongs to another program and is never ended here.
    hosted: bool,
    /// Deadline of the run.
    deadline: OnceLock<Instant>,
}

/// Why a run stops.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// A signal.
    Signal(i32),
    /// The time limit.
    TimeLimit,
}

impl Reason {
    /// The corresponding exit code.
    pub const fn exit_code(self) -> u8 {
        match self {
            Self::Signal(signal) => exit::stopped_by(signal),
            Self::TimeLimit => exit::TIME_LIMIT,
        }
    }
}

impl Stop {
    /// Listens to INT, TERM, HUP and USR1 from now on.
    ///
    /// # Errors
    /// [`RunnerError::Start`] if the system refuses.
    pub fn on_signals() -> Result<Self, RunnerError> {
        Self::listen(StopRequest::default())
    }

    /// Listens in a task of a scheduler, which may send several signals at the end and then KILL:
    /// only INT ends the process before it has published its results.
    ///
    /// # Errors
    /// As [`Stop::on_signals`].
    pub fn for_a_task() -> Result<Self, RunnerError> {
        Self::listen(StopRequest {
            patient: true,
            ..StopRequest::default()
        })
    }

    /// For a program that handles signals itself and requests stops; this never ends it.
    pub fn by_hand() -> Self {
        Self(Arc::new(StopRequest {
            hosted: true,
            ..StopRequest::default()
        }))
    }

    /// Requests a stop, like this signal.
    pub fn ask(&self, signal: i32) {
        let _ = (self.0.signal).compare_exchange(0, signal, Ordering::SeqCst, Ordering::SeqCst);
    }

    /// Whether a step that takes too long after a signal may be abandoned, which ends the process.
    pub(super) fn may_abandon(&self) -> bool {
        !self.0.hosted
    }

    /// Listens from now on.
    fn listen(asked: StopRequest) -> Result<Self, RunnerError> {
        let refused = |error: std::io::Error| RunnerError::Start {
            what: "signal handlers",
            reason: error.to_string(),
        };
        let stop = Self(Arc::new(asked));
        let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP, SIGUSR1]).map_err(refused)?;
        let handle = stop.clone();
        std::thread::Builder::new()
            .name("signals".into())
            .spawn(move || {
                let mut first_at: Option<Instant> = None;
                for signal in signals.forever() {
                    let is_echo = first_at.is_some_and(|at| at.elapsed() < ECHO);
                    first_at.get_or_insert_with(Instant::now);
                    let first = handle.0.signal.compare_exchange(
                        0,
                        signal,
                        Ordering::SeqCst,
                        Ordering::SeqCst,
                    );
                    let abort =
                        (first.is_err() && !is_echo) || !handle.0.is_running.load(Ordering::SeqCst);
                    if abort && (!handle.0.patient || signal == SIGINT) {
                        Self::exit(Reason::Signal(signal));
                    }
                    crate::store::shorten_lock_wait();
                }
            })
            .map_err(refused)?;
        Ok(stop)
    }

    /// The signal that requested a stop.
    pub fn signal(&self) -> Option<i32> {
        Some(self.0.signal.load(Ordering::SeqCst)).filter(|signal| *signal != 0)
    }

    /// The reason to stop, if any.
    pub fn reason(&self) -> Option<Reason> {
        let is_late = || {
            self.0
                .deadline
                .get()
                .is_some_and(|end| Instant::now() >= *end)
        };
        match self.signal() {
            Some(signal) => Some(Reason::Signal(signal)),
            None => is_late().then_some(Reason::TimeLimit),
        }
    }

    /// Requests a stop after this time; only the first call counts.
    pub fn after(&self, time: Duration) {
        if let Some(end) = Instant::now().checked_add(time) {
            let _ = self.0.deadline.set(end);
        }
    }

    /// Sets whether there are cases to checkpoint.
    pub(super) fn set_running(&self, is_running: bool) {
        self.0.is_running.store(is_running, Ordering::SeqCst);
    }

    /// Ends the program immediately. This is safe for the store, since uncommitted changes are
    /// discarded.
    pub(super) fn exit(reason: Reason) -> ! {
        std::process::exit(reason.exit_code().into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_manual_stop_reports_its_first_signal_and_ends_no_process() {
        let stop = Stop::by_hand();
        assert_eq!(stop.signal(), None);
        stop.ask(SIGINT);
        stop.ask(SIGTERM);
        assert_eq!(stop.signal(), Some(SIGINT));
        assert!(!stop.may_abandon());
        assert!(Stop::default().may_abandon());
    }
}
