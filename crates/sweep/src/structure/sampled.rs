//! The numbers of the spheres at an instant that every run samples: order, homogeneity, motion and
//! constraints.

use super::constraints::hyperstaticity;
use super::network::Network;
use super::order::{concentration, layering, localisation, psi_6, q_6};
use sd_core::Space;
use sd_core::simulation::{Frame, StructureSample};

/// What the numbers of a frame are relative to.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Reference<'r> {
    /// Sense of the shear, 1 or −1.
    pub direction: f64,
    /// Places of the spheres at the start of the run along gradient and vorticity, in a.
    pub start: Option<&'r [[f64; 2]]>,
    /// Whether there is shear across the primary one: images then also lie apart along z, and the
    /// spheres are carried along it.
    pub has_cross_shear: bool,
}

/// The numbers of a frame and its network; NaN where they have no meaning.
pub(crate) fn sampled<S: Space>(
    frame: &Frame<S>,
    network: &Network<S>,
    reference: Reference<'_>,
) -> StructureSample {
    let (side, is_layer) = (frame.side, S::DIMENSIONS == 2);
    let or_nan = |is: bool, of: &dyn Fn() -> f64| if is { of() } else { f64::NAN };
    // Other cells have no period along an axis, and other flows carry spheres along all of them.
    let has_y = network.is_sheared();
    let has_z = has_y && !is_layer && !reference.has_cross_shear;
    let localised = || {
        let disturbances = frame.velocities.iter().zip(&frame.centres);
        let disturbances = disturbances.map(|(u, x)| u[0] - reference.direction * x[1]);
        localisation(network, side, disturbances)
    };
    StructureSample {
        layering: or_nan(has_y, &|| layering(network, side)),
        psi_6: or_nan(is_layer, &|| psi_6(network, side)),
        q_6: or_nan(!is_layer, &|| q_6(network, side)),
        localisation: or_nan(has_y, &localised),
        concentration_y: or_nan(has_y, &|| concentration(network, side, 1)),
        concentration_z: or_nan(has_z, &|| concentration(network, side, 2)),
        displacement_yy: or_nan(has_y, &|| displacement(frame, reference.start, 1)),
        displacement_zz: or_nan(has_z, &|| displacement(frame, reference.start, 2)),
        hyperstaticity: hyperstaticity(network),
    }
}

/// Mean square displacement along y or z since the start of the run, in a²: the primary shear
/// carries no sphere along these axes. NaN without a start.
fn displacement<S: Space>(frame: &Frame<S>, start: Option<&[[f64; 2]]>, axis: usize) -> f64 {
    let Some(start) = start.filter(|start| start.len() == frame.unwrapped.len()) else {
        return f64::NAN;
    };
    let pairs = frame.unwrapped.iter().zip(start);
    let squares = pairs.map(|(x, start)| (x[axis] - start[axis - 1]).powi(2));
    squares.sum::<f64>() / start.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::spaces::InSpace;
    use crate::test_support::{frame, suspension};

    #[test]
    fn layers_and_suspensions_have_the_numbers_that_exist_for_them() {
        let InSpace::Layer(layer) = frame() else {
            panic!("a layer")
        };
        let network = Network::try_from(&layer).unwrap();
        let start = [[1.0, 0.0], [2.0, 0.0]];
        let reference = Reference {
            direction: 1.0,
            start: Some(&start),
            has_cross_shear: false,
        };
        let found = sampled(&layer, &network, reference);
        // Unwrapped heights 2 and −6, from 1 and 2.
        assert_eq!(found.displacement_yy, 65.0 / 2.0);
        assert!(found.psi_6.is_finite() && found.q_6.is_nan());
        assert!(found.displacement_zz.is_nan() && found.concentration_z.is_nan());
        // One contact that slides: a constraint of four translations.
        assert_eq!(found.hyperstaticity, -1.5);
        let unknown = Reference {
            start: None,
            ..reference
        };
        assert!(sampled(&layer, &network, unknown).displacement_yy.is_nan());

        let InSpace::Suspension(bulk) = suspension(0.5, [1.0, 2.0, 0.5]) else {
            panic!("a suspension")
        };
        let network = Network::try_from(&bulk).unwrap();
        let found = sampled(&bulk, &network, reference);
        assert!(found.q_6.is_finite() && found.psi_6.is_nan());
        // Unwrapped depths 0.5 and −7.5, from 0.
        assert_eq!(found.displacement_zz, 56.5 / 2.0);
        let crossed = Reference {
            has_cross_shear: true,
            ..reference
        };
        let found = sampled(&bulk, &network, crossed);
        assert!(found.displacement_zz.is_nan() && found.displacement_yy.is_finite());
    }
}
