//! Whether runs fit the memory of this machine.

use super::PROGRAM_BYTES;
use crate::model::campaign::Campaign;
use crate::text::format::bytes;
use sd_core::{Params, memory_bytes};

/// Why a campaign has a run too large for the memory of this machine, with the number of spheres
/// that fits; `None` where all fit, or where that memory is not known.
pub fn beyond_memory(campaign: &Campaign) -> Option<String> {
    let cases = campaign.cases.iter().map(|(_, case)| &case.params);
    refusal(cases, installed()?)
}

/// Why the largest run does not fit into so many bytes; `None` if it does.
fn refusal<'a>(runs: impl Iterator<Item = &'a Params>, installed: f64) -> Option<String> {
    let needed = |params: &Params| PROGRAM_BYTES + memory_bytes(params);
    let largest = runs.max_by(|a, b| needed(a).total_cmp(&needed(b)))?;
    if needed(largest) <= installed {
        return None;
    }
    // The number of spheres at which the memory is just enough, by bisection.
    let (mut fits, mut too_many) = (0, largest.spheres);
    while too_many - fits > 1 {
        let spheres = fits.midpoint(too_many);
        let params = Params {
            spheres,
            ..largest.clone()
        };
        if needed(&params) <= installed {
            fits = spheres;
        } else {
            too_many = spheres;
        }
    }
    Some(format!(
        "a run of {} needs about {} of memory, and this machine has {}; {fits} fit",
        largest.spheres,
        bytes(needed(largest)),
        bytes(installed)
    ))
}

/// Bytes of memory that this process may use: those of the machine, or of its control group.
fn installed() -> Option<f64> {
    let machine = std::fs::read_to_string("/proc/meminfo")
        .ok()
        .and_then(|text| {
            let line = text.lines().find(|line| line.starts_with("MemTotal:"))?;
            let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
            Some(1024.0 * kilobytes)
        });
    let group = std::fs::read_to_string("/sys/fs/cgroup/memory.max")
        .ok()
        .and_then(|text| text.trim().parse().ok());
    machine.into_iter().chain(group).reduce(f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_beyond_the_memory_is_refused_with_the_number_that_fits() {
        let of = |spheres| Params {
            spheres,
            ..crate::test_support::params()
        };
        let installed = 1e9;
        let message = refusal([of(90), of(1_000_000)].iter(), installed).unwrap();
        let fits = message.split(' ').rev().nth(1).unwrap().parse().unwrap();
        assert!(
            message.contains("a run of 1000000 needs about"),
            "{message}"
        );
        assert_eq!(refusal([of(fits)].iter(), installed), None);
        assert!(refusal([of(fits + 1)].iter(), installed).is_some());
    }
}
