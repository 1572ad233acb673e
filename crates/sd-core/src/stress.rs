//! All stresses of the spheres, by cause, and the energy balance.
//!
//! ```text
//! Σ = (Σ_i S_i + Σ_k S^C_k)/V,              S^C = −r f n n + (r/2) F_t (n t + t n)
//! η = 1 + Σ:E/(2 E:E),    N1 = Σ_xx − Σ_yy,    N2 = Σ_yy − Σ_zz,    Π = −(1/3) trace Σ
//! V (η − 1) rate² + Σ F v = v'Rv − Σ f v_n + Σ F_t u_t + Σ F_r u_r     (exact: an identity of the solution)
//! ```
//! with F the forces and torques applied to the spheres, whose first moment is no part of Σ.
//!
//! E is the rate of strain of the imposed flow, and rate = √(2 E:E); in simple shear
//! η = 1 + Σ_xy/rate. Under cross shear at the rate γ̇_z the left-hand side has the additional term
//! V Σ_yz γ̇_z; η remains that of the primary shear.
//!
//! V = 2 ⟨a⟩ A is the volume of a layer. The contact stress is the symmetric first moment of the
//! contact forces: each sphere feels the force at its end of the line of centres. Both n and t lie
//! in the plane, so that contacts have no zz; that of stresslets is −(S_xx + S_yy), since they are
//! traceless: Π includes only contacts and repulsion. The isotropic part of the hydrodynamic stress
//! is a number of its own, [`crate::Sample::pressure_hydrodynamic`].
//!
//! Each component is the sum of four parts: hydrodynamic, from the stresslets; normal and
//! tangential contact forces; repulsion. Adhesion is a part of the normal contact force: f − F_A.
//! Rolling friction is a couple on the two spheres: it has no first moment of force, and its
//! antisymmetric parts on the two spheres cancel, so that it affects the stress only through the
//! motion.

use crate::contact::{Contact, ContactState};
use crate::hydrodynamics::resistance::{Fluid, PressureWork};
use crate::space::{IncidentFlow, Layer, Space, VelocityGradient};
use crate::stage::StageSolver;
use serde::{Deserialize, Serialize};

/// Relative viscosity above which a run counts as temporarily jammed.
pub const JAM_VISCOSITY: f64 = 1e4;

/// One component of the stress, by cause, in mu·rate.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct StressParts {
    /// From the stresslets.
    pub hydrodynamic: f64,
    /// From the normal contact forces, adhesion included.
    pub normal_contact: f64,
    /// From the tangential contact forces.
    pub tangential_contact: f64,
    /// From the repulsion.
    pub repulsion: f64,
    /// From Brownian motion: its mean stresslets `−kT ∇·(R_SU R_FU⁻¹)`, and `−n kT` in each
    /// direction in which spheres move.
    #[serde(default)]
    pub brownian: f64,
}

impl StressParts {
    /// The component itself.
    ///
    /// ```
    /// use sd_core::StressParts;
    ///
    /// let parts = StressParts { hydrodynamic: 2.0, normal_contact: 0.5, ..StressParts::default() };
    /// assert_eq!(parts.total(), 2.5);
    /// ```
    pub fn total(&self) -> f64 {
        self.hydrodynamic
            + self.normal_contact
            + self.tangential_contact
            + self.repulsion
            + self.brownian
    }

    /// All parts times a number.
    fn scaled(self, factor: f64) -> Self {
        Self {
            hydrodynamic: self.hydrodynamic * factor,
            normal_contact: self.normal_contact * factor,
            tangential_contact: self.tangential_contact * factor,
            repulsion: self.repulsion * factor,
            brownian: self.brownian * factor,
        }
    }
}

/// The six components of the bulk stress Σ, by cause, in mu·rate: those off the diagonal, and the
/// normal ones as differences and pressure, from which [`StressComponents::xx`] and the others
/// follow.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct StressComponents {
    /// Stress of the spheres that resists the flow, in addition to that of the fluid: Σ_xy in
    /// shear, Σ:E rate/(2 E:E) in any flow.
    pub shear: StressParts,
    /// First normal stress difference Σ_xx − Σ_yy.
    pub n1: StressParts,
    /// Second normal stress difference Σ_yy − Σ_zz.
    pub n2: StressParts,
    /// Particle pressure −(1/3) trace Σ, without its hydrodynamic part, which is 0 here: see
    /// [`crate::Sample::pressure_hydrodynamic`].
    pub particle_pressure: StressParts,
    /// Σ_xy: in simple shear `shear`, with the sign of its direction.
    #[serde(default)]
    pub xy: StressParts,
    /// Σ_xz; 0 in a layer.
    #[serde(default)]
    pub xz: StressParts,
    /// Σ_yz; 0 in a layer.
    #[serde(default)]
    pub yz: StressParts,
}

/// Bulk stress at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Stress {
    /// η in full, in mu.
    pub viscosity: f64,
    /// η without the contact stress, as in (20) of the paper.
    pub viscosity_stresslet: f64,
    /// All components by cause, in mu·rate.
    pub components: StressComponents,
    /// v'Rv/(V rate), in mu·rate; that of a cross shear is included.
    pub dissipation: f64,
    /// V, in a³.
    pub volume: f64,
}

/// Workspace for stresslets and their forces.
#[derive(Default, Debug)]
pub struct StressWork<S: Fluid = Layer> {
    /// Stresslet components of each sphere.
    pub stresslets: Vec<S::Strain>,
    /// Hydrodynamic counterforces `R_FU v − R_FE e`.
    forces: Vec<f64>,
    far: Vec<f64>,
    /// Stresslets of the motion under random forces.
    random: Vec<S::Strain>,
    pub(crate) pressure: PressureWork<S>,
}

impl<S: Fluid> StressWork<S> {
    /// Stresslets of all spheres in the motion last solved; returns v'Rv, in mu·a³·rate².
    pub fn update(&mut self, stage: &StageSolver<S>, flow: &IncidentFlow<S>) -> f64 {
        let strains = flow.strains();
        stage.counterforces(
            strains,
            &mut self.far,
            &mut self.forces,
            &mut self.stresslets,
        );
        let work: f64 = crate::linalg::dense::dot(stage.velocities(), &self.forces);
        let strained: f64 = self
            .stresslets
            .iter()
            .enumerate()
            .map(|(sphere, s)| S::strain_dot(s, strains.at(sphere)))
            .sum();
        work + strained
    }

    /// Sum of the stresslets of the motion that random forces alone would cause, as xx, yy, zz, xy,
    /// xz and yz; zero without them.
    pub(crate) fn random_stress(&mut self, stage: &StageSolver<S>) -> [f64; 6] {
        let mut sum = [0.0; 6];
        if stage.has_random_forces() {
            let work = [&mut self.far, &mut self.forces];
            stage.random_stresslets(work, &mut self.random);
            for stresslet in &self.random {
                for (sum, x) in sum.iter_mut().zip(S::full_tensor(stresslet)) {
                    *sum += x;
                }
            }
        }
        sum
    }

    /// Stress for the motion last solved, with its contacts and repelling pairs, in a cell of this
    /// area or volume; the viscosity is the resistance to the flow `primary`, which is the
    /// background without cross shear.
    pub fn stress(
        &mut self,
        stage: &StageSolver<S>,
        flow: &IncidentFlow<S>,
        primary: &VelocityGradient<S>,
        content: f64,
    ) -> Stress {
        let power = self.update(stage, flow);
        let volume = S::volume(content, stage.resistance.radii());
        let weights = weights(primary.rate_of_strain());
        let mut components = StressComponents::default();
        let mut add = |tensor, part| components.add(tensor, &weights, part);
        for s in &self.stresslets {
            add(S::full_tensor(s), |parts| &mut parts.hydrodynamic);
        }
        for c in &stage.contacts.list {
            add(normal_stress(c), |parts| &mut parts.normal_contact);
            add(tangential_stress(c), |parts| &mut parts.tangential_contact);
        }
        for c in &stage.distant.adhesive {
            add(normal_stress(c), |parts| &mut parts.normal_contact);
        }
        let distant = &stage.distant;
        for c in distant.repulsive.iter().chain(&distant.attractive) {
            add(normal_stress(c), |parts| &mut parts.repulsion);
        }
        let components = components.scaled(volume.recip());
        Stress {
            viscosity: 1.0 + components.shear.total(),
            viscosity_stresslet: 1.0 + components.shear.hydrodynamic,
            components,
            dissipation: power / volume,
            volume,
        }
    }
}

/// Weights of xx, yy, zz, xy, xz, yz in `Σ:E/(2 E:E)`. Of a fluid at rest they are those of shear.
pub(crate) fn weights(rate_of_strain: [f64; 6]) -> [f64; 6] {
    let mut weights = rate_of_strain;
    for weight in &mut weights[3..] {
        *weight *= 2.0;
    }
    let pairs = weights.iter().zip(&rate_of_strain);
    let square: f64 = pairs.map(|(weight, e)| weight * e).sum();
    if square == 0.0 {
        return [0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
    }
    weights.map(|weight| weight / (2.0 * square))
}

impl StressComponents {
    /// Adds a tensor `[xx, yy, zz, xy, xz, yz]` to one part of every component; `weights`: those of
    /// the flow.
    pub(crate) fn add(
        &mut self,
        tensor: [f64; 6],
        weights: &[f64; 6],
        part: fn(&mut StressParts) -> &mut f64,
    ) {
        let [xx, yy, zz, xy, xz, yz] = tensor;
        let along = tensor.iter().zip(weights);
        *part(&mut self.shear) += along.map(|(x, weight)| x * weight).sum::<f64>();
        *part(&mut self.n1) += xx - yy;
        *part(&mut self.n2) += yy - zz;
        *part(&mut self.particle_pressure) -= (xx + yy + zz) / 3.0;
        *part(&mut self.xy) += xy;
        *part(&mut self.xz) += xz;
        *part(&mut self.yz) += yz;
    }

    /// Σ_xx, by cause.
    ///
    /// ```
    /// use sd_core::{StressComponents, StressParts};
    ///
    /// let contacts = |normal_contact| StressParts { normal_contact, ..StressParts::default() };
    /// let stress = StressComponents {
    ///     n1: contacts(0.5),
    ///     n2: contacts(-3.0),
    ///     particle_pressure: contacts(10.0),
    ///     ..StressComponents::default()
    /// };
    /// let [xx, yy, zz] = [stress.xx(), stress.yy(), stress.zz()].map(|part| part.total());
    /// assert!((xx - yy - 0.5).abs() < 1e-12 && (yy - zz + 3.0).abs() < 1e-12);
    /// assert!((xx + yy + zz + 30.0).abs() < 1e-12);
    /// ```
    pub fn xx(&self) -> StressParts {
        self.normal(2.0, 1.0)
    }

    /// Σ_yy, by cause: minus the pressure `P_22` on planes across the gradient.
    pub fn yy(&self) -> StressParts {
        self.normal(-1.0, 1.0)
    }

    /// Σ_zz, by cause; in a layer that of the stresslets, which are traceless.
    pub fn zz(&self) -> StressParts {
        self.normal(-1.0, -2.0)
    }

    /// `(a N1 + b N2)/3 − Π`, by cause. Stresslets have no trace by definition, and friction none
    /// but for rounding, as it acts across the line of centres.
    fn normal(&self, a: f64, b: f64) -> StressParts {
        let deviator =
            |part: fn(&StressParts) -> f64| (a * part(&self.n1) + b * part(&self.n2)) / 3.0;
        let pressure = &self.particle_pressure;
        StressParts {
            hydrodynamic: deviator(|parts| parts.hydrodynamic),
            normal_contact: deviator(|parts| parts.normal_contact) - pressure.normal_contact,
            tangential_contact: deviator(|parts| parts.tangential_contact),
            repulsion: deviator(|parts| parts.repulsion) - pressure.repulsion,
            brownian: deviator(|parts| parts.brownian) - pressure.brownian,
        }
    }

    /// All parts of all components times a number.
    fn scaled(self, factor: f64) -> Self {
        Self {
            shear: self.shear.scaled(factor),
            n1: self.n1.scaled(factor),
            n2: self.n2.scaled(factor),
            particle_pressure: self.particle_pressure.scaled(factor),
            xy: self.xy.scaled(factor),
            xz: self.xz.scaled(factor),
            yz: self.yz.scaled(factor),
        }
    }
}

/// −r f n n as `[xx, yy, zz, xy, xz, yz]`, in mu·a³·rate.
fn normal_stress<S: Space>(c: &Contact<S>) -> [f64; 6] {
    S::moment_along(&c.pair.normal, -c.pair.distance * c.normal_force)
}

/// (r/2) (n F_t + F_t n) as `[xx, yy, zz, xy, xz, yz]`, in mu·a³·rate.
fn tangential_stress<S: Space>(c: &Contact<S>) -> [f64; 6] {
    S::moment_across(&c.pair.normal, &c.tangential_force, c.pair.distance)
}

/// Numbers of contacts by state, and their mean normal velocity.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ContactCounts {
    /// Pairs with f > 0.
    pub contacts: u32,
    /// Of these, pairs with friction.
    pub activated: u32,
    /// Of the activated, pairs that roll.
    pub sticking: u32,
    /// Of the activated, pairs that slip.
    pub slipping: u32,
    /// Mean `v_n` over the pairs with f > 0, in a·rate; 0 without any.
    pub normal_velocity: f64,
}

impl ContactCounts {
    /// Counts the contacts of a solved stage.
    pub(crate) fn of<S: Space>(contacts: &[Contact<S>]) -> Self {
        let mut counts = Self::default();
        for c in contacts.iter().filter(|c| c.normal_force > 0.0) {
            counts.contacts += 1;
            counts.normal_velocity += c.normal_velocity;
            match c.state {
                ContactState::Frictionless => {}
                ContactState::Sticking => counts.sticking += 1,
                ContactState::Slipping => counts.slipping += 1,
            }
        }
        counts.activated = counts.sticking + counts.slipping;
        if counts.contacts > 0 {
            counts.normal_velocity /= f64::from(counts.contacts);
        }
        counts
    }
}
