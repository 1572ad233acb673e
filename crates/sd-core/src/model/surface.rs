//! Parameters of the surfaces for the contact laws.

/// Surfaces: roughness and friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Roughness height h, in a.
    pub roughness: f64,
    /// Friction coefficient ν.
    pub friction: f64,
    /// Normal force above which friction acts, in mu·a²·rate.
    pub critical_load: f64,
}

impl Surface {
    /// Whether friction can act.
    pub fn has_friction(&self) -> bool {
        self.friction > 0.0 && self.critical_load.is_finite()
    }
}
