//! Progress display of a run: bars on a terminal, lines at intervals in a log, or nothing.

mod bars;
mod event;
mod overall;

use crate::model::case::{Case, State, step_cost, without_shear};
use crate::store::{Claim, Counts, Work};
use crate::system::lock;
use crate::text::choices::choices;
use crate::text::visible::visible;
use bars::{bar_width, line, room, terminal_width};
use event::RunningCase;
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use overall::Overall;
use sd_core::Params;
use std::io::Write;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// Number of divisions of the overall bar.
const PARTS: u64 = 10_000;
/// Interval between lines of JSON.
const JSON_EVERY: Duration = Duration::from_secs(1);

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
        let line = match self {
            Self::Bars | Self::Lines => text.to_owned(),
            Self::Json => event::note(text),
            Self::Quiet => return,
        };
        let _ = writeln!(std::io::stderr(), "{line}");
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
    overall: ProgressBar,
    workers: Vec<Worker>,
    /// Progress of the campaign.
    campaign: Mutex<Overall>,
    reported: Mutex<Vec<ReportedFailure>>,
    log: Mutex<Box<dyn Write + Send>>,
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
    bar: ProgressBar,
    case: Mutex<Option<RunningCase>>,
    /// Steps of its case done.
    steps: AtomicU64,
    viscosity: AtomicU64,
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
        let styled = |template: &str| {
            ProgressStyle::with_template(template)
                .unwrap_or_else(|_| ProgressStyle::default_bar())
                .progress_chars("━╸ ")
        };
        let overall = bars.add(ProgressBar::new(PARTS));
        let bar = bar_width();
        let look = styled(&format!("{{bar:{bar}}} {{percent:>3}} %  {{msg}}"));
        overall.set_style(look.clone());
        let workers = (0..workers)
            .map(|_| {
                let bar = bars.add(ProgressBar::new(1));
                bar.set_style(look.clone());
                Worker {
                    bar,
                    case: Mutex::new(None),
                    steps: AtomicU64::new(0),
                    viscosity: AtomicU64::new(0),
                }
            })
            .collect();
        Self {
            style,
            bars,
            overall,
            workers,
            campaign: Mutex::new(Overall::new()),
            reported: Mutex::new(Vec::new()),
            log: Mutex::new(log),
        }
    }

    /// The run begins with so much work.
    pub(super) fn begin(&self, work: &Work) {
        let counts = work.counts;
        let done = work.done + work.given_up;
        lock(&self.campaign)
            .history
            .push_back((Instant::now(), done));
        self.see(work);
        let left = counts.pending + counts.running;
        if self.style == Style::Lines && left > 0 {
            self.line(&format!(
                "{left} of {} cases to do, {} in parallel",
                counts.total(),
                self.workers.len()
            ));
        }
    }

    /// Updates the progress of all processes from the store. The remaining work may increase where
    /// a precision is requested.
    pub(super) fn see(&self, work: &Work) {
        let mut campaign = lock(&self.campaign);
        campaign.total = work.total;
        campaign.stored = work.done + work.given_up;
        campaign.since = 0.0;
        campaign.counts = work.counts;
    }

    /// A worker starts a case, at some step.
    pub(super) fn start_case(&self, worker: usize, claim: &Claim, steps: u64) {
        let Some(worker) = self.workers.get(worker) else {
            return;
        };
        worker.steps.store(steps, Ordering::Relaxed);
        let unknown = f64::NAN.to_bits();
        worker.viscosity.store(unknown, Ordering::Relaxed);
        worker.bar.reset();
        worker.bar.set_length(claim.case.steps);
        *lock(&worker.case) = Some(RunningCase::of(claim, steps));
    }

    /// A worker did a step.
    pub(super) fn step(&self, worker: usize, steps: u64, viscosity: f64) {
        if let Some(worker) = self.workers.get(worker) {
            worker.steps.store(steps, Ordering::Relaxed);
            worker
                .viscosity
                .store(viscosity.to_bits(), Ordering::Relaxed);
        }
    }

    /// A worker ended its case.
    pub(super) fn end_case(&self, worker: usize, kept: bool) {
        if let Some(worker) = self.workers.get(worker) {
            let cost = worker.cost();
            *lock(&worker.case) = None;
            worker.steps.store(0, Ordering::Relaxed);
            worker.bar.set_message("");
            worker.bar.set_position(0);
            if kept {
                lock(&self.campaign).since += cost;
            }
        }
    }

    /// Draws what changed.
    pub(super) fn draw(&self) {
        let room = room();
        for worker in &self.workers {
            let (steps, viscosity) = worker.now();
            worker.bar.set_position(steps);
            if self.style == Style::Bars
                && let Some(case) = lock(&worker.case).as_ref()
            {
                let strain = steps as f64 * case.case.params.time_step;
                worker
                    .bar
                    .set_message(line(&case.case, strain, viscosity, room));
            }
        }
        let message = {
            let campaign = self.advanced();
            let part = crate::text::format::count((campaign.fraction() * PARTS as f64).floor());
            self.overall.set_position(part as u64);
            campaign.message()
        };
        self.overall.set_message(message.clone());
        if self.style == Style::Lines && lock(&self.campaign).is_due() {
            self.line(&message);
        }
    }

    /// Progress of the campaign, as last drawn.
    pub fn standing(&self) -> CampaignProgress {
        let campaign = lock(&self.campaign);
        CampaignProgress {
            fraction: campaign.fraction(),
            counts: campaign.counts,
            message: campaign.message(),
        }
    }

    /// A case failed. Of similar failures at different shear rates only the first is reported.
    pub(super) fn failed(&self, case: &Case, message: &str) {
        let alike = without_shear(&case.params);
        {
            let mut reported = lock(&self.reported);
            let mut all = reported.iter_mut();
            if let Some(known) = all.find(|t| t.params == alike && t.message == message) {
                known.more += 1;
                return;
            }
            reported.push(ReportedFailure {
                params: alike,
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
            Style::Bars => {
                let text = crate::text::format::wrapped(text, terminal_width());
                // Lost if the terminal is gone, like the bars.
                let _ = self.bars.println(text.trim_end());
            }
            Style::Lines => self.line(text),
            Style::Json => self.line(&event::note(text)),
            Style::Quiet => {}
        }
    }

    /// A case ended, with its state, steps and CPU seconds.
    pub(super) fn ended(&self, claim: &Claim, state: &str, steps: u64, cpu_time_s: f64) {
        if let Some(state) = State::of(state) {
            lock(&self.campaign).counts.end(state);
        }
        if self.style == Style::Json {
            self.line(&event::ended(claim, state, steps, cpu_time_s));
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
        for worker in &self.workers {
            let (steps, viscosity) = worker.now();
            if let Some(case) = lock(&worker.case).as_ref() {
                self.line(&case.line(steps, viscosity));
            }
        }
        let line = {
            let campaign = self.advanced();
            let left = campaign.left().map(|left| left.as_secs_f64());
            event::campaign(&campaign.counts, campaign.fraction(), left)
        };
        self.line(&line);
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
            worker.bar.finish_and_clear();
        }
        self.overall.finish_and_clear();
        if self.style == Style::Lines {
            let message = lock(&self.campaign).message();
            self.line(&message);
        }
    }

    /// Writes a line; a log that cannot be written is no reason to stop computing.
    fn line(&self, text: &str) {
        let _ = writeln!(lock(&self.log), "{text}");
    }

    /// Progress of the campaign, including running cases.
    fn advanced(&self) -> MutexGuard<'_, Overall> {
        let here: f64 = self.workers.iter().map(Worker::cost).sum();
        let mut campaign = lock(&self.campaign);
        let done = campaign.stored + campaign.since + here;
        campaign.advance(done);
        campaign
    }
}

impl Worker {
    /// Steps of its case so far, and the viscosity at the last of them.
    fn now(&self) -> (u64, f64) {
        let viscosity = self.viscosity.load(Ordering::Relaxed);
        let steps = self.steps.load(Ordering::Relaxed);
        (steps, f64::from_bits(viscosity))
    }

    /// Estimated cost of the steps of its case so far.
    fn cost(&self) -> f64 {
        let case = lock(&self.case);
        let each = case.as_ref().map(|case| step_cost(&case.case.params));
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
            counts.end(state);
        }
        assert_eq!((counts.done, counts.failed, counts.jammed), (1, 1, 1));
        assert_eq!(counts.total(), 3);
    }
}
