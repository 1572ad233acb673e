//! Runs.

use super::{LUBRICATION, params, rigid, sheared, springs};
use sd_core::{
    Bulk, ContactLaws, ContactScheme, Hydrodynamics, NearFields, Params, Simulation, Snapshot,
    StiffnessUnit, TangentialLaw,
};

/// A suspension resumed from the text form of its snapshot.
fn resumed(params: &Params, suspension: &Simulation<Bulk>) -> Simulation<Bulk> {
    let text = serde_json::to_string(&suspension.snapshot()).unwrap();
    let snapshot: Snapshot<Bulk> = serde_json::from_str(&text).unwrap();
    Simulation::from_snapshot(params, snapshot, &NearFields::default()).unwrap()
}

#[test]
fn rigid_contacts_keep_their_gaps_and_friction_raises_the_viscosity() {
    let run = |friction| {
        let mut params = params(rigid(TangentialLaw::Coulomb), Hydrodynamics::BallMelrose);
        params.friction = friction;
        params.shear_rate = f64::INFINITY;
        params.canonicalise();
        let mut suspension = sheared(&params, 80);
        let viscosity: f64 = (0..40)
            .map(|_| suspension.step().unwrap().viscosity / 40.0)
            .sum();
        assert!(suspension.counters().minimum_gap > 0.95 * params.roughness);
        viscosity
    };
    let [without, with] = [0.0, 0.5].map(run);
    assert!(with > 1.1 * without, "{without} {with}");
}

#[test]
fn parameters_of_the_other_space_are_refused() {
    let good = params(springs(TangentialLaw::StickSlide), LUBRICATION);
    let refused = |change: &dyn Fn(&mut Params)| {
        let mut bad = good.clone();
        change(&mut bad);
        let made = Simulation::<Bulk>::new(&bad, 1, &NearFields::default());
        made.unwrap_err().to_string()
    };
    assert!(refused(&|p| p.volume_fraction = Some(0.7)).contains("volume_fraction"));
    assert!(refused(&|p| p.area_fraction = 0.5).contains("area_fraction"));
    assert!(refused(&|p| p.contact = ContactScheme::Procedure).contains("protocol of layers"));
    assert!(refused(&|p| p.spheres = 8).contains("wide along"));
    let layer = Params {
        area_fraction: 0.5,
        volume_fraction: None,
        ..good.clone()
    };
    let made = Simulation::<Bulk>::new(&layer, 1, &NearFields::default());
    assert!(made.unwrap_err().to_string().contains("volume_fraction"));
    let made = Simulation::<sd_core::Layer>::new(&good, 1, &NearFields::default());
    assert!(made.unwrap_err().to_string().contains("area_fraction"));
}

#[test]
fn interrupted_runs_have_the_same_bits_before_any_pair_is_near() {
    let mut params = params(rigid(TangentialLaw::Coulomb), Hydrodynamics::BallMelrose);
    (params.spheres, params.volume_fraction) = (60, Some(0.3));
    (params.size_ratio, params.large_fraction) = (1.0, 0.0);
    (params.time_step, params.shear_rate) = (0.01, f64::INFINITY);
    params.canonicalise();
    let mut run = sheared(&params, 1);
    assert!(run.snapshot().near_pairs.is_empty());
    let mut other = resumed(&params, &run);
    for _ in 0..4 {
        let [a, b] = [&mut run, &mut other].map(|run| run.step().unwrap());
        assert_eq!(a, b);
    }
    assert!(!run.snapshot().near_pairs.is_empty());
    assert_eq!(run.snapshot(), other.snapshot());
}

#[test]
fn soft_steps_are_of_order_two() {
    // Leading-order lubrication ends at its cutoff, and velocities jump where a pair crosses it:
    // with that model no step is of order two.
    let laws = ContactLaws {
        stiffness_unit: StiffnessUnit::Flow,
        ..ContactLaws::linear_spring(100.0, TangentialLaw::StickSlide, 0.01)
    };
    let mut params = params(laws, Hydrodynamics::BallMelrose);
    params.shear_rate = f64::INFINITY;
    params.canonicalise();
    let suspension = sheared(&params, 60);
    let centres = |steps: u64| {
        let mut finer = params.clone();
        finer.time_step /= steps as f64;
        let mut snapshot = suspension.snapshot();
        snapshot.steps *= steps;
        let mut run = Simulation::from_snapshot(&finer, snapshot, &NearFields::default()).unwrap();
        for _ in 0..steps {
            run.step().unwrap();
        }
        run.centres().to_vec()
    };
    let finest = centres(64);
    let error = |steps| {
        let pairs = centres(steps).into_iter().zip(&finest);
        let mut errors: Vec<f64> = pairs.map(|(a, b)| (a - b).norm()).collect();
        errors.sort_by(f64::total_cmp);
        // The median: a contact that opens within a step moves a few spheres.
        errors[errors.len() / 2]
    };
    let order = (error(1) / error(4)).log2() / 2.0;
    assert!((order - 2.0).abs() < 0.2, "order {order}");
}
