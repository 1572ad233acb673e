//! Points that share their runs: friction has no effect at Γ = 0, nor has the shear rate without
//! friction.
//!
//! Such points are one case, by [`sd_core::Params::settle`]. A file may name several of them, and a
//! user who requested three shear rates expects three points.

use super::grid::Grid;
use super::reader::Table;
use super::{grids, protocol_of};
use crate::model::axes::{Identity, identity};
use sd_core::Params;
use std::collections::HashMap;
use toml::de::DeTable;

/// The points of a file as written.
#[derive(Debug, Default)]
pub(crate) struct WrittenPoints {
    /// Position of each in the file, without its start layer.
    places: HashMap<Identity, usize>,
    /// Points that share their runs with others, by the parameters of these runs.
    folded: HashMap<Identity, Vec<Params>>,
}

impl WrittenPoints {
    /// The points of the text of a campaign file that was read before.
    pub(crate) fn of(text: &str) -> Self {
        let mut points = Self::default();
        let Ok(document) = DeTable::parse(text) else {
            return points;
        };
        let mut problems = Vec::new();
        let top = Table::new(document.get_ref(), 0..0, "the campaign", &[], &mut problems);
        let protocol = protocol_of(&top, 0..0, &mut problems);
        let tables = grids(&top, &mut problems).into_iter();
        let grids: Vec<Grid> = tables
            .map(|(span, entries)| Grid::read(entries, span, &protocol, None, &mut problems))
            .collect();
        // Expanding a large campaign takes time, and most have no such point.
        if !grids.iter().any(Grid::may_fold) {
            return points;
        }
        for grid in &grids {
            grid.each_point(&protocol, |as_written, settled| {
                let next = points.places.len();
                points.places.entry(identity(as_written)).or_insert(next);
                let all = points.folded.entry(identity(settled)).or_default();
                if !all.contains(as_written) {
                    all.push(as_written.clone());
                }
            });
        }
        points
            .folded
            .retain(|own, all| all.iter().any(|point| identity(point) != *own));
        points
    }

    /// Whether no two points share their runs.
    pub(crate) fn is_plain(&self) -> bool {
        self.folded.is_empty()
    }

    /// The points that the runs of these parameters belong to: at least these parameters
    /// themselves.
    pub(crate) fn of_run(&self, params: &Params) -> Vec<Params> {
        let Some(all) = self.folded.get(&identity(&without_start(params))) else {
            return vec![params.clone()];
        };
        let begun = all.iter().map(|point| Params {
            start: params.start.clone(),
            ..point.clone()
        });
        begun.collect()
    }

    /// Position of a point in the file.
    pub(crate) fn place(&self, params: &Params) -> usize {
        let place = self.places.get(&identity(&without_start(params)));
        place.copied().unwrap_or(usize::MAX)
    }
}

/// The same parameters, as in a grid before its start layers are read.
fn without_start(params: &Params) -> Params {
    Params {
        start: None,
        ..params.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_share_their_runs_stand_where_the_file_has_them() {
        let text = "name = \"n\"\n[[grid]]\narea_fraction = 0.5\nfriction = [0, 0.3]\nroughness = 0.01\n\
                    shear_rate = [0, 1.0, inf]\nspheres = 20\nseeds = 2\n";
        let points = WrittenPoints::of(text);
        let campaign = crate::campaign::parse("n.toml", text.into()).unwrap();
        // Without friction one case for three rates, and with it at the rate 0 the same.
        assert_eq!(campaign.cases.len(), 3 * 2);
        assert_eq!(campaign.folded, 3 * 2);
        let shown: Vec<(f64, f64, usize)> = campaign
            .cases
            .iter()
            .step_by(2)
            .flat_map(|(_, case)| points.of_run(&case.params))
            .map(|point| (point.friction, point.shear_rate, points.place(&point)))
            .collect();
        let inf = f64::INFINITY;
        assert_eq!(
            shown,
            [
                (0.0, 0.0, 0),
                (0.0, 1.0, 1),
                (0.0, inf, 2),
                (0.3, 0.0, 3),
                (0.3, 1.0, 4),
                (0.3, inf, 5)
            ]
        );
        assert!(!points.is_plain());
        let plain = WrittenPoints::of(&text.replace("[0, 0.3]", "0.3").replace("[0, 1.0", "[1.0"));
        assert!(plain.is_plain());
    }
}
