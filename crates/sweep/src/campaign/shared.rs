//! Points that share their runs: friction has no effect at Γ = 0, nor has the shear rate without
//! friction.
//!
//! Such points are one case, by [`sd_core::Params::settle`]. A file may name several of them, and a
//! user who requested three shear rates expects three points.

use super::grid::Grid;
use super::protocol::Written;
use crate::model::axes::{Identity, identity};
use crate::model::case::{Case, CaseKey};
use sd_core::Params;
use std::collections::{HashMap, HashSet};
use std::ops::Range;

/// These points of the grids, in the order of the file, each with the position of the case that
/// follows it.
pub(super) fn shared(
    grids: &[Grid],
    protocol: &Written,
    cases: &[(CaseKey, Case)],
) -> Vec<(u64, Params)> {
    // Expanding a large campaign takes time, and most have no such point.
    if !grids.iter().any(Grid::may_fold) {
        return Vec::new();
    }
    // Where the first cases of each point are.
    let mut places: HashMap<Identity, Range<usize>> = HashMap::new();
    for (place, (_, case)) in cases.iter().enumerate() {
        let point = identity(&without_start(&case.params));
        let first = places.entry(point).or_insert(place..place);
        if first.end == place {
            first.end += 1;
        }
    }
    let mut all: Vec<(usize, Identity, Params)> = Vec::new();
    let mut sharing = HashSet::new();
    let mut next = 0;
    for grid in grids {
        grid.each_point(protocol, |as_written, settled| {
            let point = identity(settled);
            let own = places.get(&point).cloned().unwrap_or(next..next);
            let follows = next.max(own.start);
            next = next.max(own.end);
            if identity(as_written) != point {
                sharing.insert(point.clone());
            }
            all.push((follows, point, as_written.clone()));
        });
    }
    let mut seen = HashSet::new();
    all.retain(|(_, point, written)| sharing.contains(point) && seen.insert(identity(written)));
    let shared = all.into_iter();
    shared
        .map(|(follows, _, params)| (follows as u64, params))
        .collect()
}

/// Parameters as in a grid before its start layers are read.
fn without_start(params: &Params) -> Params {
    Params {
        start: None,
        ..params.clone()
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn points_that_share_their_runs_stand_where_the_file_has_them() {
        let text = "name = \"n\"\n[[grid]]\narea_fraction = 0.5\nfriction = [0, 0.3]\nroughness = 0.01\n\
                    shear_rate = [0, 1.0, inf]\nspheres = 20\nseeds = 2\n";
        let campaign = crate::campaign::parse("n.toml", text.into()).unwrap();
        // Without friction one case for three rates, and with it at the rate 0 the same.
        assert_eq!((campaign.cases.len(), campaign.folded), (3 * 2, 3 * 2));
        let shared = campaign.written.shared.iter();
        let shared: Vec<_> = shared
            .map(|(follows, point)| (*follows, point.friction, point.shear_rate))
            .collect();
        let inf = f64::INFINITY;
        assert_eq!(
            shared,
            [(0, 0.0, 0.0), (2, 0.0, 1.0), (2, 0.0, inf), (2, 0.3, 0.0)]
        );
        let plain = text.replace("[0, 0.3]", "0.3").replace("[0, 1.0", "[1.0");
        let plain = crate::campaign::parse("n.toml", plain).unwrap();
        assert!(plain.written.shared.is_empty());
    }
}
