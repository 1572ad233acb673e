//! Progress of a campaign and estimate of the remaining time.

use crate::store::Counts;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// The remaining time is estimated from the work of this recent interval.
const WINDOW: Duration = Duration::from_mins(5);
/// Maximum interval between lines in a log; the first lines come sooner, to show progress.
const LOG_EVERY: Duration = Duration::from_mins(1);
/// Time until the first line in a log.
const LOG_FIRST: Duration = Duration::from_secs(2);

/// Progress of the campaign in units of estimated cost.
pub(super) struct Overall {
    pub(super) total: f64,
    /// Work done according to the store, without the cases running here.
    pub(super) stored: f64,
    /// Work of cases that ended here since the last update from the store.
    pub(super) since: f64,
    /// The maximum shown so far, so that the bar never moves back.
    shown: f64,
    pub(super) counts: Counts,
    /// History of the progress.
    pub(super) history: VecDeque<(Instant, f64)>,
    /// Start, and delay until the next line in the log.
    begun: Instant,
    due: Duration,
}

impl Overall {
    /// The progress of a campaign before the first update.
    pub(super) fn new() -> Self {
        Self {
            total: 0.0,
            stored: 0.0,
            since: 0.0,
            shown: 0.0,
            counts: Counts::default(),
            history: VecDeque::new(),
            begun: Instant::now(),
            due: LOG_FIRST,
        }
    }

    /// Whether the next line in the log is due; if so, schedules the one after it.
    pub(super) fn is_due(&mut self) -> bool {
        let elapsed = self.begun.elapsed();
        let is_due = elapsed >= self.due;
        if is_due {
            self.due = elapsed + elapsed.min(LOG_EVERY);
        }
        is_due
    }

    /// Records the progress.
    pub(super) fn advance(&mut self, done: f64) {
        self.shown = self.shown.max(done.min(self.total));
        let now = Instant::now();
        let fresh = self
            .history
            .back()
            .is_some_and(|(at, _)| now.duration_since(*at) < Duration::from_secs(1));
        if !fresh {
            self.history.push_back((now, self.shown));
        }
        while self.history.len() > 2
            && self
                .history
                .front()
                .is_some_and(|(at, _)| now.duration_since(*at) > WINDOW)
        {
            self.history.pop_front();
        }
    }

    pub(super) fn fraction(&self) -> f64 {
        if self.total > 0.0 {
            (self.shown / self.total).clamp(0.0, 1.0)
        } else {
            1.0
        }
    }

    /// Remaining time at the rate of the last minutes.
    pub(super) fn left(&self) -> Option<Duration> {
        let (since, before) = *self.history.front()?;
        let (now, done) = *self.history.back()?;
        let rate = (done - before) / now.duration_since(since).as_secs_f64();
        let left = (self.total - self.shown) / rate;
        (rate > 0.0 && left.is_finite())
            .then(|| Duration::try_from_secs_f64(left.max(0.0)).ok())
            .flatten()
    }

    pub(super) fn message(&self) -> String {
        let c = &self.counts;
        let mut words = format!("{} of {} cases", c.done + c.jammed + c.failed, c.total());
        for (number, word) in [(c.jammed, "jammed"), (c.failed, "failed")] {
            if number > 0 {
                words = format!("{words}, {number} {word}");
            }
        }
        let is_open = c.pending + c.running > 0;
        match self.left().filter(|_| is_open) {
            Some(left) => format!(
                "{words}, {} left",
                crate::text::format::duration(left.as_secs_f64())
            ),
            None => words,
        }
    }
}
