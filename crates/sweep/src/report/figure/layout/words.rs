//! Text on a panel: numbers and labels.

use super::Frame;
use crate::report::figure::font;
use crate::report::figure::scene::{Anchor, Place, Shape, Text};

/// Distance between the points of a curve that are tested for overlap.
const NEAR: f64 = 3.0;

impl Frame<'_> {
    /// Numbers, labels and text within the axes.
    pub(super) fn words(&self, is_left: bool, is_lowest: bool) -> Vec<Shape> {
        let [[left, top], [right, bottom]] = self.corners;
        let (label, size) = (self.outline.label_size, self.outline.tick_size);
        let mut texts = Vec::new();
        for (at, words) in self.named_ticks(size) {
            let place = [at, bottom + 1.3 * size];
            texts.push(Text::new(place, words, size, Anchor::Middle));
        }
        for (place, words) in &self.panel.y.ticks {
            let place = [left - 0.5 * size, self.y(*place) + 0.36 * size];
            texts.push(Text::new(place, words, size, Anchor::End));
        }
        // A label longer than its axis is set smaller.
        let fitting = |words: &str, room: f64| label * (room / font::width(words, label)).min(1.0);
        if is_lowest {
            let words = &self.panel.x.label;
            let place = [0.5 * (left + right), bottom + 1.4 * size + 1.35 * label];
            let size = fitting(words, right - left + 2.0 * label);
            texts.push(Text::new(place, words, size, Anchor::Middle));
        }
        if is_left {
            let words = &self.panel.y.label;
            let place = [1.1 * label, 0.5 * (top + bottom)];
            let size = fitting(words, bottom - top + label);
            texts.push(Text::new(place, words, size, Anchor::Middle).upright());
        }
        if !self.panel.title.is_empty() {
            let place = [0.5 * (left + right), top - 0.5 * label];
            texts.push(Text::new(place, &self.panel.title, label, Anchor::Middle));
        }
        if let Some(strain) = self.panel.shaded {
            let end = self.x(strain).clamp(left, right);
            let (words, middle) = ("discarded", 0.5 * (left + end));
            let upright = |x| Text::new([x, top + 0.6 * size], words, size, Anchor::End).upright();
            texts.push(if end - left > font::width(words, size) + size {
                Text::new([middle, top + 1.4 * size], words, size, Anchor::Middle)
            } else if end - left > 1.4 * size {
                upright(middle + 0.36 * size)
            } else {
                upright(end + 1.2 * size)
            });
        }
        texts.into_iter().flat_map(Text::shapes).collect()
    }

    /// Labelled ticks of the lower axis: all, or every nth where labels would overlap. Plateaus
    /// beyond breaks are always labelled.
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

    /// Points that a legend should not hide.
    pub(super) fn obstacles(&self) -> Vec<Place> {
        let parts = [Self::bands, Self::lines, Self::bars, Self::markers];
        let curves = self.panel.curves.iter();
        let shapes = curves.flat_map(|curve| parts.map(|part| part(self, curve)));
        let shapes = shapes.flatten().chain(self.dashed());
        shapes.flat_map(|shape| shape.places(NEAR)).collect()
    }
}
