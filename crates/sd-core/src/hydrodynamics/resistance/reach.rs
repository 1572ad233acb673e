//! The range of the pairs that a sparse factor includes.

/// Range of pairs of the near part, in s'. Other pairs contribute only their diagonal blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Pairs closer than this must be in the pattern.
    pub(super) required: f64,
    /// A new pattern includes pairs up to this range, so that it stays valid for several steps.
    pub(super) included: f64,
    /// Required gap, in s' − 2, beyond the height of contacts, since approaching contacts are
    /// stiff.
    pub(super) contact_margin: f64,
}

impl Reach {
    /// This range with all contacts of asperities of a height, in the mean radius of a pair.
    pub(super) fn with_contacts(self, height: f64) -> Self {
        let required = self.required.max(2.0 + height + self.contact_margin);
        Self {
            required,
            included: self.included + (required - self.required),
            ..self
        }
    }
}
