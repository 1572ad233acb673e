//! What stiffnesses are in units of: what stays the same while Γ varies.
//!
//! ```text
//! critical-load   k in F_crit/a         a property of the material, as F_crit is
//! flow            k in 6π mu a · rate   overlaps stay the same at every rate: the limit of hard spheres is approached alike
//! ```
//!
//! Source of the second: Mari, Seto, Morris & Denn, J. Rheol. 58, 1693 (2014), whose stiffness follows the stress so that the largest overlap
//! stays the same.

use std::f64::consts::PI;

super::words! {
    /// What stiffnesses are in units of.
    StiffnessUnit {
        CriticalLoad = "critical-load", "F_crit/a: a property of the material, as F_crit is.";
        Flow = "flow", "6π μ a × shear rate: overlaps stay the same at every rate.";
    }
}

impl StiffnessUnit {
    /// The force that is 1 in it, in mu·a²·rate.
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
