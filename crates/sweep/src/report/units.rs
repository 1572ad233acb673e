//! Physical units: conversion of the numbers of a campaign for spheres of a given radius in a given
//! fluid.
//!
//! ```text
//! length          a                          force           F_crit
//! viscosity       mu                         shear rate      rate = Γ F_crit/(6π mu a²)
//! stress          mu rate, F_crit/a²         velocity        a rate
//! displacement    a (squared: a²)            diffusivity     a² rate
//! stiffness       F_crit/a, 6π mu a rate     dashpot         mu a
//! ```
//! Without the critical load F_crit there is no time scale, so rates and stresses are not
//! converted. At the plateaus Γ = 0 and Γ = ∞ stresses and velocities are multiples of an
//! undetermined rate and are left out.

use super::error::ReportError;
use crate::data::{Cells, DataColumn};
use crate::model::axes::Axis;
use sd_core::Params;
use sd_core::law::{ColloidUnit, StiffnessUnit};
use std::f64::consts::PI;

/// The units of tables and figures; by default those of the program.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Units(Option<Physical>);

/// SI values of a real layer.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Physical {
    /// Radius a in m.
    radius: f64,
    /// Viscosity mu of the fluid in Pa s.
    viscosity: f64,
    /// Critical load F_crit in N.
    critical_load: Option<f64>,
}

/// Input of a conversion at a point besides the unit of a number.
#[derive(Debug, Clone, Copy)]
pub(super) struct At {
    /// Shear rate Γ; `None` where it is unknown.
    shear_rate: Option<f64>,
    /// Whether stiffnesses are multiples of 6π mu a rate, and not of F_crit/a.
    by_flow: bool,
    /// Unit of the forces of colloids, in F_crit; `None` where it is unknown.
    of_colloids: Option<f64>,
}

impl At {
    /// A point with these parameters and this shear rate.
    pub(super) fn new(params: &Params, shear_rate: Option<f64>) -> Self {
        Self {
            shear_rate,
            by_flow: params.contact.laws().stiffness_unit == StiffnessUnit::Flow,
            of_colloids: unit_of_colloids(params),
        }
    }

    /// A point with only a shear rate.
    pub(super) fn rate(shear_rate: Option<f64>) -> Self {
        Self {
            shear_rate,
            by_flow: false,
            of_colloids: Some(1.0),
        }
    }
}

/// The unit of the forces of colloids, in F_crit: kT/a over that, if they are given in kT/a.
fn unit_of_colloids(params: &Params) -> Option<f64> {
    if params.contact.laws().colloid_unit != ColloidUnit::Thermal {
        return Some(1.0);
    }
    if params.thermal_load > 0.0 {
        return Some(params.thermal_load.recip());
    }
    let of_stress = |stress| 6.0 * PI * stress;
    let rate = params.shear_stress.map_or(params.shear_rate, of_stress);
    Some(rate / params.peclet).filter(|unit| unit.is_finite() && *unit > 0.0)
}

/// The name of shear rates Γ among units.
pub(super) const RATE: &str = "Γ";

/// Decimal prefixes.
#[rustfmt::skip]
const PREFIXES: [(&str, f64); 11] = [
    ("f", 1e-15), ("p", 1e-12), ("n", 1e-9), ("u", 1e-6), ("µ", 1e-6), ("μ", 1e-6),
    ("m", 1e-3), ("c", 1e-2), ("k", 1e3), ("M", 1e6), ("G", 1e9),
];

/// Arguments: name, unit, example.
const KEYS: [(&str, &str, &str); 3] = [
    ("a", "m", "1um"),
    ("mu", "Pas", "1mPas"),
    ("f_crit", "N", "10pN"),
];

impl Units {
    /// Reads `a=1um,mu=1mPas,f_crit=10pN`; `f_crit` is optional.
    ///
    /// # Errors
    /// [`ReportError::Argument`] on an unknown name, a unit of another kind, a number that is not
    /// positive.
    pub fn parse(text: &str) -> Result<Self, ReportError> {
        let mut values: [Option<f64>; 3] = [None; 3];
        for part in text.split(',') {
            let (key, value) = part.split_once('=').unwrap_or((part, ""));
            let key = key.trim().to_lowercase();
            let Some(place) = KEYS.iter().position(|(name, ..)| *name == key) else {
                let known = KEYS.map(|(key, _, example)| format!("{key}={example}"));
                let known = known.join(",");
                return Err(refused(format!("{part:?} is no KEY=VALUE of {known}")));
            };
            let (name, unit, example) = KEYS[place];
            let value = quantity(value.trim(), unit).ok_or_else(|| {
                refused(format!(
                    "{part:?} is not a positive number with a unit of {unit}; write it as {name}={example}"
                ))
            })?;
            if values[place].replace(value).is_some() {
                return Err(refused(format!("{name} is given twice")));
            }
        }
        let [Some(radius), Some(viscosity), critical_load] = values else {
            return Err(refused(
                "the radius a and the viscosity mu of the fluid are needed, as in a=1um,mu=1mPas",
            ));
        };
        Ok(Self(Some(Physical {
            radius,
            viscosity,
            critical_load,
        })))
    }

    /// Whether physical units are requested.
    pub(super) fn are_requested(&self) -> bool {
        self.0.is_some()
    }

    /// Conversion of numbers of a unit at a point: the new unit, and the factor, which is `None`
    /// without a finite scale. `None` if they are not converted.
    fn converted(&self, unit: &str, at: At) -> Option<(&'static str, Option<f64>)> {
        let Physical {
            radius,
            viscosity,
            critical_load,
        } = self.0?;
        match unit {
            "a" => return Some(("m", Some(radius))),
            "mu" => return Some(("Pa s", Some(viscosity))),
            "mu²" => return Some(("Pa² s²", Some(viscosity * viscosity))),
            "a²" => return Some(("m²", Some(radius * radius))),
            "mu a" => return Some(("N s/m", Some(viscosity * radius))),
            _ => {}
        }
        let load = critical_load?;
        let unit_of_rate = load / (6.0 * PI * viscosity * radius * radius);
        let rate = at.shear_rate.map(|rate| rate * unit_of_rate);
        let rate = rate.filter(|rate| rate.is_finite() && *rate > 0.0);
        Some(match unit {
            "F_crit" => ("N", Some(load)),
            "F" => ("N", at.of_colloids.map(|unit| unit * load)),
            "F a" => ("J", at.of_colloids.map(|unit| unit * load * radius)),
            "F_crit/a²" => ("Pa", Some(load / (radius * radius))),
            "F/a" if at.by_flow => ("N/m", rate.map(|rate| 6.0 * PI * viscosity * radius * rate)),
            "F/a" => ("N/m", Some(load / radius)),
            "mu rate" => ("Pa", rate.map(|rate| viscosity * rate)),
            "a rate" => ("m/s", rate.map(|rate| radius * rate)),
            "a² rate" => ("m²/s", rate.map(|rate| radius * radius * rate)),
            RATE => ("1/s", Some(unit_of_rate)),
            _ => return None,
        })
    }

    /// Name of a unit after conversion.
    pub(super) fn word<'u>(&self, unit: &'u str) -> &'u str {
        self.converted(unit, At::rate(None))
            .map_or(unit, |(word, _)| word)
    }

    /// Factor for a number of this unit at a point; `None` without a finite scale.
    pub(super) fn factor(&self, unit: &str, at: At) -> Option<f64> {
        self.converted(unit, at)
            .map_or(Some(1.0), |(_, factor)| factor)
    }

    /// The unit to which the values on an axis are converted; `None` if they are not.
    pub(super) fn of_axis(&self, axis: &Axis) -> Option<&'static str> {
        let unit = dimension_of(axis);
        Some(self.word(unit)).filter(|word| *word != unit)
    }

    /// The label of an axis in a figure.
    pub(super) fn label_of(&self, axis: &Axis) -> String {
        match self.of_axis(axis) {
            None => axis.label(),
            Some(unit) => {
                let label = axis.meaning.split(';').next().unwrap_or(axis.meaning);
                format!("{} ({unit})", without_symbol(label))
            }
        }
    }

    /// A position along an axis; 0 and infinity are unchanged, and values without a finite scale
    /// become NaN.
    pub(super) fn along(&self, axis: &Axis, at: At, place: f64) -> f64 {
        if self.of_axis(axis).is_none() || place == 0.0 || place.is_infinite() {
            return place;
        }
        let factor = self.factor(dimension_of(axis), at);
        factor.map_or(f64::NAN, |factor| factor * place)
    }

    /// Converts the numbers of a column, with the shear rate of each of its rows.
    pub(super) fn convert(self, column: &mut DataColumn, rows: impl Iterator<Item = At>) {
        let Cells::Number(cells) = &mut column.cells else {
            return;
        };
        if self.0.is_none() {
            return;
        }
        let axis = Axis::of_key(&column.name);
        for (cell, at) in cells.iter_mut().zip(rows) {
            let number = cell.and_then(|number| match axis {
                Some(axis) => Some(self.along(axis, at, number)),
                None => Some(self.factor(column.unit, at)? * number),
            });
            *cell = number.filter(|number| !number.is_nan());
        }
        column.unit = match axis {
            Some(axis) => self.of_axis(axis).unwrap_or(column.unit),
            None => self.word(column.unit),
        };
    }

    /// Factor for a relative viscosity.
    pub(super) fn viscosity_factor(&self) -> f64 {
        self.0.map_or(1.0, |physical| physical.viscosity)
    }

    /// Label of a measured quantity in a figure, with its unit; after a conversion without the
    /// symbol of a pure number.
    pub(super) fn label(&self, name: &str, unit: &str) -> String {
        let word = self.word(unit);
        if word == unit {
            match unit {
                "" | "1" | "mu" => name.to_owned(),
                "mu rate" => format!("{name} (μ × rate)"),
                "a rate" => format!("{name} (a × rate)"),
                "a² rate" => format!("{name} (a² × rate)"),
                unit => format!("{name} ({unit})"),
            }
        } else {
            let name = name.trim_start_matches("relative ");
            format!("{} ({word})", without_symbol(name))
        }
    }

    /// Checks that a quantity can be converted.
    ///
    /// # Errors
    /// [`ReportError::Argument`] if it needs the critical load and none is given.
    pub(super) fn reach(&self, name: &str, unit: &str) -> Result<(), ReportError> {
        let needs_load = ["mu rate", "F_crit/a²", "a rate", "a² rate"].contains(&unit);
        match self.0 {
            Some(physical) if needs_load && physical.critical_load.is_none() => {
                Err(refused(format!(
                    "the {name} has a physical unit only with the critical load of contacts, which sets the time: add f_crit, as in f_crit=10pN"
                )))
            }
            _ => Ok(()),
        }
    }

    /// The error if nothing shown has a scale: at the plateaus stresses and velocities are known
    /// only up to the rate.
    pub(super) fn without_scale() -> ReportError {
        refused(
            "at the plateaus, Γ = 0 and Γ = ∞, stresses and velocities are known only as multiples of the shear rate, and have no physical \
             value; leave the units out, or choose other points",
        )
    }
}

/// A name without its final symbol, for a quantity that is a pure number only in the units of the
/// program.
fn without_symbol(name: &str) -> &str {
    name.trim_end_matches(" Γ").trim_end_matches(" σ*")
}

/// The unit of the values on an axis, including shear rates.
pub(super) fn dimension_of(axis: &Axis) -> &'static str {
    if axis.is_shear_rate() {
        RATE
    } else {
        axis.unit
    }
}

/// A number with a prefix and a unit, in the unit itself.
fn quantity(text: &str, unit: &str) -> Option<f64> {
    let bare: String = text.chars().filter(|c| !" ·*".contains(*c)).collect();
    let number = bare.strip_suffix(unit)?;
    let (number, factor) = PREFIXES
        .iter()
        .find_map(|(prefix, factor)| Some((number.strip_suffix(prefix)?, *factor)))
        .unwrap_or((number, 1.0));
    let value = factor * number.parse::<f64>().ok()?;
    (value.is_finite() && value > 0.0).then_some(value)
}

/// The error about the argument.
fn refused(message: impl Into<String>) -> ReportError {
    ReportError::argument("units", message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_have_prefixes() {
        let units = Units::parse("a=1um, mu=1 mPa s, f_crit=10pN").unwrap();
        let Units(Some(physical)) = units else {
            unreachable!("units were read")
        };
        assert!((physical.radius / 1e-6 - 1.0).abs() < 1e-12);
        assert!((physical.viscosity / 1e-3 - 1.0).abs() < 1e-12);
        assert!((physical.critical_load.unwrap() / 1e-11 - 1.0).abs() < 1e-12);
        assert_eq!(
            Units::parse("a=1e-6m,mu=0.001Pas").unwrap().word("mu rate"),
            "mu rate"
        );
        for (text, part) in [
            ("a=1um", "mu"),
            ("a=1um,mu=1mPas,g=3", "f_crit"),
            ("a=1uN,mu=1mPas", "a=1um"),
            ("a=0um,mu=1mPas", "positive"),
            ("a=1um,a=2um", "twice"),
            ("b", "KEY=VALUE"),
        ] {
            let error = Units::parse(text).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn forces_of_colloids_may_be_in_units_of_the_temperature() {
        let mut params = crate::test_support::params();
        (params.shear_rate, params.peclet) = (2.0, 10.0);
        let mut laws = *params.contact.laws();
        let units = Units::parse("a=1um,mu=1mPas,f_crit=10pN").unwrap();
        for (unit, load) in [
            (ColloidUnit::CriticalLoad, 1e-11),
            (ColloidUnit::Thermal, 2e-12),
        ] {
            laws.colloid_unit = unit;
            params.contact = sd_core::ContactScheme::Laws(laws);
            let at = At::new(&params, Some(2.0));
            // kT/a = F_crit Γ/Pe.
            assert!((units.factor("F", at).unwrap() / load - 1.0).abs() < 1e-12);
            assert!((units.factor("F a", at).unwrap() / (1e-6 * load) - 1.0).abs() < 1e-12);
        }
    }

    /// σ = η mu rate = σ* F_crit/a², and k = k* F_crit/a = (k* /Γ) 6π mu a rate, in both forms.
    #[test]
    fn stresses_are_the_same_by_rate_and_by_load() {
        let units = Units::parse("a=2um,mu=1.5mPas,f_crit=0.3nN").unwrap();
        let (eta, at) = (7.0, At::rate(Some(3.0)));
        let factor = |unit| units.factor(unit, at).unwrap();
        let by_rate = eta * factor("mu rate");
        let by_load = eta * 3.0 / (6.0 * PI) * factor("F_crit/a²");
        assert!((by_rate / by_load - 1.0).abs() < 1e-12);
        let rate = 3.0 * factor(RATE);
        let by_viscosity = rate * eta * factor("mu");
        assert!((by_viscosity / by_rate - 1.0).abs() < 1e-12);
        let flow = At {
            by_flow: true,
            ..at
        };
        let stiffness = units.factor("F/a", flow).unwrap() / 3.0;
        assert!((stiffness / factor("F/a") - 1.0).abs() < 1e-12);
        // A diffusivity is a velocity times a length.
        let [diffusivity, velocity] = ["a² rate", "a rate"].map(factor);
        assert!((diffusivity / (velocity * factor("a")) - 1.0).abs() < 1e-12);
        assert!((factor("a²") / factor("a").powi(2) - 1.0).abs() < 1e-12);
        for plateau in [0.0, f64::INFINITY] {
            let at = At::rate(Some(plateau));
            assert_eq!(units.factor("mu rate", at), None);
            assert!(units.factor("mu", at).is_some());
        }
    }
}
