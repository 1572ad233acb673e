//! What an imposed pressure is the mean of, and how the cell answers.

crate::law::words! {
    /// The normal stress that an imposed pressure is.
    PressureKind {
        Isotropic = "isotropic", "The mean of the normal stresses; the cell dilates alike in all directions.";
        Gradient = "gradient", "The normal stress on planes across the gradient, as a porous plate imposes it; the cell dilates along the gradient alone.";
    }
}

#[expect(clippy::derivable_impls, reason = "the macro declares the enum")]
impl Default for PressureKind {
    fn default() -> Self {
        Self::Isotropic
    }
}
