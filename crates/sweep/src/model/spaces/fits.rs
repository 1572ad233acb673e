//! Detects impossible suspensions without packing.

use sd_core::model::Refusal;
use sd_core::{Error, Params, start};

/// Volume fraction of the densest lattice, π/√18.
const CLOSEST: f64 = 0.740_480_489_693_061;
/// Volume fraction that equal spheres at random do not exceed: random close packing has 0.64. A
/// hundred spheres with a roughness of 0.01 were packed at 0.62, but not at 0.63.
const CLOSEST_AT_RANDOM: f64 = 0.645;

/// Refuses spheres that no cell holds without contact, and cells narrower than the near field.
pub(super) fn check(params: &Params) -> Result<(), Error> {
    let volume_fraction = params.volume_fraction.unwrap_or(0.0);
    let refuse = |key, value: String, problem: String, allowed: String, because| {
        Err(Error::from(Refusal {
            key,
            value,
            problem,
            allowed,
            because: Some(because),
        }))
    };
    // Spheres with the roughness around them.
    let growth = (1.0 + 0.5 * params.roughness).powi(3);
    let closest = if params.is_mixed() {
        CLOSEST
    } else {
        CLOSEST_AT_RANDOM
    };
    let most = closest / growth;
    if volume_fraction > most {
        return refuse(
            "volume_fraction",
            volume_fraction.to_string(),
            format!(
                "is denser than any suspension that starts without contact at `roughness` = {}",
                params.roughness
            ),
            format!(
                "at most {most:.3} at this roughness; two sizes, as of `size_ratio` = 1.4, are packed somewhat denser"
            ),
            "roughness",
        );
    }
    match start::radii_and_side(params) {
        Ok(_) => Ok(()),
        Err(Error::CellTooSmall { side, needed, .. }) => {
            let least = least_spheres(params, side, needed);
            refuse(
                "spheres",
                params.spheres.to_string(),
                format!(
                    "at `volume_fraction` = {volume_fraction} make a cell {side:.3} wide, less than {needed:.3}, twice the cutoff distance of pairs"
                ),
                format!(
                    "at least {least} spheres at this volume fraction, or a volume fraction of at most {:.3}",
                    volume_fraction * (side / needed).powi(3)
                ),
                "volume_fraction",
            )
        }
        Err(other) => Err(other),
    }
}

/// The number of spheres that make a cell of width `needed`, where the present number makes one of
/// width `side`. The largest of more spheres may be larger.
fn least_spheres(params: &Params, mut side: f64, mut needed: f64) -> usize {
    let mut more = params.clone();
    while more.spheres < Params::MAX_SPHERES {
        let wanted =
            crate::text::format::count((more.spheres as f64 * (needed / side).powi(3)).ceil());
        more.spheres = wanted.max(more.spheres + 1);
        match start::radii_and_side(&more) {
            Err(Error::CellTooSmall {
                side: wide,
                needed: least,
                ..
            }) => (side, needed) = (wide, least),
            _ => break,
        }
    }
    more.spheres
}
