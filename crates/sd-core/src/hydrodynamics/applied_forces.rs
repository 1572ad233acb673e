//! Which spheres there may be, and which forces may be applied to them.

use super::resistance::Fluid;
use crate::error::Error;
use crate::model::Hydrodynamics;
use crate::space::cell::Cell;
use crate::space::{FixedArray as _, Space};

/// Largest sum of forces, over the sum of their magnitudes, that counts as rounding.
const ROUNDING: f64 = 1e-10;

/// Refuses numbers that are not finite, in a list with `each` numbers of every sphere.
///
/// # Errors
/// [`Error::OfSphere`].
pub(crate) fn check_numbers(field: &'static str, list: &[f64], each: usize) -> Result<(), Error> {
    match list.iter().position(|x| !x.is_finite()) {
        Some(at) => Err(Error::OfSphere {
            field,
            sphere: at / each,
            value: list[at],
            allowed: "finite",
        }),
        None => Ok(()),
    }
}

/// Refuses parameters of the hydrodynamics, radii or centres out of range, and centres of another
/// number.
///
/// # Errors
/// [`Error::OutOfRange`]; [`Error::Length`]; [`Error::OfSphere`].
pub(crate) fn check_spheres<S: Space>(
    hydrodynamics: Hydrodynamics,
    radii: &[f64],
    centres: &[S::Vector],
) -> Result<(), Error> {
    if let Some(numbers) = hydrodynamics.leading_order() {
        numbers.check()?;
    }
    let bad = |radius: &f64| !(*radius > 0.0 && radius.is_finite());
    if let Some(sphere) = radii.iter().position(bad) {
        return Err(Error::OfSphere {
            field: "radii",
            sphere,
            value: radii[sphere],
            allowed: "positive and finite",
        });
    }
    check_centres::<S>(centres, radii.len())
}

/// Refuses centres of another number, or that are not finite.
///
/// # Errors
/// [`Error::Length`]; [`Error::OfSphere`].
pub(crate) fn check_centres<S: Space>(centres: &[S::Vector], spheres: usize) -> Result<(), Error> {
    check_length("centres", centres.len(), spheres)?;
    let points: Vec<_> = centres.iter().map(S::point).collect();
    check_numbers("centres", S::Point::flat(&points), S::DIMENSIONS)
}

/// Refuses a list without one entry for each sphere.
///
/// # Errors
/// [`Error::Length`].
pub(crate) fn check_length(
    field: &'static str,
    found: usize,
    expected: usize,
) -> Result<(), Error> {
    if found == expected {
        return Ok(());
    }
    Err(Error::Length {
        field,
        found,
        expected,
    })
}

/// Refuses a net force that moves the spheres infinitely fast: on a periodic layer under the full
/// far field. The list has `each` numbers of every sphere, forces first.
///
/// # Errors
/// [`Error::NetForce`].
pub(crate) fn check_net_force<S: Fluid>(
    hydrodynamics: Hydrodynamics,
    cell: &Cell<S>,
    forces: &[f64],
    each: usize,
) -> Result<(), Error> {
    if hydrodynamics != Hydrodynamics::StokesianDynamics || cell.content().is_none() {
        return Ok(());
    }
    for k in 0..S::DRIFTS {
        let along = || forces.iter().skip(k).step_by(each);
        let net: f64 = along().sum();
        let magnitude: f64 = along().map(|force| force.abs()).sum();
        if net.abs() > ROUNDING * magnitude || !net.is_finite() {
            return Err(Error::NetForce {
                direction: ['x', 'y', 'z'][k],
                net,
            });
        }
    }
    Ok(())
}
