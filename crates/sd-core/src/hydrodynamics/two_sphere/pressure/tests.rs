use super::super::near_contact;
use super::super::two_sphere_resistance;
use super::*;

/// `[X11P, X11Q, X12P, X12Q]` by size ratio and ξ, from another solution: Lamb's multipoles of both
/// spheres, no slip in the mean square at points of their surfaces, and x·σ·n of the flow
/// integrated over sphere 1.
const OF_TRACTION: [(f64, f64, [f64; 4]); 6] = [
    (1.0, 2.0, [0.0491595, 0.0230011, -0.1136099, 0.0868829]),
    (1.0, 0.5, [0.4456843, 0.3589074, -0.5686359, 0.5755160]),
    (2.0, 0.5, [0.3900307, 0.2669469, -0.5327972, 1.3277769]),
    (0.5, 0.2, [1.0087778, 0.9876959, -1.0888345, 0.4613046]),
    (1.0, 0.1, [3.1737612, 3.0432427, -3.3218674, 3.3917028]),
    (3.0, 0.3, [0.6738690, 0.4705586, -0.8275622, 3.2158338]),
];

#[test]
fn moments_are_those_of_the_traction() {
    for (ratio, xi, expected) in OF_TRACTION {
        let [[p_own, p_other], [q_own, q_other]] = pressure_moments(ratio, 2.0 + xi).unwrap();
        for (found, expected) in [p_own, q_own, p_other, q_other].iter().zip(expected) {
            assert!((found - expected).abs() < 6e-8, "{ratio} {xi}: {found}");
        }
    }
    assert!(pressure_moments(1.0, 2.0).is_err() && pressure_moments(0.0, 3.0).is_err());
}

/// The largest difference of entries, over the largest entry or, if larger, 4π a³.
fn difference(found: &PressureEntries, expected: &PressureEntries, [a, b]: [f64; 2]) -> f64 {
    let least = 4.0 * PI * a.max(b).powi(3);
    let largest = expected.iter().fold(least, |most, x| most.max(x.abs()));
    let pairs = found.iter().zip(expected);
    pairs.fold(0.0_f64, |most, (x, y)| most.max((x - y).abs())) / largest
}

/// The entries of spheres of radii a and b, solved with all multipoles.
fn solved([a, b]: [f64; 2], gap: f64) -> PressureEntries {
    let functions = series::pressure_moments(b / a, 2.0 * gap / (a + b), 1.0);
    let exact = entries(&functions, [1.0, b / a]);
    let far = far_entries([1.0, b / a], 1.0 + b / a + gap / a);
    std::array::from_fn(|k| (exact[k] - far[k]) * a.powi(if k % 2 == 0 { 2 } else { 3 }))
}

#[test]
fn tables_meet_solutions() {
    for (ratio, least) in [(1.0, 2e-3_f64), (1.4, 3e-3), (4.0, 1e-2)] {
        let table = PressureTable::new(ratio);
        for step in 0..30 {
            let gap = least * (50.0 / least).powf(f64::from(step) / 29.0);
            for [a, b] in [[1.0, ratio], [0.7 * ratio, 0.7]] {
                let gap = gap * a.min(b);
                let found = table.evaluate(a, b, gap);
                let expected = solved([a, b], gap);
                let error = difference(&found, &expected, [a, b]);
                assert!(error < 5e-7, "{ratio} {a} {gap}: {error:.1e}");
            }
        }
        assert_eq!(table.evaluate(1.0, ratio, 61.0), [0.0; 8]);
    }
}

#[test]
fn range_meets_solutions() {
    let range = PressureRange::new(3.7).unwrap();
    for (k, ratio) in [1.0, 1.07, 1.9, 2.6, 3.9].into_iter().enumerate() {
        for gap in [4e-3, 0.03, 0.3, 2.0] {
            let radii = if k % 2 == 0 {
                [1.0, ratio]
            } else {
                [ratio, 1.0]
            };
            let found = range.evaluate(radii[0], radii[1], gap);
            let error = difference(&found, &solved(radii, gap), radii);
            assert!(error < 1e-6, "{radii:?} {gap}: {error:.1e}");
        }
    }
}

#[test]
fn near_contact_the_moment_is_the_force_times_the_radius() {
    for radii in [[1.0, 1.0], [1.0, 1.4], [2.0, 0.5]] {
        let mean = 0.5 * (radii[0] + radii[1]);
        // 1/ξ of both from the same coefficient.
        let (moment, force) = (
            singular(radii[1] / radii[0])[0][0],
            near_contact::singular(radii[1] / radii[0])[0].x_a[0],
        );
        assert!((4.0 * moment / (6.0 * force) - 1.0).abs() < 1e-14);
        // The rest of the force is of the order of ln(1/ξ), a millionth of it.
        let xi = 1e-8;
        let ratio = radii[0].max(radii[1]) / radii[0].min(radii[1]);
        let found = PressureTable::new(ratio).evaluate(radii[0], radii[1], mean * xi);
        let resistance = two_sphere_resistance(radii[0], radii[1], mean * (2.0 + xi)).unwrap();
        let [approach, force_j] = [resistance[(0, 0)], resistance[(6, 0)]];
        let expected = [radii[0] * approach, -radii[1] * force_j];
        for (found, expected) in [found[0], found[4]].iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
        }
        // Of leading-order lubrication it is that at any gap.
        let numbers = LeadingOrder::DEFAULT;
        let pair = super::super::LeadingOrderPair::new(radii, numbers);
        for gap in [-0.01, 0.0, 0.1] {
            let of_pair = pair.evaluate(gap).matrix();
            let found = leading_order_pressure(radii, &numbers, gap);
            for (k, mode) in [0, 6].into_iter().enumerate() {
                let forces = [of_pair[(0, mode)], -of_pair[(6, mode)]];
                for sphere in 0..2 {
                    let moment = found[4 * sphere + 2 * k];
                    let expected = radii[sphere] * forces[sphere];
                    assert!((moment / expected - 1.0).abs() < 1e-12);
                }
            }
        }
        assert_eq!(
            leading_order_pressure(radii, &numbers, 0.51 * mean),
            [0.0; 8]
        );
    }
}

#[test]
fn a_pair_that_moves_as_one_has_no_lubrication_pressure() {
    for radii in [[1.0, 1.0], [1.0, 2.0], [1.4, 1.0]] {
        let [a, b] = radii;
        let both = [singular(b / a), singular(a / b)];
        let [inverse, logarithm] = [0, 1].map(|k| entries(&both.map(|of| of[k]), radii));
        for row in inverse.chunks_exact(4).chain(logarithm.chunks_exact(4)) {
            assert!((row[0] + row[2]).abs() < 1e-12, "{row:?}");
        }
        // Carried along by a strain, so that the surfaces do not approach: U_i + a E = U_j − b E.
        for row in inverse.chunks_exact(4) {
            let moment = -row[0] * (a + b) + row[1] + row[3];
            assert!(moment.abs() < 1e-12, "{row:?}");
        }
    }
}
