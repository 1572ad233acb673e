//! One run: what its result is made from.

use super::steady::rise;
use super::{Distribution, Steadiness, mean, ratio};
use sd_core::Params;
use sd_core::model::FlowType;
use sd_core::simulation::Counters;

/// What the result of a run is made from: its samples are added in their order, and not kept.
#[derive(Debug)]
pub(crate) struct RunData<'p> {
    pub(crate) params: &'p Params,
    pub(crate) discard_step: u64,
    pub(crate) steps: u64,
    /// Counters of all steps.
    pub(crate) counters: Counters,
    pub(crate) wall_time_s: f64,
    pub(crate) cpu_time_s: f64,
    pub(crate) resumed: u64,
    pub(crate) finished_at: u64,
    /// Viscosities of the averaged samples, all of them for quartiles and correlations.
    pub(crate) viscosities: Vec<f64>,
    pub(crate) stresslet_viscosities: Vec<f64>,
    pub(super) contacts: u64,
    pub(super) activated: u64,
    pub(super) sticking: u64,
    /// Approach velocities, summed over the contacts of all samples.
    pub(super) approach: f64,
    /// Fraction of the last sample, under an imposed pressure.
    pub(super) final_fraction: Option<f64>,
    /// Layering, and bond orientation, of the averaged samples.
    pub(super) order: [Vec<f64>; 2],
    /// Fractions under an imposed pressure, after the discarded strain.
    pub(super) fractions: Vec<f64>,
    /// Mean square displacements along y and z against strain.
    pub(super) displacements: [Slope; 2],
    /// Means in time of the numbers of results.
    pub(super) means: Vec<Mean>,
    /// Step and strain of the last sample.
    pub(super) last: Option<(u64, f64)>,
    /// Viscosity of the mean rate, where the rate is free.
    pub(super) free_viscosity: Option<f64>,
    pub(super) viscosity: Option<Distribution>,
    pub(super) viscosity_stresslet: Option<Distribution>,
    pub(super) steadiness: Option<Steadiness>,
}

/// A mean in progress.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Mean {
    pub(super) sum: f64,
    pub(super) number: u64,
}

/// Minimum averaged strain of a diffusivity, in which a sphere of a dense suspension passes several
/// others.
const DIFFUSION_STRAIN: f64 = 1.0;
/// Minimum number of samples of one.
const DIFFUSION_SAMPLES: u64 = 10;

/// A line of least squares in progress.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Slope {
    number: u64,
    /// The first abscissa, that all are relative to, and the last.
    ends: [f64; 2],
    /// Sums of x, y, x² and x y.
    sums: [f64; 4],
}

impl Slope {
    pub(super) fn add(&mut self, x: f64, y: f64) {
        if y.is_nan() {
            return;
        }
        if self.number == 0 {
            self.ends[0] = x;
        }
        self.ends[1] = x;
        self.number += 1;
        let x = x - self.ends[0];
        for (sum, value) in self.sums.iter_mut().zip([x, y, x * x, x * y]) {
            *sum += value;
        }
    }

    /// The slope; `None` over too short an interval.
    fn value(&self) -> Option<f64> {
        let [x, y, xx, xy] = self.sums;
        let n = self.number as f64;
        // Strains are multiples of the time step, rounded.
        let is_long = self.ends[1] - self.ends[0] > DIFFUSION_STRAIN * (1.0 - 1e-9);
        (is_long && self.number >= DIFFUSION_SAMPLES).then(|| (n * xy - x * y) / (n * xx - x * x))
    }
}

impl RunData<'_> {
    /// Computes what needs all samples.
    pub(crate) fn finish(&mut self) {
        if self.params.has_free_rate() {
            self.finish_free();
        }
        self.steadiness = Steadiness::of(&self.viscosities);
        self.viscosity = Distribution::of(self.viscosities.clone());
        self.viscosity_stresslet = Distribution::of(self.stresslet_viscosities.clone());
    }

    /// Has viscosities follow from the rates of samples, which vary with the noise about their mean
    /// ṙ:
    ///
    /// ```text
    /// η = σ/(μ ṙ),   η_k = η (2 − rate_k/ṙ)
    /// ```
    /// So the mean of all η_k is η, and those of long parts are their viscosities but for squares
    /// of the deviations.
    fn finish_free(&mut self) {
        let rate = mean(&self.viscosities).unwrap_or(f64::NAN);
        let viscosity = if rate > 0.0 { rate.recip() } else { f64::NAN };
        self.free_viscosity = Some(viscosity);
        for rate in &mut self.viscosities {
            *rate = viscosity * (2.0 - *rate * viscosity);
        }
        for stress in &mut self.stresslet_viscosities {
            *stress *= viscosity;
        }
        self.approach *= viscosity;
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> u64 {
        self.viscosities.len() as u64
    }

    /// Whether it is a suspension, and not a layer.
    pub(super) fn is_suspension(&self) -> bool {
        self.params.volume_fraction.is_some()
    }

    /// The particle pressure P. Traceless stresslets add nothing in a suspension, and in a layer
    /// the half of their zz.
    pub(super) fn pressure(&self) -> Option<f64> {
        let [xx, yy, zz] = ["sigma_xx", "sigma_yy", "sigma_zz"].map(|name| self.mean(name));
        Some(if self.is_suspension() {
            -(xx? + yy? + zz?) / 3.0
        } else {
            -(xx? + yy?) / 2.0
        })
    }

    /// Whether its averages are of a shear, and not of an extension.
    fn is_shear(&self) -> bool {
        let last = self.params.segments.last();
        last.and_then(|one| one.flow).unwrap_or(self.params.flow) == FlowType::Shear
    }

    /// Whether its averages are of a flow in one direction, at a rate or under a stress.
    fn is_steady_flow(&self) -> bool {
        let last = self.params.segments.last();
        !self.params.at_rest && last.is_none_or(|segment| segment.amplitude.is_none())
    }

    /// The pressure on planes across the gradient, over μ times the rate, in a shear in one
    /// direction.
    ///
    /// Stresses of samples have the rate of their instant as unit, and samples are taken at equal
    /// strains. So under an imposed stress, too, this is the mean in time of the pressure over that
    /// of the rate:
    ///
    /// ```text
    /// ∫ P dt/∫ rate dt = ∫ (P/rate) dγ/∫ dγ
    /// ```
    ///
    /// In a flow that is no shear, which has no gradient, the pressure is the particle pressure.
    /// `None` where the stresslets make up more than half of it: they lack the fluid's pressure.
    pub(super) fn steady_pressure_22(&self) -> Option<f64> {
        if !self.is_shear() {
            return self.pressure().filter(|_| self.is_steady_flow());
        }
        let pressure = self.mean("pressure_22").filter(|_| self.is_steady_flow())?;
        let of_fluid = self.mean("sigma_yy_hydrodynamic")?.abs();
        (of_fluid <= 0.5 * pressure.abs()).then_some(pressure)
    }

    /// A mean normal stress over that along the flow, where that is a pressure and not of the
    /// stresslets for the most part.
    pub(super) fn normal_stress_ratio(&self, name: &str) -> Option<f64> {
        let along = self.mean("sigma_xx").filter(|_| self.is_steady_flow())?;
        if self.mean("sigma_xx_hydrodynamic")?.abs() > 0.5 * along.abs() {
            return None;
        }
        ratio(-self.mean(name)?, -along)
    }

    /// A mean stress over the shear stress, in a shear in one direction.
    pub(super) fn over_stress(&self, name: &str) -> Option<f64> {
        let stress = self.mean(name).filter(|_| self.is_steady_flow())?;
        ratio(stress, self.viscosity?.mean)
    }

    /// The diffusivity along y or z, in a²·rate: half the slope of the mean square displacement
    /// since the start of the run, over the averaged samples.
    pub(super) fn diffusivity(&self, axis: usize) -> Option<f64> {
        let unit = self.free_viscosity.unwrap_or(1.0);
        let slope = self.displacements[axis].value();
        slope.map(|slope| 0.5 * slope * unit)
    }

    /// Change of layering or of bond orientation from the first half of the averaged samples to the
    /// second.
    pub(super) fn order_drift(&self, place: usize) -> Option<f64> {
        rise(&self.order[place])
    }

    /// Change of the fraction under an imposed pressure from the first half of the averaged samples
    /// to the second.
    pub(super) fn fraction_drift(&self) -> Option<f64> {
        rise(&self.fractions)
    }

    /// Strain after some steps.
    pub(super) fn strain(&self, steps: u64) -> f64 {
        steps as f64 * self.params.time_step
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::{params, sample};
    use sd_core::Sample;

    #[test]
    fn discarded_samples_do_not_count() {
        let mut samples = vec![(0, sample(0.0)), (4, sample(0.02)), (8, sample(0.04))];
        samples[0].1.viscosity = 1e6;
        let params = params();
        let run = RunData::of(&params, &samples, 4);
        assert_eq!(run.number("samples"), Some(2.0));
        assert!(run.number("viscosity").unwrap() < 100.0);
        assert_eq!(run.contacts, 2 * u64::from(sample(0.0).contacts));
    }

    /// Samples of given viscosities and of normal stresses Σ_xx, Σ_yy, Σ_zz of the contacts.
    fn stressed(all: &[(f64, [f64; 3])]) -> Vec<(u64, Sample)> {
        let one = |(step, (viscosity, [xx, yy, zz])): (usize, &(f64, [f64; 3]))| {
            let mut sample = sample(0.0);
            sample.viscosity = *viscosity;
            sample.stress = sd_core::StressComponents::default();
            sample.stress.n1.normal_contact = xx - yy;
            sample.stress.n2.normal_contact = yy - zz;
            sample.stress.particle_pressure.normal_contact = -(xx + yy + zz) / 3.0;
            (step as u64, sample)
        };
        all.iter().enumerate().map(one).collect()
    }

    fn close(run: &RunData<'_>, name: &str, wanted: f64) {
        let found = run.number(name).unwrap();
        assert!((found - wanted).abs() < 1e-12, "{name}: {found}");
    }

    #[test]
    fn ratios_of_stress_and_rate_are_those_of_means_in_time_also_under_imposed_stress() {
        // σ = 1 in some unit: the rate is 1/η, and equal strains take times that rise with η.
        let all = [
            (4.0, [-3.0, -2.0, -1.0]),
            (8.0, [-9.0, -7.0, -6.0]),
            (30.0, [-60.0, -40.0, -20.0]),
        ];
        let (mut time, mut strain, mut of_stress) = (0.0, 0.0, [0.0; 3]);
        for (viscosity, normal) in all {
            let (rate, dt) = (1.0 / viscosity, viscosity);
            time += dt;
            strain += rate * dt;
            for (sum, stress) in of_stress.iter_mut().zip(normal) {
                *sum += stress * rate * dt;
            }
        }
        let (rate, [xx, yy, zz]) = (strain / time, of_stress.map(|sum| sum / time));
        let params = Params {
            volume_fraction: Some(0.5),
            ..params()
        };
        let run = RunData::of(&params, &stressed(&all), 0);
        close(&run, "viscous_number", rate / -yy);
        close(&run, "macroscopic_friction", 1.0 / -yy);
        close(&run, "normal_viscosity", -yy / rate);
        close(&run, "n1_over_stress", xx - yy);
        close(&run, "n2_over_stress", yy - zz);
        close(&run, "lambda_2", yy / xx);
        close(&run, "lambda_3", zz / xx);
        close(&run, "pressure", -(xx + yy + zz) / (3.0 * rate));
        let n = |name: &str| run.number(name).unwrap();
        close(
            &run,
            "pressure_22",
            n("pressure") + (n("n1") - n("n2")) / 3.0,
        );
    }

    #[test]
    fn an_extension_has_no_gradient_and_its_pressure_is_that_of_the_spheres() {
        let params = Params {
            volume_fraction: Some(0.5),
            flow: FlowType::PlanarExtension,
            ..params()
        };
        let run = RunData::of(&params, &stressed(&[(5.0, [-9.0, -3.0, -6.0])]), 0);
        close(&run, "pressure", 6.0);
        close(&run, "viscous_number", 1.0 / 6.0);
        close(&run, "macroscopic_friction", 5.0 / 6.0);
        close(&run, "normal_viscosity", 6.0);
    }

    #[test]
    fn free_rates_have_the_viscosity_of_their_mean() {
        let params = Params {
            volume_fraction: Some(0.5),
            shear_rate: 0.0,
            shear_stress: Some(2.0),
            peclet: 10.0,
            ..params()
        };
        // One of them against the stress; mean rate and stresses of the spheres add up to it.
        let mut strain = 0.0;
        let all = [(-0.1, 0.7), (0.2, 0.9), (0.5, 0.8)].map(|(rate, shear)| {
            strain += rate * params.time_step;
            let mut sample = sample(strain);
            sample.viscosity = f64::NAN;
            sample.shear_rate = 6.0 * std::f64::consts::PI * 2.0 * rate;
            sample.stress = sd_core::StressComponents::default();
            sample.stress.shear.hydrodynamic = 0.75 * shear;
            sample.stress.shear.normal_contact = 0.25 * shear;
            sample.stress.particle_pressure.normal_contact = 0.4;
            sample
        });
        let samples: Vec<_> = (0..).zip(all).collect();
        let run = RunData::of(&params, &samples, 0);
        close(&run, "viscosity", 5.0);
        close(&run, "viscosity_stresslet", 4.0);
        close(&run, "shear_hydrodynamic", 3.0);
        close(&run, "shear_normal_contact", 1.0);
        close(&run, "particle_pressure", 2.0);
    }

    #[test]
    fn pressure_of_a_layer_is_that_in_its_plane() {
        let params = params();
        let mut samples = stressed(&[(4.0, [-3.0, -2.0, 0.0]), (6.0, [-7.0, -4.0, 0.0])]);
        for (_, sample) in &mut samples {
            // Traceless stresslets, with the zz that their plane leaves.
            sample.stress.n1.hydrodynamic = 0.5;
            sample.stress.n2.hydrodynamic = -1.0;
        }
        let run = RunData::of(&params, &samples, 0);
        let n = |name: &str| run.number(name).unwrap();
        close(&run, "pressure", -0.5 * (n("sigma_xx") + n("sigma_yy")));
        close(&run, "pressure_22", n("pressure") + 0.5 * n("n1"));
        close(&run, "viscous_number", 1.0 / n("pressure_22"));
        // zz is of stresslets alone.
        close(&run, "sigma_zz", n("sigma_zz_hydrodynamic"));
        assert_eq!(run.number("lambda_3"), None);
    }

    #[test]
    fn ratios_to_the_rate_have_no_meaning_in_an_oscillation_or_under_tension() {
        let samples = stressed(&[(4.0, [-3.0, -2.0, -1.0])]);
        let names = [
            "viscous_number",
            "macroscopic_friction",
            "normal_viscosity",
            "lambda_2",
        ];
        let oscillation = Params {
            segments: vec![sd_core::model::Segment {
                amplitude: Some(0.5),
                ..sd_core::model::Segment::default()
            }],
            ..params()
        };
        let steady = params();
        for name in names {
            assert_eq!(
                RunData::of(&oscillation, &samples, 0).number(name),
                None,
                "{name}"
            );
            assert!(RunData::of(&steady, &samples, 0).number(name).is_some());
        }
        let tension = stressed(&[(4.0, [3.0, 2.0, 1.0])]);
        let run = RunData::of(&steady, &tension, 0);
        for name in ["viscous_number", "macroscopic_friction", "lambda_2"] {
            assert_eq!(run.number(name), None, "{name}");
        }
        close(&run, "pressure_22", -2.0);
        // Stresslets alone lack the pressure of the fluid.
        let mut alone = stressed(&[(4.0, [0.0; 3])]);
        alone[0].1.stress.n1.hydrodynamic = 0.9;
        alone[0].1.stress.n2.hydrodynamic = 0.6;
        let run = RunData::of(&steady, &alone, 0);
        for name in names {
            assert_eq!(run.number(name), None, "{name}");
        }
    }

    #[test]
    fn diffusivity_is_half_the_slope_of_displacements_after_the_discarded_strain() {
        use rand::{RngExt as _, SeedableRng as _};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        // Walkers with D = 0.04 along y and 0.01 along z, after a start at five times these.
        let (n, every) = (20_000, 0.05_f64);
        let mut walkers = vec![[0.0_f64; 2]; n];
        let mut samples = Vec::new();
        for step in 0..80_u32 {
            let strain = f64::from(step) * every;
            let squares = |k: usize| walkers.iter().map(|x| x[k] * x[k]).sum::<f64>() / n as f64;
            let mut one = sample(strain);
            one.structure = Some(sd_core::simulation::StructureSample {
                displacement_yy: squares(0),
                displacement_zz: squares(1),
                ..sd_core::simulation::StructureSample::NONE
            });
            samples.push((u64::from(step), one));
            let scale = if strain < 1.0 { 5.0 } else { 1.0 };
            for walker in &mut walkers {
                for (x, d) in walker.iter_mut().zip([0.04, 0.01]) {
                    // A uniform number of variance 2 D dγ.
                    let reach = (6.0 * scale * d * every).sqrt();
                    *x += random.random_range(-reach..reach);
                }
            }
        }
        let params = params();
        let run = RunData::of(&params, &samples, 20);
        // The error of a mean square is √(2/n) of it, 0.56 at the end.
        for (name, wanted) in [("diffusivity_yy", 0.04), ("diffusivity_zz", 0.01)] {
            let found = run.number(name).unwrap();
            assert!((found / wanted - 1.0).abs() < 0.05, "{name}: {found}");
        }
        // Too short, too few samples, and samples of an earlier program.
        let early = &samples[..40];
        assert_eq!(
            RunData::of(&params, early, 20).number("diffusivity_yy"),
            None
        );
        assert!(
            RunData::of(&params, &samples[..41], 20)
                .number("diffusivity_yy")
                .is_some()
        );
        let few: Vec<_> = samples.iter().copied().step_by(7).collect();
        assert_eq!(
            RunData::of(&params, &few, 20).number("diffusivity_yy"),
            None
        );
        for (_, sample) in &mut samples {
            sample.structure = None;
        }
        assert_eq!(
            RunData::of(&params, &samples, 20).number("diffusivity_yy"),
            None
        );
    }

    #[test]
    fn no_contacts_no_fractions() {
        let params = params();
        let run = RunData::of(&params, &[], 0);
        for name in [
            "activated_fraction",
            "contacts_per_sphere",
            "viscosity",
            "n1",
        ] {
            assert_eq!(run.number(name), None, "{name}");
        }
    }
}
