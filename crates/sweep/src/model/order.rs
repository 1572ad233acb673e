//! The order of work: one seed of every point, the cheapest first, so
//! that curves appear early; then the other seeds, the most expensive first, so that no core idles
//! at the end; then the seeds that precisions request, the batch with the largest gain per second
//! first. Where every point has one seed only, the most expensive points, which account for 75 % of
//! the work, are ordered like the other seeds.

use super::axes::{Identity, identity};
use super::campaign::Campaign;
use sd_core::Params;
use std::collections::HashMap;

/// The rank of every case, in the order of the file. Cases that precisions may add share the
/// last.
pub(crate) fn ranks(campaign: &Campaign, costs: &[f64]) -> Vec<u64> {
    let mut later = vec![false; campaign.cases.len()];
    for rule in &campaign.rules {
        let first = (rule.cases.start + rule.precision.at_least).min(rule.cases.end);
        later[first..rule.cases.end].fill(true);
    }
    let mut seeds: HashMap<_, usize> = HashMap::new();
    // Cases of a point come one after the other in their file.
    let mut last: Option<(&Params, Identity)> = None;
    let mut order: Vec<(usize, f64, usize, usize)> = Vec::with_capacity(campaign.cases.len());
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
        order.push((round, cost, *seed, position));
        *seed += 1;
    }
    if order.iter().all(|(round, ..)| *round == 0) {
        let limit = expensive_threshold(costs);
        for (round, cost, ..) in order.iter_mut().filter(|(_, cost, ..)| *cost > limit) {
            (*round, *cost) = (1, -*cost);
        }
    }
    order.sort_by(|a, b| {
        (a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))).then((a.2, a.3).cmp(&(b.2, b.3)))
    });
    let certain = order.iter().filter(|(round, ..)| *round < 2).count();
    let mut ranks = vec![0; order.len()];
    for (rank, (.., position)) in order.iter().enumerate() {
        ranks[*position] = rank.min(certain) as u64;
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
    use crate::model::case::Case;

    fn campaign(text: &str) -> Campaign {
        let text = format!(
            "name = \"order\"\n[[grid]]\narea_fraction = [0.5, 0.6]\nfriction = 0.3\nroughness = 0.01\nspheres = 40\n\
             shear_rate = [1, inf]\n{text}"
        );
        crate::campaign::parse("order.toml", text).unwrap()
    }

    /// Cases as (area fraction, shear rate, seed) in the order of work.
    fn order(campaign: &Campaign) -> Vec<(f64, f64, u64)> {
        let costs: Vec<f64> = campaign
            .cases
            .iter()
            .map(|(_, case)| case.params.area_fraction)
            .collect();
        let ranks = ranks(campaign, &costs);
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
            order(&campaign("seeds = 2\n")),
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
            let ranks = ranks(&campaign, &costs);
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
    fn seeds_of_a_precision_beyond_the_first_batch_share_the_last_rank() {
        let campaign = campaign("seeds = { precision = 0.1, at_least = 3, at_most = 9 }\n");
        let costs = vec![1.0; campaign.cases.len()];
        let ranks = ranks(&campaign, &costs);
        for rule in &campaign.rules {
            let (first, later) = ranks[rule.cases.clone()].split_at(3);
            assert!(first.iter().all(|rank| *rank < 12));
            assert!(later.iter().all(|rank| *rank == 12), "{later:?}");
        }
    }
}
