//! Runs have the same bits with any number of threads.

use crate::common::schemes::{rigid, spring};
use sd_core::internals::threads_for_small_work;
use sd_core::{
    Bulk, ContactScheme, Hydrodynamics, Layer, LeadingOrder, NearFields, Params, RunSpace,
    Simulation, Snapshot, TangentialLaw,
};

/// Two steps, and the sample of the second.
fn steps<S: RunSpace>(params: &Params, threads: usize) -> (Snapshot<S>, String) {
    let threads = threads_for_small_work(threads).unwrap();
    threads.run(|| {
        let mut run = Simulation::<S>::new(params, 3, &NearFields::default()).unwrap();
        run.step().unwrap();
        let sample = run.step().unwrap();
        (run.snapshot(), format!("{sample:?}"))
    })
}

fn compare<S: RunSpace>(params: &Params) {
    let expected = steps::<S>(params, 1);
    for threads in [2, 4, 16] {
        let found = steps::<S>(params, threads);
        let what = (threads, params.hydrodynamics, &params.contact);
        assert!(found.0 == expected.0, "{what:?}: other states");
        assert_eq!(found.1, expected.1, "{what:?}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let lubrication = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);
    let laws = [
        ContactScheme::Rigid,
        rigid(TangentialLaw::Coulomb),
        spring(1e4, TangentialLaw::StickSlide),
    ];
    for hydrodynamics in [
        Hydrodynamics::StokesianDynamics,
        Hydrodynamics::BallMelrose,
        lubrication,
    ] {
        for contact in &laws {
            let params = Params::builder()
                .roughness(0.05)
                .friction(0.5)
                .shear_rate(20.0)
                .hydrodynamics(hydrodynamics)
                .contact(*contact)
                .time_step(0.01)
                .two_sizes(1.2, 0.5);
            let layer = params.clone().spheres(150).area_fraction(0.72);
            compare::<Layer>(&layer.build().unwrap());
            let suspension = params.spheres(90).volume_fraction(0.45);
            compare::<Bulk>(&suspension.build().unwrap());
        }
    }
}
