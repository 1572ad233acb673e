//! Start layers: random, without contact, at any area fraction up to 0.84; start suspensions in
//! [`suspension`].

mod given;
mod packing;
pub mod suspension;

pub use given::fit;

use self::suspension::Mixture;
use crate::error::Error;
use crate::model::{Params, Refusal, StartLayer, Words as _};
use crate::space::cell::Cell;
use crate::space::modes::Vec2;
use crate::space::{Layer, Space};
use crate::stage::Method;
use packing::{Density, Packing};
use std::f64::consts::PI;

/// Packing limits of discs.
const DISCS: Density = Density {
    easy: 0.80,
    closest: 0.906_899_682_117_108_9, // π/√12
    shakes: 100,
    balanced: 0.0,
};

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
    /// Side of the square cell, in a.
    pub side: f64,
}

/// Refuses impossible layers without making one.
///
/// Layers that pass may still fail to pack: see [`layer`].
///
/// # Errors
/// [`Error::Refused`] about the number of spheres or the area fraction, with what is allowed.
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
    let n = params.spheres as f64;
    let refuse =
        |key, value: String, problem: String, allowed: String, because| -> Result<(), Error> {
            Err(Refusal {
                key,
                value,
                problem,
                allowed,
                because: Some(because),
            }
            .into())
        };
    let most = Method::of(params).most_spheres(params.hydrodynamics);
    if params.spheres > most {
        return refuse(
            "spheres",
            params.spheres.to_string(),
            format!(
                "is out of range under {} with the paper's procedure, which takes full matrices",
                params.hydrodynamics.word()
            ),
            format!("at most {most} there, which take a gigabyte"),
            "contact",
        );
    }
    // Spheres that, with their roughness, exceed the packing limit of discs.
    let growth = (1.0 + 0.5 * params.roughness).powi(2);
    if params.start.is_none() && params.area_fraction * growth > DISCS.closest {
        return refuse(
            "area_fraction",
            params.area_fraction.to_string(),
            format!(
                "is denser than any layer that starts without contact at `roughness` = {}",
                params.roughness
            ),
            format!("at most {:.3} at this roughness", DISCS.closest / growth),
            "roughness",
        );
    }
    let (largest, mean_square) = if let Some(sizes) = params.sizes {
        let radii = sizes.radii(params.spheres);
        let squares: f64 = radii.iter().map(|a| a * a).sum();
        (radii[0], squares / n)
    } else {
        // Two radii of mean 1, and the mean square of all.
        let large = number_of_large(params) as f64 / n;
        let small_radius = 1.0 / (1.0 - large + large * params.size_ratio);
        let largest = if large > 0.0 {
            params.size_ratio * small_radius
        } else {
            small_radius
        };
        let mean_square = small_radius
            * small_radius
            * (1.0 - large + large * params.size_ratio * params.size_ratio);
        (largest, mean_square)
    };
    let area = n * PI * mean_square;
    let side = (area / params.area_fraction).sqrt();
    let Err(Error::CellTooSmall { side, needed, .. }) =
        Cell::<Layer>::equal_sides(side, 0.0)?.check_range(&[largest])
    else {
        return match &params.start {
            Some(given) => fit(given, params).map(|_| ()),
            None => Ok(()),
        };
    };
    let least = (needed * needed * params.area_fraction / (PI * mean_square)).ceil();
    refuse(
        "spheres",
        params.spheres.to_string(),
        format!(
            "at `area_fraction` = {} make a cell {side:.3} wide, less than {needed:.3}, twice the cutoff distance of pairs",
            params.area_fraction
        ),
        format!(
            "at least {least} spheres at this area fraction, or an area fraction of at most {:.3}",
            area / (needed * needed)
        ),
        "area_fraction",
    )
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
/// [`Error::CellTooSmall`].
pub fn radii_and_side(params: &Params) -> Result<(Vec<f64>, f64), Error> {
    if params.volume_fraction.is_some() {
        return Mixture::of(params).radii_and_side();
    }
    let radii = match params.sizes {
        Some(sizes) => sizes.radii(params.spheres).to_vec(),
        None => radii(params.spheres, params.size_ratio, number_of_large(params)),
    };
    let area: f64 = radii.iter().map(|a| PI * a * a).sum();
    let side = (area / params.area_fraction).sqrt();
    Cell::<Layer>::equal_sides(side, 0.0)?.check_range(&radii)?;
    Ok((radii, side))
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
pub fn first_layer(params: &Params, seed: u64) -> Result<Start, Error> {
    let Some(given) = &params.start else {
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
/// # Errors
/// [`Error::CellTooSmall`], or [`Error::CannotPack`] with the area fraction reached.
pub fn layer(params: &Params, seed: u64) -> Result<Start, Error> {
    let (radii, side) = radii_and_side(params)?;
    let mut packing = Packing::<Layer>::new(Cell::equal_sides(side, 0.0)?, radii, params.roughness);
    packing
        .pack(params.area_fraction, &DISCS, seed)
        .map_err(|reached| Error::CannotPack {
            spheres: params.spheres,
            kind: "area",
            fraction: params.area_fraction,
            gap: params.roughness,
            reached,
            advice: "lower the area fraction or the roughness, use other numbers of spheres, or two sizes",
        })?;
    if params.spheres > Params::LARGE_ABOVE {
        packing.number_by_rows(params.sizes);
    }
    Ok(Start {
        orientations: vec![0.0; packing.radii.len()],
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
    use crate::model::{ContactScheme, Hydrodynamics};

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
            ..Params::UNWRITTEN
        }
    }

    /// Smallest gap between any two images, by brute force.
    fn smallest_gap(start: &Start) -> f64 {
        let mut smallest = f64::INFINITY;
        for (i, x) in start.centres.iter().enumerate() {
            for (j, y) in start.centres.iter().enumerate().skip(i + 1) {
                for m in -1..=1 {
                    for n in -1..=1 {
                        let shift = Vec2::new(f64::from(m), f64::from(n)) * start.side;
                        let gap = (y + shift - x).norm() - start.radii[i] - start.radii[j];
                        smallest = smallest.min(gap);
                    }
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
            assert!(smallest_gap(&start) >= params.roughness);
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
        assert!(smallest_gap(&start) >= params.roughness);
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
        // Grown by h = 0.4 these discs would cover more than the plane.
        let params = Params {
            roughness: 0.4,
            ..params(30, 0.84, 1.0)
        };
        assert!(matches!(layer(&params, 1), Err(Error::CannotPack { .. })));
    }

    #[test]
    fn small_cell_is_refused() {
        let too_small = layer(&params(10, 0.84, 1.0), 1);
        assert!(matches!(too_small, Err(Error::CellTooSmall { .. })));
    }
}
