//! One `[[grid]]`: the product of its axes.

use super::axis_values::{SIZES, axis_values};
use super::error::Problem;
use super::imposed_keys::keys_of;
use super::protocol::WrittenProtocol;
use super::reader::{Faults, Located, Reader, Values};
use super::seeds::{SEEDS, Seeds};
use super::start::{Layers, START, Start, is_equilibrium};
use crate::data::Value;
use crate::model::axes::{AXES, Axis, InvalidCombination, folded_params_of, params_of};
use crate::model::case::Case;
use sd_core::Params;
use sd_core::model::{Form, Refusal};
use std::ops;
use std::path::Path;
use toml::de::DeTable;

/// The values of one grid.
#[derive(Debug)]
pub(super) struct Grid<'t> {
    table: Reader<'t>,
    /// Values of each axis; `None` where it is absent.
    axes: Vec<Option<Values>>,
    pub(super) seeds: Seeds,
    /// Start layers, if they are given.
    pub(super) start: Option<Start>,
    /// Whether all its values could be read.
    pub(super) is_whole: bool,
}

/// The key of the stiffness of tangential springs.
const TANGENTIAL_STIFFNESS: &str = "tangential_stiffness";
/// Number of problems of one grid after which the check stops.
const MAX_PROBLEMS: usize = 200;

/// One value of each axis of the file.
type Combination<'g> = Vec<Option<&'g Located<Value>>>;

impl<'t> Grid<'t> {
    /// Reads a grid and checks the range of every value in it. The protocol's values count where
    /// the grid has none. Relative paths of start layers begin at `folder`.
    pub(super) fn read(
        (span, entries): (ops::Range<usize>, &'t DeTable<'t>),
        protocol: &WrittenProtocol<'t>,
        folder: &Path,
        faults: &'t Faults,
    ) -> Self {
        let known = AXES.iter().map(|axis| axis.key);
        let written = AXES.iter().filter_map(Axis::written_key);
        let known: Vec<&str> = known.chain([SEEDS]).chain(written).collect();
        let table = Reader::new(entries, span, "[[grid]]", &known, faults);
        let mut shear = AXES.iter().filter(|axis| axis.is_of_shear());
        let imposes = shear.any(|axis| table.get(axis.key).is_some());
        let axes = AXES
            .iter()
            .map(|axis| match keys_of(axis).find_map(|key| table.get(key)) {
                // A layer, which is no number.
                Some(_) if axis.key == START => None,
                Some(written) => {
                    let values = axis_values(written, axis, faults);
                    values.map(|values| protocol.converted(axis, values))
                }
                None => protocol.value_of(axis, imposes),
            });
        let axes = axes.collect();
        let seeds = Seeds::read(&table);
        if let Some(sizes) = table.get(SIZES) {
            for key in ["size_ratio", "large_fraction"] {
                if table.get(key).is_some() {
                    let problem = format!("`{key}` and `sizes` both set the sizes of the spheres");
                    faults.push(
                        Problem::at(&table.place(key), problem, "one of them in a grid")
                            .also(&sizes.span(), "and here")
                            .of_key(key),
                    );
                }
            }
        }
        let start = match (table.get("volume_fraction"), table.get(START)) {
            (Some(fraction), Some(written)) if !is_equilibrium(written) => {
                let problem = "`start` gives a layer, and a suspension cannot begin with one";
                let allowed = "`start` = \"equilibrium\", or none: then the seed packs the spheres of a suspension; to shear them \
                               first one way and then another, give the run segments, `[[protocol.segment]]`";
                let problem = Problem::at(&written.span(), problem, allowed).of_key(START);
                faults.push(problem.also(&fraction.span(), "a suspension"));
                None
            }
            _ => Start::read(&table, folder),
        };
        if let Some(start) = &start
            && matches!(start.layers, Layers::File(_))
            && seeds.most() > 1
        {
            let problem = "every seed would give the same run: the layer is in the file";
            let problem = Problem::at(&start.span, problem, "`seeds = 1` with a start layer");
            faults.push(problem.labelled("no seed makes this layer"));
        }
        Self {
            is_whole: table.is_whole(),
            table,
            axes,
            seeds,
            start,
        }
    }

    /// Start of its table.
    pub(super) fn span(&self) -> &ops::Range<usize> {
        &self.table.span
    }

    /// Records missing axes of a grid whose values cannot be expanded.
    pub(super) fn note_missing(&self) {
        let value = |(axis, values): (&Axis, &Option<Values>)| match (values, &axis.form) {
            (Some(values), _) => Some(values.all[0].value),
            (None, _) if self.table.get(axis.key).is_none() => None,
            // Faults of this key are recorded already, so any value serves; of numbers, one that
            // is not "none".
            (None, Form::Choice(choice)) => Some(Value::Word(choice.default)),
            (None, Form::Number(_)) => Some(Value::Number(1.0)),
        };
        let values: Vec<Option<Value>> = AXES.iter().zip(&self.axes).map(value).collect();
        if let Err(InvalidCombination::Missing(axes)) = params_of(&values) {
            for axis in axes {
                self.table.note_missing(axis.key, &example(axis));
            }
        }
    }

    /// Number of cases.
    pub(super) fn len(&self) -> u64 {
        let lengths = self.axes.iter().flatten().map(|values| values.all.len());
        lengths
            .map(|n| n as u64)
            .chain([self.seeds.most().max(1)])
            .fold(1, u64::saturating_mul)
    }

    /// Passes on the cases, seeds innermost and the first axis outermost, and records conflicting
    /// values. Where values have no effect, several cases can be identical; where the cause is
    /// friction without rate or rate without friction, each comes with its parameters as given.
    pub(super) fn lay_out(
        &self,
        protocol: &WrittenProtocol<'_>,
        mut take: impl FnMut(Case, Option<&Params>),
    ) {
        let mut known = Vec::new();
        let mut meaning = vec![false; AXES.len()];
        let mut has_springs = [false; 2];
        let segments = protocol.protocol.imposed();
        self.each(|combination| {
            if known.len() > MAX_PROBLEMS {
                return;
            }
            let (params, given) = match folded_params_of(&values_of(combination), &segments) {
                Ok(made) => made,
                Err(InvalidCombination::Refused(refusal)) => {
                    note(self.refused(combination, &refusal), &mut known);
                    return;
                }
                Err(InvalidCombination::Missing(axes)) => {
                    for axis in axes {
                        note(self.missing(combination, axis), &mut known);
                    }
                    return;
                }
            };
            let laws = params.contact.laws();
            if laws.tangential.has_spring() {
                has_springs[usize::from(laws.has_rigid_springs())] = true;
            }
            for (means, axis) in meaning.iter_mut().zip(AXES.iter()) {
                *means |= axis.means_something(&params);
            }
            for seed in self.seeds.all() {
                match self.begun(combination, &params, seed, protocol) {
                    Ok(params) => {
                        take(Case::new(params, seed, &protocol.protocol), given.as_ref());
                    }
                    Err(problem) => {
                        note(problem, &mut known);
                        break;
                    }
                }
            }
        });
        if let (Some(written), [true, true]) = (self.table.get(TANGENTIAL_STIFFNESS), has_springs) {
            let problem = format!(
                "`{TANGENTIAL_STIFFNESS}` has two units in this grid: over the stiffness of springs, and in F/a of rigid contacts"
            );
            let allowed = "a grid for springs and one for rigid contacts";
            known.push(Problem::at(&written.span(), problem, allowed).of_key(TANGENTIAL_STIFFNESS));
        }
        // Without any valid combination no axis has a meaning.
        if meaning.contains(&true) {
            let axes = AXES.iter().zip(&self.axes).zip(meaning);
            let without = axes.filter(|(_, means)| !means);
            known.extend(without.filter_map(|((axis, values), _)| {
                Some(self.without_meaning(axis, values.as_ref()?, axis.needs?()))
            }));
        }
        for problem in known {
            self.table.faults.push(problem);
        }
    }

    /// The problem of an axis that has no meaning in any of the cases.
    fn without_meaning(
        &self,
        axis: &Axis,
        values: &Values,
        needs: impl std::fmt::Display,
    ) -> Problem {
        let stress = AXES.iter().position(Axis::is_shear_stress);
        let stress = stress.and_then(|at| self.axes[at].as_ref());
        match stress.filter(|_| axis.is_shear_rate()) {
            Some(stress) => Problem::at(
                &values.span,
                "`shear_rate` and `shear_stress` are both imposed",
                "one of them per grid: the other follows from the viscosity",
            )
            .also(&stress.span, "and here"),
            None => Problem::at(
                &values.span,
                format!("`{}` has no meaning in this grid", axis.key),
                format!("remove it, or choose {needs}"),
            ),
        }
    }

    /// Calls a function for every combination of values, the last axis changing first.
    fn each<'g>(&'g self, mut take: impl FnMut(&Combination<'g>)) {
        let mut places = vec![0; self.axes.len()];
        loop {
            let values = self.axes.iter().zip(&places);
            let combination: Combination<'_> = values
                .map(|(values, place)| Some(&values.as_ref()?.all[*place]))
                .collect();
            take(&combination);
            let next = (0..places.len()).rev().find(|axis| {
                let values = self.axes[*axis].as_ref();
                places[*axis] + 1 < values.map_or(1, |values| values.all.len())
            });
            let Some(axis) = next else {
                return;
            };
            places[axis] += 1;
            places[axis + 1..].fill(0);
        }
    }

    /// The parameters of the run with that seed, checked, with its start layer if one is given.
    fn begun(
        &self,
        combination: &Combination<'_>,
        params: &Params,
        seed: u64,
        protocol: &WrittenProtocol<'_>,
    ) -> Result<Params, Problem> {
        let start = self.start.as_ref().map(|start| start.of_seed(seed));
        let params = Params {
            start: start.transpose()?,
            ..params.clone()
        };
        let made = |error| match error {
            sd_core::Error::Refused(refusal) => self.refused(combination, &refusal),
            other => Problem::at(self.span(), other.to_string(), "other values in this grid"),
        };
        let time_step = || place(combination, "time_step");
        if !params.segments.is_empty() {
            protocol.check_lengths(params.time_step, time_step())?;
            let flows = params.flows().into_iter().zip(&params.segments);
            for (number, (mut flow, segment)) in flows.enumerate() {
                flow.canonicalise();
                let crossed = segment.check_cross_shear(&params);
                if let Err(error) = flow.validate().and_then(|()| Ok(crossed?)) {
                    return Err(protocol.of_segment(number, made(error)));
                }
            }
        }
        let checked = params
            .validate()
            .and_then(|()| sd_core::start::check(&params));
        checked.map_err(made)?;
        protocol.check_lengths(params.time_step, time_step())?;
        Ok(params)
    }

    /// The problem of a value that conflicts with others.
    fn refused(&self, combination: &Combination<'_>, refusal: &Refusal) -> Problem {
        let key = refusal.key;
        let start = self.start.as_ref().filter(|_| key == START);
        let written = place(combination, key).or(start.map(|start| &start.span));
        let problem = Problem::at(
            written.unwrap_or(self.span()),
            format!("`{key}` = {} {}", refusal.value, refusal.problem),
            &refusal.allowed,
        )
        .of_value(key, &refusal.value);
        let because = refusal.because.filter(|because| *because != key);
        match because.and_then(|key| Some((key, place(combination, key)?))) {
            Some((key, place)) => problem.also(place, format!("with this `{key}`")),
            None => problem,
        }
    }

    /// The problem of an axis that must have a value, and the choice that requires it.
    fn missing(&self, combination: &Combination<'_>, axis: &Axis) -> Problem {
        let problem = self.table.missing(axis.key, &example(axis));
        let is_needed_without = |at: usize| {
            let mut values = values_of(combination);
            values[at] = None;
            match params_of(&values) {
                Err(InvalidCombination::Missing(axes)) => {
                    axes.iter().any(|missing| missing.key == axis.key)
                }
                Err(InvalidCombination::Refused(_)) => true,
                Ok(_) => false,
            }
        };
        let mut choices = AXES.iter().zip(combination).enumerate();
        let choice = choices.find_map(|(at, (choice, written))| {
            let written = written.filter(|_| !choice.is_numeric())?;
            (!is_needed_without(at)).then_some((choice.key, &written.span))
        });
        match choice {
            Some((key, place)) => problem.also(place, format!("for this `{key}`")),
            None => problem,
        }
    }
}

/// Records a problem of a grid unless it is known: the same values meet in many combinations.
pub(super) fn note(problem: Problem, known: &mut Vec<Problem>) {
    let same = |other: &Problem| {
        let places = other.labels.iter().map(|label| &label.0);
        other.message == problem.message && places.eq(problem.labels.iter().map(|label| &label.0))
    };
    if !known.iter().any(same) {
        known.push(problem);
    }
}

/// The values of a combination.
fn values_of(combination: &Combination<'_>) -> Vec<Option<Value>> {
    let written = combination.iter();
    written.map(|written| Some((*written)?.value)).collect()
}

/// Place of the value of an axis, if it is in the file.
fn place<'g>(combination: &Combination<'g>, key: &str) -> Option<&'g ops::Range<usize>> {
    let at = AXES.iter().position(|axis| axis.key == key)?;
    Some(&combination[at]?.span)
}

/// An example for an axis, with a note about its unit.
fn example(axis: &Axis) -> String {
    let note = match &axis.form {
        Form::Number(number) if !number.quantity.note.is_empty() => {
            format!(" ({})", number.quantity.note)
        }
        _ => String::new(),
    };
    let or = if axis.is_shear_rate() {
        ", or impose the stress: `shear_stress = [0.1, 1.0, 10.0]`"
    } else if axis.is_fraction() {
        ", or fill a volume: `volume_fraction = 0.45`"
    } else {
        ""
    };
    format!(
        "add for example `{} = {}`{note}{or}",
        axis.key,
        axis.example()
    )
}
