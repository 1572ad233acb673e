//! What is written on a panel: numbers, labels, and words within the axes where they hide least.

use super::{Frame, TICK};
use crate::report::figure::font;
use crate::report::figure::legend::hidden;
use crate::report::figure::shape::{Anchor, Place, Shape};

/// From one place that a curve passes to the next, where it is looked for what hides it.
const NEAR: f64 = 3.0;

impl Frame<'_> {
    /// Numbers, labels and what is said within the axes.
    pub(super) fn words(&self, is_left: bool, is_lowest: bool) -> Vec<Shape> {
        let [[left, top], [right, bottom]] = self.corners;
        let (label, size) = (self.outline.label_size, self.outline.tick_size);
        let text = |place, words: &str, size, anchor, upright| Shape::Text {
            place,
            words: words.to_owned(),
            size,
            anchor,
            upright,
        };
        let mut shapes = Vec::new();
        for (at, words) in self.named_ticks(size) {
            let place = [at, bottom + 1.3 * size];
            shapes.push(text(place, words, size, Anchor::Middle, false));
        }
        for (place, words) in &self.panel.y.ticks {
            let place = [left - 0.5 * size, self.y(*place) + 0.36 * size];
            shapes.push(text(place, words, size, Anchor::End, false));
        }
        // A label that is longer than its axis is written smaller.
        let fitting = |words: &str, room: f64| label * (room / font::width(words, label)).min(1.0);
        if is_lowest {
            let words = &self.panel.x.label;
            let place = [0.5 * (left + right), bottom + 1.4 * size + 1.35 * label];
            let size = fitting(words, right - left + 2.0 * label);
            shapes.push(text(place, words, size, Anchor::Middle, false));
        }
        if is_left {
            let words = &self.panel.y.label;
            let place = [1.1 * label, 0.5 * (top + bottom)];
            let size = fitting(words, bottom - top + label);
            shapes.push(text(place, words, size, Anchor::Middle, true));
        }
        if !self.panel.title.is_empty() {
            let place = [0.5 * (left + right), top - 0.5 * label];
            shapes.push(text(place, &self.panel.title, label, Anchor::Middle, false));
        }
        if let Some(strain) = self.panel.shaded {
            let end = self.x(strain).clamp(left, right);
            let words = "discarded";
            if end - left > font::width(words, size) + size {
                let place = [0.5 * (left + end), top + 1.4 * size];
                shapes.push(text(place, words, size, Anchor::Middle, false));
            } else if end - left > 1.4 * size {
                let place = [0.5 * (left + end) + 0.36 * size, top + 0.6 * size];
                shapes.push(text(place, words, size, Anchor::End, true));
            } else {
                let place = [end + 1.2 * size, top + 0.6 * size];
                shapes.push(text(place, words, size, Anchor::End, true));
            }
        }
        shapes.extend(self.dashed_words(&text));
        shapes
    }

    /// Ticks of the lower axis that are named: all, or every second, third .. one where names would run into each other. Plateaus beyond
    /// breaks are named in any case.
    fn named_ticks(&self, size: f64) -> Vec<(f64, &str)> {
        let scale = &self.panel.x;
        let places: Vec<f64> = scale.ticks.iter().map(|tick| tick.0).collect();
        let is_beyond = |place: usize| {
            let neighbours = [place.checked_sub(1), Some(place + 1)];
            let known = neighbours.into_iter().flatten();
            let mut known = known.filter_map(|other| places.get(other));
            known.any(|other| scale.breaks_between(*other, places[place]))
                && (place == 0 || place + 1 == places.len())
        };
        let kept = |step: usize| -> Vec<(f64, &str)> {
            let all = scale.ticks.iter().enumerate();
            all.filter(|(place, _)| place % step == 0 || is_beyond(*place))
                .map(|(_, (place, words))| (self.x(*place), words.as_str()))
                .collect()
        };
        let is_clear = |ticks: &[(f64, &str)]| {
            ticks.windows(2).all(|pair| {
                let halves = pair.iter().map(|tick| 0.5 * font::width(tick.1, size));
                pair[1].0 - pair[0].0 > halves.sum::<f64>() + 0.35 * size
            })
        };
        let mut steps = 1..=places.len().max(1);
        let found = steps.find_map(|step| Some(kept(step)).filter(|ticks| is_clear(ticks)));
        found.unwrap_or_else(|| kept(places.len().max(1)))
    }

    /// What dashed lines are called, where it hides least.
    fn dashed_words(
        &self,
        text: &dyn Fn(Place, &str, f64, Anchor, bool) -> Shape,
    ) -> Option<Shape> {
        let words = self.panel.dashed_label?;
        let [[left, top], [right, bottom]] = self.corners;
        let size = 0.9 * self.outline.tick_size;
        let width = font::width(words, size);
        let obstacles = self.obstacles();
        let middle = 0.5 * (left + right - width);
        let starts = [right - width - 4.0, left + 5.0, middle];
        let lines = self.panel.dashed.iter().map(|height| self.y(*height));
        // Above a line, clear of the ticks of the axis below, or under it.
        let lowest = bottom - 1.3 * TICK;
        let places = lines.flat_map(|y| {
            let above = (y - 0.35 * size).min(lowest);
            [above, y + 1.05 * size].map(|y| (y, starts))
        });
        let places = places.flat_map(|(y, starts)| starts.map(|x| [x, y]));
        places
            .filter(|[_, y]| *y - size > top && *y <= lowest)
            .min_by_key(|[x, y]| {
                hidden(
                    [[*x, y - 0.9 * size], [x + width, y + 0.3 * size]],
                    &obstacles,
                )
            })
            .map(|place| text(place, words, size, Anchor::Start, false))
    }

    /// Places that words should leave free.
    pub(super) fn obstacles(&self) -> Vec<Place> {
        let mut places = Vec::new();
        let mut line = |from: Place, to: Place| {
            let length = (to[0] - from[0]).hypot(to[1] - from[1]);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a page is small"
            )]
            let number = (length / NEAR).ceil().clamp(1.0, 1e4) as usize;
            for n in 0..=number {
                let part = n as f64 / number as f64;
                places.push([0, 1].map(|k| from[k] + part * (to[k] - from[k])));
            }
        };
        for curve in &self.panel.curves {
            let at = |place: usize| {
                let point = &curve.points[place];
                [self.x(point.0), self.y(point.1)]
            };
            for (first, last) in &curve.pieces {
                for place in *first..*last {
                    line(at(place), at(place + 1));
                }
            }
            for point in &curve.points {
                let x = self.x(point.0);
                let [up, down] = [self.y(point.1 + point.3), self.y(point.1 - point.2)];
                line([x, up], [x, down]);
            }
        }
        for height in &self.panel.dashed {
            let [[left, _], [right, _]] = self.corners;
            line([left, self.y(*height)], [right, self.y(*height)]);
        }
        places
    }
}
