//! Stokesian Dynamics of sheared layers and suspensions of rough, frictional spheres.
//!
//! # The viscosity of a layer
//! ```
//! use sd_core::{Hydrodynamics, Layer, NearFields, Params, Simulation};
//!
//! let params = Params::builder()
//!     .spheres(40)
//!     .area_fraction(0.65)
//!     .roughness(0.01) // in radii
//!     .friction(0.5)
//!     .shear_rate(f64::INFINITY) // friction acts on every contact
//!     .hydrodynamics(Hydrodynamics::BallMelrose)
//!     .build()?;
//! let seed = 1;
//! let mut layer = Simulation::<Layer>::new(&params, seed, &NearFields::default())?;
//!
//! let (mut sum, mut samples) = (0.0, 0);
//! while layer.strain() < 0.5 {
//!     let sample = layer.step()?;
//!     // The random start is not steady yet; real runs discard two strains.
//!     if sample.strain > 0.2 {
//!         sum += sample.viscosity;
//!         samples += 1;
//!     }
//! }
//! let viscosity = sum / f64::from(samples);
//! assert!(viscosity > 4.0 && viscosity < 20.0, "{viscosity}");
//! # Ok::<(), sd_core::Error>(())
//! ```
//! The viscosity is in units of that of the fluid, and the mean radius and the shear rate are 1. A
//! value that is forgotten, out of range or in conflict with others is an [`Error`] that names it.
//! Build with `--release`: most of the time is spent in linear algebra, which is slow unoptimised.
//!
//! # The viscosity of a suspension
//! A suspension has a volume fraction in place of the area fraction. These spheres are soft, as in
//! most published simulations:
//! ```
//! use sd_core::{
//!     Bulk, ContactLaws, Hydrodynamics, LeadingOrder, NearFields, Params, Simulation,
//!     StiffnessUnit, TangentialLaw,
//! };
//!
//! let springs = ContactLaws {
//!     stiffness_unit: StiffnessUnit::Flow,
//!     ..ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.0)
//! };
//! let params = Params::builder()
//!     .spheres(120)
//!     .volume_fraction(0.45)
//!     .two_sizes(1.4, 0.27) // ratio of the radii, number of large spheres over all
//!     .roughness(0.0)
//!     .friction(0.5)
//!     .shear_rate(f64::INFINITY)
//!     .hydrodynamics(Hydrodynamics::Lubrication(LeadingOrder::DEFAULT))
//!     .contact(springs)
//!     .build()?;
//! let mut suspension = Simulation::<Bulk>::new(&params, 1, &NearFields::default())?;
//! let mut viscosity = 0.0;
//! for _ in 0..10 {
//!     viscosity = suspension.step()?.viscosity;
//! }
//! assert!(viscosity > 2.0, "{viscosity}");
//! # Ok::<(), sd_core::Error>(())
//! ```
//!
//! # More
//! | Task | Start at |
//! | --- | --- |
//! | choose contact laws and hydrodynamics | [`ContactLaws`], [`Hydrodynamics`] |
//! | impose a stress, reversals, oscillations | [`model::ParamsBuilder`], [`model::Segment`] |
//! | read forces and gaps of contacts | [`Simulation::contacts`] |
//! | read positions, stresslets and contacts of a sample | [`Simulation::step_with_frame`] |
//! | compute one run by several threads | [`Threads`] |
//! | store a run and resume it with the same bits | [`Simulation::snapshot`] |
//! | solve the velocities at given positions | [`instant::solve`] |
//! | put the spheres into a flow that is not linear | [`IncidentFlow`] |
//! | apply forces and torques to the spheres of a run, without shear too | [`Simulation::use_forces`], [`Params::at_rest`] |
//! | follow spheres through the cell, read their velocities | [`Simulation::unwrapped`], [`Simulation::velocities`] |
//! | multiply by the mobility or the resistance at many positions | [`products`] |
//! | move two spheres past each other | [`pair::pass`] |
//! | look up two-sphere resistance functions | [`two_sphere::scalars`] |
//! | implement a contact law | [`law::CustomNormalLaw`] |
//! | compute more coarsely or more exactly | [`model::SolverSettings`] |
//!
//! `cargo run --release -p sd-core --example layer` shears a layer, `suspension` a suspension,
//! `cone` a layer under a law of its own, `pair` two spheres, `sedimentation` sinks a suspension.
//! Parameter sweeps with error bars are the task of the program `sweep`, which is built on this
//! crate.
//!
//! # The physics
//! N spheres in the plane z = 0 of an unbounded viscous fluid, doubly periodic in the plane, under
//! the shear flow `u∞ = y x̂`. Follows Townsend & Wilson, Phys. Fluids 29, 121607 (2017), "the
//! paper"; its equations are cited as (n).
//!
//! A suspension fills a triply periodic cell instead, under the same flow. Both share one code,
//! generic in the [`Space`]: [`Layer`], the default, or [`Bulk`]. Equations below are those of the
//! layer; for a suspension, tensors and tangent planes are three-dimensional: friction is then a
//! vector, its bound a disc.
//!
//! The crate reads no file, prints nothing and starts no threads but those of [`Threads`]; a run
//! depends only on [`Params`] and a seed.
//!
//! # Units and symbols
//! Mean radius a, viscosity μ and shear rate are 1. x is the flow, y the gradient, z the vorticity.
//!
//! | Symbol | Meaning |
//! | --- | --- |
//! | `U, Ω` | velocity and angular velocity of a sphere; `v = (U − u∞, Ω − Ω∞)` its disturbance |
//! | `E`, `e` | background rate of strain, as a tensor and as `(e1, e2, e3)`, see [`modes`] |
//! | `F, T, S~` | external force and torque on a sphere, moment it exerts on the fluid; the stresslet of (20) is `S = −S~` |
//! | `g, ξ, s'` | gap `r − a_i − a_j`; `2g/(a_i + a_j)`; `2r/(a_i + a_j) = 2 + ξ` |
//! | `n, t` | unit vector from i to j; `t = (−n_y, n_x)` |
//! | `c, h, ν, Γ` | area fraction, roughness height, friction coefficient, dimensionless shear rate `6π/F_crit` |
//! | `η, N1, N2, Π` | relative viscosity, normal stress differences, particle pressure |
//!
//! # Equations
//! The module named at the right documents the source, signs and limits of each.
//! ```text
//! (F, T, S~) = R (v, −E)                           R grand resistance, symmetric positive definite      hydrodynamics::resistance
//! R = R_far + Σ_pairs [R2B − R2B∞]                 Stokesian Dynamics; Ball-Melrose: isolated drag for R_far
//! R = isolated drag + Σ_pairs singular terms       leading-order lubrication                           hydrodynamics::two_sphere
//! R_far = M⁻¹, its uniform mode at no cost         M mobility of the periodic layer                     hydrodynamics::far_field
//! R2B                                              two spheres, any gap and size ratio                  hydrodynamics::two_sphere
//! f ≥ 0, w = C v + b + κ f ≥ 0, f w = 0            normal forces, w the gap minus h after the step         contact
//! |t| ≤ ρ(f), z = D v + d − μ t = 0 inside         friction, z the slip beyond what the law allows      contact
//! κ, μ, ρ                                          contact laws, a file each                            law
//! R_FU v = R_FE E + F_external + Cᵀ f − Dᵀ t       the motion                                           stage
//! η = 1 + (Σ S_xy + Σ contact stress)/V            the viscosity, V = 2 ⟨a⟩ A or that of the cell       stress
//! dx/dt = u∞ + v, dθ/dt = Ω                        fourth order in time                                 run::steppers
//! ```
//!
//! # Units of input and output
//! | Quantity | Unit | Where |
//! | --- | --- | --- |
//! | lengths, gaps, roughness | a | [`Params`], [`Snapshot`], [`Sample`] |
//! | time, strain | 1/rate | [`Params::time_step`], [`Sample::strain`] |
//! | velocities, residuals | a·rate | [`contact::Contact`], [`contact::Quality`] |
//! | forces, critical load | μ·a²·rate | [`contact::Contact`], [`Params::critical_load`] |
//! | viscosity; stresses | μ; μ·rate | [`Sample`], [`Stress`] |
//!
//! # Modules, from the lowest level up
//! A module may depend only on those above it in this list.
//! ```text
//! error           why a computation was refused or could not be finished
//! threads         work of one run divided among threads, with the same bits
//! law             constitutive laws of contact: pure functions of numbers, one file each
//! model           what decides a run: every parameter and choice declared once, ranged, validated
//! linalg          dense matrices, lu, cholesky (dense, tiled, sparse), gmres, anderson, lanczos,
//!                 polynomials: the only module that names the linear-algebra library
//! space           what differs between a layer and a suspension: vectors, modes, tangents, orientations; linear and incident flows, lattices
//!                 and the cell, pairs and lists of them, written once for both; the six planar modes of a sphere in a layer
//! hydrodynamics   free_space: mobility of one and of two spheres; two_sphere: near field of a pair; far_field: mobility of
//!                 all spheres; resistance: their sum, held dense or pair by pair; iterative: the far field put on top of
//!                 Ball-Melrose by iteration, for many spheres; inverse_mobility: solves with the mobility. All generic in the
//!                 space, but for the sums of the far field and its mobilities
//! contact         forces between rough surfaces. laws: the entries of a law at a stage; contact_solver: the pairs that take part;
//!                 problem: the one contact problem, its states, and its dense and sparse linear algebra
//! procedure       the paper's steps, apart from the laws
//! stage           positions → velocities: the only place where contact and far field meet; method: how it is computed
//! stress          viscosity, normal stress differences, particle pressure, each by its causes; energy balance
//! run             start: the first layer or suspension; steppers: methods in time; simulation: a run and its snapshots; instant: one evaluation;
//!                 products: mobility and resistance, planned once; transport: diffusion and sedimentation at short times; pair: two
//!                 spheres alone
//! ```
//! A right-hand side calls them in this order: pairs in range (`space`), their near field and the
//! far field of all (`hydrodynamics`), contact forces and velocities (`contact`, `stage`),
//! viscosity (`stress`), the next stage (`run::steppers`).

pub mod contact;
mod error;
mod hydrodynamics;
pub mod law;
mod linalg;
pub mod model;
mod procedure;
mod run;
mod space;
mod stage;
mod stress;
mod threads;

pub use error::Error;
pub use hydrodynamics::resistance::NearFields;
pub use hydrodynamics::two_sphere;
pub use model::{
    ContactLaws, ContactScheme, FrictionOnset, Hydrodynamics, LeadingOrder, NormalLaw, Params,
    StiffnessUnit, TangentialLaw,
};
/// The library of the vectors and matrices in this interface.
pub use nalgebra;
pub use run::compiled::RunSpace;
pub use run::simulation::{Flow, Sample, Simulation, Snapshot};
pub use run::{pair, products, simulation, start, transport};
pub use space::pair::{Neighbours, PairKey};
pub use space::{
    Bulk, IncidentFlow, Layer, LocalFlow, Space, Strains, VelocityGradient, bulk, cell, modes,
};
pub use stage::{Method, memory_bytes};
pub use stress::{Stress, StressComponents, StressParts};
pub use threads::Threads;

/// One instant of one configuration: velocities, stresslets, contact forces.
pub mod instant {
    pub use crate::run::compiled::solve;
    pub use crate::run::instant::{
        Configuration, InstantContacts, SolvedConfiguration, look_ahead, method,
    };
}

/// What tests, benchmarks and `sweep verify` measure one by one. No part of the interface: it may
/// change in any version.
#[doc(hidden)]
pub mod internals {
    pub use crate::contact::contact_solver::SolvePass;
    pub use crate::contact::laws::{OVERLAP_CORRECTION, Span, StageKind};
    pub use crate::contact::memory::{ContactMemory, WarmStart};
    pub use crate::contact::springs::Springs;
    pub use crate::hydrodynamics::far_field::{FarField, FarResistance};
    pub use crate::hydrodynamics::iterative::IterativeFarField;
    pub use crate::hydrodynamics::resistance::Resistance;
    pub use crate::linalg::{Matrix, StaggeredColumns, TiledCholesky, TiledMatrix, vectorised};
    pub use crate::procedure::ContactList;
    pub use crate::run::steppers::rosenbrock::Rosenbrock;
    pub use crate::run::steppers::{RungeKutta, State};
    pub use crate::space::neighbours::NeighbourList;
    pub use crate::stage::{StageContacts, StageSolver};
    pub use crate::stress::StressWork;
    pub use crate::threads::threads_for_small_work;
}

#[cfg(test)]
mod tests;
