//! One `[[grid]]`: the product of its axes.

mod begins;

use super::error::Problem;
use super::protocol::Written;
use super::reader::{Located, Table, Values, nearest, of_axis, values};
use super::seeds::{SEEDS, Seeds};
use super::sizes::SIZES;
use crate::data::Value;
use crate::model::axes::{AXES, Axis, InvalidCombination, folded_params_of, params_of};
use crate::model::case::Case;
use begins::{Start, start_layer};
use sd_core::Params;
use sd_core::model::{Form, Refusal};
use std::ops;
use std::path::Path;
use toml::Spanned;
use toml::de::DeTable;

/// The key of the start layer.
const START: &str = "start";

/// The values of one grid.
#[derive(Debug)]
pub(super) struct Grid {
    /// Start of its table.
    pub(super) span: ops::Range<usize>,
    /// Values of each axis; `None` where it is absent.
    axes: Vec<Option<Values>>,
    pub(super) seeds: Seeds,
    /// The start layer of all its runs, if one is given.
    start: Option<Located<Start>>,
    /// Whether all its values could be read.
    pub(super) is_whole: bool,
}

/// Number of problems of one grid after which the check stops.
const MAX_PROBLEMS: usize = 200;

/// One value of each axis of the file.
type Combination<'g> = Vec<Option<&'g Located<Value>>>;

impl Grid {
    /// Reads a grid and checks the range of every value in it. The protocol's values count where
    /// the grid has none. Start layers are read if the folder of their relative paths is given.
    pub(super) fn read(
        entries: &DeTable<'_>,
        span: ops::Range<usize>,
        protocol: &Written,
        folder: Option<&Path>,
        problems: &mut Vec<Problem>,
    ) -> Self {
        let known: Vec<&str> = AXES.iter().map(|axis| axis.key).chain([SEEDS]).collect();
        let table = Table::new(entries, span.clone(), "[[grid]]", &known, problems);
        let before = problems.len();
        let mut shear = AXES.iter().filter(|axis| axis.is_of_shear());
        let imposes = shear.any(|axis| table.get(axis.key).is_some());
        let axes: Vec<Option<Values>> = AXES
            .iter()
            .map(|axis| match table.get(axis.key) {
                // A layer, which is no number.
                Some(_) if axis.key == START => None,
                Some(written) => values(written, axis.key, problems, |value| of_axis(value, axis)),
                None => protocol.value_of(axis, imposes),
            })
            .collect();
        let seeds = if let Some(written) = table.get(SEEDS) {
            Seeds::read(written, problems)
        } else {
            problems.extend(table.missing(SEEDS, "8"));
            Seeds::List(Vec::new())
        };
        if let Some(sizes) = table.get(SIZES) {
            for key in ["size_ratio", "large_fraction"] {
                if let Some(other) = table.get(key) {
                    problems.push(
                        Problem::at(
                            &other.span(),
                            format!("`{key}` and `sizes` both set the sizes of the spheres"),
                            "one of them in a grid",
                        )
                        .also(&sizes.span(), "and here")
                        .of_key(key),
                    );
                }
            }
        }
        let start = table
            .get(START)
            .zip(folder)
            .and_then(|(written, folder)| start_layer(written, folder, problems));
        if let Some(
            start @ Located {
                value: Start::File(_),
                ..
            },
        ) = &start
            && seeds.most() > 1
        {
            problems.push(
                Problem::at(
                    &start.span,
                    "every seed would give the same run: the layer is in the file",
                    "`seeds = 1` with a start layer",
                )
                .labelled("no seed makes this layer"),
            );
        }
        Self {
            start,
            is_whole: table.is_known && problems.len() == before,
            span,
            axes,
            seeds,
        }
    }

    /// Records missing axes of a grid whose values cannot be expanded.
    pub(super) fn note_missing(&self, entries: &DeTable<'_>, problems: &mut Vec<Problem>) {
        let values: Vec<Option<Value>> = AXES
            .iter()
            .zip(&self.axes)
            .map(|(axis, values)| match (values, &axis.form) {
                (Some(values), _) => Some(values.all[0].value),
                (None, _) if !entries.contains_key(axis.key) => None,
                // Faults of this key are recorded already, so any value serves; of numbers, one
                // that is not "none".
                (None, Form::Choice(choice)) => Some(Value::Word(choice.default)),
                (None, Form::Number(_)) => Some(Value::Number(1.0)),
            })
            .collect();
        let meant = |axis: &Axis| {
            let keys = entries.keys().map(Spanned::get_ref);
            let axes = || AXES.iter().map(|axis| axis.key);
            keys.filter(|key| !axes().any(|known| known == key.as_ref()))
                .any(|key| nearest(key, axes()) == Some(axis.key))
        };
        if let Err(InvalidCombination::Missing(axes)) = params_of(&values) {
            problems.extend(
                axes.into_iter()
                    .filter(|axis| !meant(axis))
                    .map(|axis| self.missing(axis)),
            );
        }
    }

    /// The values of an axis, if the file has it.
    fn written(&self, is_wanted: impl Fn(&Axis) -> bool) -> Option<&Values> {
        let place = AXES.iter().position(is_wanted)?;
        self.axes[place].as_ref()
    }

    /// The problem of an axis that must have a value.
    fn missing(&self, axis: &Axis) -> Problem {
        let message = format!("[[grid]] has no `{}`", axis.key);
        Problem::at(&self.span, message, example(axis))
            .labelled(format!("needs `{}`", axis.key))
            .of_key(axis.key)
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
    /// values. Where values have no effect, several cases can be identical; each comes with a flag
    /// that says whether the cause is friction without rate or rate without friction.
    pub(super) fn lay_out(
        &self,
        protocol: &Written,
        problems: &mut Vec<Problem>,
        mut take: impl FnMut(Case, bool, &mut Vec<Problem>),
    ) {
        let mut new = Vec::new();
        let mut meaning = vec![false; AXES.len()];
        let mut any = false;
        let segments = protocol.protocol.imposed();
        self.each(|combination| {
            if new.len() > MAX_PROBLEMS {
                return;
            }
            let values = values_of(combination);
            let (params, given) = match folded_params_of(&values, &segments) {
                Ok(made) => made,
                Err(unmade) => {
                    for problem in self.unmade(combination, unmade) {
                        self.note(problem, &mut new);
                    }
                    return;
                }
            };
            any = true;
            for (means, axis) in meaning.iter_mut().zip(AXES.iter()) {
                *means |= axis.means_something(&params);
            }
            for seed in self.seeds.all() {
                let checked = self.begun(&params, seed).and_then(|params| {
                    self.check(combination, &params, protocol)?;
                    Ok(params)
                });
                match checked {
                    Err(problem) => {
                        self.note(problem, &mut new);
                        break;
                    }
                    Ok(params) => {
                        let case = Case::new(params, seed, &protocol.protocol);
                        take(case, given.is_some(), &mut new);
                    }
                }
            }
        });
        for ((axis, written), _) in AXES
            .iter()
            .zip(&self.axes)
            .zip(meaning)
            .filter(|(_, means)| any && !means)
        {
            if let (Some(needs), Some(values)) = (axis.needs, written) {
                let stress = self.written(Axis::is_shear_stress);
                new.push(match stress.filter(|_| axis.is_shear_rate()) {
                    Some(stress) => Problem::at(
                        &values.span,
                        "`shear_rate` and `shear_stress` are both imposed",
                        "one of them per grid: the other follows from the viscosity",
                    )
                    .also(&stress.span, "and here"),
                    None => Problem::at(
                        &values.span,
                        format!("`{}` has no meaning in this grid", axis.key),
                        format!("remove it, or choose {}", needs()),
                    ),
                });
            }
        }
        problems.append(&mut new);
    }

    /// Whether points may share their runs: some value has no friction or is the lower plateau.
    pub(super) fn may_fold(&self) -> bool {
        let without = |axis: &Axis, value: Value| match axis.key {
            "friction" | "shear_rate" => value == Value::Number(0.0),
            "tangential" => value == Value::Word("none"),
            _ => false,
        };
        let written = AXES.iter().zip(&self.axes);
        let mut written = written.filter_map(|(axis, values)| Some((axis, values.as_ref()?)));
        written.any(|(axis, values)| values.all.iter().any(|value| without(axis, value.value)))
    }

    /// Calls a function for every point, without its start layer: its parameters as written, and
    /// settled.
    pub(super) fn each_point(&self, protocol: &Written, mut take: impl FnMut(&Params, &Params)) {
        let segments = protocol.protocol.imposed();
        self.each(|combination| {
            let values = values_of(combination);
            if let Ok((params, given)) = folded_params_of(&values, &segments) {
                take(given.as_ref().unwrap_or(&params), &params);
            }
        });
    }

    /// The parameters of the run with that seed, with its start layer if one is given.
    fn begun(&self, params: &Params, seed: u64) -> Result<Params, Problem> {
        let layer = match &self.start {
            None => None,
            Some(start) => match &start.value {
                Start::File(layer) => Some(layer),
                Start::Runs(layers) => {
                    let Some((_, layer)) = layers.iter().find(|layer| layer.0 == seed) else {
                        let seeds: Vec<String> =
                            layers.iter().map(|layer| layer.0.to_string()).collect();
                        return Err(Problem::at(
                            &start.span,
                            format!("no finished run of that point has seed {seed}"),
                            format!("`seeds` among those of that point: {}", seeds.join(", ")),
                        ));
                    };
                    Some(layer)
                }
            },
        };
        Ok(Params {
            start: layer.cloned(),
            ..params.clone()
        })
    }

    /// Calls a function for every combination of values, the last axis changing first.
    fn each<'g>(&'g self, mut take: impl FnMut(&Combination<'g>)) {
        let mut places = vec![0; self.axes.len()];
        loop {
            let combination: Combination<'_> = self
                .axes
                .iter()
                .zip(&places)
                .map(|(values, place)| values.as_ref().map(|values| &values.all[*place]))
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

    /// Records a problem unless it is known: the same values meet in many combinations.
    pub(super) fn note(&self, problem: Problem, known: &mut Vec<Problem>) {
        // Problems differ in their places, except those of the whole grid.
        let same = |other: &Problem| {
            let places = other.labels.iter().map(|label| &label.0);
            let of_the_grid = other.labels.iter().all(|label| label.0 == self.span);
            places.eq(problem.labels.iter().map(|label| &label.0))
                && (!of_the_grid || other.message == problem.message)
        };
        if !known.iter().any(same) {
            known.push(problem);
        }
    }

    /// Checks the values of one combination and their start layer.
    fn check(
        &self,
        combination: &Combination<'_>,
        params: &Params,
        protocol: &Written,
    ) -> Result<(), Problem> {
        let made = |error| match error {
            sd_core::Error::Refused(refusal) => self.refused(combination, &refusal),
            other => Problem::at(&self.span, other.to_string(), "other values in this grid"),
        };
        if !params.segments.is_empty() {
            protocol.check_lengths(params.time_step, place(combination, "time_step"))?;
            let flows = params.flows();
            for (number, (mut flow, segment)) in flows.into_iter().zip(&params.segments).enumerate()
            {
                flow.settle();
                let crossed = segment.check_cross_shear(params);
                if let Err(error) = flow.validate().and_then(|()| Ok(crossed?)) {
                    return Err(protocol.of_segment(number, made(error)));
                }
            }
        }
        params
            .validate()
            .and_then(|()| sd_core::start::check(params))
            .map_err(made)?;
        protocol.check_lengths(params.time_step, place(combination, "time_step"))
    }

    /// The problems of an invalid combination of values.
    fn unmade(&self, combination: &Combination<'_>, unmade: InvalidCombination) -> Vec<Problem> {
        match unmade {
            InvalidCombination::Refused(refusal) => vec![self.refused(combination, &refusal)],
            InvalidCombination::Missing(axes) => axes
                .into_iter()
                .map(|axis| {
                    let problem = self.missing(axis);
                    match choice_that_needs(combination, axis) {
                        Some((key, place)) => problem.also(place, format!("for this `{key}`")),
                        None => problem,
                    }
                })
                .collect(),
        }
    }

    /// The problem of a value that conflicts with others.
    fn refused(&self, combination: &Combination<'_>, refusal: &Refusal) -> Problem {
        let Refusal {
            key,
            value,
            problem,
            allowed,
            because,
        } = refusal;
        let start = self.start.as_ref().filter(|_| *key == START);
        let written = place(combination, key).or(start.map(|start| &start.span));
        let problem = Problem::at(
            written.unwrap_or(&self.span),
            format!("`{key}` = {value} {problem}"),
            allowed,
        )
        .of_value(key, value);
        let because = because.filter(|because| because != key);
        match because.and_then(|key| Some((key, place(combination, key)?))) {
            Some((key, place)) => problem.also(place, format!("with this `{key}`")),
            None => problem,
        }
    }
}

/// The choice that makes an axis required: its key and its place.
fn choice_that_needs<'g>(
    combination: &Combination<'g>,
    axis: &Axis,
) -> Option<(&'static str, &'g ops::Range<usize>)> {
    let values = |without: usize| -> Vec<Option<Value>> {
        let others = combination.iter().enumerate();
        others
            .map(|(at, written)| Some(written.filter(|_| at != without)?.value))
            .collect()
    };
    let choices = AXES.iter().zip(combination).enumerate();
    choices
        .filter(|(_, (choice, _))| !choice.is_numeric())
        .find_map(|(at, (choice, written))| {
            let written = (*written)?;
            let needed = match params_of(&values(at)) {
                Err(InvalidCombination::Missing(axes)) => {
                    axes.iter().any(|missing| missing.key == axis.key)
                }
                Err(InvalidCombination::Refused(_)) => true,
                Ok(_) => false,
            };
            (!needed).then_some((choice.key, &written.span))
        })
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
        Form::Number(number) => number.quantity.note,
        Form::Choice(_) => "",
    };
    let or = if axis.is_shear_rate() {
        ", or impose the stress: `shear_stress = [0.1, 1.0, 10.0]`"
    } else if axis.is_fraction() {
        ", or fill a volume: `volume_fraction = 0.45`"
    } else {
        ""
    };
    let example = format!("add for example `{} = {}`", axis.key, axis.example());
    if note.is_empty() {
        format!("{example}{or}")
    } else {
        format!("{example} ({note}){or}")
    }
}
