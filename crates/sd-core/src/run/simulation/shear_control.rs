//! Control of the shear, by rate or by stress.
//!
//! In units of the flow the rate is always 1; the critical load F_crit = 6π/Γ depends on it, and so
//! does every force given in units of F_crit. Under an imposed stress F_crit is determined at every
//! stage, see [`crate::run::balance`]; strain remains the independent variable, and a step takes
//! the time strain/rate.
//!
//! Under a stress imposed on Brownian spheres the rate of an instant may have either sign, so that
//! time is the independent variable. Its unit is mu/σ, the forces are in units of σ, and the rate
//! of a stage is that at which the spheres bear the imposed stress and the random one, see
//! [`super::brownian`].

use super::{SchemeMemory, Simulation, background};
use crate::contact::laws::{ForceLaw, Laws};
use crate::contact::{Quality, SolvePass, Status};
use crate::error::Error;
use crate::model::{ContactScheme, FrictionOnset, Hydrodynamics, Params, Surface};
use crate::run::balance::{Balance, Next};
use crate::run::spaces::Starts;
use crate::run::steppers::Stage;
use crate::space::cell::Cell;
use std::cmp::Ordering;
use std::f64::consts::PI;

/// Initial viscosity of the search for the first load of a run.
const FIRST_VISCOSITY: f64 = 10.0;
/// Number of solves of a stage after which the set of frictional contacts is fixed: at a jump of
/// the law, no load may balance the stress.
const MAX_DECISIONS: u32 = 6;
/// Number of solves of a stage after which what its stress lacks is added to its residual.
const MAX_SOLVES: u32 = 60;
/// Largest excess of the stress of Brownian spheres, over the sum of its parts: what is left is far
/// below the noise.
const EXCESS: f64 = 1e-6;
/// The least derivative of the stress with respect to the rate, that of the fluid alone.
const LEAST_SLOPE: f64 = 1.0;

/// Control of the shear.
#[derive(Debug, Clone, Copy)]
pub(super) enum ShearControl {
    /// By its rate.
    Rate,
    /// By its stress.
    Stress {
        /// σ*.
        stress: f64,
        /// F_crit at the stage last solved, in mu·a²·rate.
        load: f64,
        /// Whether a stage was solved.
        begun: bool,
    },
    /// By its stress, of Brownian spheres.
    Thermal {
        /// σ*.
        stress: f64,
        /// Rate at the stage last solved, in σ/mu.
        rate: f64,
        /// Derivative of the stress with respect to it there, in mu.
        slope: f64,
    },
}

/// The search for the rate at which a stage bears a stress that rises with it.
#[derive(Debug, Default)]
struct RateSearch {
    /// Rate and excess of the stress below zero, above zero, and of the last trial.
    low: Option<f64>,
    high: Option<f64>,
    last: Option<[f64; 2]>,
}

impl RateSearch {
    /// The next rate after the excess of the stress at one. `slope`: the derivative, if that of the
    /// trials is none; set to it otherwise.
    fn after(&mut self, rate: f64, excess: f64, slope: &mut f64) -> f64 {
        if let Some([before, excess_before]) = self.last {
            let found = (excess - excess_before) / (rate - before);
            if found.is_finite() && found >= LEAST_SLOPE {
                *slope = found;
            }
        }
        self.last = Some([rate, excess]);
        let end = if excess < 0.0 {
            &mut self.low
        } else {
            &mut self.high
        };
        *end = Some(rate);
        let next = rate - excess / *slope;
        match (self.low, self.high) {
            (Some(low), Some(high)) if !(next > low && next < high) => 0.5 * (low + high),
            _ => next,
        }
    }
}

impl ShearControl {
    /// The control of a run with these parameters, with the critical load of its last stage if it
    /// is resumed.
    pub(super) fn new(params: &Params, load: Option<f64>) -> Self {
        match params.shear_stress {
            None => Self::Rate,
            Some(stress) if params.has_free_rate() => Self::Thermal {
                stress,
                rate: FIRST_VISCOSITY.recip(),
                slope: FIRST_VISCOSITY,
            },
            Some(stress) => Self::Stress {
                stress,
                load: load.unwrap_or(FIRST_VISCOSITY / stress),
                begun: load.is_some(),
            },
        }
    }

    /// The critical load of the stage last solved, under an imposed stress.
    pub(super) fn critical_load(&self) -> Option<f64> {
        match *self {
            Self::Stress {
                load, begun: true, ..
            } => Some(load),
            _ => None,
        }
    }

    /// Γ.
    pub(super) fn shear_rate(&self, params: &Params) -> f64 {
        match *self {
            Self::Rate => params.shear_rate,
            Self::Stress { load, .. } => 6.0 * PI / load,
            Self::Thermal { stress, rate, .. } => 6.0 * PI * stress * rate,
        }
    }

    /// σ* of Brownian spheres.
    pub(super) fn thermal_stress(&self) -> Option<f64> {
        match *self {
            Self::Thermal { stress, .. } => Some(stress),
            _ => None,
        }
    }

    /// Discards the rate of the stage solved last, so that a run that is resumed here has the same
    /// bits.
    pub(super) fn begin_step(&mut self, params: &Params) {
        if self.is_thermal() {
            *self = Self::new(params, None);
        }
    }

    /// The rate of shear of Brownian spheres under an imposed stress.
    pub(super) fn thermal_rate(&self) -> Option<f64> {
        match *self {
            Self::Thermal { rate, .. } => Some(rate),
            _ => None,
        }
    }

    pub(super) fn is_thermal(&self) -> bool {
        self.thermal_stress().is_some()
    }

    /// The contact laws at that critical load.
    pub(super) fn laws(&self, params: &Params) -> Laws {
        let choice = params.contact.laws();
        let laws = Laws::new(choice, self.surface(params));
        match params.thermal_energy() {
            Some(energy) => laws.at_thermal_energy(choice, energy),
            None => laws,
        }
    }

    /// Roughness, friction and critical load.
    pub(super) fn surface(&self, params: &Params) -> Surface {
        match *self {
            Self::Rate => params.surface(),
            Self::Stress { load, .. } => Surface {
                critical_load: load,
                ..params.surface()
            },
            Self::Thermal { stress, .. } => Surface {
                critical_load: stress.recip(),
                ..params.surface()
            },
        }
    }
}

/// Dependence of a stage on the critical load.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Dependence {
    /// Nothing.
    None,
    /// Only the set of frictional contacts.
    Set,
    /// Forces, and with a jump of friction at its onset that set too.
    Forces {
        /// Whether friction jumps at its onset.
        jumps: bool,
    },
}

impl Dependence {
    fn of(params: &Params) -> Self {
        let laws = params.contact.laws();
        let has_friction = params.has_friction();
        let jumps = has_friction && laws.onset == FrictionOnset::CriticalLoad;
        let smooth = has_friction && laws.onset == FrictionOnset::Reduced;
        match params.contact {
            ContactScheme::Laws(laws) if laws.is_soft() || laws.needs_critical_load() || smooth => {
                Self::Forces { jumps }
            }
            _ if jumps => Self::Set,
            _ => Self::None,
        }
    }
}

impl<S: Starts> Simulation<S> {
    /// Solves a stage at the critical load at which it carries the imposed stress.
    pub(super) fn solve_at_stress(
        &mut self,
        stage: Stage,
        cell: &Cell<S>,
        centres: &[S::Vector],
    ) -> Result<Quality, Error> {
        let mut pass = SolvePass::First;
        let ShearControl::Stress {
            stress, mut load, ..
        } = self.shear_control
        else {
            unreachable!("only where the stress is imposed");
        };
        let dependence = Dependence::of(&self.params);
        let mut balance = Balance::new(stress, self.settings.stress_tolerance);
        // The last load at which the spheres flowed, if any.
        let mut flowing = None;
        for count in 1.. {
            self.take_load(load);
            let mut quality = self.solve(stage, cell, centres, pass)?;
            if pass == SolvePass::First {
                pass = SolvePass::Repeat;
            }
            let mut viscosity = self.stress_of_stage().viscosity;
            if !quality.jammed() {
                flowing = Some(load);
            }
            let settled = match dependence {
                Dependence::None => true,
                Dependence::Set => self.acts_alike(balance.load_of(viscosity)),
                Dependence::Forces { .. } => false,
            };
            if settled && viscosity > 0.0 {
                // The solution is the same at the balancing load.
                self.take_load(balance.load_of(viscosity));
                return Ok(quality);
            }
            let next = balance.after(load, viscosity);
            let done = match next {
                Next::Found => true,
                Next::AtRest => {
                    quality.status = Status::NoAdmissibleMotion;
                    true
                }
                Next::Try(_) => count >= MAX_SOLVES,
            };
            if done {
                if next != Next::AtRest {
                    let missing = (balance.load_of(viscosity) / load - 1.0).abs();
                    quality.residual = quality.residual.max(missing);
                }
                return Ok(quality);
            }
            let Next::Try(try_next) = next else {
                unreachable!("the search ended above");
            };
            load = try_next;
            let jumps = matches!(
                dependence,
                Dependence::Set | Dependence::Forces { jumps: true }
            );
            if jumps && pass != SolvePass::FixedActivation && count >= MAX_DECISIONS {
                if quality.jammed()
                    && let Some(flowing) = flowing
                {
                    // The flowing one of the two sides of the jump.
                    self.take_load(flowing);
                    quality = self.solve(stage, cell, centres, pass)?;
                    viscosity = self.stress_of_stage().viscosity;
                }
                if dependence == Dependence::Set {
                    // With the set of frictional contacts fixed, nothing else depends on the load.
                    self.take_load(balance.load_of(viscosity));
                    return Ok(quality);
                }
                pass = SolvePass::FixedActivation;
                balance = Balance::new(stress, self.settings.stress_tolerance);
            }
        }
        unreachable!("solves are limited")
    }

    /// Solves a stage of Brownian spheres at the rate at which they bear the imposed stress and the
    /// random one.
    pub(super) fn solve_at_thermal_stress(
        &mut self,
        stage: Stage,
        cell: &Cell<S>,
        centres: &[S::Vector],
    ) -> Result<Quality, Error> {
        let ShearControl::Thermal {
            stress,
            mut rate,
            mut slope,
        } = self.shear_control
        else {
            unreachable!("only where the stress is imposed on Brownian spheres");
        };
        let mut search = RateSearch::default();
        let mut pass = SolvePass::First;
        for count in 1.. {
            self.shear_control = ShearControl::Thermal {
                stress,
                rate,
                slope,
            };
            self.background = self.primary_flow().scaled(rate);
            if pass != SolvePass::First && !self.laws.act_without_contact() {
                let flow = self.background.into();
                self.solver.change_flow(&flow, self.forces.values());
            }
            let mut quality = self.solve(stage, cell, centres, pass)?;
            let components = self.stress_of_stage().components;
            let random = self.brownian.as_ref().map_or(0.0, |noise| noise.stress);
            let excess = rate + components.shear.total() - 1.0 - random;
            let size = 1.0 + random.abs() + rate.abs() + components.shear.hydrodynamic.abs();
            let tolerance = size
                * match self.params.hydrodynamics {
                    Hydrodynamics::StokesianDynamics => self.settings.far_field_residual,
                    Hydrodynamics::BallMelrose | Hydrodynamics::Lubrication(_) => EXCESS,
                };
            let next = search.after(rate, excess, &mut slope);
            let ends = count >= MAX_SOLVES;
            if excess.abs() <= tolerance || ends {
                if ends {
                    quality.residual = quality.residual.max(excess.abs() / slope);
                }
                self.shear_control = ShearControl::Thermal {
                    stress,
                    rate,
                    slope,
                };
                self.shears.record(rate);
                return Ok(quality);
            }
            // Not zero, which would leave the rate of the first stage no ratio to it.
            rate = if next == 0.0 { f64::EPSILON } else { next };
            pass = match count.cmp(&MAX_DECISIONS) {
                Ordering::Less => SolvePass::Repeat,
                Ordering::Equal => {
                    search = RateSearch::default();
                    SolvePass::FixedActivation
                }
                Ordering::Greater => SolvePass::FixedActivation,
            };
        }
        unreachable!("solves are limited")
    }

    /// Imposes the shear of the run's segments in a step.
    pub(super) fn impose(&mut self, step: u64) {
        let Some(run) = &self.run else {
            return;
        };
        let imposed = run.imposed(step);
        if imposed == self.imposed {
            return;
        }
        let stress = self.params.shear_stress;
        let flow = (self.params.flow, self.params.direction);
        self.params.copy_shear(run, &imposed);
        self.imposed = imposed;
        self.background = background(&self.params, &imposed);
        if (self.params.flow, self.params.direction) != flow
            && let SchemeMemory::Procedure { velocities, .. } = &mut self.memory
        {
            // Velocities of the last step no longer indicate which pairs approach.
            velocities.clear();
        }
        if self.params.shear_stress.is_none() {
            self.shear_control = ShearControl::Rate;
            self.take_laws();
        } else if self.params.shear_stress != stress {
            // The laws, and springs in their units, are updated with the first trial load.
            self.shear_control = ShearControl::new(&self.params, None);
        }
    }

    /// Rescales all that is in units of the critical load.
    fn take_load(&mut self, new: f64) {
        if let ShearControl::Stress { load, begun, .. } = &mut self.shear_control {
            *load = new;
            *begun = true;
        }
        self.take_laws();
    }

    /// Rescales all that is in units of the flow to the new shear.
    fn take_laws(&mut self) {
        let before = self.laws.tangential_stiffness;
        self.laws = self.laws_at_load();
        if let SchemeMemory::Laws(memory) = &mut self.memory
            && before > 0.0
        {
            // A spring keeps its stretch, not its force in units of the flow.
            let factor = self.laws.tangential_stiffness / before;
            memory.springs.rescale(factor);
            memory.rolling_springs.rescale(factor);
        }
    }

    /// The contact laws at the present critical load.
    pub(super) fn laws_at_load(&self) -> Laws {
        let mut laws = self.shear_control.laws(&self.params);
        if let Some(law) = self.custom_law {
            laws.normal.law = ForceLaw::Custom(law);
        }
        laws
    }

    /// Whether friction would act on the same contacts at another critical load. The paper's steps
    /// determine this themselves.
    fn acts_alike(&self, load: f64) -> bool {
        let mut contacts = self.solver.contacts.list.iter();
        contacts.all(|contact| contact.friction_acts == (contact.normal_force > load))
    }
}
