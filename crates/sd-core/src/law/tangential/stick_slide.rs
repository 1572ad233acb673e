//! A tangential spring that slides at Coulomb's limit, and its history.
//!
//! ```text
//! F_t = k_t ξ,   |F_t| ≤ ρ(f),   ξ' = u_t while the spring sticks; at the limit the spring slides and keeps F_t = ±ρ
//! ```
//!
//! In a layer the stretch ξ is a number along the tangent t of the pair, which rotates with the
//! pair: it does not change under a rigid rotation of the pair. In a suspension it is a vector
//! across the line of centres, carried along with it, and |F_t| its length. It starts at 0 when two
//! spheres touch and friction acts, and is discarded when they separate or friction is deactivated.
//! Source: Cundall & Strack, Géotechnique 29, 47 (1979); in suspensions Mari et al., J. Rheol. 58,
//! 1693 (2014), eq. (9)-(11).
//!
//! In a two-stage step of size τ with the coefficient γ the spring looks ahead as all contact
//! forces do. In terms of the force s = k_t ξ at the start of the step, with r = s + 2 (F1 − s)
//! terms that the second stage takes back:
//!
//! ```text
//! F1 = clamp(s + k_t γτ u1),             s2 = s + (F1 − s)/γ
//! F2 = clamp(s2 − 2 (F1 − s) + k_t γτ u2)
//! s  ← s + (3 (F1 − s) + F2 − s2)/(2γ)
//! ```
//!
//! so that s follows u_t to second order while the spring sticks, and lands on a limit at which
//! both stages slide.
//!
//! In a step of rigid contacts, whose second stage is in the middle of the step and moves the
//! spheres over all of it:
//!
//! ```text
//! F1 = clamp(s + k_t γτ u1)
//! F2 = clamp(s + (1 − γ)(F1 − s) + k_t γτ u2)        the force in the middle
//! s  ← s + k_t τ u2
//! ```
//!
//! With γ (2 − γ) = ½ this is of second order and L-stable too: under a stiff spring s is forgotten
//! within a step, and F2 is the force that prevents the slip.

use super::FrictionConstraint;
use crate::law::Quantity;
use crate::law::quantity::Range;
use std::ops::{Add, Div, Mul, Sub};

/// Keyword in campaign files.
pub const KEYWORD: &str = "stick-slide";
/// Description.
pub const MEANING: &str = "A tangential spring whose force is at most ν f.";
/// The stiffness of its spring.
pub const PARAMETERS: &[&Quantity] = &[&TANGENTIAL_STIFFNESS];
/// The slip minus the deformation of the spring.
pub const CONSTRAINT: FrictionConstraint = FrictionConstraint::SpringSlip;

/// Stiffness k_t of the tangential spring: over the normal stiffness k of springs, and in the unit
/// of a stiffness beside rigid contacts, which have no k.
pub static TANGENTIAL_STIFFNESS: Quantity = Quantity {
    key: "tangential_stiffness",
    unit: "k, or F/a",
    meaning: "tangential stiffness k_t; over k, of rigid contacts in F/a",
    range: Range::between(0.0, f64::INFINITY),
    note: "over the stiffness of springs, at most 100; of rigid contacts in F/a, with F as for `stiffness`; an infinite \
           one is `tangential` = \"coulomb\" on rigid contacts, and none is `friction` = 0",
};

/// Largest k_t over k of springs.
pub const MAX_RATIO: f64 = 100.0;

/// Default of k_t over k: Mari et al., J. Rheol. 58, 1693 (2014).
pub const DEFAULT_STIFFNESS: f64 = 0.5;

/// Coulomb's limit.
pub fn bound(friction: f64, load: f64) -> f64 {
    friction * load
}

/// One contact during a step: spring force s at its start, friction F1 at the first stage.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TangentialSpring<T = f64> {
    /// s, in mu·a²·rate.
    pub start: T,
    /// F1, in mu·a²·rate.
    pub first: T,
}

impl<T> TangentialSpring<T>
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T> + Div<f64, Output = T>,
{
    /// A spring with both forces mapped by a function.
    #[must_use]
    pub fn map(&self, change: impl Fn(T) -> T) -> Self {
        Self {
            start: change(self.start),
            first: change(self.first),
        }
    }

    /// s2, at the second stage of a step with the coefficient γ.
    fn second(&self, gamma: f64) -> T {
        self.start + (self.first - self.start) / gamma
    }

    /// The force to which the second stage adds `k_t γτ u2`.
    pub fn base(&self, gamma: f64) -> T {
        self.second(gamma) - (self.first - self.start) * 2.0
    }

    /// The force to which the stage in the middle of a step of rigid contacts adds `k_t γτ u2`.
    pub fn middle(&self, gamma: f64) -> T {
        self.start + (self.first - self.start) * (1.0 - gamma)
    }

    /// `s + k_t τ u2`, with friction F2 in the middle of a step of rigid contacts.
    pub fn end_of_middle(&self, second: T, gamma: f64) -> T {
        self.start + (second - self.middle(gamma)) / gamma
    }

    /// `s + k_t τ u1`, where the first stage moves the spheres over the whole step.
    pub fn end_of_first(&self, gamma: f64) -> T {
        self.second(gamma)
    }

    /// s at the end of the step, with friction F2 at the second stage.
    pub fn end(&self, second: T, gamma: f64) -> T {
        let change = (self.first - self.start) * 3.0 + second - self.second(gamma);
        self.start + change / (2.0 * gamma)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficient of the two-stage step.
    const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

    /// Spring force after a unit of time of slip cos(3t), in steps, sticking throughout.
    fn stretched(steps: u32) -> f64 {
        let (stiffness, dt) = (40.0, 1.0 / f64::from(steps));
        let ahead = stiffness * GAMMA * dt;
        let mut s = 0.0;
        for k in 0..steps {
            let slip = |shift: f64| (3.0 * (f64::from(k) + shift) * dt).cos();
            let stretch = TangentialSpring {
                start: s,
                first: s + ahead * slip(0.0),
            };
            s = stretch.end(stretch.base(GAMMA) + ahead * slip(1.0), GAMMA);
        }
        s
    }

    /// Spring force after a unit of time in which it relaxes, s' = −rate (s − cos t), in steps of
    /// rigid contacts.
    fn relaxed(rate: f64, steps: u32) -> f64 {
        let dt = 1.0 / f64::from(steps);
        let ahead = GAMMA * rate * dt;
        let mut s = 1.0;
        for k in 0..steps {
            let at = |shift: f64| ((f64::from(k) + shift) * dt).cos();
            let spring = TangentialSpring {
                start: s,
                first: (s + ahead * at(0.0)) / (1.0 + ahead),
            };
            let second = (spring.middle(GAMMA) + ahead * at(0.5)) / (1.0 + ahead);
            s = spring.end_of_middle(second, GAMMA);
        }
        s
    }

    #[test]
    fn sticking_spring_follows_the_slip_to_second_order() {
        let exact = 40.0 * 3.0_f64.sin() / 3.0;
        let order = ((stretched(20) - exact) / (stretched(40) - exact)).log2();
        assert!((order - 2.0).abs() < 0.05, "order {order}");
    }

    #[test]
    fn spring_beside_rigid_contacts_relaxes_to_second_order_and_at_once_where_it_is_stiff() {
        let rate = 10.0_f64;
        let forced = |t: f64| (rate * rate * t.cos() + rate * t.sin()) / (rate * rate + 1.0);
        let exact = forced(1.0) + (1.0 - forced(0.0)) * (-rate).exp();
        let order = ((relaxed(rate, 100) - exact) / (relaxed(rate, 200) - exact)).log2();
        assert!((order.abs() - 2.0).abs() < 0.1, "order {order}");
        // The force of a stiff spring does not swing about that of its forcing.
        assert!((relaxed(1e9, 20) - 1.0_f64.cos()).abs() < 0.05);
    }

    #[test]
    fn sliding_spring_lands_on_its_limit() {
        let stretch = TangentialSpring {
            start: 1.0,
            first: 3.0,
        };
        assert!((stretch.end(3.0, GAMMA) - 3.0).abs() < 1e-13);
        // After separation the spring force is 0.
        let parted = TangentialSpring {
            start: 1.0,
            first: 0.0,
        };
        assert!(parted.end(0.0, GAMMA).abs() < 1e-14);
    }
}
