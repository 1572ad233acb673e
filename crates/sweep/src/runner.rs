//! Computes the cases of a store: a bounded pool, one case per thread, until nothing is left or a signal says stop.

mod compute;
mod error;
mod panics;
mod progress;
mod stop;

pub use error::RunnerError;
pub use progress::{CampaignProgress, Progress, Style};
pub use stop::{Reason, Stop};

use crate::campaign::{Campaign, Protocol};
use crate::store::{Claim, Store, StoreError};
use crate::system::lock;
use crate::tables;
use sd_core::NearFields;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// Time from one look at signals and bars to the next.
const TICK: Duration = Duration::from_millis(100);
/// Time from one look at other processes to the next.
const LOOK: Duration = Duration::from_secs(2);
/// Time from one heartbeat to the next.
const HEARTBEAT: Duration = Duration::from_secs(10);
/// Short cases are claimed together for this time, and their results kept together after it at the latest.
const MAX_RESULT_DELAY: Duration = Duration::from_secs(1);
/// A look at all cases takes at most this share of the time.
const SCAN_SHARE: u32 = 50;
/// How long all threads wait for other processes before the user is told for whom, and then between one time and the next.
const WAIT_BEFORE_NOTE: Duration = Duration::from_secs(5);
/// The same once it was told.
const WAIT_BETWEEN_NOTES: Duration = Duration::from_mins(5);
/// How long a step in progress may go on after a signal before it is abandoned for its last checkpoint.
const GRACE: Duration = Duration::from_secs(10);

/// What goes along with a run: publishes its store, for one.
pub trait RunObserver: Sync {
    /// Called every few seconds.
    fn look(&self, progress: &Progress);
    /// Called before the process is ended because a step takes too long after a signal.
    fn before_abort(&self, signal: i32, progress: &Progress);
}

/// How to run.
#[derive(Clone, Copy)]
pub struct Options<'o> {
    /// Cases computed at a time, one thread each.
    pub workers: usize,
    /// Threads, at least as many: those without a case help to fill and to factor the large matrices of the others.
    pub threads: usize,
    /// Computing time after which a single case ends as failed; without one, many times what it is expected to take.
    pub wall_limit: Option<Duration>,
    /// Keep a frame of the layer with every sample.
    pub trajectory: bool,
    /// What goes along with the run.
    pub observer: Option<&'o dyn RunObserver>,
    /// Says when to stop.
    pub stop: &'o Stop,
    /// What the user sees.
    pub progress: &'o Progress,
}

/// What the threads of a run share.
struct Shared<'r> {
    /// The store; whoever holds the lock is the one writer.
    store: Mutex<&'r mut Store>,
    /// How every run is made.
    protocol: &'r Protocol,
    options: Options<'r>,
    /// Near fields of unequal spheres.
    tables: &'r NearFields,
    /// The first trouble with the store: all stop.
    trouble: Mutex<Option<StoreError>>,
    working: AtomicUsize,
    /// Threads with a case; the others wait for cases of other processes.
    computing: AtomicUsize,
}

/// Computes what a store lacks of the campaign it has taken in: first the tables that its spheres need, then all its cases.
///
/// Returns when no case is left that can be had, or after a signal. Cases that fail are no error: they are in the store.
///
/// # Errors
/// Trouble with the store, threads the system would not give, sizes of spheres that no table can be made for.
pub fn compute_campaign(
    store: &mut Store,
    campaign: &Campaign,
    options: Options<'_>,
) -> Result<(), RunnerError> {
    let ratios = tables::ratios(campaign.cases.iter().map(|(_, case)| &case.params))?;
    let tables = tables::make(&ratios, |text| options.progress.note(text))?;
    run(store, &campaign.protocol, &tables, options)
}

/// Computes all cases that can be had; returns when none is left, or after a signal.
fn run(
    store: &mut Store,
    protocol: &Protocol,
    tables: &NearFields,
    options: Options<'_>,
) -> Result<(), RunnerError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .thread_name(|number| format!("worker {number}"))
        .build()
        .map_err(|error| RunnerError::Start {
            what: "threads",
            reason: error.to_string(),
        })?;
    panics::capture_in_workers();
    options.stop.set_under_way(true);
    let result = run_in(&pool, store, protocol, tables, options);
    options.stop.set_under_way(false);
    result
}

/// [`run`] in a pool.
fn run_in(
    pool: &rayon::ThreadPool,
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
    let shared = Shared {
        store: Mutex::new(store),
        protocol,
        options,
        tables,
        trouble: Mutex::new(None),
        working: AtomicUsize::new(options.workers),
        computing: AtomicUsize::new(0),
    };
    pool.in_place_scope(|scope| {
        for worker in 0..options.workers {
            let shared = &shared;
            scope.spawn(move |_| {
                shared.work(worker);
                shared.working.fetch_sub(1, Ordering::Release);
            });
        }
        shared.supervise(&waiting);
    });
    let is_well = lock(&shared.trouble).is_none();
    if is_well && let Err(error) = shared.look_around() {
        shared.stop_on_error(error);
    }
    progress.end();
    let trouble = lock(&shared.trouble).take();
    let left = shared.store().leave();
    match trouble.or(left.err()) {
        Some(trouble) => Err(trouble.into()),
        None => Ok(()),
    }
}

impl<'r> Shared<'r> {
    /// The store, for as long as the guard lives. A panic elsewhere leaves it whole: transactions roll back.
    fn store(&self) -> MutexGuard<'_, &'r mut Store> {
        lock(&self.store)
    }

    /// Keeps the first trouble, which ends the run.
    fn stop_on_error(&self, error: StoreError) {
        lock(&self.trouble).get_or_insert(error);
    }

    /// Whether the threads are to stop.
    fn stopping(&self) -> bool {
        self.options.stop.reason().is_some() || lock(&self.trouble).is_some()
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
                    // A statement of its own: the guard of a `match` would keep the store from all others while this thread sleeps.
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

    /// Computes claimed cases one after the other, keeps what comes of them together, and gives back what is left at a stop.
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

    /// Another process thought us dead and has the case now, whose result will be the same: that is no trouble.
    fn unless_lost(&self, error: StoreError) -> Result<(), StoreError> {
        match error {
            StoreError::ClaimLost { .. } => {
                self.options.progress.note(&error.to_string());
                Ok(())
            }
            error => Err(error),
        }
    }

    /// Watches over the threads from the one that started them.
    fn supervise(&self, waiting: &Mutex<Option<String>>) {
        let (mut looked, mut beaten) = (Instant::now(), Instant::now());
        let mut look = self.options.progress.every().unwrap_or(LOOK);
        let mut stopped: Option<Instant> = None;
        // When at least one thread computed last, and how long after that the user is told what is waited for.
        let (mut busy, mut patience) = (Instant::now(), WAIT_BEFORE_NOTE);
        while self.working.load(Ordering::Acquire) > 0 {
            std::thread::sleep(TICK);
            let told = lock(waiting).take();
            if let Some(text) = told {
                self.options.progress.note(&text);
            }
            // A worker may wait for the lock of the file and hold the store as long; what is due is done after that.
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
                    // A task with a observer publishes first, whatever else it is told.
                    self.options.progress.note(match reason {
                        Reason::TimeLimit => "the time is up: stopping at the next step",
                        Reason::Signal(_) if self.options.observer.is_some() => {
                            "stopping at the next step"
                        }
                        Reason::Signal(_) => {
                            "stopping at the next step; once more, after a second, aborts at once"
                        }
                    });
                    Instant::now()
                });
                if since.elapsed() > GRACE && self.options.stop.may_abandon() {
                    self.options
                        .progress
                        .note("a step takes too long: its case goes on from its last checkpoint");
                    // Given back here, so that what the abandoned threads may still write no longer counts.
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

    /// Says for which processes all threads wait.
    fn print_wait_reason(&self) -> Result<(), StoreError> {
        let processes = self.store().processes()?;
        for process in processes {
            self.options.progress.note(&format!(
                "waiting for {} runs of process {} on {}, last heard of {} ago; they go on here once it is gone",
                process.running,
                process.pid,
                process.host,
                crate::format::duration(process.silent_s)
            ));
        }
        Ok(())
    }

    /// Frees the cases of dead processes, and sees how far all are. The store must still hold what this process computes.
    fn look_around(&self) -> Result<(), StoreError> {
        let mut store = self.store();
        let freed = store.release_dead()?;
        if freed > 0 {
            self.options.progress.note(&format!(
                "{freed} cases of a process that is gone go on from their last checkpoints"
            ));
        }
        store.check_campaign()?;
        self.options.progress.see(&store.work()?);
        // While the store is held no other case can end: whoever reads of one before this finds it counted here.
        self.options.progress.print_progress();
        Ok(())
    }
}
