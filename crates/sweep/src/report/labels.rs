//! Values on axes as text: cells of tables, labels of curves, titles of panels, captions.

use super::points::Report;
use super::starts::Starts;
use super::units::{At, Units};
use crate::data::{Kind, Value};
use crate::model::axes::{AXES, Axis};
use crate::text::format::{Digits, power_of_ten, short};
use sd_core::Params;

/// Format of the values on one axis: in the units of a report, with as few digits as distinguish
/// different values.
#[derive(Debug, Clone, Copy)]
pub(super) struct AxisWords<'a> {
    axis: &'a Axis,
    units: Units,
    starts: &'a Starts,
    pub(super) digits: Digits,
}

impl<'a> AxisWords<'a> {
    /// The format for the values of these parameters.
    pub(super) fn of<'p>(
        axis: &'a Axis,
        units: Units,
        starts: &'a Starts,
        params: impl Iterator<Item = &'p Params>,
    ) -> Self {
        let params = params.filter(|_| axis.kind() == Kind::Number);
        Self {
            axis,
            units,
            starts,
            digits: Digits::of(params.map(|params| on_axis(axis, units, params))),
        }
    }

    /// The value of some parameters, without its unit.
    pub(super) fn plain(&self, params: &Params) -> String {
        match (
            self.starts.name_on(self.axis, params),
            self.axis.value(params),
        ) {
            (Some(name), _) => name.to_owned(),
            // Two sizes are on axes of their own, beside distributions and lists.
            (None, Value::Word(_)) if self.axis.key == "sizes" && params.sizes.is_none() => {
                match params.size_ratio {
                    1.0 => "equal".into(),
                    ratio => format!("1 : {}", short(ratio, 4)),
                }
            }
            (None, Value::Number(_)) => self.digits.write(on_axis(self.axis, self.units, params)),
            (None, value) => value.to_string(),
        }
    }

    /// The value, with its unit if it has been converted to one.
    pub(super) fn value(&self, params: &Params) -> String {
        let value = self.plain(params);
        match self.units.of_axis(self.axis) {
            Some(unit) if value != "0" && value != "inf" => format!("{value} {unit}"),
            _ => value,
        }
    }

    /// The value with its symbol, for curves and panels: `Γ = ∞`, `h = 10⁻⁸ m`; keywords and named
    /// start layers without a symbol.
    pub(super) fn named(&self, params: &Params) -> String {
        let value = self.value(params);
        if !self.axis.is_numeric() || self.starts.name_on(self.axis, params).is_some() {
            return value;
        }
        let value = value.replace("inf", "∞");
        let (number, unit) = value.split_once(' ').unwrap_or((&value, ""));
        let number = match number.split_once('e') {
            Some(("1", power)) => power_of_ten(power),
            Some((digits, power)) => format!("{digits}·{}", power_of_ten(power)),
            None => number.to_owned(),
        };
        let text = format!("{} = {number} {unit}", self.axis.symbol());
        text.trim_end().to_owned()
    }
}

/// The position of parameters along an axis, in some units.
fn on_axis(axis: &Axis, units: Units, params: &Params) -> f64 {
    let rate = params.shear_stress.is_none().then_some(params.shear_rate);
    units.along(axis, At::new(params, rate), axis.number(params))
}

/// The values of some parameters on all axes with an effect, for captions.
pub(super) fn all_named(params: &Params, units: Units, starts: &Starts) -> Vec<String> {
    let alone = || std::iter::once(params);
    let axes = AXES.iter().filter(|axis| axis.matters(alone()));
    axes.map(|axis| AxisWords::of(axis, units, starts, alone()).named(params))
        .collect()
}

/// The label of a curve.
#[derive(Debug, Clone, Default)]
pub(super) struct Label {
    /// As text: `c = 0.69, Γ = ∞`; empty for a single curve.
    pub(super) words: String,
    /// Its number, where curves differ in one number only.
    pub(super) number: Option<f64>,
}

impl<W: Into<String>> From<W> for Label {
    fn from(words: W) -> Self {
        Self {
            words: words.into(),
            number: None,
        }
    }
}

impl Label {
    /// The label with a further part.
    pub(super) fn with(&self, part: &str) -> String {
        let comma = if self.words.is_empty() { "" } else { ", " };
        format!("{}{comma}{part}", self.words)
    }
}

/// Common settings of the curves of a figure: their axis, the axis of the panels, the units, and
/// the names of start layers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shared<'a> {
    pub(super) along: Option<&'a Axis>,
    /// Keys of axes whose values are chosen for each place along the curves.
    pub(super) chosen: &'a [&'static str],
    pub(super) panels: Option<&'a Axis>,
    pub(super) units: Units,
    pub(super) starts: &'a Starts,
}

impl Shared<'_> {
    /// Whether this axis varies along the curves: rate and stress follow from each other.
    pub(super) fn is_along(self, axis: &Axis) -> bool {
        self.chosen.contains(&axis.key)
            || self.along.is_some_and(|along| {
                axis.key == along.key || axis.is_of_shear() && along.is_of_shear()
            })
    }

    pub(super) fn is_of_panels(self, axis: &Axis) -> bool {
        self.panels.is_some_and(|panels| panels.key == axis.key)
    }

    /// The labels of some parameters, without common values, the axis of the curves and that of the
    /// panels.
    pub(super) fn labels(self, all: &[&Params]) -> Vec<Label> {
        let params = || all.iter().copied();
        let axes = AXES
            .iter()
            .filter(|axis| !self.is_along(axis) && !self.is_of_panels(axis));
        let mut differing: Vec<&'static Axis> = axes.filter(|axis| axis.varies(params())).collect();
        // The words of the sizes have the ratio.
        if differing.iter().any(|axis| axis.key == "sizes") {
            differing.retain(|axis| axis.key != "size_ratio");
        }
        let words = |axis: &&'static Axis| AxisWords::of(axis, self.units, self.starts, params());
        let words: Vec<AxisWords<'_>> = differing.iter().map(words).collect();
        let is_imposed = |params: &Params| params.shear_stress.is_some();
        let both = params().any(is_imposed) && !params().all(is_imposed);
        let by_number = match differing.as_slice() {
            [axis] if axis.is_numeric() && !both => Some(*axis),
            _ => None,
        };
        let label = |params: &Params| {
            let named = differing.iter().zip(&words);
            let named = named.filter(|(axis, _)| !axis.is_absent(params));
            let mut parts: Vec<String> = named.map(|(_, words)| words.named(params)).collect();
            if both && self.along.is_some() {
                let how = if is_imposed(params) { "stress" } else { "rate" };
                parts.push(format!("imposed {how}"));
            }
            Label {
                words: parts.join(", "),
                number: by_number.map(|axis| axis.number(params)),
            }
        };
        params().map(label).collect()
    }
}

/// The axes on which parameters differ, other than these, each with its values.
pub(super) fn differences<'p>(
    params: &(impl Iterator<Item = &'p Params> + Clone),
    is_other: impl Fn(&Axis) -> bool,
) -> Vec<String> {
    let axes = AXES.iter().filter(|axis| !is_other(axis));
    let axes = axes.filter(|axis| axis.varies(params.clone()));
    axes.map(|axis| {
        let values = params.clone().filter(|params| axis.means_something(params));
        let values: Vec<String> = axis.distinct(values).iter().map(Value::to_string).collect();
        format!("{} has {}", axis.key, values.join(", "))
    })
    .collect()
}

impl Report {
    /// The labels of points with these parameters, without common values.
    pub(super) fn labels<'p>(&self, params: impl Iterator<Item = &'p Params>) -> Vec<Label> {
        let shared = Shared {
            along: None,
            chosen: &[],
            panels: None,
            units: self.units,
            starts: &self.starts,
        };
        shared.labels(&params.collect::<Vec<_>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::params;

    #[test]
    fn sizes_are_told_apart_whether_they_are_two_or_a_distribution() {
        let with = |size_ratio, sizes: Option<&str>| Params {
            size_ratio,
            sizes: sizes.map(|sizes| sizes.parse().unwrap()),
            ..params()
        };
        let all = [
            with(1.0, None),
            with(1.4, None),
            with(1.0, Some("lognormal 0.2")),
        ];
        let sizes = Axis::of_key("sizes").unwrap();
        assert!(sizes.varies(all.iter()));
        assert!(!sizes.varies(all[..2].iter()));
        let shared = Shared {
            along: None,
            chosen: &[],
            panels: None,
            units: Units::default(),
            starts: &Starts::default(),
        };
        let words = |all: &[Params]| -> Vec<String> {
            let labels = shared.labels(&all.iter().collect::<Vec<_>>());
            labels.into_iter().map(|label| label.words).collect()
        };
        assert_eq!(words(&all), ["equal", "1 : 1.4", "lognormal 0.2"]);
        assert_eq!(words(&all[..2]), ["size ratio = 1", "size ratio = 1.4"]);
    }
}
