//! The state of a run as input of `sweep solve`, which is kept of a failure so that it can be
//! studied separately.

use crate::model::spaces::{AnySnapshot, of_either};
use sd_core::instant::look_ahead;
use sd_core::simulation::SchemeMemory;
use sd_core::{ContactScheme, Params, Snapshot, Space};
use serde_json::json;

/// The input of `sweep solve` for one state of a layer or a suspension.
pub(crate) fn replay(p: &Params, snapshot: &AnySnapshot) -> String {
    of_either!(snapshot, snapshot => replay_in(p, snapshot))
}

fn replay_in<S: Space>(run: &Params, snapshot: &Snapshot<S>) -> String {
    let imposed = run.imposed(snapshot.steps);
    let p = &run.in_step(&imposed);
    let load = snapshot.critical_load.unwrap_or(p.critical_load());
    // At Γ = 0 the load is infinite, which JSON cannot represent; without friction it does not
    // matter.
    let (friction, load) = if load.is_finite() {
        (p.friction, load)
    } else {
        (0.0, 0.0)
    };
    let mut contact = json!({
        "scheme": match p.contact {
            ContactScheme::Rigid => "rigid",
            ContactScheme::Procedure => "procedure",
            ContactScheme::Laws(_) => "laws",
        },
        "roughness": p.roughness,
        "friction": friction,
        "critical_load": load,
    });
    match p.contact {
        ContactScheme::Procedure => {}
        ContactScheme::Rigid => contact["time_span"] = json!(look_ahead(p)),
        ContactScheme::Laws(laws) => {
            contact["time_span"] = json!(look_ahead(p));
            contact["laws"] = json!(laws);
            if let SchemeMemory::Laws(memory) = &snapshot.memory {
                contact["springs"] = json!(memory.springs);
                if laws.rolling_friction > 0.0 {
                    contact["rolling_springs"] = json!(memory.rolling_springs);
                }
            }
        }
    }
    let at_start = p.given_layer().map_or(0.0, |layer| layer.offset);
    let spin = -0.5 * imposed.direction;
    let mut rate_of_strain = json!({"xx": 0.0, "yy": 0.0, "xy": 0.5 * imposed.direction});
    let mut angular_velocity = json!(spin);
    if S::DIMENSIONS > 2 {
        let cross = 0.5 * imposed.cross_rate();
        rate_of_strain["xz"] = json!(0.0);
        rate_of_strain["yz"] = json!(cross);
        angular_velocity = json!([cross, 0.0, spin]);
    }
    let mut input = json!({
        "centres": snapshot.centres,
        "radii": snapshot.radii,
        "cell": vec![snapshot.side; S::DIMENSIONS],
        "offset": at_start + run.net_strain(snapshot.steps) * snapshot.side,
        "background": {
            "rate_of_strain": rate_of_strain,
            "angular_velocity": angular_velocity,
        },
        "hydrodynamics": p.hydrodynamics,
        "contact": contact,
    });
    let cross_strain = run.cross_strain(snapshot.steps);
    if cross_strain != 0.0 {
        input["cross_offset"] = json!(cross_strain * snapshot.side);
    }
    input.to_string()
}
