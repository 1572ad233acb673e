//! The rate of dilation under an imposed pressure, by both backends of the contact problem.

use crate::contact::laws::{Laws, Span};
use crate::contact::{ContactMemory, ImposedPressure, SolvePass, Status, Surface};
use crate::model::PressureKind;
use crate::space::cell::Cell;
use crate::space::{Layer, Space as _, VelocityGradient};
use crate::stage::{Method, StageContacts};
use crate::{Hydrodynamics, NearFields, Params, Simulation, TangentialLaw};

#[test]
fn both_backends_dilate_the_cell_alike_and_contacts_bear_the_pressure() {
    let params = Params::builder()
        .spheres(40)
        .area_fraction(0.74)
        .roughness(0.01)
        .friction(0.3)
        .shear_rate(f64::INFINITY)
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .build()
        .unwrap();
    let tables = NearFields::default();
    let mut run = Simulation::<Layer>::new(&params, 1, &tables).unwrap();
    for _ in 0..60 {
        run.step().unwrap();
    }
    let cell: Cell = run.cell_at(run.time()).unwrap();
    let volume = Layer::volume(cell.content().unwrap(), run.radii());
    let laws = Laws {
        tangential: TangentialLaw::Coulomb,
        ..Laws::rigid(Surface {
            roughness: 0.01,
            friction: 0.3,
            critical_load: 0.0,
        })
    };
    let cases = [
        (100.0, 10.0, PressureKind::Isotropic),
        (0.1, 1.0, PressureKind::Isotropic),
        (1e4, 1e-3, PressureKind::Isotropic),
        (100.0, 10.0, PressureKind::Gradient),
        (1e4, 1e-3, PressureKind::Gradient),
    ];
    for (pressure, resistance, kind) in cases {
        let solved = [Method::Dense, Method::Pairwise].map(|method| {
            let mut stage = method
                .solver::<Layer>(
                    params.hydrodynamics,
                    &cell,
                    run.radii(),
                    &tables,
                    &[],
                    &crate::model::SolverSettings::default(),
                )
                .unwrap();
            stage.assemble(&cell, run.centres()).unwrap();
            stage.contacts.pressure = Some(ImposedPressure {
                pressure,
                volume,
                resistance,
                kind,
            });
            let contact = StageContacts::Laws {
                laws: &laws,
                span: Span::single(0.01),
                memory: &mut ContactMemory::default(),
            };
            let flow = VelocityGradient::simple_shear(1.0).into();
            let quality = stage.solve(&flow, &[], contact, SolvePass::First).unwrap();
            assert_eq!(quality.status, Status::Solved, "{quality:?}");
            let list = &stage.contacts.list;
            let borne = list.iter().map(|c| {
                let directions = c.directions();
                let [shifting] = c.shifting(kind, &directions);
                let [friction] = Layer::along(&directions, &c.tangential_force);
                c.opening(kind) * c.normal_force - shifting * friction
            });
            let borne: f64 = borne.sum();
            // V κ_V e = Σ c f − Σ s t − V P
            let dilation = stage.contacts.dilation;
            let error = volume * resistance * dilation - (borne - volume * pressure);
            assert!(error.abs() < 1e-9 * volume * pressure, "{error}");
            // No pair that is closed within the step comes nearer than the roughness.
            for c in list.iter().filter(|c| c.pair.gap > 0.01) {
                let end = c.pair.gap + 0.01 * c.normal_velocity;
                // Rigid contacts yield by 1e-10 of their force.
                let yielded = 0.01 * 1e-10 * c.normal_force;
                assert!(end > 0.01 - yielded - 1e-9, "{pressure} {method:?}: {end}");
            }
            (dilation, stage.velocities().to_vec(), borne)
        });
        let [(e, v, f), (e2, v2, f2)] = &solved;
        assert!((e - e2).abs() < 1e-6 * e.abs().max(1.0), "{e} {e2}");
        assert!((f / f2 - 1.0).abs() < 1e-6 || *f == *f2, "{f} {f2}");
        let largest = v
            .iter()
            .zip(v2)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(largest < 1e-6, "{largest}");
    }
}
