//! Units and meanings of the columns of runs and of samples.

use crate::data::{Cells, DataColumn};
use crate::measure::sampled::named;
use crate::model::axes::AXES;

/// Name, unit and meaning of a column.
type Meaning = (&'static str, &'static str, &'static str);
/// Its unit and meaning.
type Found = (&'static str, &'static str);

/// Columns that identify a row.
#[rustfmt::skip]
const OF_ROWS: &[Meaning] = &[
    ("key", "", "the run: a hash of all that determines its result"),
    ("seed", "1", "seed of its random numbers"),
    ("step", "1", "steps from the start of the run"),
];

/// Columns of runs.
#[rustfmt::skip]
const OF_RUNS: &[Meaning] = &[
    ("state", "", "pending, running, done, jammed or failed"),
    ("discard_step", "1", "first step whose sample is averaged"),
    ("samples", "1", "samples averaged"),
    ("viscosity", "mu", "mean in time of the viscosity in full"),
    ("viscosity_quartile_1", "mu", "first quartile in time of the viscosity"),
    ("viscosity_median", "mu", "median in time of the viscosity"),
    ("viscosity_quartile_3", "mu", "third quartile in time of the viscosity"),
    ("viscosity_stresslet", "mu", "mean in time of the viscosity without contact stress"),
    ("viscosity_stresslet_quartile_1", "mu", "its first quartile in time"),
    ("viscosity_stresslet_median", "mu", "its median in time"),
    ("viscosity_stresslet_quartile_3", "mu", "its third quartile in time"),
    ("normal_stress_difference", "mu rate", "mean in time of the first normal stress difference"),
    ("contacts_per_sphere", "1", "pairs with a contact force over spheres, mean in time"),
    ("activated_fraction", "1", "contacts above the critical load over contacts"),
    ("rolling_fraction", "1", "rolling contacts over activated ones"),
    ("mean_approach_velocity", "a rate", "over all contacts of all samples, positive for approach"),
    ("contacts", "1", "contacts, summed over the samples"),
    ("activated", "1", "contacts above the critical load, summed over the samples"),
    ("rolling", "1", "rolling contacts, summed over the samples"),
    ("approach", "a rate", "approach velocities, summed over contacts and samples"),
    ("minimum_gap", "a", "smallest gap of all stages, the discarded strain included"),
    ("jammed_strain", "1", "strain above the threshold of jamming"),
    ("final_strain", "1", "strain at its end"),
    ("wall_time_s", "s", "wall time of computing"),
    ("cpu_time_s", "s", "CPU time"),
    ("resumed", "1", "times it was resumed from a checkpoint"),
    ("finished_at", "ms", "when it ended, since 1970"),
    ("doubts", "", "why its numbers are doubtful"),
    ("viscosity_part_1", "mu", "mean viscosity over the first quarter of the strain kept"),
    ("viscosity_part_2", "mu", "the same over the second quarter"),
    ("viscosity_part_3", "mu", "the same over the third quarter"),
    ("viscosity_part_4", "mu", "the same over the last quarter"),
    ("viscosity_variance", "mu²", "variance in time of the viscosity"),
    ("viscosity_correlation", "1", "samples after which the viscosity counts as independent"),
];

/// Sets unit and meaning of a column of runs.
pub(super) fn explain_of_runs(column: &mut DataColumn) {
    let own = listed(OF_RUNS, &column.name);
    explain(column, |axis, number| own.or(axis).or(number));
}

/// Sets unit and meaning of a column of samples.
pub(super) fn explain_of_samples(column: &mut DataColumn) {
    explain(column, |axis, number| number.or(axis));
}

/// Sets a property of a column from the axis or the number of a sample with its name.
fn explain(
    column: &mut DataColumn,
    choose: impl FnOnce(Option<Found>, Option<Found>) -> Option<Found>,
) {
    let name = column.name.as_ref();
    let axis = AXES.iter().find(|axis| axis.key == name);
    let axis = axis.map(|axis| (axis.unit, axis.meaning));
    let number = named(name).map(|number| (number.unit, number.meaning));
    let found = listed(OF_ROWS, name).or_else(|| choose(axis, number));
    if let Some((unit, meaning)) = found {
        // A choice is a keyword in samples and runs, whatever its unit.
        let is_word = matches!(column.cells, Cells::Word(_));
        column.unit = if is_word { "" } else { unit };
        column.meaning = meaning;
    }
}

/// The entry of a name in a list.
fn listed(list: &[Meaning], name: &str) -> Option<Found> {
    let known = list.iter().find(|known| known.0 == name);
    known.map(|(_, unit, meaning)| (*unit, *meaning))
}
