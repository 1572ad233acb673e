//! The explicit Runge-Kutta methods that are compared.

/// An explicit Runge-Kutta method.
pub(crate) struct Method {
    pub(crate) name: &'static str,
    /// Nodes c.
    pub(crate) nodes: &'static [f64],
    /// Rows of the tableau.
    pub(crate) rows: &'static [&'static [f64]],
    /// Time spans τ of the stages, in steps.
    pub(crate) spans: &'static [f64],
    pub(crate) weights: &'static [f64],
    /// Weights of the embedded method less these, if there is one; then the order of the error over
    /// a step.
    pub(crate) embedded: Option<(&'static [f64], f64)>,
    /// Whether the last stage is the first of the next step.
    pub(crate) last_is_first: bool,
    /// Whether the second stage holds the gaps of the step's start over the whole step.
    pub(crate) held: bool,
}

/// One right-hand side per step.
pub(crate) const EULER: Method = Method {
    name: "Euler",
    nodes: &[0.0],
    rows: &[&[]],
    spans: &[1.0],
    weights: &[1.0],
    embedded: None,
    last_is_first: false,
    held: false,
};
/// Two right-hand sides per step.
pub(crate) const MIDPOINT: Method = Method {
    name: "midpoint",
    nodes: &[0.0, 0.5],
    rows: &[&[], &[0.5]],
    spans: &[1.0, 0.5],
    weights: &[0.0, 1.0],
    embedded: None,
    last_is_first: false,
    held: false,
};
/// The method of the program: the midpoint rule, with the gaps of the step's start held over the
/// whole step.
pub(crate) const HELD: Method = Method {
    name: "midpoint, gaps held",
    spans: &[1.0, 1.0],
    held: true,
    ..MIDPOINT
};
/// Four right-hand sides per step.
pub(crate) const RK4: Method = Method {
    name: "RK4",
    nodes: &[0.0, 0.5, 0.5, 1.0],
    rows: &[&[], &[0.5], &[0.0, 0.5], &[0.0, 0.0, 1.0]],
    spans: &[1.0, 0.5, 0.5, 1.0],
    weights: &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
    embedded: None,
    last_is_first: false,
    held: false,
};
/// Heun with Euler embedded.
pub(crate) const HEUN: Method = Method {
    name: "Heun 2(1)",
    nodes: &[0.0, 1.0],
    rows: &[&[], &[1.0]],
    spans: &[1.0, 1.0],
    weights: &[0.5, 0.5],
    embedded: Some((&[0.5, -0.5], 2.0)),
    last_is_first: false,
    held: false,
};
/// Bogacki and Shampine (1989).
pub(crate) const BOGACKI_SHAMPINE: Method = Method {
    name: "Bogacki-Shampine 3(2)",
    nodes: &[0.0, 0.5, 0.75, 1.0],
    rows: &[
        &[],
        &[0.5],
        &[0.0, 0.75],
        &[2.0 / 9.0, 1.0 / 3.0, 4.0 / 9.0],
    ],
    spans: &[1.0, 0.5, 0.5, 1.0],
    weights: &[2.0 / 9.0, 1.0 / 3.0, 4.0 / 9.0, 0.0],
    embedded: Some((&[-5.0 / 72.0, 1.0 / 12.0, 1.0 / 9.0, -1.0 / 8.0], 3.0)),
    last_is_first: true,
    held: false,
};
