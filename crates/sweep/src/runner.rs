//! Computes the cases of a store with a bounded number of threads, each case by one or more of its
//! own, until none is left or a signal stops it.

mod campaign;
mod compute;
mod error;
mod panics;
mod progress;
mod stop;

pub use campaign::{StartOptions, StartedCampaign, begin, complete};
pub use error::RunnerError;
pub use progress::{CampaignProgress, Progress, Style};
pub use stop::{Reason, Stop};

use crate::model::campaign::Campaign;
use crate::model::protocol::Protocol;
use crate::near_field_cache;
use crate::store::{Claim, Store, StoreError};
use crate::system::lock;
use sd_core::{NearFields, Threads};
use std::fmt;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// Interval between checks of signals and updates of bars.
const TICK: Duration = Duration::from_millis(100);
/// Interval between checks of other processes.
const LOOK: Duration = Duration::from_secs(2);
/// Interval between heartbeats.
const HEARTBEAT: Duration = Duration::from_secs(10);
/// Estimated time of the short cases that are claimed together, and maximum delay before their
/// results are stored.
const MAX_RESULT_DELAY: Duration = Duration::from_secs(1);
/// Scans of all cases take at most 1 over this of the time.
const SCAN_SHARE: u32 = 50;
/// Time that all threads wait for other processes before the first note to the user.
const WAIT_BEFORE_NOTE: Duration = Duration::from_secs(5);
/// Interval between further notes.
const WAIT_BETWEEN_NOTES: Duration = Duration::from_mins(5);
/// Time that a step in progress may continue after a signal before it is abandoned for its last
/// checkpoint.
const GRACE: Duration = Duration::from_secs(10);

/// An observer of a run, which publishes its store for instance.
pub trait RunObserver: Sync {
    /// Called every few seconds.
    fn look(&self, progress: &Progress);
    /// Called before the process ends because a step takes too long after a signal.
    fn before_abort(&self, signal: i32, progress: &Progress);
}

/// Options of a run.
#[derive(Clone, Copy)]
pub struct Options<'o> {
    /// Cases computed in parallel.
    pub workers: usize,
    /// Number of threads of all of them together: each case has an equal share, at least one.
    pub threads: usize,
    /// Computing time after which a case ends as failed; by default a multiple of its estimate.
    pub wall_limit: Option<Duration>,
    /// The observer of the run.
    pub observer: Option<&'o dyn RunObserver>,
    /// The stop request.
    pub stop: &'o Stop,
    /// The progress display.
    pub progress: &'o Progress,
}

impl fmt::Debug for Options<'_> {
    /// The numbers and the display: observers need no text.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Options")
            .field("workers", &self.workers)
            .field("threads", &self.threads)
            .field("wall_limit", &self.wall_limit)
            .field("stop", &self.stop)
            .field("progress", &self.progress)
            .finish_non_exhaustive()
    }
}

/// State shared by the threads of a run.
struct Workers<'r> {
    /// The store; the holder of the lock is the only writer.
    store: Mutex<&'r mut Store>,
    /// The protocol of every run.
    protocol: &'r Protocol,
    options: Options<'r>,
    /// Near fields of unequal spheres.
    tables: &'r NearFields,
    /// The first error of the store, which stops all threads.
    store_error: Mutex<Option<StoreError>>,
    working: AtomicUsize,
    /// Number of threads with a case; the others wait for cases of other processes.
    computing: AtomicUsize,
}

/// Computes the open cases of a store: first the tables for its spheres, then all cases.
///
/// Returns when no case is available, or after a signal. Failed cases are no error: they are in the
/// store.
///
/// # Errors
/// An I/O or SQLite error, threads that cannot be started, sizes of spheres without a table.
pub fn compute_campaign(
    store: &mut Store,
    campaign: &Campaign,
    options: Options<'_>,
) -> Result<(), RunnerError> {
    let ratios = near_field_cache::ratios(campaign.cases.iter().map(|(_, case)| &case.params))?;
    let tables = near_field_cache::make(&ratios, |text| options.progress.note(text))?;
    run(store, &campaign.protocol, &tables, options)
}

/// Computes all available cases; returns when none is left, or after a signal.
fn run(
    store: &mut Store,
    protocol: &Protocol,
    tables: &NearFields,
    options: Options<'_>,
) -> Result<(), RunnerError> {
    let start = |_| Threads::new(options.threads / options.workers.max(1));
    let teams = (0..options.workers).map(start).collect::<Result<_, _>>();
    let teams: Vec<Threads> = teams.map_err(|error| RunnerError::Start {
        what: "threads",
        reason: error.to_string(),
    })?;
    panics::capture_in_workers();
    options.stop.set_running(true);
    let result = run_in(&teams, store, protocol, tables, options);
    options.stop.set_running(false);
    result
}

/// [`run`] with the threads of each worker.
fn run_in(
    teams: &[Threads],
    store: &mut Store,
    protocol: &Protocol,
    tables: &NearFields,
    options: Options<'_>,
) -> Result<(), RunnerError> {
    let progress = options.progress;
    store.register(options.workers)?;
    store.release_dead()?;
    progress.begin(&store.work()?);
    let waiting = store.waiting();
    let shared = Workers {
        store: Mutex::new(store),
        protocol,
        options,
        tables,
        store_error: Mutex::new(None),
        working: AtomicUsize::new(options.workers),
        computing: AtomicUsize::new(0),
    };
    std::thread::scope(|scope| {
        for (worker, team) in teams.iter().enumerate() {
            let shared = &shared;
            scope.spawn(move || {
                team.run(|| shared.work(worker));
                shared.working.fetch_sub(1, Ordering::Release);
            });
        }
        shared.supervise(&waiting);
    });
    let is_well = lock(&shared.store_error).is_none();
    if is_well && let Err(error) = shared.look_around() {
        shared.stop_on_error(error);
    }
    progress.end();
    let store_error = lock(&shared.store_error).take();
    let left = shared.store().leave();
    match store_error.or(left.err()) {
        Some(store_error) => Err(store_error.into()),
        None => Ok(()),
    }
}

impl<'r> Workers<'r> {
    /// Locks the store. A panic elsewhere leaves it intact: transactions roll back.
    fn store(&self) -> MutexGuard<'_, &'r mut Store> {
        lock(&self.store)
    }

    /// Records the first error, which ends the run.
    fn stop_on_error(&self, error: StoreError) {
        lock(&self.store_error).get_or_insert(error);
    }

    /// Whether the threads are to stop.
    fn stopping(&self) -> bool {
        self.options.stop.reason().is_some() || lock(&self.store_error).is_some()
    }

    /// One thread: batch after batch, most of one case.
    fn work(&self, worker: usize) {
        while !self.stopping() {
            let claims = self.store().claim(self.options.workers, MAX_RESULT_DELAY);
            let result = match claims {
                Ok(claims) if !claims.is_empty() => {
                    self.computing.fetch_add(1, Ordering::AcqRel);
                    let result = self.compute_batch(worker, &claims);
                    self.computing.fetch_sub(1, Ordering::AcqRel);
                    result
                }
                Ok(_) => {
                    // A separate statement: the guard of a `match` would lock the store while this
                    // thread sleeps.
                    let left = self.store().has_open_cases();
                    match left {
                        Ok(true) => {
                            std::thread::sleep(TICK * 2);
                            Ok(())
                        }
                        Ok(false) => return,
                        Err(error) => Err(error),
                    }
                }
                Err(error) => Err(error),
            };
            if let Err(error) = result {
                self.stop_on_error(error);
            }
        }
    }

    /// Computes claimed cases in order, stores their results together, and releases the remaining
    /// cases at a stop.
    fn compute_batch(&self, worker: usize, claims: &[Claim]) -> Result<(), StoreError> {
        let mut ended = Vec::new();
        let mut since = Instant::now();
        let mut computed = 0;
        for claim in claims {
            if self.stopping() {
                break;
            }
            computed += 1;
            match self.compute(worker, claim) {
                Ok(Some(finished)) => ended.push((claim, finished)),
                Ok(None) => {}
                Err(error) => self.unless_lost(error)?,
            }
            if since.elapsed() >= MAX_RESULT_DELAY {
                self.keep_ended(&std::mem::take(&mut ended))?;
                since = Instant::now();
            }
        }
        self.keep_ended(&ended)?;
        if computed < claims.len() {
            self.store().release(&claims[computed..])?;
        }
        Ok(())
    }

    /// Another process considered this one dead and now has the case. This is no error, as its
    /// result will be the same.
    fn unless_lost(&self, error: StoreError) -> Result<(), StoreError> {
        match error {
            StoreError::ClaimLost { .. } => {
                self.options.progress.note(&error.to_string());
                Ok(())
            }
            error => Err(error),
        }
    }

    /// Supervises the threads from the one that started them.
    fn supervise(&self, waiting: &Mutex<Option<String>>) {
        let (mut looked, mut beaten) = (Instant::now(), Instant::now());
        let mut look = self.options.progress.every().unwrap_or(LOOK);
        let mut stopped: Option<Instant> = None;
        // Last time at which some thread computed, and the delay until the next note about waiting.
        let (mut busy, mut patience) = (Instant::now(), WAIT_BEFORE_NOTE);
        while self.working.load(Ordering::Acquire) > 0 {
            std::thread::sleep(TICK);
            let note = lock(waiting).take();
            if let Some(text) = note {
                self.options.progress.note(&text);
            }
            // A worker may hold the store while it waits for the lock of the file; due tasks are
            // done after that.
            if beaten.elapsed() >= HEARTBEAT
                && let Ok(mut store) = self.store.try_lock()
            {
                beaten = Instant::now();
                if let Err(error) = store.heartbeat() {
                    self.stop_on_error(error);
                }
            }
            if looked.elapsed() >= look
                && let Ok(store) = self.store.try_lock()
            {
                looked = Instant::now();
                drop(store);
                if let Err(error) = self.look_around() {
                    self.stop_on_error(error);
                }
                look = look.max(looked.elapsed() * SCAN_SHARE);
                if let Some(observer) = self.options.observer {
                    observer.look(self.options.progress);
                }
            }
            if self.computing.load(Ordering::Acquire) > 0 {
                (busy, patience) = (Instant::now(), WAIT_BEFORE_NOTE);
            } else if busy.elapsed() >= patience {
                patience += WAIT_BETWEEN_NOTES;
                if let Err(error) = self.print_wait_reason() {
                    self.stop_on_error(error);
                }
            }
            self.options.progress.draw();
            if let Some(reason) = self.options.stop.reason() {
                let since = *stopped.get_or_insert_with(|| {
                    // A task with an observer publishes first, whatever the signal.
                    self.options.progress.note(match reason {
                        Reason::TimeLimit => "time limit reached: stopping after this step",
                        Reason::Signal(_) if self.options.observer.is_some() => {
                            "stopping at the next step"
                        }
                        Reason::Signal(_) => {
                            "stopping after this step; another signal, after a second, aborts"
                        }
                    });
                    Instant::now()
                });
                if since.elapsed() > GRACE && self.options.stop.may_abandon() {
                    self.options.progress.note(
                        "a step takes too long: its case will continue from its last checkpoint",
                    );
                    // Released here, so that later writes of the abandoned threads do not count.
                    if let Ok(mut store) = self.store.try_lock() {
                        let _ = store.leave();
                    }
                    if let (Some(observer), Reason::Signal(signal)) =
                        (self.options.observer, reason)
                    {
                        observer.before_abort(signal, self.options.progress);
                    }
                    Stop::exit(reason);
                }
            }
        }
    }

    /// Notes the processes that all threads wait for.
    fn print_wait_reason(&self) -> Result<(), StoreError> {
        let processes = self.store().processes()?;
        for process in processes {
            self.options.progress.note(&format!(
                "waiting for {} of process {} on {}, last heartbeat {} ago; they continue here if it dies",
                crate::text::format::counted(process.running, "run"),
                process.pid,
                process.host,
                crate::text::format::duration(process.silent_s)
            ));
        }
        Ok(())
    }

    /// Releases the cases of dead processes and updates the progress. The store must still hold the
    /// campaign of this process.
    fn look_around(&self) -> Result<(), StoreError> {
        let mut store = self.store();
        let freed = store.release_dead()?;
        if freed > 0 {
            self.options.progress.note(&format!(
                "{} of a dead process continue from their last checkpoints",
                crate::text::format::counted(freed, "case")
            ));
        }
        store.check_campaign()?;
        let work = store.work()?;
        self.options.progress.see(&work, store.time_left(&work)?);
        // While the store is locked no other case can end, so this count includes every case
        // reported before.
        self.options.progress.print_progress();
        Ok(())
    }
}
