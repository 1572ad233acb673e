//! Moves two spheres past each other: the paper's Fig. 8, smooth, rough, and with friction.
//!
//! `cargo run --release -p sd-core --example pair`
#![expect(clippy::print_stdout, reason = "examples print their results")]

use sd_core::pair::{PairScenario, pass};
use sd_core::{Error, NearFields};

/// Four passages: contact permanently separates the paths and suppresses the rotation; friction
/// restores it.
pub(crate) fn main() -> Result<(), Error> {
    let cases = [
        None,
        Some((0.05, 0.0)),
        Some((0.05, 0.1)),
        Some((0.05, 0.5)),
    ];
    for contact in cases {
        let scenario = PairScenario {
            size_ratio: 1.0,
            contact, // roughness h and friction coefficient ν
            offset: 0.25,
            start: 5.0,
            time_step: 0.2,
        };
        let passed = pass(&scenario, &NearFields::default())?;
        println!(
            "{contact:?}: offset 0.25 → {:.3}, smallest gap {:.5}, turned by {:.1}°",
            passed.final_offset, passed.minimum_gap, passed.rotation_degrees[0]
        );
    }
    Ok(())
}
