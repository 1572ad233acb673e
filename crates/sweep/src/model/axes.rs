//! The axes of a campaign: all that distinguishes its points, which a file may vary besides the
//! seeds.
//!
//! Each is made from the declaration of its parameter in [`sd_core::model::PARAMETERS`]; how it is
//! shown is in `presentation`. The campaign file, keys of cases, columns and views of the store,
//! tables, figures, pages and selections all use this one list.

mod presentation;

use crate::data::{DataColumn, Kind, Tag, Value};
use sd_core::Params;
use sd_core::model::{Form, PARAMETERS, Parameter, Refusal, Segment};
use std::borrow::Cow;
use std::collections::{BTreeSet, HashSet};
use std::ops::Deref;
use std::sync::{LazyLock, Mutex, PoisonError};

/// One axis, with everything that its parameter declares.
#[derive(Debug)]
pub struct Axis(&'static Parameter);

/// All axes, in the order of the columns and of nested loops: the first changes last.
pub static AXES: LazyLock<Vec<Axis>> = LazyLock::new(|| {
    let declared = PARAMETERS.iter();
    #[cfg(test)]
    let declared = tests::ONE_MORE.iter().chain(declared);
    declared.map(Axis).collect()
});

/// Names of axes in other programs, besides their symbols.
const OTHER_NAMES: [(&str, &str); 8] = [
    ("phi", "volume_fraction"),
    ("nu", "friction"),
    ("mu", "friction"),
    ("Gamma", "shear_rate"),
    ("gamma", "shear_rate"),
    ("sigma", "shear_stress"),
    ("dt", "time_step"),
    ("n", "spheres"),
];

impl Deref for Axis {
    type Target = Parameter;

    fn deref(&self) -> &Parameter {
        self.0
    }
}

impl Axis {
    /// The axis with this key, its words joined by `_` or `-`.
    pub fn of_key(key: &str) -> Option<&'static Self> {
        let key = key.replace('-', "_");
        AXES.iter().find(|axis| axis.key == key)
    }

    /// Its symbol, as in the heads of tables, and its names elsewhere.
    pub fn other_names(&self) -> impl Iterator<Item = &'static str> {
        let others = OTHER_NAMES.iter().filter(|(_, key)| *key == self.key);
        std::iter::once(self.symbol()).chain(others.map(|(name, _)| *name))
    }

    /// Its key in a campaign file where that differs: a file has `pressure` where the column is
    /// `imposed_pressure`, beside the measured one.
    pub fn written_key(&self) -> Option<&'static str> {
        self.key.strip_prefix("imposed_")
    }

    /// The axis of this name: its key, that in a campaign file, or one of the other names.
    pub fn named(name: &str) -> Option<&'static Self> {
        let has_name = |axis: &&Self| {
            axis.written_key() == Some(name) || axis.other_names().any(|other| other == name)
        };
        Self::of_key(name).or_else(|| AXES.iter().find(has_name))
    }

    /// Its value.
    pub fn value(&self, params: &Params) -> Value {
        match &self.form {
            Form::Choice(choice) => match (choice.get)(params) {
                Cow::Borrowed(word) => Value::Word(word),
                Cow::Owned(text) => interned(&text),
            },
            Form::Number(number) if number.whole => {
                Value::Count(crate::text::format::count((number.get)(params)) as u64)
            }
            Form::Number(number) => Value::Number((number.get)(params)),
        }
    }

    /// Its number; NaN for keywords.
    pub fn number(&self, params: &Params) -> f64 {
        self.value(params).number()
    }

    /// Its label on a figure.
    pub fn label(&self) -> String {
        let label = self.meaning.split(';').next().unwrap_or(self.meaning);
        match self.unit {
            "" | "1" => label.into(),
            unit => format!("{label} ({unit})"),
        }
    }

    /// Type of its values.
    pub fn kind(&self) -> Kind {
        match &self.form {
            Form::Choice(_) => Kind::Word,
            Form::Number(number) if number.whole => Kind::Count,
            Form::Number(_) => Kind::Number,
        }
    }

    /// Sets its value in some parameters.
    fn set(&self, params: &mut Params, value: Value) -> Result<(), Refusal> {
        match (&self.form, value) {
            (Form::Choice(choice), Value::Word(word)) => (choice.set)(params, word)?,
            (Form::Number(number), Value::Count(count)) => (number.set)(params, count as f64),
            (Form::Number(number), Value::Number(value)) => (number.set)(params, value),
            (Form::Choice(_), _) | (Form::Number(_), Value::Word(_)) => {
                unreachable!("values are read by the form of their axis")
            }
        }
        Ok(())
    }

    /// Whether its values are numbers.
    pub fn is_numeric(&self) -> bool {
        self.kind() != Kind::Word
    }

    /// Whether it is the axis of shear rates.
    pub fn is_shear_rate(&self) -> bool {
        self.key == "shear_rate"
    }

    /// Whether it is the axis of imposed shear stresses.
    pub fn is_shear_stress(&self) -> bool {
        self.key == "shear_stress"
    }

    /// Whether it imposes the shear, by rate or by stress.
    pub fn is_of_shear(&self) -> bool {
        self.is_shear_rate() || self.is_shear_stress()
    }

    /// Whether it imposes the pressure, by the viscous number or its ratio to the stress.
    pub fn is_imposed_pressure(&self) -> bool {
        ["imposed_viscous_number", "imposed_macroscopic_friction"].contains(&self.key)
    }

    /// Whether it is an area fraction or a volume fraction.
    pub fn is_fraction(&self) -> bool {
        ["area_fraction", "volume_fraction"].contains(&self.key)
    }

    /// Whether it belongs to the laws of friction, which have no effect where friction does not
    /// act.
    pub(crate) fn is_of_friction(&self) -> bool {
        let keys = [
            "tangential",
            "friction_onset",
            "rolling_friction",
            "tangential_stiffness",
        ];
        keys.contains(&self.key)
    }

    /// Whether it is one of two alternatives: rate or stress, area fraction or volume fraction.
    pub fn is_alternative(&self) -> bool {
        self.is_of_shear() || self.is_fraction()
    }

    /// Whether a point has no value on it: it has the alternative, or no pressure is imposed, whose
    /// viscous number is not the 0 that stands for it.
    pub(crate) fn is_absent(&self, params: &Params) -> bool {
        let may_be = self.is_alternative() || self.written_key().is_some();
        may_be && !self.means_something(params)
    }

    /// Whether a table of these parameters has it as a column.
    pub fn matters<'p>(&self, params: impl Iterator<Item = &'p Params>) -> bool {
        let mut params = params;
        params.any(|params| self.is_shown(params))
    }

    /// Whether it has an effect at a point.
    pub fn means_something(&self, params: &Params) -> bool {
        (self.has_meaning)(params)
    }

    /// Whether its value varies among these parameters, where it has a meaning. One size or two are
    /// values beside the distributions of sizes.
    pub fn varies<'p>(&self, params: impl Iterator<Item = &'p Params>) -> bool {
        let is_sizes = self.key == "sizes";
        let mut params = params.filter(|p| is_sizes || self.means_something(p));
        let first = params.next().map(|p| self.value(p));
        params.any(|p| Some(self.value(p)) != first)
    }

    /// The values of some parameters on it as a column.
    pub(crate) fn column<'p>(&self, params: impl Iterator<Item = &'p Params>) -> DataColumn {
        let cells = params.map(|params| Some(self.value(params)));
        DataColumn {
            unit: self.unit,
            ..DataColumn::of(self.key, self.kind(), self.meaning, cells)
        }
    }

    /// The values of some parameters on it, each once, in the order of their first use.
    pub(crate) fn distinct<'p>(&self, params: impl Iterator<Item = &'p Params>) -> Vec<Value> {
        let mut seen = HashSet::new();
        let values = params.map(|p| self.value(p));
        values.filter(|value| seen.insert(value.tag())).collect()
    }
}

/// A text as a value. Each is stored once and never freed, as their number is limited by campaign
/// files.
pub(crate) fn interned(text: &str) -> Value {
    static TEXTS: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut texts = TEXTS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = texts.get(text) {
        return Value::Word(known);
    }
    let known = Box::leak(text.into());
    texts.insert(known);
    Value::Word(known)
}

/// Why a combination of values is invalid.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InvalidCombination {
    /// Required axes without a value.
    #[error("no value is given of {}", .0.iter().map(|axis| axis.key).collect::<Vec<_>>().join(", "))]
    Missing(Vec<&'static Axis>),
    /// A value conflicts with the others.
    #[error(transparent)]
    Refused(#[from] Refusal),
}

/// The parameters with these values, one per axis; `None` stands for the default.
///
/// # Errors
/// A missing or conflicting value. Ranges are not checked: see [`Params::validate`].
pub fn params_of(values: &[Option<Value>]) -> Result<Params, InvalidCombination> {
    Ok(folded_params_of(values, &[])?.0)
}

/// Parameters of a run in segments; and where friction does not act, or its onset has no effect,
/// the parameters with friction, its laws and the shear rate as they are given, if these differ.
///
/// # Errors
/// As [`params_of`].
pub(crate) fn folded_params_of(
    values: &[Option<Value>],
    segments: &[Segment],
) -> Result<(Params, Option<Params>), InvalidCombination> {
    let mut params = as_given(values, segments)?;
    let (friction, shear_rate) = (params.friction, params.shear_rate);
    params.canonicalise();
    if params.has_friction() && (params.shear_stress.is_some() || params.shear_rate.is_finite()) {
        return Ok((params, None));
    }
    let mut given = as_if_friction_acted(values, segments).unwrap_or_else(|| params.clone());
    let touches = params.contact.laws().normal.touches();
    given.friction = if touches { friction + 0.0 } else { 0.0 };
    if params.shear_stress.is_none() {
        given.shear_rate = shear_rate + 0.0;
    }
    let is_folded = given != params;
    Ok((params, is_folded.then_some(given)))
}

/// Parameters with these values and defaults, not in canonical form.
fn as_given(values: &[Option<Value>], segments: &[Segment]) -> Result<Params, InvalidCombination> {
    let mut builder = Params::builder();
    // The last axis first, since a choice precedes the numbers that have a meaning under it.
    for (axis, value) in AXES.iter().zip(values).rev() {
        if let Some(value) = value {
            builder.set(axis, |params| axis.set(params, *value))?;
        }
    }
    let missing = builder.fill(AXES.iter().map(Deref::deref))?;
    if !missing.is_empty() {
        let axes = AXES.iter().filter(|axis| missing.contains(&axis.key));
        return Err(InvalidCombination::Missing(axes.collect()));
    }
    let mut params = builder.into_given();
    // A flow has a number above 0.
    params.at_rest = params.peclet == 0.0;
    params.impose(segments);
    Ok(params)
}

/// Canonical parameters with the laws of friction as they are given, which that form lacks where a
/// friction coefficient or a shear rate of 0 keeps friction from acting, and at an infinite rate.
fn as_if_friction_acted(values: &[Option<Value>], segments: &[Segment]) -> Option<Params> {
    let of_axis = |(axis, value): (&Axis, &Option<Value>)| match *value {
        Some(Value::Number(0.0)) if axis.key == "friction" => Some(Value::Number(1.0)),
        Some(Value::Number(0.0 | f64::INFINITY)) if axis.is_shear_rate() => {
            Some(Value::Number(1.0))
        }
        value => value,
    };
    let values: Vec<Option<Value>> = AXES.iter().zip(values).map(of_axis).collect();
    let mut params = as_given(&values, segments).ok()?;
    params.canonicalise();
    Some(params)
}

/// The identity of a point.
pub(crate) type Identity = Vec<Tag>;

/// The identity of the point of a run: its values on the axes, then the shear of its segments,
/// which differs among points that are named by that of the last.
pub(crate) fn identity(params: &Params) -> Identity {
    let shear = |segment: &Segment| [segment.shear_rate, segment.shear_stress];
    let bits = params.segments.iter().flat_map(shear);
    let bits = bits.map(|value| Tag::Bits(value.map_or(u64::MAX, f64::to_bits)));
    let values = AXES.iter().map(|axis| axis.value(params).tag());
    values.chain(bits).collect()
}

#[cfg(test)]
mod tests;
