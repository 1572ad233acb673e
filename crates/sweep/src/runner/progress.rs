//! Progress display of a run: bars on a terminal, lines at intervals in a log, lines of JSON for
//! programs (names and meanings are in `docs/json.md`), or nothing.

use crate::model::case::{Case, State, step_cost, without_shear};
use crate::store::{Claim, Counts, Work};
use crate::system::lock;
use crate::text::choices::choices;
use crate::text::format::{count, duration, significant};
use crate::text::visible::visible;
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use sd_core::Params;
use serde_json::json;
use std::fmt;
use std::io::Write;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Number of divisions of the overall bar.
const PARTS: u64 = 1_000_000_000;
/// Interval between lines of JSON.
const JSON_EVERY: Duration = Duration::from_secs(1);
/// Maximum interval between lines in a log; the first lines come sooner, to show progress.
const LOG_EVERY: Duration = Duration::from_mins(1);
/// Time until the first line in a log.
const LOG_FIRST: Duration = Duration::from_secs(2);

choices! {
    /// Style of the progress display.
    Style {
        Bars = "bars", "Bars on a terminal";
        Lines = "lines", "Lines in a log";
        Json = "json", "Lines of JSON";
        Quiet = "none", "Nothing";
    }
}

impl Style {
    /// Prints a note on standard error, before or after a run. Standard error may be closed, which
    /// is no reason to stop.
    pub fn note(self, text: &str) {
        if self != Self::Quiet {
            let _ = writeln!(std::io::stderr(), "{}", self.line(text));
        }
    }

    /// The line of a note.
    fn line(self, text: &str) -> String {
        match self {
            Self::Json => json!({"event": "note", "text": text}).to_string(),
            _ => text.to_owned(),
        }
    }
}

/// Progress of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct CampaignProgress {
    /// Fraction of its work that is done, 0 to 1.
    pub fraction: f64,
    /// Its cases by state, as last read from the store.
    pub counts: Counts,
    /// Ended cases and the remaining time, as text.
    pub message: String,
}

/// Progress of all cases and of each worker.
pub struct Progress {
    style: Style,
    bars: MultiProgress,
    /// Of all cases: its position never decreases.
    overall: Bar,
    workers: Vec<Worker>,
    campaign: Mutex<CampaignWork>,
    reported: Mutex<Vec<ReportedFailure>>,
    log: Mutex<Box<dyn Write + Send>>,
    begun: Instant,
}

impl fmt::Debug for Progress {
    /// Its style alone: the rest changes all the time, under locks.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Progress")
            .field("style", &self.style)
            .finish_non_exhaustive()
    }
}

/// Progress of the campaign in units of estimated cost.
struct CampaignWork {
    total: f64,
    /// Work done according to the store, without the cases running here.
    stored: f64,
    /// Work of cases that ended here since the last update from the store.
    since: f64,
    counts: Counts,
    /// Remaining seconds according to the store, which knows them once a run has ended.
    left: Option<f64>,
    /// Time from the start to the next line in the log.
    due: Duration,
}

/// A failure that was reported.
struct ReportedFailure {
    /// Parameters of the case, without its shear rate.
    params: Params,
    message: String,
    label: String,
    /// How many more failed in the same way.
    more: u64,
}

/// Progress of one worker. Its thread writes numbers only; the supervising thread draws.
struct Worker {
    bar: Bar,
    /// Its case, with the key.
    case: Mutex<Option<(String, Case)>>,
    /// Steps of its case done.
    steps: AtomicU64,
    viscosity: AtomicU64,
}

/// A bar that knows where it began. Its time left follows from the mean speed since then.
struct Bar {
    drawn: ProgressBar,
    from: AtomicU64,
}

impl Bar {
    /// Work done before now is not of this run.
    fn begin(&self) {
        self.from.store(self.drawn.position(), Ordering::Relaxed);
        self.drawn.reset_elapsed();
    }

    /// Remaining time, where it is known.
    fn left(&self) -> Option<Duration> {
        let (from, at) = (self.from.load(Ordering::Relaxed), self.drawn.position());
        let done = at.saturating_sub(from);
        let left = self.drawn.length()?.saturating_sub(at);
        let is_known = done > 0 && left > 0;
        is_known.then(|| self.drawn.elapsed().mul_f64(left as f64 / done as f64))
    }
}

impl Progress {
    /// A display for a number of workers; lines go to `log`.
    pub fn new(style: Style, workers: usize, log: Box<dyn Write + Send>) -> Self {
        let target = if style == Style::Bars {
            ProgressDrawTarget::stderr_with_hz(8)
        } else {
            ProgressDrawTarget::hidden()
        };
        let bars = MultiProgress::with_draw_target(target);
        let look = ProgressStyle::with_template("{bar:20} {percent:>3} %  {wide_msg}")
            .unwrap_or_else(|_| ProgressStyle::default_bar())
            .progress_chars("━╸ ");
        let bar = |length| Bar {
            drawn: bars.add(ProgressBar::new(length).with_style(look.clone())),
            from: AtomicU64::new(0),
        };
        let overall = bar(PARTS);
        let worker = |_| Worker {
            bar: bar(1),
            case: Mutex::new(None),
            steps: AtomicU64::new(0),
            viscosity: AtomicU64::new(0),
        };
        Self {
            style,
            workers: (0..workers).map(worker).collect(),
            overall,
            bars,
            campaign: Mutex::new(CampaignWork {
                total: 0.0,
                stored: 0.0,
                since: 0.0,
                counts: Counts::default(),
                left: None,
                due: LOG_FIRST,
            }),
            reported: Mutex::new(Vec::new()),
            log: Mutex::new(log),
            begun: Instant::now(),
        }
    }

    /// The run begins with so much work.
    pub(super) fn begin(&self, work: &Work) {
        self.see(work, None);
        self.advance();
        self.overall.begin();
        let left = work.counts.pending + work.counts.running;
        if self.style == Style::Lines && left > 0 {
            self.line(&format!(
                "{left} of {} cases to do, {} in parallel",
                work.counts.total(),
                self.workers.len()
            ));
        }
    }

    /// Updates the progress of all processes from the store, and the remaining seconds where it
    /// knows them. Both may increase where a precision is requested.
    pub(super) fn see(&self, work: &Work, left: Option<f64>) {
        let mut campaign = lock(&self.campaign);
        campaign.total = work.total;
        campaign.stored = work.done + work.given_up;
        campaign.since = 0.0;
        campaign.counts = work.counts;
        campaign.left = left;
    }

    /// A worker starts a case, at some step.
    pub(super) fn start_case(&self, worker: usize, claim: &Claim, steps: u64) {
        let Some(worker) = self.workers.get(worker) else {
            return;
        };
        worker.write(steps, f64::NAN);
        worker.bar.drawn.reset();
        worker.bar.drawn.set_length(claim.case.steps);
        worker.bar.drawn.set_position(steps);
        worker.bar.drawn.tick();
        worker.bar.begin();
        *lock(&worker.case) = Some((claim.key.clone(), claim.case.clone()));
    }

    /// A worker did a step.
    pub(super) fn step(&self, worker: usize, steps: u64, viscosity: f64) {
        if let Some(worker) = self.workers.get(worker) {
            worker.write(steps, viscosity);
        }
    }

    /// A worker ended its case.
    pub(super) fn end_case(&self, worker: usize, kept: bool) {
        if let Some(worker) = self.workers.get(worker) {
            let cost = worker.cost();
            *lock(&worker.case) = None;
            worker.bar.drawn.set_message("");
            worker.bar.drawn.set_position(0);
            if kept {
                lock(&self.campaign).since += cost;
            }
        }
    }

    /// Draws what changed.
    pub(super) fn draw(&self) {
        for worker in &self.workers {
            let Some((_, case)) = &*lock(&worker.case) else {
                worker.bar.drawn.tick();
                continue;
            };
            let (steps, viscosity) = worker.now();
            worker.bar.drawn.set_position(steps);
            if self.style == Style::Bars {
                let strain = steps as f64 * case.params.time_step;
                let viscosity = if viscosity.is_finite() {
                    format!("  η {}", significant(viscosity, 4))
                } else {
                    String::new()
                };
                let message = format!("strain {strain:.2}{viscosity}  {}", case.label());
                worker.bar.drawn.set_message(message);
            }
        }
        self.advance();
        let message = self.standing().message;
        if self.style == Style::Lines {
            let elapsed = self.begun.elapsed();
            let mut campaign = lock(&self.campaign);
            if elapsed >= campaign.due {
                campaign.due = elapsed + elapsed.min(LOG_EVERY);
                self.line(&message);
            }
        }
        self.overall.drawn.set_message(message);
    }

    /// Moves the overall bar to the work done, including running cases.
    fn advance(&self) {
        let here: f64 = self.workers.iter().map(Worker::cost).sum();
        let campaign = lock(&self.campaign);
        let done = (campaign.stored + campaign.since + here) / campaign.total;
        let part = if campaign.total > 0.0 { done } else { 1.0 };
        let position = count((part.clamp(0.0, 1.0) * PARTS as f64).floor()) as u64;
        let bar = &self.overall.drawn;
        bar.set_position(position.max(bar.position()));
    }

    /// Progress of the campaign, as last drawn.
    pub fn standing(&self) -> CampaignProgress {
        let (counts, left) = {
            let campaign = lock(&self.campaign);
            (campaign.counts, campaign.left)
        };
        let ended = counts.done + counts.jammed + counts.failed;
        let mut message = format!("{ended} of {} cases", counts.total());
        if counts.jammed > 0 {
            message = format!("{message}, {}", counts.words_of_jammed());
        }
        if counts.failed > 0 {
            message = format!("{message}, {} failed", counts.failed);
        }
        let is_open = counts.pending + counts.running > 0;
        let left = left.or_else(|| Some(self.overall.left()?.as_secs_f64()));
        if let Some(left) = left.filter(|_| is_open) {
            message = format!("{message}, {} left", duration(left));
        }
        CampaignProgress {
            fraction: self.overall.drawn.position() as f64 / PARTS as f64,
            counts,
            message,
        }
    }

    /// A case failed. Of similar failures at different shear rates only the first is reported.
    pub(super) fn failed(&self, case: &Case, message: &str) {
        let params = without_shear(&case.params);
        {
            let mut reported = lock(&self.reported);
            let mut all = reported.iter_mut();
            if let Some(known) = all.find(|t| t.params == params && t.message == message) {
                known.more += 1;
                return;
            }
            reported.push(ReportedFailure {
                params,
                message: message.to_owned(),
                label: case.label(),
                more: 0,
            });
        }
        self.note(&format!("failed: {}: {message}", case.label()));
    }

    /// A note to the user, above the bars or in the log.
    pub fn note(&self, text: &str) {
        let text = &*visible(text);
        match self.style {
            // Lost if the terminal is gone, like the bars.
            Style::Bars => drop(self.bars.println(text)),
            Style::Quiet => {}
            style => self.line(&style.line(text)),
        }
    }

    /// A case ended, with its state, steps and CPU seconds.
    pub(super) fn ended(&self, claim: &Claim, state: &str, steps: u64, cpu_time_s: f64) {
        if let Some(state) = State::of(state) {
            let is_arrest = state.is_arrest(&claim.case.params);
            lock(&self.campaign).counts.end(state, is_arrest);
        }
        if self.style == Style::Json {
            let case = &claim.case;
            let line = json!({
                "event": "ended", "key": claim.key, "case": case.label(), "seed": case.seed, "state": state,
                "strain": steps as f64 * case.params.time_step, "cpu_time_s": cpu_time_s,
            });
            self.line(&line.to_string());
        }
    }

    /// Interval of updates from the store, where they are reported.
    pub(super) fn every(&self) -> Option<Duration> {
        (self.style == Style::Json).then_some(JSON_EVERY)
    }

    /// Lines of JSON, if requested: one per running case, and one for the campaign as just read
    /// from the store.
    pub(super) fn print_progress(&self) {
        if self.style != Style::Json {
            return;
        }
        let seconds = |bar: &Bar| bar.left().map(|left| left.as_secs_f64());
        for worker in &self.workers {
            let (steps, viscosity) = worker.now();
            if let Some((key, case)) = &*lock(&worker.case) {
                // A viscosity that is not known yet is null.
                let line = json!({
                    "event": "case", "key": key, "case": case.label(), "seed": case.seed,
                    "strain": steps as f64 * case.params.time_step, "strain_end": case.strain(),
                    "viscosity": viscosity, "eta_s": seconds(&worker.bar),
                });
                self.line(&line.to_string());
            }
        }
        self.advance();
        let standing = self.standing();
        let line = json!({
            "event": "campaign", "cases": standing.counts, "work_done": standing.fraction,
            "eta_s": seconds(&self.overall),
        });
        self.line(&line.to_string());
    }

    /// Removes the bars and notes how many failures were not reported.
    pub(super) fn end(&self) {
        let reported = std::mem::take(&mut *lock(&self.reported));
        for reported in reported.iter().filter(|reported| reported.more > 0) {
            self.note(&format!(
                "{} more runs failed as did {}",
                reported.more, reported.label
            ));
        }
        for worker in &self.workers {
            worker.bar.drawn.finish_and_clear();
        }
        let message = self.standing().message;
        self.overall.drawn.finish_and_clear();
        if self.style == Style::Lines {
            self.line(&message);
        }
    }

    /// Writes a line; a log that cannot be written is no reason to stop computing.
    fn line(&self, text: &str) {
        let _ = writeln!(lock(&self.log), "{text}");
    }
}

impl Worker {
    fn write(&self, steps: u64, viscosity: f64) {
        self.steps.store(steps, Ordering::Relaxed);
        self.viscosity.store(viscosity.to_bits(), Ordering::Relaxed);
    }

    /// Steps of its case so far, and the viscosity at the last of them.
    fn now(&self) -> (u64, f64) {
        let viscosity = self.viscosity.load(Ordering::Relaxed);
        let steps = self.steps.load(Ordering::Relaxed);
        (steps, f64::from_bits(viscosity))
    }

    /// Estimated cost of the steps of its case so far.
    fn cost(&self) -> f64 {
        let case = lock(&self.case);
        let each = case.as_ref().map(|(_, case)| step_cost(&case.params));
        each.unwrap_or(0.0) * self.steps.load(Ordering::Relaxed) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_that_end_between_looks_into_the_store_are_counted() {
        let mut counts = Counts {
            running: 1,
            pending: 2,
            ..Counts::default()
        };
        for state in [State::Done, State::Failed, State::Jammed, State::Done] {
            counts.end(state, false);
        }
        assert_eq!((counts.done, counts.failed, counts.jammed), (1, 1, 1));
        assert_eq!(counts.total(), 3);
    }

    #[test]
    fn the_remaining_time_is_that_of_the_store_or_of_the_work_done_here() {
        let progress = Progress::new(Style::Quiet, 1, Box::new(std::io::sink()));
        let work = |done| {
            let mut work = Work::default();
            (work.counts.pending, work.total, work.done) = (1, 100.0, done);
            work
        };
        progress.begin(&work(50.0));
        assert_eq!(progress.standing().fraction, 0.5);
        assert_eq!(progress.standing().message, "0 of 1 cases");
        std::thread::sleep(Duration::from_millis(200));
        progress.see(&work(60.0), None);
        progress.draw();
        assert_eq!(progress.standing().fraction, 0.6);
        // Of the other 40 at 10 in 0.2 s or somewhat more.
        let left = progress.overall.left().unwrap().as_secs_f64();
        assert!((0.1..60.0).contains(&left), "{left}");
        progress.see(&work(10.0), Some(7200.0));
        progress.draw();
        assert_eq!(
            progress.standing().fraction,
            0.6,
            "the bar never moves back"
        );
        assert_eq!(progress.standing().message, "0 of 1 cases, 2 h 0 min left");
    }
}
