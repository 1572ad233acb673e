//! Signals: the first asks for a stop after a checkpoint, the second aborts at once.

use crate::error::Error;
use crate::exit;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};
use signal_hook::iterator::Signals;
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

/// Whether a stop was asked for, and by which signal.
#[derive(Debug, Clone, Default)]
pub struct Stop(Arc<AtomicI32>);

impl Stop {
    /// Listens to INT, TERM, HUP and USR1 from now on.
    ///
    /// # Errors
    /// [`Error::Start`] if the system does not let us.
    pub fn on_signals() -> Result<Self, Error> {
        let refused = |error: std::io::Error| Error::Start {
            what: "signal handlers",
            reason: error.to_string(),
        };
        let stop = Self::default();
        let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP, SIGUSR1]).map_err(refused)?;
        let told = stop.clone();
        std::thread::Builder::new()
            .name("signals".into())
            .spawn(move || {
                for signal in signals.forever() {
                    if told.0.swap(signal, Ordering::Relaxed) != 0 {
                        Self::exit(signal);
                    }
                }
            })
            .map_err(refused)?;
        Ok(stop)
    }

    /// The signal that asked for a stop.
    pub fn signal(&self) -> Option<i32> {
        Some(self.0.load(Ordering::Relaxed)).filter(|signal| *signal != 0)
    }

    /// Ends the program here and now. The store stands for this: what is not committed never was.
    pub(super) fn exit(signal: i32) -> ! {
        std::process::exit(exit::stopped_by(signal).into())
    }
}
