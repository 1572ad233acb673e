//! One `[[grid]]`: the product of its axes.

use super::contact::{self, Choice, Contact};
use super::error::Problem;
use super::protocol;
use super::reader::{Axis, Distinct, Located, Table, number, whole, word};
use super::{CASE_LIMIT, Protocol};
use crate::case::Case;
use sd_core::cell::Cell;
use sd_core::{Hydrodynamics, Params};
use std::f64::consts::PI;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Most spheres of a layer.
const SPHERE_LIMIT: u64 = 10_000;
/// Most spheres under Stokesian Dynamics.
const FULL_LIMIT: u64 = 2_000;
/// Keys of a grid, besides those of [`contact`].
const KEYS: [&str; 10] = [
    "area_fraction",
    "friction",
    "roughness",
    "shear_rate",
    "seeds",
    "spheres",
    "hydrodynamics",
    "size_ratio",
    "large_fraction",
    "time_step",
];
/// Words for the hydrodynamics.
const HYDRODYNAMICS: [(&str, Hydrodynamics); 2] = [
    ("stokesian-dynamics", Hydrodynamics::StokesianDynamics),
    ("ball-melrose", Hydrodynamics::BallMelrose),
];
impl Distinct for Hydrodynamics {
    fn identity(&self) -> u64 {
        *self as u64
    }
    fn written(&self) -> String {
        name_of(&HYDRODYNAMICS, self).into()
    }
}

/// The word for a choice.
fn name_of<T: PartialEq>(words: &[(&'static str, T)], value: &T) -> &'static str {
    words
        .iter()
        .find(|(_, choice)| choice == value)
        .map_or("?", |(name, _)| name)
}

/// The axes of one grid.
#[derive(Debug)]
pub(super) struct Grid {
    /// Where its table begins.
    pub(super) span: Range<usize>,
    /// Area fraction c.
    area_fraction: Axis<f64>,
    /// Friction coefficient ν.
    friction: Axis<f64>,
    /// Roughness height h.
    roughness: Axis<f64>,
    /// Dimensionless shear rate Γ.
    shear_rate: Axis<f64>,
    /// Seeds.
    seeds: Axis<u64>,
    /// Number of spheres N.
    spheres: Axis<u64>,
    /// Hydrodynamics.
    hydrodynamics: Axis<Hydrodynamics>,
    /// Contact laws.
    contact: Contact,
    /// Size ratio.
    size_ratio: Axis<f64>,
    /// Number fraction of large spheres.
    large_fraction: Axis<f64>,
    /// Time step; the protocol's where the grid says nothing.
    time_step: Option<Axis<f64>>,
}

impl Grid {
    /// Reads a grid and checks the range of every value in it.
    pub(super) fn read(entries: &DeTable<'_>, span: Range<usize>) -> Result<Self, Problem> {
        let known = [&KEYS[..], &contact::KEYS].concat();
        let table = Table::new(entries, span.clone(), "[[grid]]", &known)?;
        let numbers = |key, example: &str, range, inside: fn(f64) -> bool| {
            table.need(key, example)?;
            table.axis(key, |written, key| number(written, key, range, inside))
        };
        let needed = |key, example: &str, range, inside| {
            numbers(key, example, range, inside)?
                .ok_or_else(|| Problem::at(&span, format!("no `{key}`"), "give it a value"))
        };
        let area_fraction = needed("area_fraction", "0.693", "above 0 and at most 0.84", |v| {
            v > 0.0 && v <= 0.84
        })?;
        let friction = needed("friction", "0.3", "from 0 to 10", |v| {
            (0.0..=10.0).contains(&v)
        })?;
        let roughness = needed("roughness", "0.01", "above 0 and below 0.5", |v| {
            v > 0.0 && v < 0.5
        })?;
        let shear_rate = needed(
            "shear_rate",
            "[0.1, 1.0, 10.0, inf]",
            "from 0 to inf (0 and inf are the plateaus)",
            |v| v >= 0.0,
        )?;
        table.need("spheres", "90")?;
        let spheres = table
            .axis("spheres", |written, key| {
                whole(written, key, 1..=SPHERE_LIMIT)
            })?
            .unwrap_or_else(|| Axis::default_value(90, &span));
        let seeds = read_seeds(table.need("seeds", "8")?, &table)?;
        let size_ratio = table
            .axis("size_ratio", |written, key| {
                number(written, key, "from 1 to 10", |v| (1.0..=10.0).contains(&v))
            })?
            .unwrap_or_else(|| Axis::default_value(1.0, &span));
        let large_fraction = table
            .axis("large_fraction", |written, key| {
                number(written, key, "from 0 to 1", |v| (0.0..=1.0).contains(&v))
            })?
            .unwrap_or_else(|| Axis::default_value(0.5, &span));
        let alike = size_ratio.values.iter().find(|ratio| ratio.value <= 1.0);
        if let (Some(ratio), true) = (alike, large_fraction.values.len() > 1) {
            return Err(Problem::at(
                &large_fraction.span,
                "several values of `large_fraction` at size ratio 1 are the same case",
                "one value, or only size ratios above 1 in this grid",
            )
            .also(&ratio.span, "all spheres alike"));
        }
        let hydrodynamics = table
            .axis("hydrodynamics", |written, key| {
                word(written, key, &HYDRODYNAMICS)
            })?
            .unwrap_or_else(|| Axis::default_value(Hydrodynamics::StokesianDynamics, &span));
        let contact = Contact::read(&table, &span)?;
        contact.check(&span, &roughness, &shear_rate)?;
        let time_step = table.axis("time_step", |written, key| {
            number(written, key, protocol::STEP_RANGE, protocol::is_step)
        })?;
        Ok(Self {
            span,
            area_fraction,
            friction,
            roughness,
            shear_rate,
            seeds,
            spheres,
            hydrodynamics,
            contact,
            size_ratio,
            large_fraction,
            time_step,
        })
    }

    /// Number of cases.
    pub(super) fn len(&self) -> u64 {
        [
            self.area_fraction.values.len(),
            self.friction.values.len(),
            self.roughness.values.len(),
            self.shear_rate.values.len(),
            self.seeds.values.len(),
            self.spheres.values.len(),
            self.hydrodynamics.values.len(),
            self.size_ratio.values.len(),
            self.large_fraction.values.len(),
            self.time_step.as_ref().map_or(1, |axis| axis.values.len()),
        ]
        .into_iter()
        .fold(self.contact.len(), |product: u64, n| {
            product.saturating_mul(n as u64)
        })
    }

    /// Refuses layers whose cell is smaller than twice the lubrication cut-off, and layers that no packing reaches.
    pub(super) fn check(&self, protocol: &Protocol) -> Result<(), Problem> {
        for step in self.time_step.iter().flat_map(|axis| &axis.values) {
            protocol::check_step(protocol, step)?;
        }
        for fraction in &self.area_fraction.values {
            for roughness in &self.roughness.values {
                check_packing(fraction, roughness)?;
            }
        }
        let full = self
            .hydrodynamics
            .values
            .iter()
            .any(|choice| choice.value == Hydrodynamics::StokesianDynamics);
        for spheres in &self.spheres.values {
            if full && spheres.value > FULL_LIMIT {
                return Err(Problem::at(
                    &spheres.span,
                    format!(
                        "`spheres` = {} is out of range under stokesian-dynamics",
                        spheres.value
                    ),
                    format!(
                        "at most {FULL_LIMIT} there, a gigabyte of full matrices; ball-melrose takes {SPHERE_LIMIT}"
                    ),
                ));
            }
            for fraction in &self.area_fraction.values {
                for ratio in &self.size_ratio.values {
                    for large in &self.large_fraction.values {
                        check_cell(spheres, fraction, ratio.value, large.value)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// All cases, seeds innermost, then shear rates, time steps outermost. Where values have no meaning, several can be the same.
    pub(super) fn cases<'g>(&'g self, protocol: &'g Protocol) -> impl Iterator<Item = Case> + 'g {
        let choices = self.contact.choices();
        let steps: Vec<f64> = match &self.time_step {
            Some(axis) => axis.values.iter().map(|step| step.value).collect(),
            None => vec![protocol.time_step],
        };
        steps
            .into_iter()
            .flat_map(move |step| self.cases_of(protocol.with_time_step(step), choices.clone()))
    }

    /// The cases of one time step under some contact laws.
    fn cases_of(
        &self,
        protocol: Protocol,
        choices: Vec<Choice>,
    ) -> impl Iterator<Item = Case> + '_ {
        let outer = self
            .hydrodynamics
            .values
            .iter()
            .flat_map(move |hydrodynamics| {
                choices.clone().into_iter().flat_map(move |contact| {
                    self.spheres.values.iter().flat_map(move |spheres| {
                        self.area_fraction
                            .values
                            .iter()
                            .flat_map(move |area_fraction| {
                                self.size_ratio.values.iter().map(move |ratio| {
                                    (hydrodynamics, contact, spheres, area_fraction, ratio)
                                })
                            })
                    })
                })
            });
        outer.flat_map(
            move |(hydrodynamics, contact, spheres, area_fraction, ratio)| {
                self.large_fraction.values.iter().flat_map(move |large| {
                    self.roughness.values.iter().flat_map(move |roughness| {
                        self.friction.values.iter().flat_map(move |friction| {
                            self.shear_rate.values.iter().flat_map(move |shear_rate| {
                                let (scheme, friction) =
                                    contact.scheme(roughness.value, friction.value);
                                let params = Params {
                                    spheres: usize::try_from(spheres.value).unwrap_or(usize::MAX),
                                    area_fraction: area_fraction.value,
                                    roughness: roughness.value,
                                    friction,
                                    shear_rate: shear_rate.value,
                                    size_ratio: ratio.value,
                                    large_fraction: large.value,
                                    hydrodynamics: hydrodynamics.value,
                                    contact: scheme,
                                    time_step: protocol.time_step,
                                };
                                self.seeds.values.iter().map(move |seed| {
                                    Case::new(params.clone(), seed.value, &protocol)
                                })
                            })
                        })
                    })
                })
            },
        )
    }
}

/// The seeds: a count n stands for 1, 2, … n; a list for itself.
fn read_seeds(written: &Spanned<DeValue<'_>>, table: &Table<'_>) -> Result<Axis<u64>, Problem> {
    if let DeValue::Array(_) = written.get_ref() {
        let largest = u64::from(u32::MAX);
        return table
            .axis("seeds", |written, key| whole(written, key, 0..=largest))?
            .ok_or_else(|| Problem::at(&written.span(), "no seeds", "give at least one"));
    }
    let count = whole(written, "seeds", 1..=CASE_LIMIT)?;
    Ok(Axis {
        values: (1..=count.value)
            .map(|value| Located {
                value,
                span: count.span.clone(),
            })
            .collect(),
        span: count.span,
    })
}

/// Radii of small and large spheres of mean 1, and the mean square over all `n`.
fn radii(n: u64, size_ratio: f64, large_fraction: f64) -> (f64, f64) {
    let n = n as f64;
    let large = if size_ratio > 1.0 {
        (large_fraction * n).round()
    } else {
        0.0
    };
    let x = large / n;
    let small_radius = 1.0 / (1.0 - x + x * size_ratio);
    let large_radius = size_ratio * small_radius;
    let largest = if large > 0.0 {
        large_radius
    } else {
        small_radius
    };
    let mean_square = (1.0 - x) * small_radius * small_radius + x * large_radius * large_radius;
    (largest, mean_square)
}

/// Refuses spheres that, with the roughness around them, cover more than the densest packing of equal discs.
///
/// Layers short of that may still fail to pack: their runs then fail and say so.
fn check_packing(fraction: &Located<f64>, roughness: &Located<f64>) -> Result<(), Problem> {
    let close_packed = PI / 12.0_f64.sqrt();
    let growth = 1.0 + 0.5 * roughness.value;
    if fraction.value * growth * growth <= close_packed {
        return Ok(());
    }
    Err(Problem::at(
        &fraction.span,
        format!(
            "no layer of `area_fraction` = {} starts without contact at `roughness` = {}",
            fraction.value, roughness.value
        ),
        format!(
            "an area fraction of at most {:.3} at this roughness",
            close_packed / (growth * growth)
        ),
    )
    .labelled("too dense")
    .also(&roughness.span, "for this roughness"))
}

/// Refuses one layer if its cell is too small.
fn check_cell(
    spheres: &Located<u64>,
    fraction: &Located<f64>,
    size_ratio: f64,
    large_fraction: f64,
) -> Result<(), Problem> {
    let (largest, mean_square) = radii(spheres.value, size_ratio, large_fraction);
    let side = (spheres.value as f64 * PI * mean_square / fraction.value).sqrt();
    let refused = Cell::periodic(side, side, 0.0).and_then(|cell| cell.check_range(&[largest]));
    let Err(error) = refused else {
        return Ok(());
    };
    let sd_core::Error::CellTooSmall { side, needed, .. } = error else {
        return Err(Problem::at(
            &fraction.span,
            error.to_string(),
            "a larger cell",
        ));
    };
    let least = (needed * needed * fraction.value / (PI * mean_square)).ceil();
    Err(Problem::at(
        &spheres.span,
        format!(
            "`spheres` = {} at `area_fraction` = {} make a cell {side:.3} wide, \
             less than {needed:.3}, twice the lubrication cut-off",
            spheres.value, fraction.value
        ),
        format!(
            "at least {least} spheres at this area fraction, or an area fraction of at most {:.3}",
            spheres.value as f64 * PI * mean_square / (needed * needed)
        ),
    )
    .labelled("too few spheres")
    .also(&fraction.span, "for this area fraction"))
}
