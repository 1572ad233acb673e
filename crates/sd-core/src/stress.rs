//! Viscosity, normal stress difference, energy balance.
//!
//! ```text
//! η = 1 + (Σ S_xy + Σ_k S^C_k,xy)/(V rate),    S^C_xy = −r f n_x n_y + (r/2) F_t (n_x² − n_y²)
//! N1 = Σ (S_xx − S_yy)/V,                      S^C_xx − S^C_yy = −r f (n_x² − n_y²) − 2 r F_t n_x n_y
//! V (η − 1) = v'Rv − Σ f v_n + Σ F_t u_t       (exact: an identity of the solution)
//! ```
//!
//! V = 2 ⟨a⟩ A is the volume of the layer. The contact stress is the symmetric first moment of the contact forces,
//! `−r f n n + (r/2) F_t (n t + t n)`: each sphere feels the force at its end of the line of centres.

use crate::contact::{Contact, ContactState};
use crate::geometry::modes::{Background, strain_tensor};
use crate::motion::Motion;
use nalgebra::Vector3;

/// Bulk stress of the layer at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stress {
    /// η in full, in mu.
    pub viscosity: f64,
    /// η without the contact stress, (20) of the paper to the letter.
    pub viscosity_stresslet: f64,
    /// N1, contact stress included, in mu·rate.
    pub normal_stress_difference: f64,
    /// v'Rv/(V rate), in mu·rate.
    pub dissipation: f64,
}

/// Workspace for stresslets and the forces that go with them.
#[derive(Debug, Default)]
pub struct StressWork {
    /// Stresslet components `(s1, s2, s3)` of each sphere.
    pub stresslets: Vec<Vector3<f64>>,
    /// Hydrodynamic counterforces `R_FU v − R_FE e`, `[3N]`.
    forces: Vec<f64>,
    far: Vec<f64>,
}

impl StressWork {
    /// Stresslets of all spheres in the motion last solved; returns v'Rv, in mu·a³·rate².
    pub fn update(&mut self, motion: &Motion, background: &Background) -> f64 {
        let strain = background.strain();
        motion.counterforces(
            &strain,
            &mut self.far,
            &mut self.forces,
            &mut self.stresslets,
        );
        let work: f64 = crate::linalg::dense::dot(motion.velocities(), &self.forces);
        let strained: f64 = self.stresslets.iter().map(|s| s.dot(&strain)).sum();
        work + strained
    }

    /// Stress of a layer of area `area`, for the motion last solved, with its contacts and the pairs that repel each other.
    pub fn stress(&mut self, motion: &Motion, background: &Background, area: f64) -> Stress {
        let power = self.update(motion, background);
        let radii = motion.resistance.radii();
        let volume = 2.0 * area * radii.iter().sum::<f64>() / radii.len() as f64;
        let (mut shear, mut difference) = (0.0, 0.0);
        for s in &self.stresslets {
            let (xx, yy, xy) = strain_tensor(s);
            shear += xy;
            difference += xx - yy;
        }
        let (mut contact_shear, mut contact_difference) = (0.0, 0.0);
        for c in motion.contacts.list.iter().chain(&motion.repelled.pairs) {
            let (shear, difference) = contact_stress(c);
            contact_shear += shear;
            contact_difference += difference;
        }
        Stress {
            viscosity: 1.0 + (shear + contact_shear) / volume,
            viscosity_stresslet: 1.0 + shear / volume,
            normal_stress_difference: (difference + contact_difference) / volume,
            dissipation: power / volume,
        }
    }
}

/// `S^C_xy` and `S^C_xx − S^C_yy` of one contact, in mu·a³·rate.
fn contact_stress(c: &Contact) -> (f64, f64) {
    let (n, r) = (c.pair.normal, c.pair.distance);
    let (f, f_t) = (c.normal_force, c.tangential_force);
    let (product, difference) = (n.x * n.y, n.x * n.x - n.y * n.y);
    (
        -r * f * product + 0.5 * r * f_t * difference,
        -r * f * difference - 2.0 * r * f_t * product,
    )
}

/// Numbers of contacts by state, and their mean normal velocity.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ContactCounts {
    /// Pairs with f > 0.
    pub contacts: u32,
    /// Of these, pairs with friction.
    pub activated: u32,
    /// Of the activated, pairs that roll.
    pub rolling: u32,
    /// Of the activated, pairs that slip.
    pub slipping: u32,
    /// Mean `v_n` over the pairs with f > 0, in a·rate; 0 without any.
    pub normal_velocity: f64,
}

impl ContactCounts {
    /// Counts the contacts of a solved stage.
    pub(crate) fn of(contacts: &[Contact]) -> Self {
        let mut counts = Self::default();
        for c in contacts.iter().filter(|c| c.normal_force > 0.0) {
            counts.contacts += 1;
            counts.normal_velocity += c.normal_velocity;
            match c.state {
                ContactState::Frictionless => {}
                ContactState::Rolling => counts.rolling += 1,
                ContactState::Slipping => counts.slipping += 1,
            }
        }
        counts.activated = counts.rolling + counts.slipping;
        if counts.contacts > 0 {
            counts.normal_velocity /= f64::from(counts.contacts);
        }
        counts
    }
}
