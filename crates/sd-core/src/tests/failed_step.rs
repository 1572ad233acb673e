//! The state after a step that failed is that before it.

use crate::model::Segment;
use crate::{
    ContactLaws, ContactScheme, Error, FrictionOnset, Hydrodynamics, Layer, NearFields, Params,
    Simulation, TangentialLaw,
};

/// A dense layer in which spheres touch.
fn layer(spheres: usize, hydrodynamics: Hydrodynamics, contact: ContactScheme) -> Params {
    Params {
        spheres,
        area_fraction: 0.7,
        roughness: 0.01,
        friction: 0.5,
        shear_rate: 5.0,
        size_ratio: 1.4,
        large_fraction: 0.5,
        hydrodynamics,
        contact,
        time_step: 0.005,
        ..Params::UNSET
    }
}

/// Fails a step once the run has made `steps` steps, and checks that neither the snapshot nor the
/// next step shows it. `spoil` makes the cell of a stage invalid.
fn check(params: &Params, steps: u64, spoil: fn(&mut Simulation, f64)) {
    let tables = NearFields::default();
    let [mut run, mut undisturbed] =
        [(); 2].map(|()| Simulation::<Layer>::new(params, 2, &tables).unwrap());
    for _ in 0..steps {
        assert_eq!(run.step().unwrap(), undisturbed.step().unwrap());
    }
    let before = run.snapshot();
    assert_eq!(before, undisturbed.snapshot());
    spoil(&mut run, steps as f64 * params.time_step);
    let error = run.step().unwrap_err();
    assert!(
        matches!(&error, Error::Step { step, source, .. }
            if *step == steps && matches!(**source, Error::OutOfRange { .. })),
        "{error}"
    );
    run.imposed.cross = undisturbed.imposed.cross;
    run.extent.side = undisturbed.extent.side;
    assert_eq!(run.snapshot(), before);
    for _ in 0..2 {
        assert_eq!(run.step().unwrap(), undisturbed.step().unwrap());
    }
    assert_eq!(run.snapshot(), undisturbed.snapshot());
}

/// Makes every stage but the first of a step fail: only suspensions can have a cross strain.
fn later_stages(run: &mut Simulation, strain: f64) {
    run.imposed.cross.since = strain;
    run.imposed.cross.rate = 1.0;
}

/// Makes the first stage of a step fail.
fn first_stage(run: &mut Simulation, _: f64) {
    run.extent.side = f64::INFINITY;
}

#[test]
fn failed_step_under_any_scheme_leaves_no_trace() {
    let near = Hydrodynamics::BallMelrose;
    let springs = ContactLaws {
        rolling_friction: 0.1,
        ..ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01)
    };
    for contact in [
        ContactScheme::Rigid,
        ContactScheme::Laws(springs),
        ContactScheme::Procedure,
    ] {
        for steps in [0, 20] {
            check(&layer(40, near, contact), steps, later_stages);
        }
    }
}

#[test]
fn failed_step_with_sparse_matrices_and_an_iterated_far_field_leaves_no_trace() {
    // The first step makes the pattern of the matrices.
    for hydrodynamics in [Hydrodynamics::BallMelrose, Hydrodynamics::StokesianDynamics] {
        let mut params = layer(130, hydrodynamics, ContactScheme::Rigid);
        params.area_fraction = 0.6;
        for steps in [0, 4] {
            check(&params, steps, later_stages);
        }
    }
}

#[test]
fn failed_step_under_an_imposed_stress_keeps_the_load() {
    let reduced = ContactLaws {
        onset: FrictionOnset::Reduced,
        ..ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01)
    };
    for contact in [ContactScheme::Rigid, ContactScheme::Laws(reduced)] {
        let params = Params {
            shear_rate: 0.0,
            shear_stress: Some(3.0),
            ..layer(40, Hydrodynamics::BallMelrose, contact)
        };
        for steps in [0, 10] {
            check(&params, steps, later_stages);
        }
    }
}

#[test]
fn failed_step_of_an_oscillation_keeps_the_springs() {
    // Every step imposes another rate, and with it another unit of the forces of springs.
    let oscillation = Segment {
        start: 0.05,
        amplitude: Some(1.0),
        ..Segment::default()
    };
    let springs = ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01);
    let params = Params {
        segments: vec![Segment::default(), oscillation],
        ..layer(40, Hydrodynamics::BallMelrose, ContactScheme::Laws(springs))
    };
    params.validate().unwrap();
    for steps in [10, 20] {
        check(&params, steps, first_stage);
    }
}
