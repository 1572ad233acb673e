//! A sphere alone in unbounded fluid.

use std::f64::consts::PI;

/// Drag on its translation and its rotation: `(6π a, 6π a, 8π a³)`.
pub(super) fn drag(a: f64) -> [f64; 3] {
    [6.0 * PI * a, 6.0 * PI * a, 8.0 * PI * a.powi(3)]
}

/// Its stresslet over the rate of strain: `(20/3)π a³`.
pub(super) fn stresslet(a: f64) -> f64 {
    20.0 / 3.0 * PI * a.powi(3)
}
