//! The state of a run as input of `sweep solve`, which is kept of a failure so that it can be
//! studied separately.

use crate::model::spaces::{AnySnapshot, of_either};
use sd_core::instant::look_ahead;
use sd_core::law::Keywords as _;
use sd_core::simulation::SchemeMemory;
use sd_core::{ContactScheme, Params, Snapshot, Space, VelocityGradient};
use serde_json::json;

/// The input of `sweep solve` for one state of a layer or a suspension.
pub(crate) fn replay(p: &Params, snapshot: &AnySnapshot) -> String {
    of_either!(snapshot, snapshot => replay_in(p, snapshot))
}

fn replay_in<S: Space>(run: &Params, snapshot: &Snapshot<S>) -> String {
    let imposed = run.imposed(snapshot.steps);
    let p = &run.in_step(&imposed);
    // Of Brownian spheres under a stress it is in units of that.
    let of_stress = p
        .shear_stress
        .filter(|_| run.has_free_rate())
        .map(f64::recip);
    let load = snapshot
        .critical_load
        .or(of_stress)
        .unwrap_or(p.critical_load());
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
    let flow = VelocityGradient::<S>::of_type(p.flow, p.direction);
    let flow = flow.with_cross_shear(imposed.cross_rate());
    let [xx, yy, _, xy, xz, yz] = flow.rate_of_strain();
    let mut rate_of_strain = json!({"xx": xx, "yy": yy, "xy": xy});
    let row = |k: usize| S::point(&flow.rows()[k]);
    let spin = 0.5 * (row(1)[0] - row(0)[1]);
    let mut angular_velocity = json!(spin);
    if S::DIMENSIONS > 2 {
        (rate_of_strain["xz"], rate_of_strain["yz"]) = (json!(xz), json!(yz));
        let about_x = 0.5 * (row(2)[1] - row(1)[2]);
        let about_y = 0.5 * (row(0)[2] - row(2)[0]);
        angular_velocity = json!([about_x, about_y, spin]);
    }
    let mut input = json!({
        "centres": snapshot.centres,
        "radii": snapshot.radii,
        "background": {
            "rate_of_strain": rate_of_strain,
            "angular_velocity": angular_velocity,
        },
        "hydrodynamics": p.hydrodynamics.word(),
        "contact": contact,
    });
    if let Some(numbers) = p.hydrodynamics.leading_order() {
        input["lubrication"] = json!(numbers);
    }
    if run.is_sheared() && snapshot.height == 1.0 && !run.has_free_rate() {
        input["cell"] = json!(vec![snapshot.side; S::DIMENSIONS]);
        input["offset"] = json!(at_start + run.net_strain(snapshot.steps) * snapshot.side);
        let cross_strain = run.cross_strain(snapshot.steps);
        if cross_strain != 0.0 {
            input["cross_offset"] = json!(cross_strain * snapshot.side);
        }
    } else if let Ok(cell) = snapshot.cell(run) {
        let vectors = cell
            .lattice()
            .map(|lattice| lattice.vectors().iter().map(S::point));
        input["lattice"] = json!(vectors.map(Iterator::collect::<Vec<_>>));
    }
    input.to_string()
}
