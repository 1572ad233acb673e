//! Unit of the forces between surfaces that do not touch.
//!
//! ```text
//! critical-load   forces in F_crit, energies in F_crit a     for comparison with the load at which friction begins
//! thermal         forces in kT/a, energies in kT             for comparison with Brownian motion
//! ```

super::words! {
    /// Unit of the repulsion and of van der Waals attraction.
    #[non_exhaustive]
    ColloidUnit {
        CriticalLoad = "critical-load", "F_crit, the load at which friction begins; energies in F_crit a.";
        Thermal = "thermal", "kT/a of Brownian motion; energies in kT.";
    }
}
