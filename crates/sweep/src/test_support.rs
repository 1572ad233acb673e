//! Synthetic samples and snapshots for tests outside the physics.

use crate::model::spaces::{AnyFrame, AnySnapshot, InSpace};
use sd_core::simulation::{Counters, Frame, FrameContact, SNAPSHOT_VERSION};
use sd_core::{ContactScheme, Hydrodynamics, Params, Sample, Snapshot, StressComponents};

/// Parameters of the paper's layer.
pub(crate) fn params() -> Params {
    Params::builder()
        .spheres(90)
        .area_fraction(0.693)
        .roughness(0.01)
        .friction(0.3)
        .shear_rate(f64::INFINITY)
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .contact(ContactScheme::Rigid)
        .time_step(0.005)
        .build()
        .unwrap()
}

/// Plausible counters.
pub(crate) fn counters() -> Counters {
    Counters {
        stages: 40,
        unconverged_stages: 1,
        jammed_stages: 2,
        worst_residual: 1e-10,
        minimum_gap: 0.0098,
        ..Counters::default()
    }
}

/// Plausible components of the stress.
fn stress() -> StressComponents {
    let mut sample = Sample::default();
    for (place, number) in crate::measure::numbers::kept().enumerate() {
        number.put(
            &mut sample,
            crate::data::Value::Number(0.25 * place as f64 - 2.0),
        );
    }
    sample.stress
}

/// A plausible sample.
pub(crate) fn sample(strain: f64) -> Sample {
    Sample {
        strain,
        viscosity: 7.0 + strain.sin(),
        viscosity_stresslet: 4.5,
        normal_stress_difference: -0.3,
        stress: stress(),
        shear_rate: 10.0,
        dissipation: 6.0,
        contacts: 60,
        activated: 30,
        sticking: 15,
        slipping: 15,
        normal_velocity: -1e-4,
        applied_power: 0.0,
        minimum_gap: 0.0099,
        counters: counters(),
        network: None,
        structure: None,
        fraction: None,
        pressure_hydrodynamic: Some(0.25),
    }
}

/// A plausible snapshot after a number of steps.
pub(crate) fn snapshot(steps: u64) -> AnySnapshot {
    let layer: Snapshot = serde_json::from_value(serde_json::json!({
        "version": SNAPSHOT_VERSION,
        "steps": steps,
        "centres": [[0.1, 0.2], [3.0, 0.3]],
        "orientations": [0.5, -0.25],
        "radii": [1.0, 1.0],
        "side": 20.0,
        "memory": {"laws": {"warm_start": {"forces": [[0, 1, 2.5, -0.5]], "rolling": [[0, 1, 0.25]]},
            "springs": [[0, 1, -0.5]], "rolling_springs": [[0, 1, 0.25]]}},
        "counters": counters(),
    }))
    .unwrap();
    InSpace::Layer(layer)
}

/// A frame of a suspension of two spheres in contact, the first at that position.
pub(crate) fn suspension(strain: f64, place: [f64; 3]) -> AnyFrame {
    InSpace::Suspension(Frame {
        strain,
        side: 8.0,
        vectors: Vec::new(),
        offset: -2.0,
        cross_offset: 0.0,
        radii: vec![1.0, 1.0],
        centres: vec![place, [3.5, 2.0, 0.5]],
        unwrapped: vec![[place[0] + 8.0, place[1], place[2]], [3.5, 2.0, -7.5]],
        velocities: vec![[2.5, 0.25, 1.0], [2.0, -0.25, 0.0]],
        angular_velocities: vec![[0.5, 0.0, -0.25].into(), [0.0, 0.0, -0.5].into()],
        orientations: vec![[0.8, 0.0, 0.6, 0.0], [1.0, 0.0, 0.0, 0.0]],
        stresslets: vec![[1.0, -1.0, 20.5, 0.25, -0.5], [0.0, 0.5, 19.0, 0.0, 2.0]],
        contacts: vec![FrameContact {
            i: 0,
            j: 1,
            normal: [0.0, 0.6, 0.8],
            gap: 0.0078125,
            normal_force: 12.5,
            tangential_force: [3.0, 0.0, -4.0].into(),
            rolling_force: [0.0; 3].into(),
            state: sd_core::contact::ContactState::Sticking,
        }],
    })
}

/// A frame of two spheres in contact.
pub(crate) fn frame() -> AnyFrame {
    InSpace::Layer(Frame {
        strain: 0.5,
        side: 8.0,
        vectors: Vec::new(),
        offset: -2.0,
        cross_offset: 0.0,
        radii: vec![1.0, 1.5],
        centres: vec![[1.0, 2.0], [3.5, 2.0]],
        unwrapped: vec![[9.0, 2.0], [1.5, -6.0]],
        velocities: vec![[2.5, 0.25], [2.0, -0.25]],
        angular_velocities: vec![-0.5, -0.75],
        orientations: vec![0.0, -0.25],
        stresslets: vec![[1.0, -1.0, 20.5], [0.0, 0.5, 19.0]],
        contacts: vec![FrameContact {
            i: 0,
            j: 1,
            normal: [1.0, 0.0],
            gap: 0.0078125,
            normal_force: 12.5,
            tangential_force: -2.0,
            rolling_force: 0.5,
            state: sd_core::contact::ContactState::Slipping,
        }],
    })
}
