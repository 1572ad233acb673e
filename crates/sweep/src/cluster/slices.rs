//! Slices assign cases to tasks. They are cut once, before any task starts, so that all tasks
//! agree.

use super::ClusterError;
use crate::store::OpenCase;
use crate::system::files::read_text;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fmt::Write as _;
use std::path::Path;

/// Header of a file of slices, with the version of its format.
const HEADER: &str = "sweep slices 1";
/// Last line of a complete file of slices.
const END: &str = "end";
/// Largest file of slices, in bytes: the keys of 10^7 cases have 330 MB.
const SIZE_LIMIT: u64 = 1 << 30;

/// The cases of every task, in the order of work.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Slices {
    /// Keys of cases by task.
    pub tasks: Vec<Vec<String>>,
}

impl Slices {
    /// Cuts open cases into slices of equal estimated cost: the most expensive first, each to the
    /// task with the least work so far. The same cases give the same slices.
    pub(crate) fn cut(open: &[OpenCase], tasks: usize) -> Self {
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
        for slice in &mut slices {
            slice.sort_unstable();
        }
        Self {
            tasks: slices
                .into_iter()
                .map(|slice| {
                    slice
                        .into_iter()
                        .map(|case| open[case].key.clone())
                        .collect()
                })
                .collect(),
        }
    }

    /// Hash of the slices and of the campaign they were cut from: names the plan.
    pub(crate) fn plan(&self, campaign: &str) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(campaign.as_bytes());
        hasher.update(self.lines().as_bytes());
        hasher.finalize().to_hex()[..8].to_owned()
    }

    /// One line for every task.
    fn lines(&self) -> String {
        self.tasks
            .iter()
            .map(|keys| keys.join(" ") + "\n")
            .collect()
    }

    /// As a file.
    pub(crate) fn text(&self, plan: &str) -> String {
        let mut text = format!("{HEADER} {plan} {}\n", self.tasks.len());
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}{END}", self.lines());
        text
    }

    /// The plan and the keys of one of `tasks` tasks from a file of slices.
    ///
    /// # Errors
    /// A file that is missing, incomplete, or for another number of tasks.
    pub(crate) fn read(
        path: &Path,
        task: usize,
        tasks: usize,
    ) -> Result<(String, Vec<String>), ClusterError> {
        let broken = |reason: String| ClusterError::Slices {
            path: path.to_owned(),
            reason,
        };
        let text = read_text(path, SIZE_LIMIT).map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => ClusterError::NoSlices {
                path: path.to_owned(),
            },
            _ => broken(error.to_string()),
        })?;
        let mut lines = text.lines();
        let mut next = || {
            let line = lines.next();
            line.ok_or_else(|| broken("half-written: the last line is missing".into()))
        };
        let header = next()?;
        let words: Vec<&str> = header
            .strip_prefix(HEADER)
            .ok_or_else(|| broken("not slices of this version of sweep".into()))?
            .split_whitespace()
            .collect();
        let [plan, number] = words.as_slice() else {
            return Err(broken("not slices of this version of sweep".into()));
        };
        if number.parse() != Ok(tasks) {
            return Err(broken(format!(
                "these are slices for {number} tasks, and --shard says {tasks}"
            )));
        }
        let mut keys = Vec::new();
        for line in 0..tasks {
            let text = next()?;
            if line == task {
                keys = text.split_whitespace().map(String::from).collect();
            }
        }
        if next()? != END {
            return Err(broken("half-written: the last line is missing".into()));
        }
        Ok(((*plan).to_owned(), keys))
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
            let slices = Slices::cut(&open(&costs), tasks);
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
    fn file_gives_every_task_its_keys_and_half_of_it_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("slices");
        let slices = Slices::cut(&open(&[1.0, 5.0, 2.0, 2.0, 0.0]), 3);
        let plan = slices.plan("text");
        assert_ne!(plan, slices.plan("other text"));
        let text = slices.text(&plan);
        std::fs::write(&path, &text).unwrap();
        for task in 0..3 {
            let (found, keys) = Slices::read(&path, task, 3).unwrap();
            assert_eq!((found, &keys), (plan.clone(), &slices.tasks[task]));
        }
        assert!(Slices::read(&path, 0, 4).is_err());
        for length in 0..text.len() - 1 {
            std::fs::write(&path, &text[..length]).unwrap();
            assert!(Slices::read(&path, 0, 3).is_err(), "{length}");
        }
    }
}
