//! Starts: random spheres without contact, in layers at any area fraction up to 0.84, in
//! suspensions up to a volume fraction of 0.60 for equal spheres and 0.62 for sizes 1 : 1.4; as
//! they are packed, or in thermal equilibrium.
//!
//! The parameters must be valid, as those of [`Params::builder`] are: only
//! [`Snapshot::start`](crate::Snapshot::start) checks them too.

mod equilibrium;
mod given;
mod packing;

pub use given::fit;

use crate::error::Error;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::model::{Keywords as _, Params, PressureKind, Refusal, StartFrom, StartLayer};
use crate::run::cell_path::CellPath;
use crate::space::cell::{Cell, LUBRICATION_RANGE, needed};
use crate::space::modes::Vec2;
use crate::space::{Bulk, Layer, Space};
use crate::stage::Method;
use equilibrium::HardSpheres;
use packing::{Density, Packing};
use std::f64::consts::PI;

/// Packing limits of discs.
const DISCS: Density = Density {
    easy: 0.80,
    closest: 0.906_899_682_117_108_9, // π/√12
    shakes: 100,
    balanced: 0.0,
};

/// Packing limits of spheres.
const SPHERES: Density = Density {
    easy: 0.55,
    closest: 0.740_480_489_693_061, // π/√18
    shakes: 10,
    balanced: 1e-4,
};

/// Volume fraction that equal spheres at random do not exceed: random close packing has 0.64. A
/// hundred spheres with a roughness of 0.01 were packed at 0.62, but not at 0.63.
const CLOSEST_AT_RANDOM: f64 = 0.645;

/// Area and volume fraction up to which an imposed pressure may compress discs and spheres.
const DENSEST: [f64; 2] = [0.84, 0.64];

/// Area fraction up to which equal hard discs in equilibrium are a fluid (Bernard & Krauth, Phys.
/// Rev. Lett. 107, 155704, 2011).
const FREEZING_OF_DISCS: f64 = 0.700;

/// Volume fraction up to which equal hard spheres in equilibrium are a fluid (Hoover & Ree, J.
/// Chem. Phys. 49, 3609, 1968).
const FREEZING_OF_SPHERES: f64 = 0.494;

/// Radii, centres and cell of a layer or a suspension at strain 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Start<S: Space = Layer> {
    /// Radii, in a; their mean is 1.
    pub radii: Vec<f64>,
    /// Centres, in a, inside the cell.
    pub centres: Vec<S::Vector>,
    /// Orientations: in radians, or unit quaternions.
    pub orientations: Vec<S::Orientation>,
    /// Stretches of tangential springs, in a, by pair.
    pub springs: Vec<(u32, u32, S::Tangent)>,
    /// Stretches of the springs of rolling friction.
    pub rolling_springs: Vec<(u32, u32, S::Tangent)>,
    /// Side of the square or cubic cell, or of one with the content of the lattice, in a.
    pub side: f64,
}

/// Refuses impossible layers and suspensions without making one.
///
/// Those that pass may still fail to pack: see [`layer`] and [`suspension`].
///
/// # Errors
/// [`Error::Refused`] about the number of spheres or their fraction, with what is allowed.
///
/// # Panics
/// May panic if [`Params::validate`] refuses the parameters.
///
/// ```
/// use sd_core::start;
/// # use sd_core::{Hydrodynamics, Params};
/// # let params = Params::builder()
/// #     .spheres(40)
/// #     .area_fraction(0.6)
/// #     .roughness(0.01)
/// #     .friction(0.5)
/// #     .shear_rate(2.0)
/// #     .hydrodynamics(Hydrodynamics::BallMelrose)
/// #     .build()?;
///
/// start::check(&params)?;
/// // A cell of ten spheres is too small for the range of lubrication.
/// let few = Params { spheres: 10, ..params };
/// assert!(start::check(&few).unwrap_err().to_string().contains("at least"));
/// # Ok::<(), sd_core::Error>(())
/// ```
pub fn check(params: &Params) -> Result<(), Error> {
    let method = Method::of(params);
    let most = method.most_spheres(params.hydrodynamics);
    if params.spheres > most {
        let word = params.hydrodynamics.word();
        let (problem, because) = match method {
            Method::Dense => (
                format!(
                    "is out of range under {word} with the paper's procedure, which takes full matrices"
                ),
                "contact",
            ),
            Method::Pairwise | Method::Iterated => {
                (format!("is out of range under {word}"), "hydrodynamics")
            }
        };
        return Err(Refusal {
            key: "spheres",
            value: params.spheres.to_string(),
            problem,
            allowed: format!("at most {most} there"),
            because: Some(because),
        }
        .into());
    }
    if params.given_layer().is_none() {
        check_density(params)?;
    }
    let (shape, side, needed) = match radii_and_side(params) {
        Ok((radii, _)) => {
            check_cutoff(params, &radii)?;
            return match params.given_layer() {
                Some(given) => fit(given, params).map(|_| ()),
                None => Ok(()),
            };
        }
        Err(Error::CellTooSmall { side, needed, .. }) => {
            let shape = if params.imposes_pressure() {
                format!("a cell that a pressure may shrink to a width of {side:.3}")
            } else {
                format!("a cell {side:.3} wide")
            };
            (shape, side, needed)
        }
        Err(Error::LatticeTooShort { shortest, needed }) => (
            format!("a lattice whose shortest vector is {shortest:.3} at times in this `flow`"),
            shortest,
            needed,
        ),
        Err(other) => return Err(other),
    };
    let (key, kind, fraction, power) = fraction_of(params);
    let sizes = match &params.sizes {
        Some(sizes) => Some(("sizes", sizes.to_string())),
        None if params.size_ratio > 1.0 => Some(("size_ratio", params.size_ratio.to_string())),
        None => None,
    };
    let of_sizes = sizes.as_ref().map_or_else(String::new, |(key, value)| {
        format!(" and `{key}` = {value}")
    });
    let (range, model) = match params.hydrodynamics.leading_order() {
        Some(numbers) if power == 3 => (
            2.0 + numbers.cutoff,
            format!("`lubrication_cutoff` = {}", numbers.cutoff),
        ),
        _ => (
            LUBRICATION_RANGE,
            format!("`hydrodynamics` = {:?}", params.hydrodynamics.word()),
        ),
    };
    Err(Refusal {
        key: "spheres",
        value: params.spheres.to_string(),
        problem: format!(
            "at `{key}` = {fraction}{of_sizes} make {shape}, less than {needed:.3}, twice the range of pairs under {model}, \
             which is {range} radii of the largest sphere"
        ),
        allowed: if params.imposes_pressure() {
            format!("at least {} spheres", least_spheres(params, side, needed))
        } else {
            format!(
                "at least {} spheres at this {kind} fraction, or {} {kind} fraction of at most {:.3}",
                least_spheres(params, side, needed),
                if power == 2 { "an" } else { "a" },
                fraction * (side / needed).powi(power)
            )
        },
        because: Some(sizes.map_or(key, |(key, _)| key)),
    }
    .into())
}

/// Refuses a suspension whose pairs are listed only when their asperities overlap: contacts act
/// between pairs within the cutoff of lubrication.
pub(super) fn check_cutoff(params: &Params, radii: &[f64]) -> Result<(), Error> {
    let (Some(numbers), Some(_)) = (params.hydrodynamics.leading_order(), params.volume_fraction)
    else {
        return Ok(());
    };
    let smallest = radii.iter().copied().fold(f64::INFINITY, f64::min);
    let (range, most) = (
        params.contact.laws().hydrodynamic_friction_range,
        numbers.cutoff * smallest,
    );
    if range > most {
        return Err(Refusal {
            key: "hydrodynamic_friction_range",
            value: range.to_string(),
            problem: "reaches beyond the pairs that `lubrication_cutoff` leaves".into(),
            allowed: format!(
                "at most {most:.4}, the cutoff times the radius of the smallest spheres"
            ),
            because: Some("lubrication_cutoff"),
        }
        .into());
    }
    let least = (params.roughness + params.time_step) / smallest;
    if numbers.cutoff >= least {
        return Ok(());
    }
    Err(Refusal {
        key: "lubrication_cutoff",
        value: numbers.cutoff.to_string(),
        problem: format!(
            "ends before spheres of `roughness` = {} touch, and pairs beyond it have no contacts",
            params.roughness
        ),
        allowed: format!(
            "at least {least:.4}, the roughness and the strain of a step over the radius of the smallest spheres"
        ),
        because: Some("roughness"),
    }
    .into())
}

/// The fraction above which equal spheres of this roughness in equilibrium are no fluid, if the run
/// begins with such spheres and has a larger one: moves from a packing then end before crystals
/// are in equilibrium with it.
pub fn freezing_exceeded(params: &Params) -> Option<f64> {
    let (.., fraction, power) = fraction_of(params);
    let freezing = if power == 2 {
        FREEZING_OF_DISCS
    } else {
        FREEZING_OF_SPHERES
    };
    let freezing = freezing / (1.0 + 0.5 * params.roughness).powi(power);
    let begins_so = params.start == Some(StartFrom::Equilibrium) && !params.is_mixed();
    (begins_so && fraction > freezing).then_some(freezing)
}

/// Key, kind and value of the fraction of the spheres, and the number of dimensions.
fn fraction_of(params: &Params) -> (&'static str, &'static str, f64, i32) {
    match params.volume_fraction {
        Some(fraction) => ("volume_fraction", "volume", fraction, 3),
        None => ("area_fraction", "area", params.area_fraction, 2),
    }
}

/// Refuses spheres that, with their roughness, exceed the packing limit.
fn check_density(params: &Params) -> Result<(), Error> {
    let (key, _, fraction, power) = fraction_of(params);
    let growth = (1.0 + 0.5 * params.roughness).powi(power);
    let (name, closest, more) = match power {
        2 => ("layer", DISCS.closest, ""),
        _ => (
            "suspension",
            if params.is_mixed() {
                SPHERES.closest
            } else {
                CLOSEST_AT_RANDOM
            },
            "; random starts reach about 0.60, of sizes 1 : 1.4 about 0.62",
        ),
    };
    if fraction * growth <= closest {
        return Ok(());
    }
    Err(Refusal {
        key,
        value: fraction.to_string(),
        problem: format!(
            "is denser than any {name} that starts without contact at `roughness` = {}",
            params.roughness
        ),
        allowed: format!("at most {:.3} at this roughness{more}", closest / growth),
        because: Some("roughness"),
    }
    .into())
}

/// The number of spheres that make a cell of width `needed`, where the present number makes one of
/// width `side`. The largest of more spheres may be larger.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a number of spheres; a cast saturates"
)]
fn least_spheres(params: &Params, mut side: f64, mut needed: f64) -> usize {
    let (.., power) = fraction_of(params);
    let mut more = params.clone();
    while more.spheres < Params::MAX_SPHERES {
        let wanted = (more.spheres as f64 * (needed / side).powi(power)).ceil() as usize;
        more.spheres = wanted.max(more.spheres + 1);
        match radii_and_side(&more) {
            Err(
                Error::CellTooSmall {
                    side: wide,
                    needed: least,
                    ..
                }
                | Error::LatticeTooShort {
                    shortest: wide,
                    needed: least,
                },
            ) => (side, needed) = (wide, least),
            _ => break,
        }
    }
    more.spheres
}

/// Number of large spheres.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a fraction of n, rounded"
)]
fn number_of_large(params: &Params) -> usize {
    if params.size_ratio == 1.0 {
        0
    } else {
        (params.large_fraction * params.spheres as f64).round() as usize
    }
}

/// Radii and cell side, without packing.
///
/// # Errors
/// [`Error::CellTooSmall`]; [`Error::LatticeTooShort`] in a flow that is no shear.
///
/// # Panics
/// May panic if [`Params::validate`] refuses the parameters.
pub fn radii_and_side(params: &Params) -> Result<(Vec<f64>, f64), Error> {
    let radii = match &params.sizes {
        Some(sizes) => sizes.radii(params.spheres),
        None => radii(params.spheres, params.size_ratio, number_of_large(params)),
    };
    let side = if let Some(fraction) = params.volume_fraction {
        let volume: f64 = radii.iter().map(|a| 4.0 / 3.0 * PI * a.powi(3)).sum();
        let side = (volume / fraction).cbrt();
        check_range::<Bulk>(params, &radii, side)?;
        side
    } else {
        let area: f64 = radii.iter().map(|a| PI * a * a).sum();
        let side = (area / params.area_fraction).sqrt();
        check_range::<Layer>(params, &radii, side)?;
        side
    };
    Ok((radii, side))
}

/// Refuses a cell of this side, or a lattice of the same content, in which a sphere could have two
/// images of one neighbour in range, at the start or in the flow of the run.
fn check_range<S: Fluid>(params: &Params, radii: &[f64], side: f64) -> Result<(), Error> {
    let range = Resistance::<S>::range(params.hydrodynamics);
    let (.., fraction, power) = fraction_of(params);
    let shrunk = if params.imposes_pressure() {
        let power = match params.pressure {
            PressureKind::Isotropic => power,
            PressureKind::Gradient => 1,
        };
        (fraction / DENSEST[S::DIMENSIONS - 2]).powf(f64::from(power).recip())
    } else {
        1.0
    };
    let Some(shortest) = CellPath::<S>::shortest(params, side)? else {
        return Cell::<S>::equal_sides(side * shrunk, 0.0)?.check_range(radii, range);
    };
    let shortest = shortest * shrunk;
    let needed = needed(radii, range);
    if shortest < needed {
        return Err(Error::LatticeTooShort { shortest, needed });
    }
    Ok(())
}

/// The cell of a run at strain 0, with this side or the same content.
///
/// # Errors
/// Those of [`Cell::periodic`].
pub(crate) fn first_cell<S: Space>(params: &Params, side: f64) -> Result<Cell<S>, Error> {
    match CellPath::new(params, side)? {
        Some(path) => path.at(0.0, 0.0),
        None => Cell::equal_sides(side, 0.0),
    }
}

/// Whether a run has the cells of a shorter one, whose segments are its first, until that ends.
/// Only then is a state of the shorter run one of the longer too, with the same bits.
///
/// It has them if it is sheared throughout. Otherwise the cell at the start is chosen for all
/// segments together, and one more may change it. Parameters that [`check`] refuses have no cells.
///
/// # Panics
/// May panic if [`Params::validate`] refuses the parameters.
pub fn begins_like(run: &Params, shorter: &Params) -> bool {
    if run.is_sheared() {
        return true;
    }
    let begins = radii_and_side(run).and_then(|(_, side)| match run.volume_fraction {
        Some(_) => CellPath::<Bulk>::begins_like(run, shorter, side),
        None => CellPath::<Layer>::begins_like(run, shorter, side),
    });
    begins.unwrap_or(false)
}

/// Radii of mean 1, the large ones first.
fn radii(spheres: usize, size_ratio: f64, large: usize) -> Vec<f64> {
    let mut radii = vec![1.0; spheres];
    radii[..large].fill(size_ratio);
    let mean = radii.iter().sum::<f64>() / spheres as f64;
    for a in &mut radii {
        *a /= mean;
    }
    radii
}

/// The start layer of a run: a given one, or else that of the seed.
///
/// # Errors
/// Those of [`fit`] and [`layer`].
///
/// # Panics
/// May panic if [`Params::validate`] refuses the parameters.
pub fn first_layer(params: &Params, seed: u64) -> Result<Start, Error> {
    let Some(given) = params.given_layer() else {
        return layer(params, seed);
    };
    let StartLayer {
        side,
        radii,
        centres,
        orientations,
        springs,
        rolling_springs,
        ..
    } = fit(given, params)?;
    Ok(Start {
        springs,
        rolling_springs,
        radii,
        centres: centres.iter().map(|x| Vec2::new(x[0], x[1])).collect(),
        orientations,
        side,
    })
}

/// Makes the layer, which depends only on the parameters and the seed (`ChaCha8`).
///
/// ```
/// use sd_core::start;
/// # use sd_core::{Hydrodynamics, Params};
/// # let params = Params::builder()
/// #     .spheres(40)
/// #     .area_fraction(0.6)
/// #     .roughness(0.01)
/// #     .friction(0.5)
/// #     .shear_rate(2.0)
/// #     .hydrodynamics(Hydrodynamics::BallMelrose)
/// #     .build()?;
///
/// let layer = start::layer(&params, 7)?;
/// assert_eq!(layer, start::layer(&params, 7)?);
/// let discs: f64 = layer.radii.iter().map(|a| std::f64::consts::PI * a * a).sum();
/// assert!((discs / layer.side.powi(2) - 0.6).abs() < 1e-12);
/// # Ok::<(), sd_core::Error>(())
/// ```
///
/// # Errors
/// [`Error::Refused`] above the packing limit, [`Error::CellTooSmall`], or [`Error::CannotPack`]
/// with the area fraction reached.
///
/// # Panics
/// May panic if [`Params::validate`] refuses the parameters.
pub fn layer(params: &Params, seed: u64) -> Result<Start, Error> {
    let by_rows = params.spheres > Params::LARGE_ABOVE;
    pack(
        params,
        (params.area_fraction, "area"),
        &DISCS,
        by_rows,
        seed,
    )
}

/// Makes the suspension, which depends only on the parameters and the seed (`ChaCha8`).
///
/// # Errors
/// [`Error::Refused`] above the packing limit, [`Error::CellTooSmall`], or [`Error::CannotPack`]
/// with the volume fraction reached.
///
/// # Panics
/// May panic if [`Params::validate`] refuses the parameters.
pub fn suspension(params: &Params, seed: u64) -> Result<Start<Bulk>, Error> {
    let fraction = params.volume_fraction.unwrap_or(0.0);
    pack(params, (fraction, "volume"), &SPHERES, true, seed)
}

fn pack<S: Space>(
    params: &Params,
    (fraction, kind): (f64, &'static str),
    density: &Density,
    by_rows: bool,
    seed: u64,
) -> Result<Start<S>, Error> {
    check_density(params)?;
    let (radii, side) = radii_and_side(params)?;
    let cell = first_cell(params, side)?;
    let mut packing = Packing::<S>::new(cell, radii, params.roughness);
    packing
        .pack(fraction, density, seed)
        .map_err(|reached| Error::CannotPack {
            spheres: params.spheres,
            kind,
            fraction,
            gap: params.roughness,
            reached,
        })?;
    if params.start == Some(StartFrom::Equilibrium) {
        let (radii, centres) = (&packing.radii, &mut packing.centres);
        HardSpheres::new(cell, radii, centres, params.roughness, seed).equilibrate();
    }
    if by_rows {
        packing.number_by_rows(params.sizes.is_some());
    }
    Ok(Start {
        orientations: vec![S::UPRIGHT; packing.radii.len()],
        springs: Vec::new(),
        rolling_springs: Vec::new(),
        radii: packing.radii,
        centres: packing.centres,
        side,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{ContactScheme, Hydrodynamics, LeadingOrder};
    use crate::space::neighbours::NeighbourList;

    fn params(spheres: usize, area_fraction: f64, size_ratio: f64) -> Params {
        Params {
            spheres,
            area_fraction,
            roughness: 0.01,
            friction: 0.0,
            shear_rate: 0.0,
            size_ratio,
            large_fraction: 0.5,
            hydrodynamics: Hydrodynamics::BallMelrose,
            contact: ContactScheme::Rigid,
            time_step: 0.005,
            ..Params::UNSET
        }
    }

    /// A suspension of two hundred spheres.
    fn suspension_of(volume_fraction: f64, size_ratio: f64, roughness: f64) -> Params {
        Params {
            area_fraction: 0.0,
            volume_fraction: Some(volume_fraction),
            roughness,
            ..params(200, 0.0, size_ratio)
        }
    }

    /// Smallest gap between any two images, by brute force.
    fn smallest_gap<S: Space>(start: &Start<S>, offset: f64) -> f64 {
        let cell = Cell::<S>::equal_sides(start.side, offset).unwrap();
        let mut smallest = f64::INFINITY;
        for (i, x) in start.centres.iter().enumerate() {
            for (j, y) in start.centres.iter().enumerate().skip(i + 1) {
                for image in 0..45 {
                    let numbers = [image % 5 - 2, image / 5 % 3 - 1, image / 15 - 1];
                    let mut image = S::Image::default();
                    for k in 0..S::DIMENSIONS {
                        image[k] = numbers[k];
                    }
                    let shift = cell.image_vector(image);
                    let apart = *y + shift - *x;
                    let distance = S::norm_squared(&apart).sqrt();
                    smallest = smallest.min(distance - start.radii[i] - start.radii[j]);
                }
            }
        }
        smallest
    }

    #[test]
    fn only_the_procedure_takes_full_matrices_for_many_spheres() {
        let many = |spheres, contact| Params {
            hydrodynamics: Hydrodynamics::StokesianDynamics,
            contact,
            ..params(spheres, 0.7, 1.0)
        };
        assert!(check(&many(10_000, ContactScheme::Rigid)).is_ok());
        assert!(check(&many(2_000, ContactScheme::Procedure)).is_ok());
        let refused = check(&many(2_001, ContactScheme::Procedure)).unwrap_err();
        assert!(refused.to_string().contains("procedure"), "{refused}");
        let refused = check(&many(10_001, ContactScheme::Rigid)).unwrap_err();
        assert!(refused.to_string().contains("at most 10000"), "{refused}");
        let near = Params {
            hydrodynamics: Hydrodynamics::BallMelrose,
            ..many(Params::MAX_SPHERES, ContactScheme::Rigid)
        };
        assert!(check(&near).is_ok());
    }

    #[test]
    fn no_pair_starts_in_contact_up_to_the_densest_layer() {
        for (spheres, c, ratio) in [
            (90, 0.1, 1.0),
            (90, 0.693, 1.0),
            (100, 0.84, 1.0),
            (100, 0.8, 1.4),
        ] {
            let params = params(spheres, c, ratio);
            let start = layer(&params, 1).unwrap();
            assert!(smallest_gap(&start, 0.0) >= params.roughness);
            let area: f64 = start.radii.iter().map(|a| PI * a * a).sum();
            assert!((area / start.side.powi(2) - c).abs() < 1e-12);
            let mean = start.radii.iter().sum::<f64>() / spheres as f64;
            assert!((mean - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn large_layers_are_numbered_row_by_row_and_keep_their_sizes() {
        let params = params(Params::LARGE_ABOVE + 1, 0.5, 1.4);
        let start = layer(&params, 1).unwrap();
        let (radii, _) = radii_and_side(&params).unwrap();
        assert_eq!(start.radii, radii);
        assert!(smallest_gap(&start, 0.0) >= params.roughness);
        // Spheres with consecutive numbers are neighbours, except at the ends of rows.
        let next = start.centres.windows(2);
        let far = next.filter(|pair| (pair[1] - pair[0]).norm() > 4.0 * packing::ROW);
        assert!(far.count() < params.spheres / 10);
    }

    #[test]
    fn layer_is_a_function_of_the_seed() {
        let params = params(60, 0.75, 1.4);
        assert_eq!(layer(&params, 7), layer(&params, 7));
        assert_ne!(layer(&params, 7), layer(&params, 8));
    }

    #[test]
    fn unpackable_spheres_are_refused() {
        // Grown by h = 0.4 these discs would cover more than the plane, the spheres as much as the
        // densest lattice; at once, as relaxations of so many spheres take long.
        let discs = Params {
            roughness: 0.4,
            ..params(1000, 0.84, 1.0)
        };
        let spheres = Params {
            spheres: 4000,
            ..suspension_of(0.45, 1.4, 0.4)
        };
        let (discs, spheres) = (layer(&discs, 1), suspension(&spheres, 1));
        for error in [discs.unwrap_err(), spheres.unwrap_err()] {
            let Error::Refused(refusal) = error else {
                panic!("{error}");
            };
            assert_eq!(refusal.because, Some("roughness"), "{refusal:?}");
        }
        // Discs that grow to 0.905 are not refused by their density, but cannot be packed.
        let dense = params(60, 0.84, 1.0);
        let dense = Params {
            roughness: 0.075,
            ..dense
        };
        assert!(matches!(layer(&dense, 1), Err(Error::CannotPack { .. })));
    }

    #[test]
    fn small_cell_is_refused() {
        let too_small = layer(&params(10, 0.84, 1.0), 1);
        assert!(matches!(too_small, Err(Error::CellTooSmall { .. })));
    }

    #[test]
    fn the_least_number_of_spheres_is_by_the_range_that_the_model_needs() {
        let with = |spheres, cutoff| Params {
            spheres,
            hydrodynamics: Hydrodynamics::Lubrication(LeadingOrder {
                cutoff,
                ..LeadingOrder::DEFAULT
            }),
            ..suspension_of(0.5, 1.4, 0.01)
        };
        check(&with(80, 0.5)).unwrap();
        // The range is (2 + ξ) a of the largest spheres, here 1.4/1.2.
        let side = |spheres| radii_and_side(&with(spheres, 0.1)).unwrap().1;
        assert!(side(30) >= 2.0 * 2.1 * 1.4 / 1.2);
        assert!(check(&with(20, 0.5)).is_err());
        let exact = Params {
            hydrodynamics: Hydrodynamics::BallMelrose,
            ..with(80, 0.5)
        };
        let error = check(&exact).unwrap_err().to_string();
        for part in [
            "spheres = 80 at `volume_fraction` = 0.5 and `size_ratio` = 1.4 make a cell",
            "twice the range of pairs under `hydrodynamics` = \"ball-melrose\", which is 4 radii of the largest sphere",
            "at least 90 spheres at this volume fraction",
        ] {
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn contacts_beyond_the_cutoff_of_lubrication_are_refused() {
        let with = |cutoff| Params {
            hydrodynamics: Hydrodynamics::Lubrication(LeadingOrder {
                cutoff,
                ..LeadingOrder::DEFAULT
            }),
            ..suspension_of(0.4, 1.0, 0.05)
        };
        let Err(Error::Refused(refusal)) = check(&with(0.04)) else {
            panic!("spheres that touch before they are neighbours");
        };
        assert_eq!(refusal.key, "lubrication_cutoff");
        check(&with(0.1)).unwrap();
    }

    #[test]
    fn no_pair_starts_in_contact_up_to_dense_suspensions() {
        for (volume_fraction, size_ratio, roughness) in [
            (0.05, 1.0, 0.01),
            (0.45, 1.0, 0.05),
            (0.60, 1.0, 0.01),
            (0.62, 1.4, 0.01),
        ] {
            let params = suspension_of(volume_fraction, size_ratio, roughness);
            let start = suspension(&params, 1).unwrap();
            let gap = smallest_gap(&start, 0.0);
            assert!(gap >= roughness, "{params:?}: {gap}");
            let radii = &start.radii;
            let volume: f64 = radii.iter().map(|a| 4.0 / 3.0 * PI * a.powi(3)).sum();
            assert!((volume / start.side.powi(3) / volume_fraction - 1.0).abs() < 1e-12);
            assert!((radii.iter().sum::<f64>() / radii.len() as f64 - 1.0).abs() < 1e-12);
            assert_eq!(radii[0] / radii[199], size_ratio);
            let inside = |x: f64| (0.0..start.side).contains(&x);
            assert!(start.centres.iter().flatten().all(|&x| inside(x)));
        }
    }

    #[test]
    fn spheres_are_packed_into_sheared_cells_too() {
        let radii = radii(150, 1.4, 75);
        let volume: f64 = radii.iter().map(|a| 4.0 / 3.0 * PI * a.powi(3)).sum();
        let side = (volume / 0.55).cbrt();
        let cell = Cell::equal_sides(side, 0.37 * side).unwrap();
        let mut packing = Packing::<Bulk>::new(cell, radii, 0.01);
        packing.pack(0.55, &SPHERES, 3).unwrap();
        let start = Start {
            orientations: Vec::new(),
            springs: Vec::new(),
            rolling_springs: Vec::new(),
            radii: packing.radii,
            centres: packing.centres,
            side,
        };
        assert!(smallest_gap::<Bulk>(&start, 0.37 * side) >= 0.01);
        // In another cell the same centres overlap.
        assert!(smallest_gap(&start, 0.0) < 0.0);
    }

    #[test]
    fn neighbours_in_a_suspension_are_near_in_memory() {
        let start = suspension(&suspension_of(0.45, 1.0, 0.01), 2).unwrap();
        let cell = Cell::<Bulk>::equal_sides(start.side, 0.0).unwrap();
        let mut list = NeighbourList::default();
        list.find(&cell, &start.centres, &start.radii, 2.5);
        let distance: usize = list.pairs().iter().map(|pair| pair.j - pair.i).sum();
        let mean = distance as f64 / list.pairs().len() as f64;
        // Numbers at random are a third of 200 apart.
        assert!(mean < 50.0, "{mean}");
    }

    #[test]
    fn suspension_is_a_function_of_the_seed() {
        let params = suspension_of(0.45, 1.0, 0.01);
        assert_eq!(suspension(&params, 7), suspension(&params, 7));
        assert_ne!(suspension(&params, 7), suspension(&params, 8));
    }

    #[test]
    fn suspensions_too_dense_or_too_small_are_refused() {
        let refusal = |params: Params| suspension(&params, 1).unwrap_err();
        let Error::CannotPack { reached, kind, .. } = refusal(suspension_of(0.70, 1.4, 0.01))
        else {
            panic!("packed");
        };
        assert!(
            kind == "volume" && reached > 0.5 && reached < 0.70,
            "{reached}"
        );
        let few = Params {
            spheres: 30,
            ..suspension_of(0.5, 1.0, 0.01)
        };
        assert!(matches!(refusal(few), Error::CellTooSmall { .. }));
    }
}
