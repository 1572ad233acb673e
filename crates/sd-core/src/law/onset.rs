//! Onset of friction with the load f of a contact.
//!
//! ```text
//! critical-load   |F_t| ≤ ν f where f > F_crit, none below
//! reduced         |F_t| ≤ ν (f − F_crit) where f > F_crit, none below
//! contact         |F_t| ≤ ν f at every contact; F_crit is only the unit of a repulsion
//! ```
//!
//! Sources: Townsend & Wilson, Phys. Fluids 29, 121607 (2017); the critical-load model of Seto et
//! al., Phys. Rev. Lett. 111, 218301 (2013), whose force does not jump; the repulsion of Mari,
//! Seto, Morris & Denn, J. Rheol. 58, 1693 (2014), in units of which stress and rate are given
//! there.

super::words! {
    /// Onset of friction with the load.
    FrictionOnset {
        CriticalLoad = "critical-load", "The paper's law: `|F_t| ≤ ν f` where f > F_crit, no friction below.";
        Reduced = "reduced", "`|F_t| ≤ ν (f − F_crit)`, which is continuous at F_crit.";
        Contact = "contact", "`|F_t| ≤ ν f` on every contact; F_crit is only the unit of the repulsion.";
    }
}

impl FrictionOnset {
    /// Load that friction is proportional to, at a normal force f; 0 where friction does not act.
    ///
    /// ```
    /// use sd_core::FrictionOnset;
    ///
    /// assert_eq!(FrictionOnset::CriticalLoad.load(3.0, 1.0), 3.0);
    /// assert_eq!(FrictionOnset::Reduced.load(3.0, 1.0), 2.0);
    /// assert_eq!(FrictionOnset::CriticalLoad.load(0.5, 1.0), 0.0);
    /// ```
    pub fn load(self, normal_force: f64, critical_load: f64) -> f64 {
        let threshold = self.threshold(critical_load);
        if normal_force <= threshold {
            return 0.0;
        }
        match self {
            Self::CriticalLoad | Self::Contact => normal_force,
            Self::Reduced => normal_force - threshold,
        }
    }

    /// Normal force above which friction acts.
    pub fn threshold(self, critical_load: f64) -> f64 {
        match self {
            Self::CriticalLoad | Self::Reduced => critical_load,
            Self::Contact => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::FrictionOnset::{Contact, CriticalLoad, Reduced};

    #[test]
    fn friction_jumps_at_the_critical_load_or_grows_from_it() {
        assert_eq!(
            (CriticalLoad.load(2.0, 2.0), Reduced.load(2.0, 2.0)),
            (0.0, 0.0)
        );
        assert_eq!(
            (CriticalLoad.load(3.0, 2.0), Reduced.load(3.0, 2.0)),
            (3.0, 1.0)
        );
        assert_eq!(
            (CriticalLoad.load(3.0, 0.0), Reduced.load(3.0, 0.0)),
            (3.0, 3.0)
        );
        assert_eq!(Reduced.load(3.0, f64::INFINITY), 0.0);
        assert_eq!((Contact.load(1.0, 2.0), Contact.load(0.0, 2.0)), (1.0, 0.0));
    }
}
