//! What holds for all types of the interface: threads can share them, errors are those of `std`,
//! all can be printed. Most of it is checked when this is compiled.

use sd_core::contact::{Contact, Laws, PairForces, Quality};
use sd_core::instant::{Configuration, InstantContacts, SolvedConfiguration};
use sd_core::model::{
    Parameter, ParamsBuilder, Refusal, Segment, Sizes, SolverSettings, StartFrom,
};
use sd_core::pair::{PairScenario, PairTrajectory};
use sd_core::products::{Mobility, Resistance};
use sd_core::simulation::{Frame, Instant};
use sd_core::start::Start;
use sd_core::transport::ShortTime;
use sd_core::two_sphere::{NearField, PairTerm, Scalars};
use sd_core::{
    Bulk, Error, IncidentFlow, Layer, Method, NearFields, Neighbours, Params, RunSpace, Sample,
    Simulation, Snapshot, Strains, Stress, Threads, VelocityGradient, cell,
};
use std::error::Error as StdError;
use std::fmt::Debug;

/// What threads can own, share and print.
fn is_shared<T: Debug + Send + Sync + 'static>() {}

/// What is made for one of the spaces, also in code that is generic in it.
fn are_shared_in<S: RunSpace>() {
    is_shared::<S>();
    is_shared::<Simulation<S>>();
    is_shared::<Snapshot<S>>();
    is_shared::<Frame<S>>();
    is_shared::<Instant<'static, S>>();
    is_shared::<Start<S>>();
    is_shared::<Configuration<S>>();
    is_shared::<InstantContacts<S>>();
    is_shared::<Contact<S>>();
    is_shared::<PairForces<S>>();
    is_shared::<Neighbours<S>>();
    is_shared::<Mobility<S>>();
    is_shared::<Resistance<S>>();
    is_shared::<IncidentFlow<S>>();
    is_shared::<Strains<'static, S>>();
    is_shared::<VelocityGradient<S>>();
    is_shared::<cell::Cell<S>>();
    is_shared::<cell::Lattice<S>>();
}

#[test]
fn threads_can_share_and_print_all_types() {
    are_shared_in::<Layer>();
    are_shared_in::<Bulk>();
    is_shared::<SolvedConfiguration<Layer>>();
    is_shared::<SolvedConfiguration<Bulk>>();
    is_shared::<Params>();
    is_shared::<ParamsBuilder>();
    is_shared::<Parameter>();
    is_shared::<Segment>();
    is_shared::<Sizes>();
    is_shared::<StartFrom>();
    is_shared::<SolverSettings>();
    is_shared::<Laws>();
    is_shared::<Quality>();
    is_shared::<Method>();
    is_shared::<Sample>();
    is_shared::<Stress>();
    is_shared::<NearFields>();
    is_shared::<NearField>();
    is_shared::<PairTerm>();
    is_shared::<Scalars>();
    is_shared::<PairScenario>();
    is_shared::<PairTrajectory>();
    is_shared::<ShortTime>();
    is_shared::<Threads>();
}

#[test]
fn errors_go_through_threads_and_boxes_and_keep_their_cause() {
    fn is_error<T: StdError + Clone + PartialEq + Send + Sync + 'static>() {}
    is_error::<Error>();
    is_error::<Refusal>();
    let failed = Error::Step {
        step: 3,
        strain: 0.03,
        source: Box::new(Error::NoSpheres),
    };
    let boxed: Box<dyn StdError + Send + Sync> = failed.into();
    let cause = boxed.source().map(ToString::to_string);
    assert_eq!(cause, Some(Error::NoSpheres.to_string()));
}
