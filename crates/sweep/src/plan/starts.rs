//! Start layers that cannot be made: one is tried for every point, within seconds.

use crate::data::Value;
use crate::model::spaces::try_start;
use crate::text::format::significant;
use sd_core::Params;
use sd_core::model::Sizes;
use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

/// Maximum wall time of all of them together.
const TIME: Duration = Duration::from_secs(6);

/// A point and the outcome of its start layer; `None` where time ran out before.
pub(super) struct StartTrial {
    params: Params,
    outcome: Option<Result<(), String>>,
}

impl StartTrial {
    /// Why the runs of its point cannot start, or may fail to.
    pub(super) fn warning(&self) -> Option<String> {
        match &self.outcome {
            Some(Ok(())) => None,
            Some(Err(reason)) => Some(reason.clone()),
            None => Some(format!(
                "no start of {} spheres at {} was found within {} s: they may be too dense to start",
                self.params.spheres,
                fraction(&self.params),
                significant(TIME.as_secs_f64(), 2)
            )),
        }
    }

    /// Whether these parameters have its start layer.
    pub(super) fn is_of(&self, params: &Params) -> bool {
        of_start(&self.params) == of_start(params)
    }

    /// Whether there is none.
    pub(super) fn has_failed(&self) -> bool {
        matches!(self.outcome, Some(Err(_)))
    }
}

/// The fraction that the spheres fill, as text.
fn fraction(params: &Params) -> String {
    match params.volume_fraction {
        Some(volume_fraction) => format!("volume fraction {volume_fraction}"),
        None => format!("area fraction {}", params.area_fraction),
    }
}

/// The parameters that the start of a seed depends on.
fn of_start(params: &Params) -> ([u64; 6], Option<&'static str>) {
    let numbers = [
        params.spheres as u64,
        params.area_fraction.to_bits(),
        params.volume_fraction.unwrap_or(0.0).to_bits(),
        params.roughness.to_bits(),
        params.size_ratio.to_bits(),
        params.large_fraction.to_bits(),
    ];
    (numbers, params.sizes.map(Sizes::text))
}

/// Makes a start layer for every point, the hardest to pack first. Each point is given with one of
/// its seeds.
pub(super) fn tried<'p>(points: impl Iterator<Item = (&'p Params, u64)>) -> Vec<StartTrial> {
    let mut known = HashSet::new();
    let mut all: Vec<(Params, u64)> = points
        .filter(|(params, _)| params.start.is_none() && known.insert(of_start(params)))
        .map(|(params, seed)| (params.clone(), seed))
        .collect();
    let grown = |p: &Params| 1.0 + 0.5 * p.roughness;
    let covered = |p: &Params| match p.volume_fraction {
        Some(volume_fraction) => volume_fraction * grown(p).powi(3),
        None => p.area_fraction * grown(p).powi(2),
    };
    all.sort_by(|(a, _), (b, _)| Value::Number(covered(b)).order(&Value::Number(covered(a))));
    let (all, next) = (Arc::new(all), Arc::new(AtomicUsize::new(0)));
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let begun = Instant::now();
    let (send, made) = mpsc::channel();
    for _ in 0..threads.min(all.len()) {
        let (all, next, send) = (Arc::clone(&all), Arc::clone(&next), send.clone());
        // A layer that takes too long is abandoned.
        std::thread::spawn(move || {
            while begun.elapsed() < TIME {
                let place = next.fetch_add(1, Ordering::Relaxed);
                let Some((params, seed)) = all.get(place) else {
                    return;
                };
                let made = try_start(params, *seed).map_err(|error| error.to_string());
                let _ = send.send((place, made));
            }
        });
    }
    drop(send);
    let mut outcomes = vec![None; all.len()];
    while let Ok((place, outcome)) = made.recv_timeout(TIME.saturating_sub(begun.elapsed())) {
        outcomes[place] = Some(outcome);
    }
    let points = all.iter().map(|(params, _)| params.clone());
    points
        .zip(outcomes)
        .map(|(params, outcome)| StartTrial { params, outcome })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::params;

    #[test]
    fn only_a_layer_too_dense_to_start_is_reported() {
        let dense = Params {
            area_fraction: 0.84,
            spheres: 20,
            roughness: 0.07,
            ..params()
        };
        let points = [params(), dense.clone(), params()];
        let tried = tried(points.iter().map(|params| (params, 1)));
        assert_eq!(tried.len(), 2, "one for each kind of start");
        let of = |params: &Params| tried.iter().find(|tried| tried.is_of(params)).unwrap();
        assert_eq!(of(&params()).warning(), None);
        let warning = of(&dense).warning().unwrap();
        assert!(
            warning.contains("20 spheres at area fraction 0.84"),
            "{warning}"
        );
    }
}
