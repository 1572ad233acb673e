//! Shears a layer under a contact law that is implemented here: asperities that are cones.
//!
//! `cargo run --release -p sd-core --example cone`
#![expect(clippy::print_stdout, reason = "examples print their results")]

use sd_core::law::CustomNormalLaw;
use sd_core::{
    ContactLaws, ContactScheme, Error, Hydrodynamics, Layer, NearFields, Params, Simulation,
    StiffnessUnit, TangentialLaw,
};

/// `F = k d²`; Sneddon, Int. J. Eng. Sci. 3, 47 (1965), of a cone pressed into a half-space.
#[derive(Debug)]
struct Cone;

impl CustomNormalLaw for Cone {
    fn force(&self, overlap: f64, stiffness: f64) -> f64 {
        stiffness * overlap.max(0.0).powi(2)
    }

    fn slope(&self, overlap: f64, stiffness: f64) -> f64 {
        2.0 * stiffness * overlap.max(0.0)
    }

    fn overlap(&self, force: f64, stiffness: f64) -> f64 {
        (force / stiffness).sqrt()
    }
}

/// Half a strain of a small layer; then the force and the overlap of its most loaded contact.
pub(crate) fn main() -> Result<(), Error> {
    let roughness = 0.02;
    let stiffness = 1e8; // k, in mu·rate
    // Tangential law, onset of friction and dashpot are those of any spring.
    let laws = ContactLaws {
        stiffness_unit: StiffnessUnit::Flow,
        ..ContactLaws::linear_spring(stiffness, TangentialLaw::Coulomb, roughness)
    };
    let params = Params::builder()
        .spheres(40)
        .area_fraction(0.65)
        .roughness(roughness)
        .friction(0.5)
        .shear_rate(f64::INFINITY)
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .contact(ContactScheme::Laws(laws))
        .time_step(0.005)
        .build()?;
    let mut layer = Simulation::<Layer>::new(&params, 1, &NearFields::default())?;
    layer.use_normal_law(&Cone)?;
    let mut sum = 0.0;
    for _ in 0..100 {
        sum += layer.step()?.viscosity;
    }
    println!("mean viscosity {:.3}", sum / 100.0);
    let most = layer
        .contacts()
        .max_by(|a, b| a.normal_force.total_cmp(&b.normal_force));
    if let Some(contact) = most {
        let overlap = roughness - contact.gap;
        println!(
            "spheres {} and {}: force {:.2} at an overlap of {overlap:.5}",
            contact.i, contact.j, contact.normal_force
        );
        assert!(overlap > 0.0 && contact.normal_force > 0.0);
    }
    Ok(())
}
