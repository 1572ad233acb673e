//! Unit of stiffnesses, which determines what is constant while Γ varies.
//!
//! ```text
//! critical-load   k in F_crit/a         a property of the material, as F_crit is
//! flow            k in 6π mu a · rate   overlaps are the same at every rate: an equal approach to the hard-sphere limit
//! ```
//!
//! Source of the second: Mari, Seto, Morris & Denn, J. Rheol. 58, 1693 (2014), whose stiffness
//! follows the stress so that the largest overlap stays the same.

use std::f64::consts::PI;

super::words! {
    /// Unit of stiffnesses.
    #[non_exhaustive]
    StiffnessUnit {
        CriticalLoad = "critical-load", "F_crit/a: a material property, as F_crit is.";
        Flow = "flow", "6π μ a × shear rate: the same overlaps at every rate.";
    }
}

impl StiffnessUnit {
    /// The unit of force, in mu·a²·rate.
    ///
    /// ```
    /// use sd_core::StiffnessUnit;
    ///
    /// assert_eq!(StiffnessUnit::CriticalLoad.force(3.0), 3.0);
    /// assert_eq!(StiffnessUnit::Flow.force(3.0), 6.0 * std::f64::consts::PI);
    /// ```
    pub fn force(self, critical_load: f64) -> f64 {
        match self {
            Self::CriticalLoad => critical_load,
            Self::Flow => 6.0 * PI,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::StiffnessUnit::{CriticalLoad, Flow};

    #[test]
    fn units_meet_where_the_critical_load_is_the_force_of_the_flow() {
        // F_crit = 6π/Γ, at Γ = 1.
        let load = 6.0 * std::f64::consts::PI;
        assert_eq!(CriticalLoad.force(load), Flow.force(load));
        assert_eq!(CriticalLoad.force(0.5 * load), 0.5 * load);
        assert_eq!(Flow.force(0.5 * load), load);
    }
}
