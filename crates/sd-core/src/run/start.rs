//! Starts: random spheres without contact, in layers at any area fraction up to 0.84, in
//! suspensions up to a volume fraction of 0.60 for equal spheres and 0.62 for sizes 1 : 1.4; as
//! they are packed, or in thermal equilibrium.
//!
//! The parameters must be valid, as those of [`Params::builder`] are: only
//! [`Snapshot::start`](crate::Snapshot::start) checks them too.

mod equilibrium;
mod first_cell;
mod given;
mod limits;
mod packing;

pub(crate) use first_cell::first_cell;
pub use first_cell::{begins_like, radii_and_side};
pub use given::fit;
pub(super) use limits::check_cutoff;
pub use limits::{check, freezing_exceeded};

use crate::error::Error;
use crate::model::{Params, StartFrom, StartLayer};
use crate::space::modes::Vec2;
use crate::space::{Bulk, Layer, Space};
use equilibrium::HardSpheres;
use limits::check_density;
use packing::{DISCS, Density, Packing, SPHERES};

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
mod tests;
