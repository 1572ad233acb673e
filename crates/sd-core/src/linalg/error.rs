//! Errors of factorizations.

/// No usable pivot was found: one that is not positive in a Cholesky factorization, zero or not
/// finite in another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BadPivot {
    /// Row, or column, of the first bad pivot.
    pub pivot: usize,
}
