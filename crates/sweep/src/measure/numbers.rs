//! The numbers that a run measures, each declared once: its name, its unit, what it means and how
//! it comes about in a sample, in the result of a run, and at a point.
//!
//! The tables of the store, averages, the columns of reports in all formats, units, the page of the
//! reference and the Python package follow this table: see `docs/add-a-measured-number.md`.

use super::run::RunData;
use super::runs::Runs;
use super::{Trend, mean, ratio};
use crate::data::{Kind, Value};
use crate::model::case::State;
use sd_core::simulation::{Counters, NetworkSample, StructureSample};
use sd_core::{Sample, StressComponents};
use std::collections::HashMap;
use std::sync::LazyLock;

/// A number by its name. It may exist in samples, in the results of runs, and at points.
#[derive(Debug, Clone, Copy)]
pub struct Number {
    /// Its name in the store, in tables and in JSON.
    pub name: &'static str,
    /// Its unit; `1` for pure numbers.
    pub unit: &'static str,
    /// Its label in figures; empty for numbers that the page does not offer.
    pub(crate) label: &'static str,
    sample: Option<(&'static str, InSample)>,
    run: Option<(&'static str, InTime)>,
    point: Option<(&'static str, OverRuns)>,
}

/// Its place in a sample.
#[derive(Debug, Clone, Copy)]
enum InSample {
    Real(fn(&mut Sample) -> &mut f64),
    Count(fn(&mut Sample) -> &mut u32),
    /// An extreme over all steps of the run so far.
    Extreme(fn(&mut Counters) -> &mut f64),
    /// A count over all steps of the run so far.
    Total(fn(&mut Counters) -> &mut u64),
    /// A component of the stress, the sum of its stored parts.
    Sum(fn(&StressComponents) -> f64),
    /// A part of a component of the stress.
    Part(fn(&mut StressComponents) -> &mut f64),
    /// A number of the contact network, which samples have only if it is observed.
    Network(fn(&mut NetworkSample) -> &mut f64),
    /// A number that not all samples have.
    Free(fn(&mut Sample) -> &mut Option<f64>),
    /// A number of the spheres, which samples of earlier programs lack.
    Structure(fn(&mut StructureSample) -> &mut f64),
}

/// How the result of a run has it.
#[derive(Debug, Clone, Copy)]
enum InTime {
    /// The mean over the averaged samples that have it.
    Mean,
    Real(fn(&RunData<'_>) -> Option<f64>),
    Count(fn(&RunData<'_>) -> u64),
}

/// How a point has it.
#[derive(Debug, Clone, Copy)]
pub(crate) enum OverRuns {
    /// The mean over the averaged runs; half the width of its 95 % interval is `NAME_ci95`.
    Mean,
    /// Computed from all runs.
    Real(fn(&Runs<'_>) -> Option<f64>),
    /// Counted over all runs.
    Count(fn(&Runs<'_>) -> u64),
}

const fn number(name: &'static str, unit: &'static str) -> Number {
    Number {
        name,
        unit,
        label: "",
        sample: None,
        run: None,
        point: None,
    }
}

impl Number {
    const fn sample(self, meaning: &'static str, place: InSample) -> Self {
        Self {
            sample: Some((meaning, place)),
            ..self
        }
    }

    const fn run(self, meaning: &'static str, how: InTime) -> Self {
        Self {
            run: Some((meaning, how)),
            ..self
        }
    }

    const fn point(self, meaning: &'static str, how: OverRuns) -> Self {
        Self {
            point: Some((meaning, how)),
            ..self
        }
    }

    /// Of a run, and its mean over runs.
    const fn with_its_mean(self) -> Self {
        match self.run {
            Some((meaning, _)) => self.point(meaning, OverRuns::Mean),
            None => self,
        }
    }

    /// Averaged in time, and over runs; offered by the page.
    const fn averaged(self) -> Self {
        let meaning = match self.sample {
            Some((meaning, _)) => meaning,
            None => "",
        };
        Self {
            label: meaning,
            ..self.run(meaning, InTime::Mean).with_its_mean()
        }
    }

    const fn label(self, label: &'static str) -> Self {
        Self { label, ..self }
    }
}

/// All numbers, in the order of the columns. Names and units stay as they are: stores have them.
#[rustfmt::skip]
#[expect(clippy::redundant_closure_for_method_calls, reason = "a method is one of runs of one lifetime")]
pub static NUMBERS: &[Number] = {
    use InSample::{Count, Extreme, Free, Network, Part, Real, Structure, Sum, Total};
    use InTime::{Count as CountOf, Mean, Real as Of};
    use OverRuns::{Count as CountOver, Mean as MeanOver, Real as Over};
    &[
        number("seeds", "1").point("runs averaged", CountOver(|r| r.averaged.len() as u64)),
        number("jammed", "1").point("runs that ended jammed: not averaged", CountOver(|r| r.number_of(|run| run.state == State::Jammed))),
        number("failed", "1").point("runs that failed: not averaged", CountOver(|r| r.number_of(|run| run.state == State::Failed))),
        number("doubtful", "1").point("finished runs with doubtful numbers: averaged only on request", CountOver(|r| r.number_of(|run| run.is_doubtful()))),
        number("strain", "1").sample("strain from the start of the run", Real(|s| &mut s.strain)),
        number("discard_step", "1").run("first step whose sample is averaged", CountOf(|r| r.discard_step)),
        number("samples", "1").run("samples averaged", CountOf(|r| r.samples())),
        number("viscosity", "mu").label("relative viscosity η")
            .sample("viscosity in full: stresslets and contact stress", Real(|s| &mut s.viscosity))
            .run("mean in time of the viscosity in full", Of(|r| Some(r.viscosity?.mean)))
            .point("viscosity in full, mean over runs of their means in time", MeanOver),
        number("viscosity_quartile_1", "mu").run("first quartile in time of the viscosity", Of(|r| Some(r.viscosity?.quartile_1))),
        number("viscosity_median", "mu").label("median viscosity")
            .run("median in time of the viscosity", Of(|r| Some(r.viscosity?.median)))
            .point("median over runs of their medians in time", Over(|r| Some(r.medians()?.median))),
        number("viscosity_quartile_3", "mu").run("third quartile in time of the viscosity", Of(|r| Some(r.viscosity?.quartile_3))),
        number("viscosity_median_quartile_1", "mu").point("first quartile over runs of their medians in time", Over(|r| Some(r.quartiles()?.quartile_1))),
        number("viscosity_median_quartile_3", "mu").point("third quartile over runs of their medians in time", Over(|r| Some(r.quartiles()?.quartile_3))),
        number("viscosity_stresslet", "mu").label("stresslet viscosity")
            .sample("viscosity without contact stress", Real(|s| &mut s.viscosity_stresslet))
            .run("mean in time of the viscosity without contact stress", Of(|r| Some(r.viscosity_stresslet?.mean)))
            .point("viscosity without contact stress", MeanOver),
        number("viscosity_stresslet_quartile_1", "mu").run("its first quartile in time", Of(|r| Some(r.viscosity_stresslet?.quartile_1))),
        number("viscosity_stresslet_median", "mu").run("its median in time", Of(|r| Some(r.viscosity_stresslet?.median))),
        number("viscosity_stresslet_quartile_3", "mu").run("its third quartile in time", Of(|r| Some(r.viscosity_stresslet?.quartile_3))),
        number("normal_stress_difference", "mu rate")
            .sample("first normal stress difference, contacts included", Real(|s| &mut s.normal_stress_difference)).averaged()
            .label("stress difference N₁"),
        number("shear_rate", "1").sample("shear rate Γ: imposed, or what the imposed stress leaves", Real(|s| &mut s.shear_rate)),
        number("dissipation", "mu rate")
            .sample("dissipation over area and rate", Real(|s| &mut s.dissipation))
            .run("dissipation over area and rate, mean in time", Mean),
        number("contacts_per_sphere", "1").label("contacts per sphere")
            .run("pairs with a contact force over spheres, mean in time", Of(|r| ratio(r.contacts as f64, (r.samples() * r.params.spheres as u64) as f64)))
            .point("pairs with a contact force over spheres", Over(|r| ratio(r.sum("contacts"), r.total(|run| run.number("samples").map(|n| n * run.params.spheres as f64))))),
        number("activated_fraction", "1").label("activated fraction")
            .run("contacts above the critical load over contacts", Of(|r| ratio(r.activated as f64, r.contacts as f64)))
            .point("contacts above the critical load over contacts", Over(|r| ratio(r.sum("activated"), r.sum("contacts")))),
        number("rolling_fraction", "1").label("rolling fraction")
            .run("rolling contacts over activated ones", Of(|r| ratio(r.sticking as f64, r.activated as f64)))
            .point("rolling contacts over activated ones", Over(|r| ratio(r.sum("rolling"), r.sum("activated")))),
        number("contacts", "1").sample("pairs with a contact force", Count(|s| &mut s.contacts)).run("contacts, summed over the samples", CountOf(|r| r.contacts)),
        number("activated", "1").sample("contacts above the critical load", Count(|s| &mut s.activated)).run("contacts above the critical load, summed over the samples", CountOf(|r| r.activated)),
        number("rolling", "1").sample("activated contacts that roll", Count(|s| &mut s.sticking)).run("rolling contacts, summed over the samples", CountOf(|r| r.sticking)),
        number("slipping", "1").sample("activated contacts that slip", Count(|s| &mut s.slipping)),
        number("minimum_gap", "a").label("smallest gap")
            .sample("smallest gap", Real(|s| &mut s.minimum_gap))
            .run("smallest gap of all stages, the discarded strain included", Of(|r| Some(r.counters.minimum_gap)))
            .point("smallest gap of any run", Over(|r| r.gap())),
        number("overlap", "a").label("largest overlap")
            .point("largest overlap of rough surfaces in any run: roughness height less smallest gap", Over(|r| Some((r.all[0].params.roughness - r.gap()?).max(0.0)))),
        number("normal_velocity", "a rate").sample("mean normal velocity of the contacts, negative for approach", Real(|s| &mut s.normal_velocity)),
        number("approach", "a rate").run("approach velocities, summed over contacts and samples", Of(|r| Some(r.approach))),
        number("mean_approach_velocity", "a rate").label("mean approach velocity")
            .run("over all contacts of all samples, positive for approach", Of(|r| ratio(r.approach, r.contacts as f64)))
            .point("over all contacts, positive for approach", Over(|r| ratio(r.sum("approach"), r.sum("contacts")))),
        number("stages", "1").sample("contact problems solved", Total(|c| &mut c.stages)).run("contact problems solved", CountOf(|r| r.counters.stages)),
        number("worst_residual", "a rate")
            .sample("largest residual of the contact problem", Extreme(|c| &mut c.worst_residual))
            .run("largest residual of the contact problem", Of(|r| Some(r.counters.worst_residual)))
            .point("of the contact problem, over all runs", Over(|r| r.values("worst_residual").into_iter().reduce(f64::max))),
        number("unconverged_stages", "1")
            .sample("contact problems that did not converge", Total(|c| &mut c.unconverged_stages))
            .run("contact problems that did not converge", CountOf(|r| r.counters.unconverged_stages)),
        number("unconverged_fraction", "1").point("contact problems that did not converge over all", Over(|r| ratio(r.sum("unconverged_stages"), r.sum("stages")))),
        number("inexact_stages", "1")
            .sample("contact problems with friction off by more than 1e-3 of the largest force", Total(|c| &mut c.inexact_stages))
            .run("contact problems with friction off by more than 1e-3 of the largest force", CountOf(|r| r.counters.inexact_stages)),
        number("inexact_fraction", "1").point("contact problems with friction off by more than 1e-3 of the largest force over all", Over(|r| ratio(r.sum("inexact_stages"), r.sum("stages")))),
        number("jammed_stages", "1")
            .sample("contact problems without an admissible motion", Total(|c| &mut c.jammed_stages))
            .run("contact problems without an admissible motion", CountOf(|r| r.counters.jammed_stages))
            .point("contact problems without an admissible motion, over all runs averaged", CountOver(|r| crate::text::format::count(r.sum("jammed_stages")) as u64)),
        number("worst_friction_error", "1")
            .sample("largest inconsistency of a friction force with its law, over the largest force", Extreme(|c| &mut c.worst_friction_error))
            .run("largest inconsistency of a friction force with its law, over the largest force", Of(|r| Some(r.counters.worst_friction_error))),
        number("minimum_gap_so_far", "a").sample("smallest gap of the run so far", Extreme(|c| &mut c.minimum_gap)),
        number("jam_events", "1")
            .sample("times the viscosity rose above the threshold of jamming", Total(|c| &mut c.jam_events))
            .run("times the viscosity rose above the threshold of jamming", CountOf(|r| r.counters.jam_events)),
        number("jammed_steps", "1").sample("steps begun above that threshold", Total(|c| &mut c.jammed_steps)),
        number("jammed_steps_running", "1").sample("steps since it was last below", Total(|c| &mut c.jammed_steps_running)),
        number("jammed_strain", "1").run("strain above the threshold of jamming", Of(|r| Some(r.strain(r.counters.jammed_steps)))),
        number("final_strain", "1").run("strain at its end", Of(|r| Some(r.strain(r.steps)))),
        number("wall_time_s", "s").run("wall time of computing", Of(|r| Some(r.wall_time_s))).point("mean wall time of a run", Over(|r| mean(&r.values("wall_time_s")))),
        number("cpu_time_s", "s").run("CPU time", Of(|r| Some(r.cpu_time_s))).point("mean CPU time of a run", Over(|r| mean(&r.values("cpu_time_s")))),
        number("resumed", "1").run("times it was resumed from a checkpoint", CountOf(|r| r.resumed)),
        number("finished_at", "ms").run("when it ended, since 1970", CountOf(|r| r.finished_at)),
        number("seeds_wanted", "1").point("seeds requested so far; where a precision is requested, those of the batches begun", CountOver(|r| r.wanted())),
        number("precision", "1").point("half width of the 95 % interval over the mean, of the requested quantity or the viscosity", Over(|r| r.precision())),
        number("discard", "1").point("strain discarded at the start of every run", Over(|r| r.of_each(|run| run.discard()).into_iter().reduce(f64::max))),
        number("drift", "1").point("(mean of second half − mean of first half) / mean of the viscosity, after the discarded strain", Over(|r| Some(r.drift()?.halves.mean))),
        number("drift_ci95", "1").point("half width of its 95 % interval over runs", Over(|r| r.drift()?.halves.ci95)),
        number("viscosity_part_1", "mu").run("mean viscosity over the first quarter of the strain kept", Of(|r| Some(r.steadiness?.parts[0]))),
        number("viscosity_part_2", "mu").run("the same over the second quarter", Of(|r| Some(r.steadiness?.parts[1]))),
        number("viscosity_part_3", "mu").run("the same over the third quarter", Of(|r| Some(r.steadiness?.parts[2]))),
        number("viscosity_part_4", "mu").run("the same over the last quarter", Of(|r| Some(r.steadiness?.parts[3]))),
        number("viscosity_variance", "mu²").run("variance in time of the viscosity", Of(|r| Some(r.steadiness?.variance))),
        number("viscosity_correlation", "1").run("samples after which the viscosity counts as independent", Of(|r| Some(r.steadiness?.correlation))),
        number("correlation_strain", "1").point("strain after which the viscosity of a run counts as independent", Over(|r| mean(&r.of_each(|run| Some(run.steadiness()?.correlation * run.sample_every))))),
        number("effective_samples", "1").point("effective number of independent samples, all runs", Over(|r| r.of_each(|run| Some(run.number("samples")? / run.steadiness()?.correlation)).into_iter().reduce(|a, b| a + b))),
        number("n1", "mu rate").sample("first normal stress difference N₁, contacts included", Sum(|s| s.n1.total())).averaged(),
        number("n2", "mu rate").sample("second normal stress difference N₂, contacts included", Sum(|s| s.n2.total())).averaged().label("stress difference N₂"),
        number("particle_pressure", "mu rate").sample("particle pressure Π of contacts, repulsion and attraction, without `pressure_hydrodynamic`", Sum(|s| s.particle_pressure.total())).averaged().label("particle pressure Π"),
        number("shear_hydrodynamic", "mu rate").sample("shear stress of the stresslets", Part(|s| &mut s.shear.hydrodynamic)).averaged(),
        number("shear_normal_contact", "mu rate").sample("shear stress of the normal contact forces", Part(|s| &mut s.shear.normal_contact)).averaged(),
        number("shear_tangential_contact", "mu rate").sample("shear stress of the tangential contact forces", Part(|s| &mut s.shear.tangential_contact)).averaged(),
        number("shear_repulsion", "mu rate").sample("shear stress of repulsion and van der Waals attraction", Part(|s| &mut s.shear.repulsion)).averaged(),
        number("shear_brownian", "mu rate").sample("shear stress of Brownian motion", Part(|s| &mut s.shear.brownian)).averaged(),
        number("n1_hydrodynamic", "mu rate").sample("N₁ of the stresslets", Part(|s| &mut s.n1.hydrodynamic)).averaged(),
        number("n1_normal_contact", "mu rate").sample("N₁ of the normal contact forces", Part(|s| &mut s.n1.normal_contact)).averaged(),
        number("n1_tangential_contact", "mu rate").sample("N₁ of the tangential contact forces", Part(|s| &mut s.n1.tangential_contact)).averaged(),
        number("n1_repulsion", "mu rate").sample("N₁ of repulsion and van der Waals attraction", Part(|s| &mut s.n1.repulsion)).averaged(),
        number("n1_brownian", "mu rate").sample("N₁ of Brownian motion", Part(|s| &mut s.n1.brownian)).averaged(),
        number("n2_hydrodynamic", "mu rate").sample("N₂ of the stresslets", Part(|s| &mut s.n2.hydrodynamic)).averaged(),
        number("n2_normal_contact", "mu rate").sample("N₂ of the normal contact forces", Part(|s| &mut s.n2.normal_contact)).averaged(),
        number("n2_tangential_contact", "mu rate").sample("N₂ of the tangential contact forces", Part(|s| &mut s.n2.tangential_contact)).averaged(),
        number("n2_repulsion", "mu rate").sample("N₂ of repulsion and van der Waals attraction", Part(|s| &mut s.n2.repulsion)).averaged(),
        number("n2_brownian", "mu rate").sample("N₂ of Brownian motion", Part(|s| &mut s.n2.brownian)).averaged(),
        number("particle_pressure_normal_contact", "mu rate").sample("particle pressure of the normal contact forces", Part(|s| &mut s.particle_pressure.normal_contact)).averaged(),
        number("particle_pressure_repulsion", "mu rate").sample("particle pressure of repulsion and van der Waals attraction", Part(|s| &mut s.particle_pressure.repulsion)).averaged(),
        number("particle_pressure_brownian", "mu rate").sample("particle pressure of Brownian motion, n kT without its hydrodynamic part", Part(|s| &mut s.particle_pressure.brownian)).averaged(),
        number("pressure_hydrodynamic", "mu rate").sample("particle pressure of the fluid: the isotropic part of the hydrodynamic stress, which all other pressures and stresses lack; none under Brownian motion", Free(|s| &mut s.pressure_hydrodynamic)).averaged().label("particle pressure of the fluid"),
        number("sigma_xx", "mu rate").sample("particle stress Σ_xx, contacts included", Sum(|s| s.xx().total())).averaged(),
        number("sigma_xx_hydrodynamic", "mu rate").sample("Σ_xx of the stresslets", Sum(|s| s.xx().hydrodynamic)).averaged().label(""),
        number("sigma_xx_normal_contact", "mu rate").sample("Σ_xx of the normal contact forces", Sum(|s| s.xx().normal_contact)).averaged().label(""),
        number("sigma_xx_tangential_contact", "mu rate").sample("Σ_xx of the tangential contact forces", Sum(|s| s.xx().tangential_contact)).averaged().label(""),
        number("sigma_xx_repulsion", "mu rate").sample("Σ_xx of repulsion and van der Waals attraction", Sum(|s| s.xx().repulsion)).averaged().label(""),
        number("sigma_xx_brownian", "mu rate").sample("Σ_xx of Brownian motion", Sum(|s| s.xx().brownian)).averaged().label(""),
        number("sigma_yy", "mu rate").sample("particle stress Σ_yy, contacts included", Sum(|s| s.yy().total())).averaged(),
        number("sigma_yy_hydrodynamic", "mu rate").sample("Σ_yy of the stresslets", Sum(|s| s.yy().hydrodynamic)).averaged().label(""),
        number("sigma_yy_normal_contact", "mu rate").sample("Σ_yy of the normal contact forces", Sum(|s| s.yy().normal_contact)).averaged().label(""),
        number("sigma_yy_tangential_contact", "mu rate").sample("Σ_yy of the tangential contact forces", Sum(|s| s.yy().tangential_contact)).averaged().label(""),
        number("sigma_yy_repulsion", "mu rate").sample("Σ_yy of repulsion and van der Waals attraction", Sum(|s| s.yy().repulsion)).averaged().label(""),
        number("sigma_yy_brownian", "mu rate").sample("Σ_yy of Brownian motion", Sum(|s| s.yy().brownian)).averaged().label(""),
        number("sigma_zz", "mu rate").sample("particle stress Σ_zz, contacts included; in a layer of the stresslets alone, which are traceless", Sum(|s| s.zz().total())).averaged(),
        number("sigma_zz_hydrodynamic", "mu rate").sample("Σ_zz of the stresslets", Sum(|s| s.zz().hydrodynamic)).averaged().label(""),
        number("sigma_zz_normal_contact", "mu rate").sample("Σ_zz of the normal contact forces", Sum(|s| s.zz().normal_contact)).averaged().label(""),
        number("sigma_zz_tangential_contact", "mu rate").sample("Σ_zz of the tangential contact forces", Sum(|s| s.zz().tangential_contact)).averaged().label(""),
        number("sigma_zz_repulsion", "mu rate").sample("Σ_zz of repulsion and van der Waals attraction", Sum(|s| s.zz().repulsion)).averaged().label(""),
        number("sigma_zz_brownian", "mu rate").sample("Σ_zz of Brownian motion", Sum(|s| s.zz().brownian)).averaged().label(""),
        number("sigma_xy", "mu rate").sample("particle stress Σ_xy, contacts included", Sum(|s| s.xy.total())).averaged(),
        number("sigma_xy_hydrodynamic", "mu rate").sample("Σ_xy of the stresslets", Part(|s| &mut s.xy.hydrodynamic)).averaged().label(""),
        number("sigma_xy_normal_contact", "mu rate").sample("Σ_xy of the normal contact forces", Part(|s| &mut s.xy.normal_contact)).averaged().label(""),
        number("sigma_xy_tangential_contact", "mu rate").sample("Σ_xy of the tangential contact forces", Part(|s| &mut s.xy.tangential_contact)).averaged().label(""),
        number("sigma_xy_repulsion", "mu rate").sample("Σ_xy of repulsion and van der Waals attraction", Part(|s| &mut s.xy.repulsion)).averaged().label(""),
        number("sigma_xy_brownian", "mu rate").sample("Σ_xy of Brownian motion", Part(|s| &mut s.xy.brownian)).averaged().label(""),
        number("sigma_xz", "mu rate").sample("particle stress Σ_xz, contacts included", Sum(|s| s.xz.total())).averaged(),
        number("sigma_xz_hydrodynamic", "mu rate").sample("Σ_xz of the stresslets", Part(|s| &mut s.xz.hydrodynamic)).averaged().label(""),
        number("sigma_xz_normal_contact", "mu rate").sample("Σ_xz of the normal contact forces", Part(|s| &mut s.xz.normal_contact)).averaged().label(""),
        number("sigma_xz_tangential_contact", "mu rate").sample("Σ_xz of the tangential contact forces", Part(|s| &mut s.xz.tangential_contact)).averaged().label(""),
        number("sigma_xz_repulsion", "mu rate").sample("Σ_xz of repulsion and van der Waals attraction", Part(|s| &mut s.xz.repulsion)).averaged().label(""),
        number("sigma_xz_brownian", "mu rate").sample("Σ_xz of Brownian motion", Part(|s| &mut s.xz.brownian)).averaged().label(""),
        number("sigma_yz", "mu rate").sample("particle stress Σ_yz, contacts included", Sum(|s| s.yz.total())).averaged(),
        number("sigma_yz_hydrodynamic", "mu rate").sample("Σ_yz of the stresslets", Part(|s| &mut s.yz.hydrodynamic)).averaged().label(""),
        number("sigma_yz_normal_contact", "mu rate").sample("Σ_yz of the normal contact forces", Part(|s| &mut s.yz.normal_contact)).averaged().label(""),
        number("sigma_yz_tangential_contact", "mu rate").sample("Σ_yz of the tangential contact forces", Part(|s| &mut s.yz.tangential_contact)).averaged().label(""),
        number("sigma_yz_repulsion", "mu rate").sample("Σ_yz of repulsion and van der Waals attraction", Part(|s| &mut s.yz.repulsion)).averaged().label(""),
        number("sigma_yz_brownian", "mu rate").sample("Σ_yz of Brownian motion", Part(|s| &mut s.yz.brownian)).averaged().label(""),
        number("fraction", "1").sample("area or volume fraction under an imposed pressure", Free(|s| &mut s.fraction)).averaged(),
        number("final_fraction", "1").run("area or volume fraction at its end, under an imposed pressure", Of(|r| r.final_fraction)),
        number("arrested_fraction", "1").label("fraction at arrest")
            .point("area or volume fraction at which jammed runs came to rest under an imposed ratio of stress and pressure, mean over them", Over(|r| r.arrested_fraction())),
        number("pressure", "mu rate").label("particle pressure P")
            .run("particle pressure P, without `pressure_hydrodynamic`: −(Σ_xx + Σ_yy + Σ_zz)/3, in a layer −(Σ_xx + Σ_yy)/2", Of(|r| r.pressure()))
            .with_its_mean(),
        number("pressure_22", "mu rate").sample("particle pressure P₂₂ = −Σ_yy on planes across the gradient, without `pressure_hydrodynamic`", Sum(|s| -s.yy().total())).averaged(),
        number("viscous_number", "1").label("viscous number J")
            .run("viscous number J = μ rate/P₂₂, of means in time; none in an oscillation or where contacts and forces between surfaces bear less than half", Of(|r| ratio(1.0, r.steady_pressure_22()?)))
            .point("viscous number J = μ rate/P₂₂, mean over runs", MeanOver),
        number("macroscopic_friction", "1").label("macroscopic friction coefficient σ/P₂₂")
            .run("macroscopic friction coefficient σ/P₂₂, of means in time; none in an oscillation or where contacts and forces between surfaces bear less than half", Of(|r| ratio(r.viscosity?.mean, r.steady_pressure_22()?)))
            .point("macroscopic friction coefficient σ/P₂₂, mean over runs", MeanOver),
        number("normal_viscosity", "mu").label("normal viscosity η_n")
            .run("normal viscosity η_n = P₂₂/rate, of means in time; none in an oscillation or where contacts and forces between surfaces bear less than half", Of(|r| r.steady_pressure_22()))
            .point("normal viscosity η_n = P₂₂/rate, mean over runs", MeanOver),
        number("lambda_2", "1").label("normal stress ratio λ₂")
            .run("normal stress ratio λ₂ = Σ_yy/Σ_xx, of means in time; none in an oscillation or where contacts and forces between surfaces bear less than half", Of(|r| r.normal_stress_ratio("sigma_yy")))
            .point("normal stress ratio λ₂ = Σ_yy/Σ_xx, mean over runs", MeanOver),
        number("lambda_3", "1").label("normal stress ratio λ₃")
            .run("normal stress ratio λ₃ = Σ_zz/Σ_xx, of means in time; none in a layer, in an oscillation or where contacts and forces between surfaces bear less than half", Of(|r| r.normal_stress_ratio("sigma_zz").filter(|_| r.is_suspension())))
            .point("normal stress ratio λ₃ = Σ_zz/Σ_xx, mean over runs", MeanOver),
        number("n1_over_stress", "1").label("N₁/σ")
            .run("first normal stress difference over the shear stress, N₁/σ, of means in time; none in an oscillation", Of(|r| r.over_stress("n1")))
            .point("first normal stress difference over the shear stress, N₁/σ, mean over runs", MeanOver),
        number("n2_over_stress", "1").label("N₂/σ")
            .run("second normal stress difference over the shear stress, N₂/σ, of means in time; none in an oscillation", Of(|r| r.over_stress("n2")))
            .point("second normal stress difference over the shear stress, N₂/σ, mean over runs", MeanOver),
        number("sticking", "1").label("sticking contacts, of all")
            .run("contacts that stick (`rolling`) over contacts", Of(|r| ratio(r.sticking as f64, r.contacts as f64)))
            .point("contacts that stick (`rolling`) over contacts", Over(|r| ratio(r.sum("rolling"), r.sum("contacts")))),
        number("sliding", "1").label("sliding contacts, of all")
            .run("contacts that slide (`slipping`) over contacts", Of(|r| ratio((r.activated - r.sticking) as f64, r.contacts as f64)))
            .point("contacts that slide (`slipping`) over contacts", Over(|r| ratio(r.sum("activated") - r.sum("rolling"), r.sum("contacts")))),
        number("layering", "1").sample("order in lanes along the flow: largest |Σ_j exp(2πi m y_j/L)|/N over m from 2 to L/a", Structure(|s| &mut s.layering)).averaged().label("layering"),
        number("psi_6", "1").sample("bond orientation Ψ₆ of a layer, 1 for a hexagonal lattice", Structure(|s| &mut s.psi_6)).averaged(),
        number("q_6", "1").sample("bond orientation Q₆ of a suspension, 0.575 for an fcc lattice", Structure(|s| &mut s.q_6)).averaged(),
        number("localisation", "1").sample("first harmonic along the gradient of the local shear rate, over the rate", Structure(|s| &mut s.localisation)).averaged().label("shear localisation"),
        number("concentration_y", "1").sample("first harmonic along the gradient of the number density, over its mean", Structure(|s| &mut s.concentration_y)).averaged(),
        number("concentration_z", "1").sample("first harmonic along the vorticity of the number density of a suspension, over its mean", Structure(|s| &mut s.concentration_z)).averaged(),
        number("hyperstaticity", "1").sample("constraints of loaded contacts less degrees of freedom of the spheres with such contacts, over their number", Structure(|s| &mut s.hyperstaticity)).averaged().label("degree of hyperstaticity"),
        number("displacement_yy", "a²").sample("mean square displacement along the gradient since the start of the run", Structure(|s| &mut s.displacement_yy)),
        number("displacement_zz", "a²").sample("mean square displacement along the vorticity of a suspension since the start of the run", Structure(|s| &mut s.displacement_zz)),
        number("diffusivity_yy", "a² rate").label("shear-induced diffusivity D_yy")
            .run("half the slope of the mean square displacement along the gradient; none below an averaged strain of 1 or ten samples", Of(|r| r.diffusivity(0)))
            .point("shear-induced diffusivity D_yy along the gradient", MeanOver),
        number("diffusivity_zz", "a² rate").label("shear-induced diffusivity D_zz")
            .run("half the slope of the mean square displacement along the vorticity; none below an averaged strain of 1 or ten samples", Of(|r| r.diffusivity(1)))
            .point("shear-induced diffusivity D_zz along the vorticity", MeanOver),
        number("layering_drift", "1")
            .run("mean layering of the second half of the averaged strain minus that of the first half", Of(|r| r.order_drift(0)))
            .with_its_mean(),
        number("bond_order_drift", "1")
            .run("mean bond orientation, Ψ₆ of a layer and Q₆ of a suspension, of the second half of the averaged strain minus that of the first half", Of(|r| r.order_drift(1)))
            .with_its_mean(),
        number("fraction_drift", "1")
            .run("mean fraction under an imposed pressure of the second half of the averaged strain minus that of the first half", Of(|r| r.fraction_drift()))
            .with_its_mean(),
        number("not_steady", "1").point("1 if the viscosity drifts or remembers the start, order falls, or the fraction under an imposed pressure drifts, significantly; none with fewer than three runs", Over(|r| r.has_trend(Trend::NotSteady))),
        number("ordering", "1").point("1 if layering or bond orientation rises significantly; none with fewer than three runs", Over(|r| r.has_trend(Trend::Ordering))),
        number("coordination", "1").sample("loaded contacts of a sphere", Network(|n| &mut n.coordination)).averaged(),
        number("frictional_coordination", "1").sample("contacts of a sphere on which friction acts", Network(|n| &mut n.frictional_coordination)).averaged(),
        number("largest_cluster", "1").sample("fraction of spheres in the largest cluster of frictional contacts", Network(|n| &mut n.largest_cluster)).averaged(),
        number("percolating_x", "1").sample("fraction of instants at which such a cluster percolates along the flow", Network(|n| &mut n.percolating_x)).averaged(),
        number("percolating_y", "1").sample("fraction of instants at which such a cluster percolates along the gradient", Network(|n| &mut n.percolating_y)).averaged(),
        number("core_fraction", "1").sample("fraction of spheres in the 3-core of the frictional contacts of a layer, in the 4-core of a suspension", Network(|n| &mut n.core_fraction)).averaged(),
    ]
};

/// A table in which numbers are columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// Samples of a run, also those derived from stored ones.
    Samples,
    /// Results of runs.
    Runs,
    /// Points of a report.
    Points,
}

impl Number {
    /// The number of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        static PLACES: LazyLock<HashMap<&str, &Number>> =
            LazyLock::new(|| NUMBERS.iter().map(|number| (number.name, number)).collect());
        PLACES.get(name).copied()
    }

    /// Its meaning in a table; `None` if it is no column there.
    pub fn meaning(&self, level: Level) -> Option<&'static str> {
        match level {
            Level::Samples => self.sample.map(|(meaning, _)| meaning),
            Level::Runs => self.run.map(|(meaning, _)| meaning),
            Level::Points => self.point.map(|(meaning, _)| meaning),
        }
    }

    /// How a point has it.
    pub(crate) fn over_runs(&self) -> Option<OverRuns> {
        self.point.map(|(_, how)| how)
    }

    /// Whether samples store it: all but sums of stored parts.
    pub(crate) fn is_kept(&self) -> bool {
        self.sample.is_some() && !self.is_sum()
    }

    /// Whether samples derive it as a sum of stored parts.
    pub(crate) fn is_sum(&self) -> bool {
        matches!(self.sample, Some((_, InSample::Sum(_))))
    }

    /// Whether it concerns all steps of a run so far, whether sampled or not.
    pub(crate) fn is_counter(&self) -> bool {
        matches!(
            self.sample,
            Some((_, InSample::Extreme(_) | InSample::Total(_)))
        )
    }

    /// Whether it is observed from a frame, by `sweep`: steps have none.
    pub fn is_observed(&self) -> bool {
        matches!(
            self.sample,
            Some((_, InSample::Network(_) | InSample::Structure(_)))
        )
    }

    /// Whether a sample may lack it.
    pub fn is_optional(&self) -> bool {
        self.is_observed() || matches!(self.sample, Some((_, InSample::Free(_))))
    }

    /// Type of its values in the tables of the store.
    pub(crate) fn kind(&self, level: Level) -> Kind {
        let is_count = match level {
            Level::Samples => matches!(
                self.sample,
                Some((_, InSample::Count(_) | InSample::Total(_)))
            ),
            Level::Runs => matches!(self.run, Some((_, InTime::Count(_)))),
            Level::Points => matches!(self.point, Some((_, OverRuns::Count(_)))),
        };
        if is_count { Kind::Count } else { Kind::Number }
    }

    /// Its value in a sample; NaN in samples without it.
    pub fn of_sample(&self, sample: &Sample) -> Value {
        let mut copy = *sample;
        let Some((_, place)) = self.sample else {
            return Value::Number(f64::NAN);
        };
        match place {
            InSample::Real(number) => Value::Number(*number(&mut copy)),
            InSample::Count(count) => Value::Count(u64::from(*count(&mut copy))),
            InSample::Extreme(number) => Value::Number(*number(&mut copy.counters)),
            InSample::Total(count) => Value::Count(*count(&mut copy.counters)),
            InSample::Sum(sum) => Value::Number(sum(&copy.stress)),
            InSample::Part(part) => Value::Number(*part(&mut copy.stress)),
            InSample::Free(number) => Value::Number(number(&mut copy).unwrap_or(f64::NAN)),
            InSample::Network(number) => {
                let network = &mut copy.network.unwrap_or(NetworkSample::NONE);
                Value::Number(*number(network))
            }
            InSample::Structure(number) => {
                let structure = &mut copy.structure.unwrap_or(StructureSample::NONE);
                Value::Number(*number(structure))
            }
        }
    }

    /// Sets its value in a sample, if it is stored.
    pub(crate) fn put(&self, sample: &mut Sample, value: Value) {
        let number = value.number();
        let count = match value {
            Value::Count(count) => count,
            _ => 0,
        };
        match self.sample {
            Some((_, InSample::Real(of))) => *of(sample) = number,
            Some((_, InSample::Count(of))) => {
                *of(sample) = u32::try_from(count).unwrap_or(u32::MAX);
            }
            Some((_, InSample::Extreme(of))) => *of(&mut sample.counters) = number,
            Some((_, InSample::Total(of))) => *of(&mut sample.counters) = count,
            Some((_, InSample::Part(of))) => *of(&mut sample.stress) = number,
            Some((_, InSample::Free(of))) => *of(sample) = (!number.is_nan()).then_some(number),
            Some((_, InSample::Network(of))) if !number.is_nan() => {
                *of(sample.network.get_or_insert(NetworkSample::NONE)) = number;
            }
            Some((_, InSample::Structure(of))) if !number.is_nan() => {
                *of(sample.structure.get_or_insert(StructureSample::NONE)) = number;
            }
            Some((_, InSample::Network(_) | InSample::Structure(_) | InSample::Sum(_))) | None => {}
        }
    }

    /// Its value in the result of a run; `None` if it has none.
    pub(crate) fn of_run(&self, run: &RunData<'_>) -> Option<Value> {
        match self.run?.1 {
            InTime::Real(of) => of(run).map(Value::Number),
            InTime::Count(of) => Some(Value::Count(of(run))),
            InTime::Mean => run.mean(self.name).map(Value::Number),
        }
    }

    /// Its value in a sample, if results have the mean of it and the sample has it.
    pub(super) fn averaged_value(&self, sample: &Sample) -> Option<f64> {
        matches!(self.run, Some((_, InTime::Mean)))
            .then(|| self.of_sample(sample).number())
            .filter(|value| !value.is_nan())
    }
}

/// The numbers that samples store.
pub(crate) fn kept() -> impl Iterator<Item = &'static Number> {
    NUMBERS.iter().filter(|number| number.is_kept())
}

/// The numbers that are columns of a table.
pub fn columns(level: Level) -> impl Iterator<Item = &'static Number> {
    NUMBERS
        .iter()
        .filter(move |number| number.meaning(level).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_has_a_name_of_its_own_and_meanings() {
        for number in NUMBERS {
            let of_name = NUMBERS.iter().filter(|other| other.name == number.name);
            assert_eq!(of_name.count(), 1, "{}", number.name);
            let levels = [Level::Samples, Level::Runs, Level::Points];
            let meanings: Vec<&str> = levels
                .iter()
                .filter_map(|level| number.meaning(*level))
                .collect();
            assert!(
                !meanings.is_empty() && !meanings.contains(&""),
                "{}",
                number.name
            );
        }
    }

    #[test]
    fn numbers_come_back_and_parts_add_up_to_what_they_are_parts_of() {
        let mut sample = Sample::default();
        let value = |number: &Number, place: usize| match number.kind(Level::Samples) {
            Kind::Count => Value::Count(place as u64),
            _ => Value::Number(place as f64 + 1.0),
        };
        for (place, number) in kept().enumerate() {
            number.put(&mut sample, value(number, place));
        }
        for (place, number) in kept().enumerate() {
            assert_eq!(
                number.of_sample(&sample),
                value(number, place),
                "{}",
                number.name
            );
        }
        let real = |name: &str| Number::named(name).unwrap().of_sample(&sample).number();
        let is_near = |a: f64, b: f64| (a - b).abs() < 1e-12 * a.abs().max(1.0);
        let mut sums = columns(Level::Samples).filter(|number| number.is_sum());
        let mut wholes = 0;
        for whole in sums.by_ref() {
            let begins = format!("{}_", whole.name);
            let parts = columns(Level::Samples).filter(|part| part.name.starts_with(&begins));
            let parts: Vec<f64> = parts.map(|part| real(part.name)).collect();
            if parts.len() > 1 {
                let sum: f64 = parts.iter().sum();
                assert!(is_near(real(whole.name), sum), "{}", whole.name);
                wholes += 1;
            }
        }
        assert_eq!(wholes, 9, "N₁, N₂, Π and six components");
        // The normal stresses are those of the differences and the pressure.
        for part in [
            "",
            "_hydrodynamic",
            "_normal_contact",
            "_tangential_contact",
            "_repulsion",
            "_brownian",
        ] {
            let of = |name: &str| real(&format!("{name}{part}"));
            let [xx, yy, zz] = ["sigma_xx", "sigma_yy", "sigma_zz"].map(of);
            assert!(
                is_near(xx - yy, of("n1")) && is_near(yy - zz, of("n2")),
                "{part}"
            );
        }
        let sum: f64 = ["sigma_xx", "sigma_yy", "sigma_zz"].map(real).iter().sum();
        assert!(is_near(sum, -3.0 * real("particle_pressure")));
        let differences = (real("n1") - real("n2")) / 3.0;
        assert!(is_near(
            real("pressure_22"),
            real("particle_pressure") + differences
        ));
        let mut unseen = Sample::default();
        for number in kept().filter(|number| number.is_optional()) {
            number.put(&mut unseen, Value::Number(f64::NAN));
        }
        assert_eq!((unseen.network, unseen.structure), (None, None));
    }
}
