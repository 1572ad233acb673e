//! Physical units: what the numbers of a campaign are for spheres of a given radius in a given fluid.
//!
//! ```text
//! length          a                          force           F_crit
//! viscosity       mu                         shear rate      rate = Γ F_crit/(6π mu a²)
//! stress          mu rate, F_crit/a²         velocity        a rate
//! ```
//! Without the critical load F_crit there is no time: rates and stresses then stay as they are.

use super::ReportError;
use std::f64::consts::PI;

/// The units of tables and figures; the default is those of the program.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Units(Option<Physical>);

/// A layer in the laboratory, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Physical {
    /// Radius a in m.
    radius: f64,
    /// Viscosity mu of the fluid in Pa s.
    viscosity: f64,
    /// Critical load F_crit in N.
    critical_load: Option<f64>,
}

/// Decimal prefixes.
const PREFIXES: [(&str, f64); 11] = [
    ("f", 1e-15),
    ("p", 1e-12),
    ("n", 1e-9),
    ("u", 1e-6),
    ("µ", 1e-6),
    ("μ", 1e-6),
    ("m", 1e-3),
    ("c", 1e-2),
    ("k", 1e3),
    ("M", 1e6),
    ("G", 1e9),
];

/// What may be given: its name, its unit, an example.
const KEYS: [(&str, &str, &str); 3] = [
    ("a", "m", "1um"),
    ("mu", "Pas", "1mPas"),
    ("f_crit", "N", "10pN"),
];

impl Units {
    /// Reads `a=1um,mu=1mPas,f_crit=10pN`; `f_crit` may be left out.
    ///
    /// # Errors
    /// [`ReportError::Argument`] on a name that is none, a unit of another kind, a number that is not above 0.
    pub fn parse(text: &str) -> Result<Self, ReportError> {
        let mut values: [Option<f64>; 3] = [None; 3];
        for part in text.split(',') {
            let known = || {
                KEYS.map(|(key, _, example)| format!("{key}={example}"))
                    .join(",")
            };
            let (key, value) = part
                .split_once('=')
                .ok_or_else(|| refused(format!("{part:?} is not KEY=VALUE; write {}", known())))?;
            let place = KEYS
                .iter()
                .position(|(name, ..)| *name == key.trim().to_lowercase())
                .ok_or_else(|| refused(format!("{key:?} is none of {}", known())))?;
            if values[place].is_some() {
                return Err(refused(format!("{} is given twice", KEYS[place].0)));
            }
            let (name, unit, example) = KEYS[place];
            values[place] = Some(quantity(value.trim(), unit).ok_or_else(|| {
                refused(format!(
                    "{name} = {value:?} is no number above 0 with a unit of {unit}; write it as {name}={example}"
                ))
            })?);
        }
        let [Some(radius), Some(viscosity), critical_load] = values else {
            return Err(refused(
                "the radius a and the viscosity mu of the fluid are needed, as in a=1um,mu=1mPas"
                    .into(),
            ));
        };
        Ok(Self(Some(Physical {
            radius,
            viscosity,
            critical_load,
        })))
    }

    /// The word of a unit after conversion.
    pub(super) fn word<'u>(&self, unit: &'u str) -> &'u str {
        let Some(physical) = self.0 else {
            return unit;
        };
        match unit {
            "a" => "m",
            "mu" => "Pa s",
            "mu rate" | "F_crit/a²" if physical.critical_load.is_some() => "Pa",
            "a rate" if physical.critical_load.is_some() => "m/s",
            "Γ" if physical.critical_load.is_some() => "1/s",
            unit => unit,
        }
    }

    /// What a number of this unit is multiplied by at a dimensionless shear rate; `None` where it has no finite value.
    pub(super) fn factor(&self, unit: &str, shear_rate: Option<f64>) -> Option<f64> {
        let Some(physical) = self.0 else {
            return Some(1.0);
        };
        let Physical {
            radius,
            viscosity,
            critical_load,
        } = physical;
        let second = critical_load.map(|load| load / (6.0 * PI * viscosity * radius * radius));
        let rate = || {
            let rate = shear_rate? * second?;
            rate.is_finite().then_some(rate)
        };
        match (unit, critical_load) {
            ("a", _) => Some(radius),
            ("mu", _) => Some(viscosity),
            ("F_crit/a²", Some(load)) => Some(load / (radius * radius)),
            ("Γ", Some(_)) => second,
            ("mu rate", Some(_)) => Some(viscosity * rate()?),
            ("a rate", Some(_)) => Some(radius * rate()?),
            _ => Some(1.0),
        }
    }

    /// What a relative viscosity is multiplied by.
    pub(super) fn viscosity_factor(&self) -> f64 {
        self.0.map_or(1.0, |physical| physical.viscosity)
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
fn refused(message: String) -> ReportError {
    ReportError::Argument {
        argument: "--units",
        message,
    }
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
            ("a=0um,mu=1mPas", "above 0"),
            ("a=1um,a=2um", "twice"),
            ("a", "KEY=VALUE"),
        ] {
            let error = Units::parse(text).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }

    /// σ = η mu rate = σ* F_crit/a², whichever way it is computed.
    #[test]
    fn stresses_are_the_same_by_rate_and_by_load() {
        let units = Units::parse("a=2um,mu=1.5mPas,f_crit=0.3nN").unwrap();
        let eta = 7.0;
        let by_rate = eta * units.factor("mu rate", Some(3.0)).unwrap();
        let by_load = eta * 3.0 / (6.0 * PI) * units.factor("F_crit/a²", Some(3.0)).unwrap();
        assert!((by_rate / by_load - 1.0).abs() < 1e-12);
        let rate = 3.0 * units.factor("Γ", Some(3.0)).unwrap();
        let viscosity = eta * units.factor("mu", Some(3.0)).unwrap();
        assert!((rate * viscosity / by_rate - 1.0).abs() < 1e-12);
        assert_eq!(units.factor("mu rate", Some(f64::INFINITY)), None);
    }
}
