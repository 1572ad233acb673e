//! Rolling friction: a couple that opposes the relative rotation of two spheres in loaded contact.
//!
//! ```text
//! u_r = a_ij (Ω_j − Ω_i),  a_ij = 2 a_i a_j/(a_i + a_j)       rolling velocity: objective; 0 if a pair rotates rigidly
//! |F_r| ≤ μ_r f                                              bound of the quasi-force F_r, f the load of friction
//! torque a_ij F_r on i, −a_ij F_r on j                       F_r has the sign of u_r, so that the couple opposes it; no force
//! with coulomb:       |F_r| < μ_r f: u_r = 0;   else F_r = μ_r f sign(u_r)
//! with stick-slide:   F_r = k_t ξ_r,   ξ_r' = u_r while the spring holds
//! ```
//!
//! Forces in mu·a²·rate. It is a part of friction: it acts where friction acts, with the same
//! onset. Source: Luding, Granular Matter 10, 235 (2008), for the objective velocity and the
//! quasi-force; in suspensions Singh et al., Phys. Rev. Lett. 124, 248005 (2020). The couple of
//! equal spheres is at most μ_r a f. Luding's reduced radius a_i a_j/(a_i + a_j) is half of a_ij:
//! his coefficient is twice the one here for the same couple.

use super::quantity::Range;
use super::tangential::{FrictionConstraint, TangentialLaw};
use super::{Keywords, Quantity};

/// μ_r.
pub static ROLLING_FRICTION: Quantity = Quantity {
    key: "rolling_friction",
    unit: "1",
    meaning: "coefficient of rolling friction μ_r",
    range: Range::from_to(0.0, 10.0),
    note: "the couple on a pair of equal spheres is at most μ_r a f",
};

/// a_ij, in a.
pub fn radius([a_i, a_j]: [f64; 2]) -> f64 {
    2.0 * a_i * a_j / (a_i + a_j)
}

/// Whether it can be combined with a tangential law: one that constrains the slip of the pair
/// among other spheres, but not its rolling.
///
/// ```
/// use sd_core::TangentialLaw;
/// use sd_core::law::rolling_friction::can_combine;
///
/// assert!(can_combine(TangentialLaw::Coulomb) && !can_combine(TangentialLaw::StickRotate));
/// ```
pub fn can_combine(law: TangentialLaw) -> bool {
    match law.constraint() {
        FrictionConstraint::Slip | FrictionConstraint::SpringSlip => true,
        FrictionConstraint::IsolatedSlip | FrictionConstraint::SlipAndRotation => false,
    }
}

/// The laws with which it can be combined, by their keywords.
pub fn combinable_words() -> String {
    let laws = TangentialLaw::ALL.iter().filter(|law| can_combine(**law));
    let words: Vec<String> = laws.map(|law| format!("{:?}", law.word())).collect();
    words.join(" or ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radius_is_that_of_equal_spheres_and_between_those_of_others() {
        assert_eq!(radius([1.0, 1.0]), 1.0);
        assert!((radius([1.0, 1.4]) - 2.8 / 2.4).abs() < 1e-15);
        assert_eq!(radius([1.0, 1.4]), radius([1.4, 1.0]));
    }

    #[test]
    fn it_combines_with_laws_that_leave_pairs_free_to_roll() {
        assert_eq!(combinable_words(), "\"stick-slide\" or \"coulomb\"");
    }
}
