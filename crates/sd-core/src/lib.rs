//! Stokesian Dynamics of a sheared layer of rough, frictional spheres.
//!
//! N spheres in the plane z = 0 of an unbounded viscous fluid, doubly periodic in the plane, under the shear flow
//! `u∞ = y x̂`. Follows Townsend & Wilson, Phys. Fluids 29, 121607 (2017), "the paper"; its equations are cited as (n).
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
//! | `η, N1` | relative viscosity, first normal stress difference |
//!
//! # Equations
//! Each stands with its derivation's source, signs and limits at the top of the module named at the right.
//! ```text
//! (F, T, S~) = R (v, −E)                           R grand resistance, symmetric positive definite      resistance
//! R = R_far + Σ_pairs [R2B − R2B∞]                 Stokesian Dynamics; Ball-Melrose: isolated drag for R_far
//! R_far = M⁻¹, its uniform mode at no cost         M mobility of the periodic layer                     far_field
//! R2B                                              two spheres, any gap and size ratio                  two_sphere
//! R_FU v = R_FE E + F_external + F_contact         the motion                                           motion
//! f ≥ 0, w ≥ 0, f w = 0                            rigid contacts, w what the gap gains beyond h        contact::rigid
//! |F_t| ≤ ν f where f > F_crit                     friction, rolling or slipping                        contact::friction
//! η = 1 + (Σ S_xy + Σ contact stress)/V            the viscosity, V = 2 ⟨a⟩ A                           stress
//! dx/dt = u∞ + v, dθ/dt = Ω                        fourth order in time                                 integrate
//! ```
//!
//! # Units of what goes in and comes out
//! | Quantity | Unit | Where |
//! | --- | --- | --- |
//! | lengths, gaps, roughness | a | [`Params`], [`Snapshot`], [`Sample`] |
//! | time, strain | 1/rate | [`Params::time_step`], [`Sample::strain`] |
//! | velocities, residuals | a·rate | [`contact::Contact`], [`contact::Quality`] |
//! | forces, critical load | μ·a²·rate | [`contact::Contact`], [`Params::critical_load`] |
//! | viscosity; stresses | μ; μ·rate | [`Sample`], [`stress::Stress`] |
//!
//! # Where things are, in the order of a right-hand side
//! [`cell`] images and neighbours → [`two_sphere`] near field of a pair, [`far_field`] mobility of all → [`resistance`] their sum,
//! factored → [`contact`] forces between rough surfaces → [`motion`] velocities → [`stress`] viscosity → [`integrate`] Runge-Kutta.
//! Past dense, [`resistance::iterative`] puts the far field on top of Ball-Melrose by iteration, its mobility applied on a grid.
//! [`simulation`] is a run of it, [`start`] its first layer, [`instant`] a single evaluation, [`mod@pair`] two spheres alone.
//! [`linalg`] holds all that names the linear-algebra library.
//!
//! The crate reads no file, prints nothing and starts no thread; a run is a function of [`Params`] and a seed alone.
//!
//! # Example
//! `cargo run --release -p sd-core --example layer` shears a layer, `--example pair` drives two spheres past each other.
//! ```
//! use sd_core::{ContactScheme, Hydrodynamics, NearFields, Params, Simulation};
//!
//! let params = Params {
//!     spheres: 20,
//!     area_fraction: 0.6,
//!     roughness: 0.01,
//!     friction: 0.3,
//!     shear_rate: f64::INFINITY,
//!     size_ratio: 1.0,
//!     large_fraction: 0.5,
//!     hydrodynamics: Hydrodynamics::BallMelrose,
//!     contact: ContactScheme::Rigid,
//!     time_step: 0.005,
//! };
//! let mut layer = Simulation::new(&params, 1, &NearFields::default())?;
//! for _ in 0..20 {
//!     let sample = layer.step()?;
//!     assert!(sample.viscosity > 1.0 + 5.0 / 3.0 * params.area_fraction);
//! }
//! # Ok::<(), sd_core::Error>(())
//! ```

pub mod cell;
pub mod contact;
pub mod error;
pub mod far_field;
pub mod instant;
pub mod integrate;
pub mod law;
pub mod linalg;
pub mod model;
pub mod modes;
pub mod motion;
pub mod pair;
pub mod resistance;
pub mod simulation;
pub mod start;
pub mod stress;
pub mod two_sphere;
pub mod two_stage;
pub mod verify;

pub use error::Error;
pub use model as params;
pub use model::{
    ContactLaws, ContactScheme, FrictionOnset, Hydrodynamics, NormalLaw, Params, TangentialLaw,
};
pub use resistance::NearFields;
pub use simulation::{Flow, Sample, Simulation, Snapshot};
