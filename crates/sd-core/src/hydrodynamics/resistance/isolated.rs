//! A sphere alone in unbounded fluid.

use crate::space::{FixedArray as _, Space};
use std::f64::consts::PI;

/// Its resistance to each of its modes: 6πa to velocities, 8πa³ to angular velocities, (20/3)πa³ to
/// strains.
pub(crate) fn isolated<S: Space>(radius: f64) -> S::PerAnyMode<f64> {
    let cube = radius.powi(3);
    let mut drag = S::PerAnyMode::each(20.0 / 3.0 * PI * cube);
    for k in 0..S::MODES {
        drag[k] = if k < S::DIMENSIONS {
            6.0 * PI * radius
        } else {
            8.0 * PI * cube
        };
    }
    drag
}
