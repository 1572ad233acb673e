//! A tangential spring that slides at Coulomb's limit, and its history.
//!
//! ```text
//! F_t = k_t ξ,   |F_t| ≤ ρ(f),   ξ' = u_t while the spring sticks; at the limit the spring slides and keeps F_t = ±ρ
//! ```
//!
//! The stretch ξ is a number along the tangent t of the pair, which turns with the pair: it does not change when the pair is
//! turned as a whole. It begins at 0 when two spheres touch and friction acts, and is forgotten when they part or friction ceases.
//! Source: Cundall & Strack, Géotechnique 29, 47 (1979); in suspensions Mari et al., J. Rheol. 58, 1693 (2014), eq. (9)-(11).
//!
//! In a two-stage step (see [`crate::run::steppers::rosenbrock`]) of size τ the spring looks ahead as all contact forces do. In terms of the force
//! s = k_t ξ at the start of the step, with r = s + 2 (F1 − s) terms that the second stage takes back:
//!
//! ```text
//! F1 = clamp(s + k_t γτ u1),             s2 = s + (F1 − s)/γ
//! F2 = clamp(s2 − 2 (F1 − s) + k_t γτ u2)
//! s  ← s + (3 (F1 − s) + F2 − s2)/(2γ)
//! ```
//!
//! so that s follows u_t to second order while the spring sticks, and lands on a limit at which both stages slide.

use crate::run::steppers::rosenbrock::GAMMA;
use serde::{Deserialize, Serialize};

/// One contact during a step: spring force s at its start, friction F1 at the first stage.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Stretch {
    /// s, in mu·a²·rate.
    pub start: f64,
    /// F1, in mu·a²·rate.
    pub first: f64,
}

impl Stretch {
    /// s2, at the second stage.
    fn second(&self) -> f64 {
        self.start + (self.first - self.start) / GAMMA
    }

    /// What the second stage adds `k_t γτ u2` to.
    pub fn base(&self) -> f64 {
        self.second() - 2.0 * (self.first - self.start)
    }

    /// s at the end of the step, with friction F2 at the second stage.
    pub fn end(&self, second: f64) -> f64 {
        self.start + (3.0 * (self.first - self.start) + second - self.second()) / (2.0 * GAMMA)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Spring force after a unit of time of slip cos(3t), in steps, sticking throughout.
    fn stretched(steps: u32) -> f64 {
        let (stiffness, dt) = (40.0, 1.0 / f64::from(steps));
        let ahead = stiffness * GAMMA * dt;
        let mut s = 0.0;
        for k in 0..steps {
            let slip = |shift: f64| (3.0 * (f64::from(k) + shift) * dt).cos();
            let stretch = Stretch {
                start: s,
                first: s + ahead * slip(0.0),
            };
            s = stretch.end(stretch.base() + ahead * slip(1.0));
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
    fn sliding_spring_lands_on_its_limit() {
        let stretch = Stretch {
            start: 1.0,
            first: 3.0,
        };
        assert!((stretch.end(3.0) - 3.0).abs() < 1e-13);
        // Parted: nothing is left.
        let parted = Stretch {
            start: 1.0,
            first: 0.0,
        };
        assert!(parted.end(0.0).abs() < 1e-14);
    }
}
