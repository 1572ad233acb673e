//! Runs resumed from their snapshots.

use sd_core::{NearFields, Params, RunSpace, Simulation};

/// Checks that a run has the same bits if it is resumed from its snapshot every few steps.
pub(crate) fn check<S: RunSpace>(params: &Params, steps: u64, every: u64) {
    let tables = NearFields::default();
    let mut whole = Simulation::<S>::new(params, 2, &tables).unwrap();
    let mut again: Option<Simulation<S>> = None;
    for step in 0..steps {
        if step % every == 0 {
            let snapshot = whole.snapshot();
            again = Some(Simulation::from_snapshot(params, snapshot, &tables).unwrap());
        }
        let resumed = again.as_mut().unwrap().step().unwrap();
        assert_eq!(whole.step().unwrap(), resumed, "step {step}");
    }
}
