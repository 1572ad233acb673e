//! Slices assign cases to tasks. They are cut once, before any task starts, so that all tasks
//! agree.

use super::ClusterError;
use crate::store::OpenCase;
use crate::system::files::read_whole;
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::io::ErrorKind;
use std::path::Path;

/// Largest file of slices, in bytes: the keys of 10^7 cases have 350 MB.
const SIZE_LIMIT: u64 = 1 << 30;

/// The keys of the cases of every task, in the order of work. As JSON it is the file that tasks
/// read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Slices {
    /// Hash of the slices and of the campaign they were cut from: names the plan.
    pub(super) plan: String,
    pub(super) tasks: Vec<Vec<String>>,
}

impl Slices {
    /// Cuts open cases into slices of equal estimated cost: the most expensive first, each to the
    /// task with the least work so far. The same cases give the same slices.
    pub(super) fn cut(campaign: &str, open: &[OpenCase], tasks: usize) -> Self {
        let mut order: Vec<usize> = (0..open.len()).collect();
        order.sort_by(|a, b| open[*b].cost.total_cmp(&open[*a].cost).then(a.cmp(b)));
        let mut slices: Vec<Vec<usize>> = vec![Vec::new(); tasks];
        // Bits of a positive float are in the order of its value.
        let mut loads: BinaryHeap<Reverse<(u64, usize, usize)>> =
            (0..tasks).map(|task| Reverse((0, 0, task))).collect();
        for case in order {
            let Some(Reverse((load, number, task))) = loads.pop() else {
                break;
            };
            let load = f64::from_bits(load) + open[case].cost.max(0.0);
            slices[task].push(case);
            // Cases of negligible cost are spread as well.
            loads.push(Reverse((load.to_bits(), number + 1, task)));
        }
        let mut hasher = blake3::Hasher::new();
        hasher.update(campaign.as_bytes());
        let mut tasks = Vec::new();
        for mut slice in slices {
            slice.sort_unstable();
            let keys: Vec<String> = slice.iter().map(|case| open[*case].key.clone()).collect();
            hasher.update((keys.join(" ") + "\n").as_bytes());
            tasks.push(keys);
        }
        Self {
            plan: hasher.finalize().to_hex()[..8].to_owned(),
            tasks,
        }
    }

    /// The slices of so many tasks from a file. Fails where it is missing or incomplete, or for
    /// another number of tasks.
    pub(super) fn read(path: &Path, tasks: usize) -> Result<Self, ClusterError> {
        let broken = |reason: String| ClusterError::Slices {
            path: path.to_owned(),
            reason,
        };
        let bytes = read_whole(path, SIZE_LIMIT).map_err(|error| match error.kind() {
            ErrorKind::NotFound => broken("no slices: the folder of shards was deleted".into()),
            _ => broken(error.to_string()),
        })?;
        let slices: Self = serde_json::from_slice(&bytes)
            .map_err(|error| broken(format!("no slices of this version of sweep: {error}")))?;
        match slices.tasks.len() {
            number if number == tasks => Ok(slices),
            number => Err(broken(format!(
                "these are slices for {number} tasks, and --shard says {tasks}"
            ))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn open(costs: &[f64]) -> Vec<OpenCase> {
        let case = |(number, cost): (usize, &f64)| OpenCase {
            key: format!("{number:032x}"),
            cost: *cost,
            begun: false,
        };
        costs.iter().enumerate().map(case).collect()
    }

    proptest! {
        #[test]
        fn every_case_is_in_one_slice_and_costs_are_near(
            costs in proptest::collection::vec(0.0..100.0_f64, 0..200), tasks in 1usize..20,
        ) {
            let slices = Slices::cut("", &open(&costs), tasks);
            prop_assert_eq!(slices.tasks.len(), tasks);
            let mut all: Vec<&String> = slices.tasks.iter().flatten().collect();
            all.sort();
            all.dedup();
            prop_assert_eq!(all.len(), costs.len());
            let load = |keys: &Vec<String>| -> f64 {
                keys.iter().map(|key| costs[usize::from_str_radix(key, 16).unwrap()]).sum()
            };
            let loads: Vec<f64> = slices.tasks.iter().map(load).collect();
            let most = loads.iter().copied().fold(0.0, f64::max);
            let least = loads.iter().copied().fold(f64::INFINITY, f64::min);
            let largest = costs.iter().copied().fold(0.0, f64::max);
            prop_assert!(most - least <= largest + 1e-9, "{most} {least} {largest}");
        }
    }

    #[test]
    fn file_gives_the_slices_and_half_of_it_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("slices");
        let slices = Slices::cut("text", &open(&[1.0, 5.0, 2.0, 2.0, 0.0]), 3);
        let other = Slices::cut("other text", &open(&[1.0, 5.0, 2.0, 2.0, 0.0]), 3);
        assert_eq!(slices.tasks, other.tasks);
        assert_ne!(slices.plan, other.plan);
        let text = serde_json::to_string(&slices).unwrap();
        std::fs::write(&path, &text).unwrap();
        assert_eq!(Slices::read(&path, 3).unwrap(), slices);
        assert!(Slices::read(&path, 4).is_err());
        for length in 0..text.len() {
            std::fs::write(&path, &text[..length]).unwrap();
            assert!(Slices::read(&path, 3).is_err(), "{length}");
        }
    }
}
