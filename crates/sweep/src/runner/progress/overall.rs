//! How far a campaign is, and how long the rest takes.

use crate::store::Counts;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Work of this last time is what the rest is estimated from.
const WINDOW: Duration = Duration::from_mins(5);
/// Time from one line in a log to the next at most; the first come sooner, so that whoever looks on sees that it moves.
const LOG_EVERY: Duration = Duration::from_mins(1);
/// Time until the first line in a log.
const LOG_FIRST: Duration = Duration::from_secs(2);

/// Progress of the campaign in units of estimated cost.
pub(super) struct Overall {
    pub(super) total: f64,
    /// What the store knows to be done, but for the cases under way here.
    pub(super) stored: f64,
    /// Cases ended here since the store was asked.
    pub(super) since: f64,
    /// The most that was ever shown: a bar does not go back.
    shown: f64,
    pub(super) counts: Counts,
    /// How far it was when.
    pub(super) history: VecDeque<(Instant, f64)>,
    /// When it began, and how long after that the next line in the log is due.
    begun: Instant,
    due: Duration,
}

impl Overall {
    /// Of a campaign of which nothing is known yet.
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

    /// Whether the next line in the log is due, which it then is no more.
    pub(super) fn is_due(&mut self) -> bool {
        let elapsed = self.begun.elapsed();
        let is_due = elapsed >= self.due;
        if is_due {
            self.due = elapsed + elapsed.min(LOG_EVERY);
        }
        is_due
    }

    /// Takes note of how far it is.
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

    /// Time left at the rate of the last minutes.
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
                crate::format::duration(left.as_secs_f64())
            ),
            None => words,
        }
    }
}
