//! Pictures of spheres.

use super::*;
use crate::model::spaces::InSpace;
use crate::test_support;
use sd_core::{Bulk, Layer, Space};

fn layer() -> Frame<Layer> {
    let InSpace::Layer(frame) = test_support::frame() else {
        panic!("no layer");
    };
    frame
}

fn suspension(z: f64) -> Frame<Bulk> {
    let InSpace::Suspension(frame) = test_support::suspension(0.5, [1.0, 2.0, z]) else {
        panic!("no suspension");
    };
    frame
}

type Drawn = (PlanePicture, SpherePicture);

fn of<S: Kept>(frame: &Frame<S>, view: SphereView) -> Result<Drawn, ReportError> {
    drawn(&[(1, frame)], view, Vec::new())
}

/// Centres and colours of the spheres in the cell.
fn spheres(drawn: &Drawn) -> Vec<([f64; 2], Colour)> {
    let sphere = |mark: &Mark| match mark {
        Mark::Sphere { centre, colour, .. } => Some((*centre, *colour)),
        _ => None,
    };
    let within = |(centre, _): &([f64; 2], Colour)| centre.iter().all(|x| (0.0..8.0).contains(x));
    drawn
        .0
        .marks
        .iter()
        .filter_map(sphere)
        .filter(within)
        .collect()
}

#[test]
fn pressures_of_spheres_sum_to_the_trace_of_the_contact_stress() {
    let frame = layer();
    let network = Network::try_from(&frame).unwrap();
    let pressures = pressures(&network);
    assert!((pressures[0] - 12.5 / (4.0 * PI)).abs() < 1e-14);
    let volumes = network.radii.iter().map(|a| 4.0 / 3.0 * PI * a.powi(3));
    let sum: f64 = volumes.zip(&pressures).map(|(volume, p)| volume * p).sum();
    // One third of r f, with r = 1 + 1.5.
    assert!((sum - 2.5 * 12.5 / 3.0).abs() < 1e-12);
}

#[test]
fn spins_are_turns_about_the_vorticity_per_strain() {
    let (from, mut to) = (layer(), layer());
    (to.strain, to.orientations) = (0.75, vec![-0.125, 0.0]);
    assert_eq!(spins(&from, &to), [-0.5, 1.0]);
    let (from, mut to) = (suspension(1.0), suspension(1.0));
    to.strain = 1.0;
    let rotation = [0.3, -0.2, -1.0];
    let turned = |orientation: &[f64; 4]| Bulk::turned(orientation, &rotation.into());
    to.orientations = from.orientations.iter().map(turned).collect();
    for spin in spins(&from, &to) {
        assert!((spin + 2.0).abs() < 1e-12, "{spin}");
    }
    // The same orientation has two quaternions.
    to.orientations = to
        .orientations
        .iter()
        .map(|q| q.map(|part| -part))
        .collect();
    assert!((spins(&from, &to)[1] + 2.0).abs() < 1e-12);
    assert!(spins(&from, &from.clone()).iter().all(|spin| spin.is_nan()));
    let view = SphereView {
        colour: SphereColour::Spin,
        ..SphereView::default()
    };
    let error = of(&layer(), view).err().unwrap().to_string();
    assert!(
        error.contains("colour") && error.contains("only one"),
        "{error}"
    );
}

#[test]
fn lines_are_as_wide_as_forces_are_large_and_reach_from_centre_to_centre() {
    let mut frame = layer();
    frame.centres.push([1.0, 4.0]);
    frame.radii.push(1.0);
    frame.orientations.push(0.0);
    frame.stresslets.push([0.0; 3]);
    let first = frame.contacts[0];
    frame.contacts.push(sd_core::simulation::FrameContact {
        j: 2,
        normal: [0.0, 1.0],
        normal_force: 0.25 * first.normal_force,
        ..first
    });
    let drawn = of(&frame, SphereView::default()).unwrap();
    assert_eq!((drawn.1.spheres, drawn.1.contacts), (3, 2));
    let lines: Vec<([[f64; 2]; 2], f64)> = drawn
        .0
        .marks
        .iter()
        .filter_map(|mark| match mark {
            Mark::Line {
                ends,
                width,
                colour,
                ..
            } if *colour == Colour::INK => Some((*ends, *width)),
            _ => None,
        })
        .collect();
    let width = |end: [f64; 2]| {
        let found = lines.iter().find(|(ends, _)| {
            let apart = |k: usize| (ends[1][k] - end[k]).abs() < 1e-12 && ends[0] == [1.0, 2.0];
            apart(0) && apart(1)
        });
        found.unwrap().1
    };
    // Where the radii divide the lines of centres.
    assert_eq!(width([2.0, 2.0]), WIDEST);
    assert_eq!(width([1.0, 3.0]), 0.25 * WIDEST);
}

#[test]
fn what_is_nearer_hides_what_is_behind_and_slabs_leave_the_rest_out() {
    for (z, last) in [(7.5, [1.0, 2.0]), (0.25, [3.5, 2.0])] {
        let drawn = of(&suspension(z), SphereView::default()).unwrap();
        assert_eq!(spheres(&drawn).last().unwrap().0, last, "{z}");
    }
    let slab = |text: &str| SphereView {
        slab: crate::report::range(text),
        ..SphereView::default()
    };
    let half = of(&suspension(7.5), slab("0..4")).unwrap();
    assert_eq!((half.1.spheres, half.1.contacts), (1, 0));
    assert_eq!(spheres(&half)[0].0, [3.5, 2.0]);
    let refused = |error: Option<ReportError>| error.unwrap().to_string();
    let error = refused(of(&suspension(7.5), slab("2..4")).err());
    assert!(error.contains("z goes from 0 to 8"), "{error}");
    let error = refused(of(&layer(), slab("2..4")).err());
    assert!(error.contains("a layer has no depth"), "{error}");
}

#[test]
fn spheres_at_the_border_are_seen_on_both_sides_of_the_sheared_cell() {
    let mut frame = layer();
    frame.centres = vec![[0.5, 0.25], [4.0, 4.0]];
    let drawn = of(&frame, SphereView::default()).unwrap();
    let shown = |wanted: [f64; 2]| {
        let is_there =
            |mark: &Mark| matches!(mark, Mark::Sphere { centre, .. } if *centre == wanted);
        drawn.0.marks.iter().any(is_there)
    };
    // The image above is shifted by the offset of −2.
    for centre in [[0.5, 0.25], [8.5, 0.25], [6.5, 8.25]] {
        assert!(shown(centre), "{centre:?}");
    }
    assert!(!shown([-1.5, 8.25]) && !shown([0.5, 8.25]));
}

#[test]
fn images_across_the_sheared_faces_have_the_depth_of_the_cross_shear() {
    // The image above is shifted by the offsets, −2 along x and 3 along z.
    let frame = Frame {
        centres: vec![[4.0, 0.25, 2.0], [3.0, 4.0, 6.0]],
        cross_offset: 3.0,
        ..suspension(1.0)
    };
    let shown = |slab: &str| {
        let view = SphereView {
            slab: crate::report::range(slab),
            ..SphereView::default()
        };
        let drawn = of(&frame, view).unwrap();
        let centres = drawn.0.marks.into_iter().filter_map(|mark| match mark {
            Mark::Sphere { centre, .. } => Some(centre),
            _ => None,
        });
        centres.collect::<Vec<_>>()
    };
    assert_eq!(shown("1..3"), [[4.0, 0.25]]);
    assert_eq!(shown("4..7"), [[2.0, 8.25], [3.0, 4.0]]);
}

#[test]
fn clusters_have_colours_of_their_own_and_contacts_are_counted() {
    let mut frame = layer();
    frame.centres.push([1.0, 6.0]);
    frame.radii.push(1.0);
    frame.orientations.push(0.0);
    frame.stresslets.push([0.0; 3]);
    let colours = |colour| {
        let view = SphereView {
            colour,
            ..SphereView::default()
        };
        let drawn = of(&frame, view).unwrap();
        let found: Vec<Colour> = spheres(&drawn)
            .into_iter()
            .map(|(_, colour)| colour)
            .collect();
        let Key::Kinds { kinds, .. } = drawn.0.key else {
            panic!("no kinds");
        };
        (found, kinds)
    };
    let (clusters, kinds) = colours(SphereColour::Cluster);
    assert_eq!(clusters, [CLUSTERS[0], CLUSTERS[0], Colour::WHITE]);
    assert_eq!(
        kinds
            .iter()
            .map(|(_, words)| words.as_str())
            .collect::<Vec<_>>(),
        ["2", "none"]
    );
    let (contacts, kinds) = colours(SphereColour::Contacts);
    assert_eq!(
        contacts,
        [Colour::heat(1.0), Colour::heat(1.0), Colour::heat(0.0)]
    );
    assert_eq!(kinds.len(), 2);
}

#[test]
fn the_nearest_strain_is_drawn_and_one_outside_is_refused() {
    let frames = [0.5, 1.0, 1.5].map(|strain| Frame { strain, ..layer() });
    let frames: Vec<&Frame<Layer>> = frames.iter().collect();
    for (strain, place) in [(None, 2), (Some(0.7), 0), (Some(1.2), 1), (Some(2.0), 2)] {
        assert_eq!(nearest(&frames, strain).unwrap(), place);
    }
    for strain in [-0.1, 2.1, f64::NAN] {
        let error = nearest(&frames, Some(strain)).unwrap_err().to_string();
        assert!(
            error.contains("3 frames are kept, at strains from 0.5000 to 1.500"),
            "{error}"
        );
    }
}
