//! Radii of the spheres and the cell they begin in, before they are packed.

use crate::error::Error;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::model::{Params, PressureKind};
use crate::run::cell_path::CellPath;
use crate::space::cell::{Cell, needed};
use crate::space::{Bulk, Layer, Space};
use std::f64::consts::PI;

/// Area and volume fraction up to which an imposed pressure may compress discs and spheres.
const DENSEST: [f64; 2] = [0.84, 0.64];

/// Key, kind and value of the fraction of the spheres, and the number of dimensions.
pub(super) fn fraction_of(params: &Params) -> (&'static str, &'static str, f64, i32) {
    match params.volume_fraction {
        Some(fraction) => ("volume_fraction", "volume", fraction, 3),
        None => ("area_fraction", "area", params.area_fraction, 2),
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
        None => radii(params.spheres, params.size_ratio, params.number_of_large()),
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

/// Radii of mean 1, the large ones first.
pub(super) fn radii(spheres: usize, size_ratio: f64, large: usize) -> Vec<f64> {
    let mut radii = vec![1.0; spheres];
    radii[..large].fill(size_ratio);
    let mean = radii.iter().sum::<f64>() / spheres as f64;
    for a in &mut radii {
        *a /= mean;
    }
    radii
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
/// segments together, and one more may change it. Parameters that
/// [`check`](super::check) refuses have no cells.
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
