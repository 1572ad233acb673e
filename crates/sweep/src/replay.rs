//! The state of a run as `sweep solve` reads it: what is kept of a failure, so that it can be looked into by itself.

use sd_core::{Params, Snapshot};
use serde_json::json;

/// The input of `sweep solve` for one state of a layer.
pub(crate) fn replay(p: &Params, snapshot: &Snapshot) -> String {
    // At Γ = 0 the load is infinite, which JSON cannot say; without friction it does not matter.
    let (friction, load) = if p.critical_load().is_finite() {
        (p.friction, p.critical_load())
    } else {
        (0.0, 0.0)
    };
    let mut contact = json!({
        "scheme": p.contact,
        "roughness": p.roughness,
        "friction": friction,
        "critical_load": load,
    });
    if p.contact == sd_core::ContactScheme::Rigid {
        contact["time_span"] = json!(p.time_step);
    }
    json!({
        "centres": snapshot.centres,
        "radii": snapshot.radii,
        "cell": [snapshot.side, snapshot.side],
        "offset": snapshot.steps as f64 * p.time_step * snapshot.side,
        "hydrodynamics": p.hydrodynamics,
        "contact": contact,
    })
    .to_string()
}
