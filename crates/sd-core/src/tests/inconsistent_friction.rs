//! An instant at which no friction was found that is consistent with its own far field.

use crate::contact::laws::{Laws, Span};
use crate::contact::{ContactMemory, ContactState, SolvePass, Status, Surface};
use crate::hydrodynamics::iterative::IterativeFarField;
use crate::hydrodynamics::resistance::Resistance;
use crate::space::cell::Cell;
use crate::space::{Bulk, VelocityGradient};
use crate::stage::{StageContacts, StageSolver};
use crate::{Hydrodynamics, NearFields, TangentialLaw};
use nalgebra::Vector3;

#[test]
fn held_friction_bounds_end_the_iteration_of_the_far_field() {
    let text = std::fs::read_to_string("tests/data/inconsistent_friction.json").unwrap();
    let data: serde_json::Value = serde_json::from_str(&text).unwrap();
    let vector = |value: &serde_json::Value| {
        Vector3::from_iterator(
            value
                .as_array()
                .unwrap()
                .iter()
                .map(|x| x.as_f64().unwrap()),
        )
    };
    let centres: Vec<_> = data["centres"]
        .as_array()
        .unwrap()
        .iter()
        .map(vector)
        .collect();
    let radii: Vec<f64> = serde_json::from_value(data["radii"].clone()).unwrap();
    let offset = data["offset"].as_f64().unwrap();
    let cell = Cell::<Bulk>::periodic(vector(&data["cell"]), offset).unwrap();
    let hydrodynamics = Hydrodynamics::StokesianDynamics;
    let tables = NearFields::default();
    let near = Resistance::new_pairwise(hydrodynamics, &cell, &radii, &tables, &[]).unwrap();
    let far = IterativeFarField::new(&cell, &radii, 1e-6).unwrap();
    let mut stage = StageSolver::with_far_field(near, far);
    stage.assemble(&cell, &centres).unwrap();
    let laws = Laws {
        tangential: TangentialLaw::Coulomb,
        ..Laws::rigid(Surface {
            roughness: 0.01,
            friction: 1.0,
            critical_load: 0.0,
        })
    };
    let contact = StageContacts::Laws {
        laws: &laws,
        span: Span::single(0.01),
        memory: &mut ContactMemory::default(),
    };
    let quality = stage
        .solve(
            &VelocityGradient::simple_shear(1.0).into(),
            &[],
            contact,
            SolvePass::First,
        )
        .unwrap();
    // Gaps hold, to a part of the far field's tolerance that depends on the way to it, and friction
    // is nearly that of the law.
    assert_eq!(quality.status, Status::InexactFriction, "{quality:?}");
    assert!(quality.residual < 1e-8, "{quality:?}");
    assert!(quality.friction_error < 0.02, "{quality:?}");
    let slipping = stage
        .contacts
        .list
        .iter()
        .filter(|c| c.state == ContactState::Slipping);
    assert!(slipping.count() > 10);
}
