//! Shears a suspension and prints its viscosity:
//! `suspension [spheres] [volume fraction] [law] [strain]`.

use sd_core::{
    Bulk, ContactLaws, ContactScheme, Hydrodynamics, LeadingOrder, NearFields, NormalLaw, Params,
    Simulation, StiffnessUnit, TangentialLaw,
};
use std::error::Error;
use std::io::Write as _;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut next = |usual: &str| arguments.next().unwrap_or_else(|| usual.into());
    let spheres = next("200").parse()?;
    let volume_fraction = next("0.5").parse()?;
    let law = next("springs");
    let strain = next("0.2").parse()?;
    shear(spheres, volume_fraction, &law, strain)?;
    Ok(())
}

/// Shears a suspension up to a strain, printing every tenth step; its last viscosity.
pub(crate) fn shear(
    spheres: usize,
    volume_fraction: f64,
    law: &str,
    strain: f64,
) -> Result<f64, Box<dyn Error>> {
    let springs = ContactLaws {
        stiffness_unit: StiffnessUnit::Flow,
        ..ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.0)
    };
    let rigid = ContactLaws {
        tangential: TangentialLaw::Coulomb,
        ..ContactLaws::PAPER
    };
    let lubrication = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);
    let near = Hydrodynamics::BallMelrose;
    let (contact, hydrodynamics, roughness) = match law {
        "springs" => (ContactScheme::Laws(springs), lubrication, 0.0),
        "hertz" => {
            let hertz = ContactLaws {
                normal: NormalLaw::Hertz,
                ..springs
            };
            (ContactScheme::Laws(hertz), lubrication, 0.0)
        }
        "coulomb" => (ContactScheme::Laws(rigid), near, 0.01),
        "rigid" => (ContactScheme::Rigid, near, 0.01),
        "full" => (
            ContactScheme::Laws(rigid),
            Hydrodynamics::StokesianDynamics,
            0.01,
        ),
        other => return Err(format!("no law {other}").into()),
    };
    let params = Params::builder()
        .spheres(spheres)
        .volume_fraction(volume_fraction)
        .roughness(roughness)
        .friction(0.5)
        .shear_rate(f64::INFINITY)
        .hydrodynamics(hydrodynamics)
        .contact(contact)
        .time_step(0.005)
        .build()?;
    let mut suspension = Simulation::<Bulk>::new(&params, 1, &NearFields::default())?;
    let mut out = std::io::stdout();
    writeln!(
        out,
        "strain viscosity contacts slipping smallest-gap unconverged worst-friction systems"
    )?;
    let mut viscosity = f64::NAN;
    while suspension.strain() < strain {
        let sample = suspension.step()?;
        viscosity = sample.viscosity;
        let counters = suspension.counters();
        if suspension.steps() % 10 == 0 {
            writeln!(
                out,
                "{:.3} {:.4} {} {} {:.5} {}/{} {:.1e} {:.1e}",
                suspension.strain(),
                sample.viscosity,
                sample.contacts,
                sample.slipping,
                sample.minimum_gap,
                counters.unconverged_stages,
                counters.stages,
                counters.worst_friction_error,
                counters.worst_residual,
            )?;
        }
    }
    Ok(viscosity)
}
