//! Control of the shear, by rate or by stress.
//!
//! In units of the flow the rate is always 1; the critical load F_crit = 6π/Γ depends on it, and so
//! does every force given in units of F_crit. Under an imposed stress F_crit is determined at every
//! stage, see [`crate::run::balance`]; strain remains the independent variable, and a step takes
//! the time strain/rate.

use super::{SchemeMemory, Simulation, background};
use crate::contact::laws::{ForceLaw, Laws};
use crate::contact::{Quality, SolvePass, Status};
use crate::error::Error;
use crate::model::{ContactScheme, FrictionOnset, Params, Surface};
use crate::run::balance::{Balance, Next};
use crate::run::spaces::Starts;
use crate::run::steppers::Stage;
use crate::space::cell::Cell;
use std::f64::consts::PI;

/// Initial viscosity of the search for the first load of a run.
const FIRST_VISCOSITY: f64 = 10.0;
/// Number of solves of a stage after which the set of frictional contacts is fixed: at a jump of
/// the law, no load may balance the stress.
const MAX_DECISIONS: u32 = 6;
/// Number of solves of a stage after which it counts as unconverged.
const MAX_SOLVES: u32 = 60;

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
}

impl ShearControl {
    /// The control of a run with these parameters, with the critical load of its last stage if it
    /// is resumed.
    pub(super) fn new(params: &Params, load: Option<f64>) -> Self {
        match params.shear_stress {
            None => Self::Rate,
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
        }
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
