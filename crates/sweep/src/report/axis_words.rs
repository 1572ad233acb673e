//! Values on an axis as text: in the units of a report, with as few digits as distinguish different
//! values.

use super::figure::scale::power_of_ten;
use super::points::Report;
use super::sheet::{Head, NumberFormat, SheetColumn};
use super::starts::Starts;
use super::units::{At, Units};
use crate::data::{Kind, Value};
use crate::model::axes::{AXES, Axis};
use crate::text::format::{Digits, Uncertain};
use sd_core::Params;

/// Format of the values on one axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct AxisWords<'a> {
    axis: &'a Axis,
    units: Units,
    starts: &'a Starts,
    pub(super) digits: Digits,
}

/// The columns of axes in a table that has a row for each of these parameters.
pub(super) fn columns_of_axes<'p>(
    axes: &[&Axis],
    report: &Report,
    params: &(impl Iterator<Item = &'p Params> + Clone),
    format: NumberFormat,
) -> Vec<SheetColumn> {
    let column = |axis: &&Axis| {
        let words = AxisWords::of(axis, report.units, &report.starts, params.clone());
        let cells = params.clone().map(|params| Some(words.cell(params)));
        let head = Head::new(axis.key, axis.symbol(), "", 0);
        SheetColumn::new(head, cells.collect(), format)
    };
    axes.iter().map(column).collect()
}

impl<'a> AxisWords<'a> {
    /// The format for the values of these parameters.
    pub(super) fn of<'p>(
        axis: &'a Axis,
        units: Units,
        starts: &'a Starts,
        params: impl Iterator<Item = &'p Params>,
    ) -> Self {
        let is_of_numbers = axis.kind() == Kind::Number;
        let params = params.filter(|_| is_of_numbers);
        Self {
            axis,
            units,
            starts,
            digits: Digits::of(params.map(|p| on_axis(axis, units, p))),
        }
    }

    /// The name of a start layer, on their axis.
    fn start(&self, params: &Params) -> Option<&str> {
        match self.axis.value(params) {
            Value::Count(number) if self.axis.key == "start" => self.starts.name(number),
            _ => None,
        }
    }

    /// The value of some parameters as a cell of a table.
    pub(super) fn cell(&self, params: &Params) -> Uncertain {
        if let Some(start) = self.start(params) {
            return Uncertain::Word(start.to_owned().into());
        }
        match self.axis.value(params) {
            Value::Word(word) => Uncertain::word(word),
            Value::Count(count) => Uncertain::Count(count),
            Value::Number(_) => {
                Uncertain::Short(on_axis(self.axis, self.units, params), self.digits)
            }
        }
    }

    /// The value as text, with its unit if it has been converted to one.
    pub(super) fn value(&self, params: &Params) -> String {
        if let Some(start) = self.start(params) {
            return start.to_owned();
        }
        let value = match self.axis.value(params) {
            Value::Number(_) => {
                let number = on_axis(self.axis, self.units, params);
                self.digits.write(number)
            }
            value => value.to_string(),
        };
        match self.units.of_axis(self.axis) {
            Some(unit) if value != "0" && value != "inf" => format!("{value} {unit}"),
            _ => value,
        }
    }

    /// The value with its symbol, for curves and panels: `Γ = ∞`, `h = 10⁻⁸ m`; keywords and named
    /// start layers without a symbol.
    pub(super) fn named(&self, params: &Params) -> String {
        if self.axis.is_numeric() && self.start(params).is_none() {
            let value = self.value(params).replace("inf", "∞");
            format!("{} = {}", self.axis.symbol(), with_power(&value))
        } else {
            self.value(params)
        }
    }
}

/// The values of some parameters on all axes with an effect, for captions.
pub(super) fn all_named(params: &Params, units: Units, starts: &Starts) -> Vec<String> {
    let alone = || std::iter::once(params);
    let axes = AXES.iter().filter(|axis| axis.matters(alone()));
    axes.map(|axis| AxisWords::of(axis, units, starts, alone()).named(params))
        .collect()
}

/// A number as a multiple of a power of ten, if it has one.
fn with_power(value: &str) -> String {
    let (number, unit) = value.split_once(' ').unwrap_or((value, ""));
    let Some((digits, power)) = number.split_once('e') else {
        return value.to_owned();
    };
    let product = if digits == "1" {
        power_of_ten(power)
    } else {
        format!("{digits}·{}", power_of_ten(power))
    };
    format!("{product} {unit}").trim_end().to_owned()
}

/// The position of parameters along an axis, in some units.
fn on_axis(axis: &Axis, units: Units, params: &Params) -> f64 {
    let rate = params.shear_stress.is_none().then_some(params.shear_rate);
    units.along(axis, At::new(params, rate), axis.number(params))
}
