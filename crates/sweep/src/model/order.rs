//! The order of work: the user's priorities, then one seed of every point, the cheapest first, so
//! that curves appear early; then the other seeds, the most expensive first, so that no core idles
//! at the end; then the seeds that precisions request, the batch with the largest gain per second
//! first. Where every point has one seed only, the most expensive points, which account for 75 % of
//! the work, are ordered like the other seeds.

use super::axes::{AXES, Axis, Identity, identity};
use super::campaign::Campaign;
use super::case::Case;
use crate::data::Value;
use sd_core::Params;
use std::collections::HashMap;
use std::fmt;

/// Inputs of the order of work.
#[derive(Clone, Copy)]
pub struct Order<'o> {
    /// Points to compute first.
    pub priority: &'o Priority,
    /// Estimated CPU seconds of a case.
    pub cost: &'o dyn Fn(&Case) -> f64,
}

impl Default for Order<'_> {
    /// No priorities, and rough estimates of costs.
    fn default() -> Self {
        static NONE: Priority = Priority { axes: Vec::new() };
        Self {
            priority: &NONE,
            cost: &|case| case.cost(),
        }
    }
}

impl fmt::Debug for Order<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Order")
            .field("priority", self.priority)
            .finish_non_exhaustive()
    }
}

/// Points to compute first: see [`Priority::parse`].
#[derive(Debug, Clone, Default)]
pub struct Priority {
    /// Axes, the most important first, with the values that come first on each.
    axes: Vec<(&'static Axis, Vec<String>)>,
}

impl Priority {
    /// Reads `KEY` (the lowest value first), `-KEY` (the highest) or `KEY=VALUE[,VALUE..]` (these
    /// values first, in this order); what is given first counts most.
    ///
    /// # Errors
    /// A message about the fault.
    pub fn parse(texts: &[String]) -> Result<Self, String> {
        let mut axes = Vec::with_capacity(texts.len());
        for text in texts {
            let (key, values) = match text.split_once('=') {
                Some((key, values)) => {
                    let values: Vec<String> =
                        values.split(',').map(|value| value.trim().into()).collect();
                    (key.trim(), values)
                }
                None => match text.trim().strip_prefix('-') {
                    Some(key) => (key, vec![HIGHEST.to_owned()]),
                    None => (text.trim(), Vec::new()),
                },
            };
            let axis = Axis::of_key(key).ok_or_else(|| {
                let known: Vec<&str> = AXES.iter().map(|axis| axis.key).collect();
                format!(
                    "{key:?} is no axis of a campaign; they are {}",
                    known.join(", ")
                )
            })?;
            axes.push((axis, values));
        }
        Ok(Self { axes })
    }

    /// The priority as text.
    pub(crate) fn words(&self) -> String {
        let word =
            |(axis, values): &(&Axis, Vec<String>)| format!("{}={}", axis.key, values.join(","));
        self.axes.iter().map(word).collect::<Vec<_>>().join(" ")
    }

    /// Checks that every value named occurs in some case.
    ///
    /// # Errors
    /// The value that none has.
    pub fn check(&self, campaign: &Campaign) -> Result<(), String> {
        for (axis, values) in &self.axes {
            for wanted in values.iter().filter(|wanted| *wanted != HIGHEST) {
                let mut cases = campaign.cases.iter();
                if !cases.any(|(_, case)| is(wanted, axis.value(&case.params))) {
                    return Err(format!("no case has {} = {wanted}", axis.key));
                }
            }
        }
        Ok(())
    }

    /// Rank of a point: lower ranks come first.
    fn place(&self, params: &Params) -> Vec<f64> {
        self.axes
            .iter()
            .map(|(axis, values)| {
                let value = axis.value(params);
                if values.first().is_some_and(|first| first == HIGHEST) {
                    -axis.number(params)
                } else if values.is_empty() {
                    axis.number(params)
                } else {
                    let place = values.iter().position(|wanted| is(wanted, value));
                    place.unwrap_or(values.len()) as f64
                }
            })
            .collect()
    }
}

/// Requests the highest value first.
const HIGHEST: &str = "-";

/// Whether a value equals the given one.
fn is(wanted: &str, value: Value) -> bool {
    match value {
        Value::Word(word) => wanted == word,
        Value::Count(count) => wanted.parse() == Ok(count),
        Value::Number(number) => wanted.replace('∞', "inf").parse() == Ok(number),
    }
}

/// The rank of every case, in the order of the file. Cases that precisions may add share one, after
/// all others of their priority.
pub(crate) fn ranks(campaign: &Campaign, costs: &[f64], priority: &Priority) -> Vec<u64> {
    let mut later = vec![false; campaign.cases.len()];
    for rule in &campaign.rules {
        let first = (rule.cases.start + rule.precision.at_least).min(rule.cases.end);
        later[first..rule.cases.end].fill(true);
    }
    let mut seeds: HashMap<_, usize> = HashMap::new();
    // Cases of a point come one after the other in their file.
    let mut last: Option<(&Params, Identity)> = None;
    let mut order: Vec<(Vec<f64>, usize, f64, usize, usize)> =
        Vec::with_capacity(campaign.cases.len());
    for (position, (_, case)) in campaign.cases.iter().enumerate() {
        let point = match last.take() {
            Some((params, point)) if *params == case.params => point,
            _ => identity(&case.params),
        };
        let seed = match seeds.get_mut(&point) {
            Some(seed) => seed,
            None => seeds.entry(point.clone()).or_default(),
        };
        last = Some((&case.params, point));
        let (round, cost) = match *seed {
            _ if later[position] => (2, 0.0),
            0 => (0, costs[position]),
            _ => (1, -costs[position]),
        };
        order.push((priority.place(&case.params), round, cost, *seed, position));
        *seed += 1;
    }
    if order.iter().all(|(_, round, ..)| *round == 0) {
        let limit = expensive_threshold(costs);
        for (_, round, cost, ..) in order.iter_mut().filter(|(_, _, cost, ..)| *cost > limit) {
            (*round, *cost) = (1, -*cost);
        }
    }
    let places = |a: &[f64], b: &[f64]| {
        let unequal = a.iter().zip(b).map(|(a, b)| a.total_cmp(b));
        unequal.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
    };
    order.sort_by(|a, b| {
        places(&a.0, &b.0)
            .then(a.1.cmp(&b.1))
            .then(a.2.total_cmp(&b.2))
            .then(a.3.cmp(&b.3))
            .then(a.4.cmp(&b.4))
    });
    let mut ranks = vec![0; order.len()];
    let mut shared: Option<(&[f64], u64)> = None;
    for (rank, (place, round, .., position)) in order.iter().enumerate() {
        let rank = rank as u64;
        ranks[*position] = match shared {
            Some((of, shared)) if *round == 2 && of == place.as_slice() => shared,
            _ => rank,
        };
        if *round == 2 {
            shared = Some((place, ranks[*position]));
        }
    }
    ranks
}

/// The largest cost among the cheapest cases that together make a quarter of the work.
fn expensive_threshold(costs: &[f64]) -> f64 {
    let mut costs = costs.to_vec();
    costs.sort_unstable_by(f64::total_cmp);
    let quarter = 0.25 * costs.iter().sum::<f64>();
    let mut sum = 0.0;
    let cheap = costs.iter().take_while(|cost| {
        sum += **cost;
        sum <= quarter
    });
    cheap.last().copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn campaign(text: &str) -> Campaign {
        let text = format!(
            "name = \"order\"\n[[grid]]\narea_fraction = [0.5, 0.6]\nfriction = 0.3\nroughness = 0.01\nspheres = 40\n\
             shear_rate = [1, inf]\n{text}"
        );
        crate::campaign::parse("order.toml", text).unwrap()
    }

    /// Cases as (area fraction, shear rate, seed) in the order of work.
    fn order(campaign: &Campaign, priority: &[&str]) -> Vec<(f64, f64, u64)> {
        let costs: Vec<f64> = campaign
            .cases
            .iter()
            .map(|(_, case)| case.params.area_fraction)
            .collect();
        let texts: Vec<String> = priority.iter().map(ToString::to_string).collect();
        let ranks = ranks(campaign, &costs, &Priority::parse(&texts).unwrap());
        let mut order: Vec<_> = ranks.into_iter().zip(&campaign.cases).collect();
        order.sort_by_key(|(rank, _)| *rank);
        order
            .into_iter()
            .map(|(_, (_, c))| (c.params.area_fraction, c.params.shear_rate, c.seed))
            .collect()
    }

    #[test]
    fn one_seed_of_every_point_cheapest_first_then_the_most_expensive() {
        let inf = f64::INFINITY;
        assert_eq!(
            order(&campaign("seeds = 2\n"), &[]),
            [
                (0.5, 1.0, 1),
                (0.5, inf, 1),
                (0.6, 1.0, 1),
                (0.6, inf, 1),
                (0.6, 1.0, 2),
                (0.6, inf, 2),
                (0.5, 1.0, 2),
                (0.5, inf, 2),
            ]
        );
    }

    /// Time from the first start to the last end where each of some workers takes the next case
    /// once it is free.
    fn time_needed(ranks: &[u64], costs: &[f64], workers: usize) -> f64 {
        let mut cases: Vec<_> = ranks.iter().zip(costs).collect();
        cases.sort_by_key(|(rank, _)| **rank);
        let mut free_at = vec![0.0_f64; workers];
        for (_, cost) in cases {
            let next = free_at.iter_mut().min_by(|a, b| a.total_cmp(b)).unwrap();
            *next += cost;
        }
        free_at.into_iter().fold(0.0, f64::max)
    }

    #[test]
    fn long_cases_are_not_started_last() {
        // Costs as near jamming: each point takes twice as long as the one before.
        let grid = |seeds: &str| {
            let text = format!(
                "name = \"order\"\n[[grid]]\narea_fraction = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]\nfriction = 0.3\nroughness = 0.01\n\
                 spheres = 40\nshear_rate = [1, 2, inf]\nseeds = {seeds}\n"
            );
            crate::campaign::parse("order.toml", text).unwrap()
        };
        for seeds in ["1", "2", "5"] {
            let campaign = grid(seeds);
            let cost = |case: &Case| (case.params.area_fraction * 10.0).exp2();
            let costs: Vec<f64> = campaign.cases.iter().map(|(_, c)| cost(c)).collect();
            let ranks = ranks(&campaign, &costs, &Priority::default());
            let last = ranks.iter().zip(&costs).max_by_key(|(rank, _)| **rank);
            let longest = costs.iter().copied().fold(0.0, f64::max);
            assert!(*last.unwrap().1 < longest, "{seeds}");
            // Lower bounds are the longest case, and all workers busy to the end.
            for workers in [2, 4] {
                let ideal = (costs.iter().sum::<f64>() / workers as f64).max(longest);
                let time = time_needed(&ranks, &costs, workers);
                assert!(time < 1.2 * ideal, "{seeds}, {workers}: {time} of {ideal}");
            }
            // From the cheapest to the most expensive, the last would run alone.
            let mut ascending: Vec<usize> = (0..costs.len()).collect();
            ascending.sort_by(|a, b| costs[*a].total_cmp(&costs[*b]));
            let mut ranks = vec![0; costs.len()];
            (0..)
                .zip(&ascending)
                .for_each(|(rank, at)| ranks[*at] = rank);
            if seeds == "1" {
                let ideal = (costs.iter().sum::<f64>() / 4.0).max(longest);
                assert!(time_needed(&ranks, &costs, 4) > 1.2 * ideal);
            }
        }
    }

    #[test]
    fn priority_of_an_axis_goes_before_all() {
        let found = order(
            &campaign("seeds = 2\n"),
            &["shear_rate=inf", "-area_fraction"],
        );
        let first: Vec<_> = found.iter().take(4).map(|c| (c.0, c.1)).collect();
        assert_eq!(
            first,
            [(0.6, f64::INFINITY); 2]
                .into_iter()
                .chain([(0.5, f64::INFINITY); 2])
                .collect::<Vec<_>>()
        );
        assert!(
            Priority::parse(&["colour".into()])
                .unwrap_err()
                .contains("area_fraction")
        );
        let unmatched = Priority::parse(&["shear_rate=7".into()]).unwrap();
        let campaign = campaign("seeds = 2\n");
        assert!(unmatched.check(&campaign).is_err());
    }

    #[test]
    fn seeds_of_a_precision_beyond_the_first_batch_share_the_last_rank() {
        let campaign = campaign("seeds = { precision = 0.1, at_least = 3, at_most = 9 }\n");
        let costs = vec![1.0; campaign.cases.len()];
        let ranks = ranks(&campaign, &costs, &Priority::default());
        for rule in &campaign.rules {
            let (first, later) = ranks[rule.cases.clone()].split_at(3);
            assert!(first.iter().all(|rank| *rank < 12));
            assert!(later.iter().all(|rank| *rank == 12), "{later:?}");
        }
    }
}
