//! Layers with a developed contact network: c = 0.693, h = 0.01, ν = 0.3, Γ = 100, rigid contacts.

use sd_core::contact::rigid::Memory;
use sd_core::{ContactScheme, Hydrodynamics, NearFields, Params, Simulation, Snapshot};

/// Time step of the runs and of the stages timed.
pub(crate) const TIME_STEP: f64 = 0.005;
/// Strain after which the layer is taken.
const STRAIN: f64 = 0.8;

/// Parameters of the layers.
pub(crate) fn params(spheres: usize, hydrodynamics: Hydrodynamics) -> Params {
    Params {
        spheres,
        area_fraction: 0.693,
        roughness: 0.01,
        friction: 0.3,
        shear_rate: 100.0,
        size_ratio: 1.0,
        large_fraction: 0.5,
        hydrodynamics,
        contact: ContactScheme::Rigid,
        time_step: TIME_STEP,
    }
}

/// A layer sheared by Ball-Melrose hydrodynamics.
pub(crate) fn sheared(spheres: usize) -> Snapshot {
    let params = params(spheres, Hydrodynamics::BallMelrose);
    let mut simulation =
        Simulation::new(&params, 1, &NearFields::default()).expect("valid parameters");
    while simulation.strain() < STRAIN {
        simulation.step().expect("a step that succeeds");
    }
    simulation.snapshot()
}

/// 2 × 2 copies of a layer, as one of four times the spheres.
pub(crate) fn quadrupled(small: &Snapshot) -> Snapshot {
    let n = small.radii.len();
    let mut large = small.clone();
    large.side = 2.0 * small.side;
    large.memory = Memory::default();
    let shift = small.steps as f64 * TIME_STEP * small.side;
    for copy in 1..4_usize {
        let (right, up) = ((copy % 2) as f64, (copy / 2) as f64);
        for k in 0..n {
            let [x, y] = small.centres[k];
            large
                .centres
                .push([x + right * small.side + up * shift, y + up * small.side]);
            large.orientations.push(small.orientations[k]);
            large.radii.push(small.radii[k]);
        }
    }
    // The same length, with the bits that the parameters give.
    let params = params(large.radii.len(), Hydrodynamics::BallMelrose);
    let (_, side) = sd_core::start::radii_and_side(&params).expect("a valid layer");
    assert!((side / large.side - 1.0).abs() < 1e-12);
    large.side = side;
    large
}
