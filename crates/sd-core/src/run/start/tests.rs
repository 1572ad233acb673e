//! Starts as a whole: what is refused, what is packed, and how.

use super::first_cell::radii;
use super::*;
use crate::model::{ContactScheme, Hydrodynamics, LeadingOrder, Sizes};
use crate::space::cell::Cell;
use crate::space::neighbours::NeighbourList;
use std::f64::consts::PI;

fn params(spheres: usize, area_fraction: f64, size_ratio: f64) -> Params {
    Params {
        spheres,
        area_fraction,
        roughness: 0.01,
        friction: 0.0,
        shear_rate: 0.0,
        size_ratio,
        large_fraction: 0.5,
        hydrodynamics: Hydrodynamics::BallMelrose,
        contact: ContactScheme::Rigid,
        time_step: 0.005,
        ..Params::UNSET
    }
}

/// A suspension of two hundred spheres.
fn suspension_of(volume_fraction: f64, size_ratio: f64, roughness: f64) -> Params {
    Params {
        area_fraction: 0.0,
        volume_fraction: Some(volume_fraction),
        roughness,
        ..params(200, 0.0, size_ratio)
    }
}

/// Smallest gap between any two images, by brute force.
fn smallest_gap<S: Space>(start: &Start<S>, offset: f64) -> f64 {
    let cell = Cell::<S>::equal_sides(start.side, offset).unwrap();
    let mut smallest = f64::INFINITY;
    for (i, x) in start.centres.iter().enumerate() {
        for (j, y) in start.centres.iter().enumerate().skip(i + 1) {
            for image in 0..45 {
                let numbers = [image % 5 - 2, image / 5 % 3 - 1, image / 15 - 1];
                let mut image = S::Image::default();
                for k in 0..S::DIMENSIONS {
                    image[k] = numbers[k];
                }
                let shift = cell.image_vector(image);
                let apart = *y + shift - *x;
                let distance = S::norm_squared(&apart).sqrt();
                smallest = smallest.min(distance - start.radii[i] - start.radii[j]);
            }
        }
    }
    smallest
}

#[test]
fn only_the_procedure_takes_full_matrices_for_many_spheres() {
    let many = |spheres, contact| Params {
        hydrodynamics: Hydrodynamics::StokesianDynamics,
        contact,
        ..params(spheres, 0.7, 1.0)
    };
    assert!(check(&many(10_000, ContactScheme::Rigid)).is_ok());
    assert!(check(&many(2_000, ContactScheme::Procedure)).is_ok());
    let refused = check(&many(2_001, ContactScheme::Procedure)).unwrap_err();
    assert!(refused.to_string().contains("procedure"), "{refused}");
    let refused = check(&many(10_001, ContactScheme::Rigid)).unwrap_err();
    assert!(refused.to_string().contains("at most 10000"), "{refused}");
    let near = Params {
        hydrodynamics: Hydrodynamics::BallMelrose,
        ..many(Params::MAX_SPHERES, ContactScheme::Rigid)
    };
    assert!(check(&near).is_ok());
}

#[test]
fn no_pair_starts_in_contact_up_to_the_densest_layer() {
    for (spheres, c, ratio) in [
        (90, 0.1, 1.0),
        (90, 0.693, 1.0),
        (100, 0.84, 1.0),
        (100, 0.8, 1.4),
    ] {
        let params = params(spheres, c, ratio);
        let start = layer(&params, 1).unwrap();
        assert!(smallest_gap(&start, 0.0) >= params.roughness);
        let area: f64 = start.radii.iter().map(|a| PI * a * a).sum();
        assert!((area / start.side.powi(2) - c).abs() < 1e-12);
        let mean = start.radii.iter().sum::<f64>() / spheres as f64;
        assert!((mean - 1.0).abs() < 1e-12);
    }
}

#[test]
fn large_layers_are_numbered_row_by_row_and_keep_their_sizes() {
    let params = params(Params::LARGE_ABOVE + 1, 0.5, 1.4);
    let start = layer(&params, 1).unwrap();
    let (radii, _) = radii_and_side(&params).unwrap();
    assert_eq!(start.radii, radii);
    assert!(smallest_gap(&start, 0.0) >= params.roughness);
    // Spheres with consecutive numbers are neighbours, except at the ends of rows.
    let next = start.centres.windows(2);
    let far = next.filter(|pair| (pair[1] - pair[0]).norm() > 4.0 * packing::ROW);
    assert!(far.count() < params.spheres / 10);
}

#[test]
fn layer_is_a_function_of_the_seed() {
    let params = params(60, 0.75, 1.4);
    assert_eq!(layer(&params, 7), layer(&params, 7));
    assert_ne!(layer(&params, 7), layer(&params, 8));
}

#[test]
fn unpackable_spheres_are_refused() {
    // Grown by h = 0.4 these discs would cover more than the plane, the spheres as much as the
    // densest lattice; at once, as relaxations of so many spheres take long.
    let discs = Params {
        roughness: 0.4,
        ..params(1000, 0.84, 1.0)
    };
    let spheres = Params {
        spheres: 4000,
        ..suspension_of(0.45, 1.4, 0.4)
    };
    let (discs, spheres) = (layer(&discs, 1), suspension(&spheres, 1));
    for error in [discs.unwrap_err(), spheres.unwrap_err()] {
        let Error::Refused(refusal) = error else {
            panic!("{error}");
        };
        assert_eq!(refusal.because, Some("roughness"), "{refusal:?}");
    }
    // Discs that grow to 0.905 are not refused by their density, but cannot be packed.
    let dense = params(60, 0.84, 1.0);
    let dense = Params {
        roughness: 0.075,
        ..dense
    };
    assert!(matches!(layer(&dense, 1), Err(Error::CannotPack { .. })));
}

#[test]
fn a_size_that_no_sphere_has_is_refused() {
    let with = |large_fraction, spheres| Params {
        large_fraction,
        ..params(spheres, 0.4, 3.0)
    };
    for (large_fraction, size) in [(0.01, "large"), (0.99, "small")] {
        let error = with(large_fraction, 40).validate().unwrap_err();
        let error = error.to_string();
        assert!(
            error.contains(size) && error.contains("about 50"),
            "{error}"
        );
        with(large_fraction, 60).validate().unwrap();
    }
    with(0.0, 40).validate().unwrap();
    let species = [[1.0, 0.5], [1.4, 0.49], [2.0, 0.01]];
    let sizes = Sizes::species(&species, 0).unwrap();
    let of_sizes = |spheres| Params {
        sizes: Some(sizes.clone()),
        ..params(spheres, 0.4, 1.0)
    };
    let error = of_sizes(40).validate().unwrap_err().to_string();
    assert!(error.contains("no sphere of radius 2"), "{error}");
    of_sizes(60).validate().unwrap();
}

#[test]
fn small_cell_is_refused() {
    let too_small = layer(&params(10, 0.84, 1.0), 1);
    assert!(matches!(too_small, Err(Error::CellTooSmall { .. })));
}

#[test]
fn the_least_number_of_spheres_is_by_the_range_that_the_model_needs() {
    let with = |spheres, cutoff| Params {
        spheres,
        hydrodynamics: Hydrodynamics::Lubrication(LeadingOrder {
            cutoff,
            ..LeadingOrder::DEFAULT
        }),
        ..suspension_of(0.5, 1.4, 0.01)
    };
    check(&with(80, 0.5)).unwrap();
    // The range is (2 + ξ) a of the largest spheres, here 1.4/1.2.
    let side = |spheres| radii_and_side(&with(spheres, 0.1)).unwrap().1;
    assert!(side(30) >= 2.0 * 2.1 * 1.4 / 1.2);
    assert!(check(&with(20, 0.5)).is_err());
    let exact = Params {
        hydrodynamics: Hydrodynamics::BallMelrose,
        ..with(80, 0.5)
    };
    let error = check(&exact).unwrap_err().to_string();
    for part in [
        "spheres = 80 at `volume_fraction` = 0.5 and `size_ratio` = 1.4 make a cell",
        "twice the range of pairs under `hydrodynamics` = \"ball-melrose\", which is 4 radii of the largest sphere",
        "at least 90 spheres at this volume fraction",
    ] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn contacts_beyond_the_cutoff_of_lubrication_are_refused() {
    let with = |cutoff| Params {
        hydrodynamics: Hydrodynamics::Lubrication(LeadingOrder {
            cutoff,
            ..LeadingOrder::DEFAULT
        }),
        ..suspension_of(0.4, 1.0, 0.05)
    };
    let Err(Error::Refused(refusal)) = check(&with(0.04)) else {
        panic!("spheres that touch before they are neighbours");
    };
    assert_eq!(refusal.key, "lubrication_cutoff");
    check(&with(0.1)).unwrap();
}

#[test]
fn no_pair_starts_in_contact_up_to_dense_suspensions() {
    for (volume_fraction, size_ratio, roughness) in [
        (0.05, 1.0, 0.01),
        (0.45, 1.0, 0.05),
        (0.60, 1.0, 0.01),
        (0.62, 1.4, 0.01),
    ] {
        let params = suspension_of(volume_fraction, size_ratio, roughness);
        let start = suspension(&params, 1).unwrap();
        let gap = smallest_gap(&start, 0.0);
        assert!(gap >= roughness, "{params:?}: {gap}");
        let radii = &start.radii;
        let volume: f64 = radii.iter().map(|a| 4.0 / 3.0 * PI * a.powi(3)).sum();
        assert!((volume / start.side.powi(3) / volume_fraction - 1.0).abs() < 1e-12);
        assert!((radii.iter().sum::<f64>() / radii.len() as f64 - 1.0).abs() < 1e-12);
        assert_eq!(radii[0] / radii[199], size_ratio);
        let inside = |x: f64| (0.0..start.side).contains(&x);
        assert!(start.centres.iter().flatten().all(|&x| inside(x)));
    }
}

#[test]
fn spheres_are_packed_into_sheared_cells_too() {
    let radii = radii(150, 1.4, 75);
    let volume: f64 = radii.iter().map(|a| 4.0 / 3.0 * PI * a.powi(3)).sum();
    let side = (volume / 0.55).cbrt();
    let cell = Cell::equal_sides(side, 0.37 * side).unwrap();
    let mut packing = Packing::<Bulk>::new(cell, radii, 0.01);
    packing.pack(0.55, &SPHERES, 3).unwrap();
    let start = Start {
        orientations: Vec::new(),
        springs: Vec::new(),
        rolling_springs: Vec::new(),
        radii: packing.radii,
        centres: packing.centres,
        side,
    };
    assert!(smallest_gap::<Bulk>(&start, 0.37 * side) >= 0.01);
    // In another cell the same centres overlap.
    assert!(smallest_gap(&start, 0.0) < 0.0);
}

#[test]
fn neighbours_in_a_suspension_are_near_in_memory() {
    let start = suspension(&suspension_of(0.45, 1.0, 0.01), 2).unwrap();
    let cell = Cell::<Bulk>::equal_sides(start.side, 0.0).unwrap();
    let mut list = NeighbourList::default();
    list.find(&cell, &start.centres, &start.radii, 2.5);
    let distance: usize = list.pairs().iter().map(|pair| pair.j - pair.i).sum();
    let mean = distance as f64 / list.pairs().len() as f64;
    // Numbers at random are a third of 200 apart.
    assert!(mean < 50.0, "{mean}");
}

#[test]
fn suspension_is_a_function_of_the_seed() {
    let params = suspension_of(0.45, 1.0, 0.01);
    assert_eq!(suspension(&params, 7), suspension(&params, 7));
    assert_ne!(suspension(&params, 7), suspension(&params, 8));
}

#[test]
fn suspensions_too_dense_or_too_small_are_refused() {
    let refusal = |params: Params| suspension(&params, 1).unwrap_err();
    let Error::CannotPack { reached, kind, .. } = refusal(suspension_of(0.70, 1.4, 0.01)) else {
        panic!("packed");
    };
    assert!(
        kind == "volume" && reached > 0.5 && reached < 0.70,
        "{reached}"
    );
    let few = Params {
        spheres: 30,
        ..suspension_of(0.5, 1.0, 0.01)
    };
    assert!(matches!(refusal(few), Error::CellTooSmall { .. }));
}
