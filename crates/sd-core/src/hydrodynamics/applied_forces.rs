//! Which forces may be applied to the spheres.

use super::resistance::Fluid;
use crate::error::Error;
use crate::model::Hydrodynamics;
use crate::space::cell::Cell;

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
        if net.abs() > ROUNDING * magnitude {
            return Err(Error::NetForce {
                direction: ['x', 'y', 'z'][k],
                net,
            });
        }
    }
    Ok(())
}
