//! Configurations with three components.

use super::super::{Amount, Answer, answer, read};

fn solved(text: &str) -> Answer {
    answer(&read(text.as_bytes()).unwrap()).unwrap()
}

fn near(a: f64, b: f64, what: &str) {
    assert!((a - b).abs() <= 1e-8 * (1.0 + b.abs()), "{what}: {a} {b}");
}

/// Spheres in a plane of unbounded fluid move in it alike whether they are written as a layer or as
/// a suspension: the two are computed with other modes, other far fields and other contact
/// problems.
#[test]
fn spheres_in_a_plane_move_as_those_of_a_layer() {
    let rest = |hydrodynamics: &str| {
        format!(
            r#""radii": [1, 1, 1.3], "hydrodynamics": "{hydrodynamics}",
            "contact": {{"scheme": "laws", "roughness": 0.05, "friction": 0.3, "critical_load": 0, "time_span": 0.01,
            "laws": {{"normal": "rigid", "tangential": "coulomb", "onset": "critical-load", "stiffness_unit": "critical-load",
            "stiffness": null, "tangential_stiffness": 0, "dashpot": 0, "lubrication_gap": 0, "repulsion": 0, "repulsion_length": 0}}}}}}"#
        )
        .replace("\"stiffness\": null, ", "\"stiffness\": \"inf\", ")
    };
    for hydrodynamics in ["ball-melrose", "stokesian-dynamics", "lubrication"] {
        let rest = rest(hydrodynamics);
        let layer = solved(&format!(
            r#"{{"centres": [[0, 0], [-1.6, 1.25], [1.4, -2.0]], "forces": [[1, 2], [0.5, -1], [-3, 0.25]], "torques": [0.5, -0.25, 1], {rest}"#
        ));
        let suspension = solved(&format!(
            r#"{{"centres": [[0, 0, 0], [-1.6, 1.25, 0], [1.4, -2.0, 0]], "forces": [[1, 2, 0], [0.5, -1, 0], [-3, 0.25, 0]],
            "torques": [[0, 0, 0.5], [0, 0, -0.25], [0, 0, 1]], {rest}"#
        ));
        assert!(!layer.contacts.is_empty());
        assert!(
            layer.contacts.iter().any(|c| c.normal_force > 0.1),
            "{hydrodynamics}"
        );
        for i in 0..3 {
            let [flat, full] = [&layer, &suspension].map(|s| &s.velocity_disturbance[i]);
            near(full[0], flat[0], hydrodynamics);
            near(full[1], flat[1], hydrodynamics);
            near(full[2], 0.0, hydrodynamics);
            let Amount::Vector(turning) = suspension.angular_velocity_disturbance[i] else {
                panic!("no vector");
            };
            near(
                turning[2],
                layer.angular_velocity_disturbance[i].numbers()[0],
                hydrodynamics,
            );
            near(
                suspension.stresslet_xx[i],
                layer.stresslet_xx[i],
                hydrodynamics,
            );
            near(
                suspension.stresslet_yy[i],
                layer.stresslet_yy[i],
                hydrodynamics,
            );
            near(
                suspension.stresslet_xy[i],
                layer.stresslet_xy[i],
                hydrodynamics,
            );
            near(
                suspension.stresslet_xz.as_ref().unwrap()[i],
                0.0,
                hydrodynamics,
            );
        }
        for (full, flat) in suspension.contacts.iter().zip(&layer.contacts) {
            assert_eq!((full.i, full.j, full.normal.len()), (flat.i, flat.j, 3));
            near(full.normal_force, flat.normal_force, "normal force");
            // Along t = (−n_y, n_x).
            let [x, y, z]: [f64; 3] = full.tangential_force.numbers().try_into().unwrap();
            let along = x * -flat.normal[1] + y * flat.normal[0];
            near(
                along.abs(),
                flat.tangential_force.numbers()[0].abs(),
                "friction",
            );
            near(z, 0.0, "friction along z");
        }
    }
}

#[test]
fn two_and_three_components_do_not_mix() {
    for (text, place, said) in [
        (
            r#"{"centres": [[0, 0], [3, 0, 0]]"#,
            "1:",
            "a vector of 3 components, where the first of `centres` has 2",
        ),
        (
            r#"{"centres": [[0, 0, 0], [3, 0]]"#,
            "1:",
            "a vector of 2 components, where the first of `centres` has 3",
        ),
        (
            "{\"centres\": [[0, 0], [3, 0]],\n\"cell\": [20, 20, 20]",
            "2:",
            "a vector of 3 components, where the first of `centres` has 2",
        ),
        (
            "{\"centres\": [[0, 0, 0], [3, 0, 0]],\n\"cell\": [20, 20]",
            "2:",
            "three for a suspension",
        ),
        (
            r#"{"centres": [[0, 0, 0], [3, 0, 0]], "forces": [[1, 0, 0]]"#,
            "",
            "forces",
        ),
        (
            r#"{"centres": [[0, 0, 0]], "contact": {"scheme": "procedure", "roughness": 0.01, "friction": 0.1, "critical_load": 0}"#,
            "contact.scheme",
            "\"procedure\" is a protocol of layers",
        ),
    ] {
        let text = format!("{text}, \"hydrodynamics\": \"ball-melrose\"}}");
        let error = read(text.as_bytes()).unwrap_err().to_string();
        assert!(
            error.contains(place) && error.contains(said),
            "{text}: {error}"
        );
    }
}
