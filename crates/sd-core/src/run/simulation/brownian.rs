//! Brownian motion of a run: random forces, drawn once a step, and their stress.
//!
//! ```text
//! ⟨F F⟩ = 2 kT R_FU/Δt at the step's start, kT = 6π/Pe;   F stays over the step
//! ```
//! A method in time of order two or more, applied to these velocities, has the drift `kT ∇·R_FU⁻¹`
//! of Brownian motion in it: of the second stage, at positions that F has moved to (Fixman, J.
//! Chem. Phys. 69, 1527, 1978; Grassia, Hinch & Nitsche, J. Fluid Mech. 282, 373, 1995). The
//! stress `−kT ∇·(R_SU R_FU⁻¹)` follows likewise from the stresslets of the motion under F alone
//! at both stages. Their difference is taken, as those of the first have mean zero: its variance
//! stays finite as Δt → 0.
//!
//! Under an imposed stress σ the strain γ is one more coordinate, and the random stress σ_B one
//! more random force, with the covariance of the resistance R of all of them:
//!
//! ```text
//! ⟨(F, V σ_B) (F, V σ_B)⟩ = 2 kT R/Δt;   η(x, rate) rate = σ + σ_B at each stage
//! ```
//! So γ diffuses by kT/(η V), and its drift follows from the second stage like that of positions.
//!
//! Rigid contacts reflect: see `contact_solver::candidates`.

use super::Sample;
use crate::error::Error;
use crate::hydrodynamics::resistance::Fluid;
use crate::run::steppers::Stage;
use crate::stage::StageSolver;
use crate::stress::{Stress, weights};
use rand::{RngExt as _, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// Random numbers of the noise are another stream than those of the start.
const STREAM: u64 = 2;

/// The random forces of a run.
#[derive(Debug)]
pub(super) struct Brownian {
    seed: u64,
    /// kT of the step, in mu·a³·rate.
    thermal_energy: f64,
    /// The step that forces were last drawn for.
    drawn: Option<u64>,
    /// Start and length of the step.
    step: [f64; 2],
    /// Random stress on a flow whose rate is free, in mu·rate.
    pub(super) stress: f64,
    /// Sums of the stresslets under random forces alone, at the first stage of the step and at its
    /// second.
    stresses: [[f64; 6]; 2],
    /// Whether the next stage is the second of the step or of its first part.
    awaits_second: bool,
    /// Time from the start of the step to that stage.
    ahead: f64,
}

impl Brownian {
    pub(super) fn new(seed: u64) -> Self {
        Self {
            seed,
            thermal_energy: 0.0,
            drawn: None,
            step: [0.0; 2],
            stress: 0.0,
            stresses: [[0.0; 6]; 2],
            awaits_second: false,
            ahead: 1.0,
        }
    }

    pub(super) fn seed(&self) -> u64 {
        self.seed
    }

    /// Draws the forces of a step from its start to start + length, at positions just assembled;
    /// nothing if they were drawn. `free`: rates of strain of a flow whose rate is free, and the
    /// volume.
    ///
    /// # Errors
    /// [`Error::NotConverged`].
    pub(super) fn draw<S: Fluid>(
        &mut self,
        number: u64,
        span: [f64; 2],
        thermal_energy: f64,
        free: Option<(S::Strain, f64)>,
        solver: &mut StageSolver<S>,
    ) -> Result<(), Error> {
        if self.drawn == Some(number) {
            return Ok(());
        }
        self.step = span;
        self.thermal_energy = thermal_energy;
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        // Every step has numbers of its own, so that a run continues from its seed and step.
        random.set_stream(STREAM);
        random.set_word_pos(u128::from(number) << 32);
        let mut normals = Normals {
            random,
            spare: None,
        };
        let scale = (2.0 * self.thermal_energy / span[1]).sqrt();
        let flow = free.as_ref().map(|(strain, _)| strain);
        let drawn = solver.draw_random_forces(scale, || normals.next(), flow)?;
        if let Some((_, volume)) = free {
            // The fluid itself resists the flow by mu in the whole volume.
            let rest = (drawn.rest + volume).max(0.0).sqrt();
            self.stress = (drawn.force + scale * rest * normals.next()) / volume;
        }
        self.drawn = Some(number);
        Ok(())
    }

    /// Records the stress of the motion under random forces alone at a solved stage.
    pub(super) fn record(&mut self, stage: &Stage, stress: impl FnOnce() -> [f64; 6]) {
        let [start, _] = self.step;
        if stage.number == 0 && stage.time == start {
            self.stresses = [stress(); 2];
            self.awaits_second = true;
        } else if std::mem::take(&mut self.awaits_second) && stage.number == 1 {
            self.stresses[1] = stress();
            self.ahead = stage.time - start;
        }
    }

    /// Takes the stress of the motion under random forces alone, at one of the recorded stages, out
    /// of the hydrodynamic stress: its mean is the Brownian stress. `strain`: the rate of strain of
    /// the flow.
    pub(super) fn take_out(&self, stage: &Stage, stress: &mut Stress, strain: [f64; 6]) {
        let of_stage = self.stresses[stage.number.min(1)].map(|x| -x / stress.volume);
        let with_it = stress.components.shear.hydrodynamic;
        let components = &mut stress.components;
        components.add(of_stage, &weights(strain), |parts| &mut parts.hydrodynamic);
        // They are not numbers in fluid at rest.
        let share = components.shear.hydrodynamic - with_it;
        stress.viscosity += share;
        stress.viscosity_stresslet += share;
    }

    /// Adds the Brownian stress of the step to its sample. `strain`: the rate of strain of the
    /// flow; `dimensions`: those in which spheres move.
    pub(super) fn finish(
        &self,
        sample: &mut Sample,
        [spheres, volume]: [f64; 2],
        strain: [f64; 6],
        dimensions: usize,
    ) {
        // The mean difference grows with the time `ahead` between the stages; after half a step it
        // is the Brownian stress.
        let share = 0.5 * self.step[1] / (self.ahead * volume);
        let [first, second] = self.stresses;
        let mut stress = [0.0; 6];
        for k in 0..6 {
            stress[k] = share * (second[k] - first[k]);
            if k < dimensions {
                stress[k] -= spheres * self.thermal_energy / volume;
            }
        }
        sample
            .stress
            .add(stress, &weights(strain), |parts| &mut parts.brownian);
        sample.normal_stress_difference = sample.stress.n1.total();
        sample.viscosity += sample.stress.shear.brownian;
    }
}

/// Independent numbers of a normal distribution with mean 0 and variance 1, in pairs (Box & Muller
/// 1958).
struct Normals {
    random: ChaCha8Rng,
    spare: Option<f64>,
}

impl Normals {
    fn next(&mut self) -> f64 {
        if let Some(number) = self.spare.take() {
            return number;
        }
        // In (0, 1].
        let share = 1.0 - self.random.random::<f64>();
        let radius = (-2.0 * libm::log(share)).sqrt();
        let (sine, cosine) = libm::sincos(TAU * self.random.random::<f64>());
        self.spare = Some(radius * sine);
        radius * cosine
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_moments_of_a_normal_distribution() {
        let mut normals = Normals {
            random: ChaCha8Rng::seed_from_u64(1),
            spare: None,
        };
        let count = 400_000;
        let mut moments = [0.0; 4];
        for _ in 0..count {
            let z = normals.next();
            for (k, moment) in (1..).zip(&mut moments) {
                *moment += z.powi(k) / f64::from(count);
            }
        }
        for (moment, expected) in moments.iter().zip([0.0, 1.0, 0.0, 3.0]) {
            assert!((moment - expected).abs() < 0.03, "{moments:?}");
        }
    }
}
