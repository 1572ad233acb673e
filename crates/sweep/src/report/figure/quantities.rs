//! What a figure shows: quantities of points.

use super::{Drawing, Kind};
use crate::measure::Estimate;
use crate::measure::numbers::{NUMBERS, Number};
use crate::report::points::Point;
use sd_core::Params;

/// A value, and the extent of its interval down and up.
pub(super) type Plotted = [f64; 3];

pub(super) fn plotted(estimate: Estimate) -> Plotted {
    let half = estimate.ci95.unwrap_or(0.0);
    [estimate.mean, half, half]
}

/// A quantity of every point: its label, and its column.
pub(super) type Measured = (&'static str, &'static str);

/// Quantities of figures that show more than one.
const CONTACTS: [Measured; 4] = [
    ("in contact", "contacts_per_sphere"),
    ("activated", "activated_per_sphere"),
    ("rolling", "rolling_per_sphere"),
    ("slipping", "slipping_per_sphere"),
];
const NORMAL_STRESS: [Measured; 2] = [("N₁/σ", "n1_over_stress"), ("N₂/σ", "n2_over_stress")];
const VISCOSITIES: [Measured; 2] = [("η", "viscosity"), ("η_n", "normal_viscosity")];

/// What the vertical axis of a figure shows: its label and unit, and the quantities.
pub(super) struct Quantities {
    pub(super) label: &'static str,
    pub(super) unit: &'static str,
    pub(super) measured: Vec<Measured>,
}

impl Quantities {
    pub(super) fn of(drawing: &Drawing) -> Self {
        let one = |label, name, unit| (label, unit, vec![(label, name)]);
        let number = |number: &'static Number| match number.label {
            "" => one(number.name, number.name, number.unit),
            label => one(label, number.name, number.unit),
        };
        let usual = Number::named("viscosity").unwrap_or(&NUMBERS[0]);
        let (label, unit, measured) = match drawing.kind {
            Kind::Contacts => ("pairs per sphere", "1", CONTACTS.to_vec()),
            Kind::NormalStress => ("N₁/σ, N₂/σ", "1", NORMAL_STRESS.to_vec()),
            Kind::Divergence => ("viscosities η, η_n", "mu", VISCOSITIES.to_vec()),
            Kind::FlowCurve => one("shear stress σ*", "shear_stress", "F_crit/a²"),
            Kind::FractionLaw => one("fraction", "fraction", "1"),
            Kind::Lissajous => one("stress / (μ γ₀ ω)", "", "1"),
            Kind::Distribution => one("probability density", "", "1"),
            Kind::Spectrum => one("power of η (per cycle in a strain of 1)", "", "1"),
            Kind::FrictionLaw => {
                Number::named("macroscopic_friction").map_or_else(|| number(usual), number)
            }
            Kind::Parts => number(usual),
            _ => number(drawing.number.unwrap_or(usual)),
        };
        Self {
            label,
            unit,
            measured,
        }
    }

    /// The names of their columns that a reference may have too.
    pub(super) fn names(&self) -> impl Iterator<Item = Measured> {
        self.measured.iter().map(|(label, name)| match *name {
            "fraction" => (*label, "volume_fraction"),
            name => (*label, name),
        })
    }
}

/// The value of a quantity at a point.
pub(super) fn read(name: &str, point: &Point) -> Option<Plotted> {
    let number = |name: &str| point.number(name);
    match name {
        "shear_stress" => point.shear_stress().map(plotted),
        "fraction" => {
            let imposed = || {
                let Params {
                    volume_fraction,
                    area_fraction,
                    ..
                } = point.params;
                Estimate::bare(volume_fraction.unwrap_or(area_fraction))
            };
            Some(plotted(point.estimate(name).unwrap_or_else(imposed)))
        }
        "viscosity_median" => {
            let value = number(name)?;
            let quartile = |n: u8| number(&format!("{name}_quartile_{n}"));
            let quartiles = quartile(1).zip(quartile(3));
            let (low, high) = quartiles.unwrap_or((value, value));
            Some([value, value - low, high - value])
        }
        "activated_per_sphere" | "rolling_per_sphere" | "slipping_per_sphere" => {
            let activated = number("activated_fraction").unwrap_or(0.0);
            let rolling = number("rolling_fraction").unwrap_or(0.0);
            let share = match name {
                "activated_per_sphere" => activated,
                "rolling_per_sphere" => activated * rolling,
                _ => activated * (1.0 - rolling),
            };
            Some([number("contacts_per_sphere")? * share, 0.0, 0.0])
        }
        "contacts_per_sphere" => Some([number(name)?, 0.0, 0.0]),
        name => point.estimate(name).map(plotted),
    }
}
