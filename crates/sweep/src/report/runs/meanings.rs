//! Units and meanings of the columns of runs and of samples.

use crate::axes::AXES;
use crate::data::{Cells, DataColumn};
use crate::model::networks::NETWORK;
use crate::model::stresses::STRESSES;
use crate::structure::meaning_of;

/// Name, unit and meaning of a column.
type Meaning = (&'static str, &'static str, &'static str);

/// Columns of runs and of samples alike.
#[rustfmt::skip]
const OF_BOTH: &[Meaning] = &[
    ("key", "", "the run: a hash of all that decides its result"),
    ("seed", "1", "seed of its random numbers"),
    ("stages", "1", "contact problems solved"),
    ("unconverged_stages", "1", "contact problems that did not converge"),
    ("inexact_stages", "1", "contact problems with friction off by more than 1e-3 of the largest force"),
    ("jammed_stages", "1", "contact problems without an admissible motion"),
    ("worst_residual", "a rate", "largest residual of the contact problem"),
    ("worst_friction_error", "1", "largest inconsistency of a friction force with its law, over the largest force"),
    ("jam_events", "1", "times the viscosity rose above the threshold of jamming"),
    ("jammed_steps", "1", "steps begun above that threshold"),
    ("jammed_steps_running", "1", "steps since it was last below"),
    ("dissipation", "mu rate", "dissipation over area and rate"),
];

/// Columns of runs.
#[rustfmt::skip]
pub(super) const OF_RUNS: &[Meaning] = &[
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
    ("wall_time_s", "s", "time of computing"),
    ("cpu_time_s", "s", "time of the processor"),
    ("resumed", "1", "times it went on from a checkpoint"),
    ("finished_at", "ms", "when it ended, since 1970"),
    ("doubts", "", "why its numbers are doubtful"),
    ("viscosity_part_1", "mu", "mean viscosity over the first quarter of the strain kept"),
    ("viscosity_part_2", "mu", "the same over the second quarter"),
    ("viscosity_part_3", "mu", "the same over the third quarter"),
    ("viscosity_part_4", "mu", "the same over the last quarter"),
    ("viscosity_variance", "mu²", "variance in time of the viscosity"),
    ("viscosity_correlation", "1", "samples after which the viscosity counts as independent"),
];

/// Columns of samples.
#[rustfmt::skip]
pub(super) const OF_SAMPLES: &[Meaning] = &[
    ("step", "1", "steps from the start of the run"),
    ("strain", "1", "strain from the start of the run"),
    ("viscosity", "mu", "viscosity in full: stresslets and contact stress"),
    ("viscosity_stresslet", "mu", "viscosity without contact stress"),
    ("normal_stress_difference", "mu rate", "first normal stress difference, contacts included"),
    ("shear_rate", "1", "shear rate Γ: imposed, or what the imposed stress leaves"),
    ("contacts", "1", "pairs with a contact force"),
    ("activated", "1", "contacts above the critical load"),
    ("rolling", "1", "activated contacts that roll"),
    ("slipping", "1", "activated contacts that slip"),
    ("normal_velocity", "a rate", "mean normal velocity of the contacts, negative for approach"),
    ("minimum_gap", "a", "smallest gap in the layer"),
    ("minimum_gap_so_far", "a", "smallest gap of the run so far"),
];

/// Gives a column its unit and its meaning.
pub(super) fn explain(column: &mut DataColumn, own: &[Meaning]) {
    let name = column.name.as_ref();
    let known = own.iter().chain(OF_BOTH).find(|known| known.0 == name);
    let axis = || AXES.iter().find(|axis| axis.key == name);
    let stress = || STRESSES.iter().find(|stress| stress.name == name);
    let network = NETWORK.iter().find(|network| network.name == name);
    if let Some(network) = network {
        (column.unit, column.meaning) = ("1", meaning_of(network.name));
        return;
    }
    let found = match (known, axis(), stress()) {
        (Some((_, unit, meaning)), ..) => (*unit, *meaning),
        (None, Some(axis), _) => (axis.unit, axis.meaning),
        (None, None, Some(stress)) => ("mu rate", stress.meaning),
        (None, None, None) => return,
    };
    // A choice is a word in a sample and in a run, whatever its unit.
    let is_word = matches!(column.cells, Cells::Word(_));
    column.unit = if is_word { "" } else { found.0 };
    column.meaning = found.1;
}
