//! Times in a²/D0.

use super::{GOOD, parse_text};

/// Brownian spheres whose times are in a²/D0, at a Péclet number.
fn thermal(peclet: &str) -> String {
    GOOD.replace(
        "[protocol]",
        "[protocol]\ntime_unit = \"diffusion\"\nsample_every = 0.1",
    )
    .replace("[0.0, 0.3]", "0.0")
    .replace("[0, 0.1, inf]", "0")
    .replace(
        "spheres = 90",
        &format!("spheres = 90\npeclet = {peclet}\ntime_step = 1e-4"),
    )
}

#[test]
fn times_in_units_of_diffusion_are_strains_of_the_peclet_number() {
    let campaign = parse_text(&thermal("0.5")).unwrap();
    let (_, case) = &campaign.cases[0];
    let close = |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-12);
    close(campaign.protocol.strain, 0.5);
    close(campaign.protocol.discard, 0.25);
    close(campaign.protocol.sample_every, 0.05);
    close(case.params.time_step, 0.5e-4);
    assert!(!case.params.at_rest);
}

#[test]
fn a_peclet_number_of_zero_is_fluid_at_rest() {
    let campaign = parse_text(&thermal("0")).unwrap();
    let params = &campaign.cases[0].1.params;
    assert!(params.at_rest && params.peclet == 0.0);
    assert_eq!(params.thermal_energy(), Some(6.0 * std::f64::consts::PI));
    assert_eq!(campaign.protocol.strain, 1.0);
    assert_eq!(params.time_step, 1e-4);
}

#[test]
fn no_precision_of_a_shear_stress_is_requested_of_fluid_at_rest() {
    let precise = |quantity: &str| {
        let seeds = format!("seeds = {{ precision = 0.1{quantity} }}");
        parse_text(&thermal("0").replace("seeds = 4", &seeds))
    };
    for quantity in ["", ", quantity = \"normal_stress_difference\""] {
        let refused = precise(quantity).unwrap_err().to_string();
        assert!(refused.contains("is 0 but for noise"), "{refused}");
    }
    precise(", quantity = \"pressure\"").unwrap();
}
