//! Signals: the first asks for a stop after a checkpoint, the second aborts at once. While no case is under way the first
//! does so too. What comes within a second of the first says the same once more: programs such as `timeout` send their signal
//! to the process and to its group.

use super::RunnerError;
use crate::exit;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};
use signal_hook::iterator::Signals;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// A signal this soon after the first is the same one again.
const ECHO: Duration = Duration::from_secs(1);

/// Whether a stop was asked for, and by which signal.
#[derive(Debug, Clone, Default)]
pub struct Stop(Arc<StopRequest>);

/// What the thread of the signals and the others share.
#[derive(Debug, Default)]
struct StopRequest {
    /// The first signal, 0 before.
    signal: AtomicI32,
    /// Whether there is anything to checkpoint.
    under_way: AtomicBool,
    /// Whether signals never end the process by themselves.
    patient: bool,
    /// Whether the process is another program's, and never ended here.
    hosted: bool,
    /// When the time given to the run is up.
    deadline: OnceLock<Instant>,
}

/// Why a run stops.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// A signal.
    Signal(i32),
    /// The time given to it is up.
    TimeLimit,
}

impl Reason {
    /// The exit code that says so.
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
    /// [`RunnerError::Start`] if the system does not let us.
    pub fn on_signals() -> Result<Self, RunnerError> {
        Self::listen(StopRequest::default())
    }

    /// The same for a task of a scheduler, which may send several signals at the end and KILL after them: none but INT ends
    /// the process before it has published what it has.
    ///
    /// # Errors
    /// As [`Stop::on_signals`].
    pub fn for_a_task() -> Result<Self, RunnerError> {
        Self::listen(StopRequest {
            patient: true,
            ..StopRequest::default()
        })
    }

    /// For a program that listens to signals itself and says when to stop; it is never ended by this.
    pub fn by_hand() -> Self {
        Self(Arc::new(StopRequest {
            hosted: true,
            ..StopRequest::default()
        }))
    }

    /// Asks for a stop, as this signal would.
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
        let told = stop.clone();
        std::thread::Builder::new()
            .name("signals".into())
            .spawn(move || {
                let mut first_at: Option<Instant> = None;
                for signal in signals.forever() {
                    let is_echo = first_at.is_some_and(|at| at.elapsed() < ECHO);
                    first_at.get_or_insert_with(Instant::now);
                    let first = told.0.signal.compare_exchange(
                        0,
                        signal,
                        Ordering::SeqCst,
                        Ordering::SeqCst,
                    );
                    let abort =
                        (first.is_err() && !is_echo) || !told.0.under_way.load(Ordering::SeqCst);
                    if abort && (!told.0.patient || signal == SIGINT) {
                        Self::exit(Reason::Signal(signal));
                    }
                    crate::store::shorten_lock_wait();
                }
            })
            .map_err(refused)?;
        Ok(stop)
    }

    /// The signal that asked for a stop.
    pub fn signal(&self) -> Option<i32> {
        Some(self.0.signal.load(Ordering::SeqCst)).filter(|signal| *signal != 0)
    }

    /// Why the run is to stop, if it is.
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

    /// Asks for a stop after this time from now; the first time given counts.
    pub fn after(&self, time: Duration) {
        if let Some(end) = Instant::now().checked_add(time) {
            let _ = self.0.deadline.set(end);
        }
    }

    /// From now on there are cases to checkpoint, or none any more.
    pub(super) fn set_under_way(&self, under_way: bool) {
        self.0.under_way.store(under_way, Ordering::SeqCst);
    }

    /// Ends the program here and now. The store stands for this: what is not committed never was.
    pub(super) fn exit(reason: Reason) -> ! {
        std::process::exit(reason.exit_code().into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_by_hand_says_its_first_signal_and_ends_no_process() {
        let stop = Stop::by_hand();
        assert_eq!(stop.signal(), None);
        stop.ask(SIGINT);
        stop.ask(SIGTERM);
        assert_eq!(stop.signal(), Some(SIGINT));
        assert!(!stop.may_abandon());
        assert!(Stop::default().may_abandon());
    }
}
