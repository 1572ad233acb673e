//! One stage: from positions to velocities, contact forces included. The only place where contact and far field meet.

mod method;

pub use method::{Method, memory_bytes};

use crate::contact::adhesion::Adhering;
use crate::contact::laws::{Laws, Span};
use crate::contact::repulsion::Repelled;
use crate::contact::solver::{AppliedForces, StageInput};
use crate::contact::{ContactMemory, ContactSolver, Pass, Quality, Status, Surface, most_contacts};
use crate::error::Error;
use crate::hydrodynamics::iterative::IterativeFarField;
use crate::hydrodynamics::iterative::fixed_point::{FixedPointMap, Progress};
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::procedure::{ContactList, ProcedureInput, ProcedureSolver};
use crate::space::cell::Cell;
use crate::space::pair::Neighbours;
use crate::space::{ImposedFlow as _, Layer};

/// What a far-field iteration asks of the contact problem, over its own relative residual: the differences of its steps, from which it
/// learns, are that much more exact.
const STRICT: f64 = 2e-3;
/// Relative residual that the first evaluation is made for.
const FIRST: f64 = 1e-2;
/// How much smaller than at the last decision the residual must be for another one on which contacts friction acts.
const CLOSER: f64 = 0.1;
/// Changes of these contacts in one solve after which they are held.
const MOST_CHANGES: u32 = 8;

/// What keeps the spheres apart, with what it remembers from stage to stage.
pub enum Contact<'a, S: Fluid = Layer> {
    /// Nothing but the fluid.
    None,
    /// Laws: entries of the one contact problem, see `contact::laws`.
    Laws {
        /// The laws.
        laws: &'a Laws,
        /// How far contact forces look ahead.
        span: Span<'a>,
        /// What contacts remember.
        memory: &'a mut ContactMemory<S>,
    },
    /// The paper's steps, see `procedure`.
    Procedure {
        /// Roughness and friction.
        surface: Surface,
        /// Pairs in contact.
        listed: &'a mut ContactList,
    },
}

/// Solver of the motion of one set of spheres, with its workspace.
pub struct StageSolver<S: Fluid = Layer> {
    /// Hydrodynamics.
    pub resistance: Resistance<S>,
    /// Contact problem of the last solve; its list is empty without contact.
    pub contacts: ContactSolver<S>,
    /// Pairs that a repulsion keeps apart, besides.
    pub repelled: Repelled<S>,
    /// Pairs that adhesion holds together, besides; their normal force is the attraction, below 0.
    pub adhering: Adhering<S>,
    /// External and background forces.
    forces: Vec<f64>,
    /// Disturbance velocities of the last solve.
    velocities: Vec<f64>,
    /// Forces that drive the spheres in one evaluation of the iteration,.
    applied: Vec<f64>,
    /// Far field iterated on top of a pairwise Ball-Melrose resistance.
    far: Option<Box<IterativeFarField<S>>>,
    /// Solver of the paper's steps, from their first stage on.
    procedure: Option<Box<ProcedureSolver<S>>>,
}

impl<S: Fluid> StageSolver<S> {
    /// Workspace for the spheres the resistance was made for.
    pub fn new(resistance: Resistance<S>) -> Self {
        let spheres = resistance.radii().len();
        let n = S::MODES * spheres;
        let mut adhering = Adhering::default();
        adhering.pairs.reserve(most_contacts::<S>(spheres));
        Self {
            contacts: ContactSolver::new(&resistance),
            resistance,
            repelled: Repelled::default(),
            adhering,
            forces: vec![0.0; n],
            velocities: vec![0.0; n],
            applied: Vec::with_capacity(n),
            far: None,
            procedure: None,
        }
    }

    /// Full Stokesian Dynamics of many spheres: the far field iterated on top of a pairwise Ball-Melrose resistance.
    pub fn with_far_field(pairwise: Resistance<S>, far: IterativeFarField<S>) -> Self {
        Self {
            far: Some(Box::new(far)),
            ..Self::new(pairwise)
        }
    }

    /// Begins a step: what is known from stages before is forgotten, but for what [`ContactMemory`] holds and what
    /// [`StageSolver::far_field`] tells. Results then depend on positions and these alone, so that a run that is resumed has the same bits.
    pub fn begin_step(&mut self) {
        self.contacts.begin_step();
        if let Some(far) = &mut self.far {
            far.round();
        }
    }

    /// From what the next solve starts its far field, where one is iterated: see [`crate::Snapshot::far_field`].
    pub fn far_field(&self) -> Vec<f32> {
        self.far.as_ref().map_or_else(Vec::new, |far| far.found())
    }

    /// Lets the next solve start its far field from what [`StageSolver::far_field`] told; from nothing, if that is empty.
    pub fn start_far_field_from(&mut self, found: &[f32]) {
        if let Some(far) = &mut self.far {
            far.start_from(found);
        }
    }

    /// Counterforces and stresslets of the last solve, as [`Resistance::apply`]; `work` is scratch.
    pub fn counterforces(
        &self,
        strain: &S::Strain,
        work: &mut Vec<f64>,
        forces: &mut Vec<f64>,
        stresslets: &mut Vec<S::Strain>,
    ) {
        self.resistance
            .apply(&self.velocities, strain, work, forces, stresslets);
        if let Some(far) = &self.far {
            far.correct(forces, stresslets);
        }
    }

    /// Disturbance velocities `(U − u∞, Ω − Ω∞)` of the last solve,.
    pub fn velocities(&self) -> &[f64] {
        &self.velocities
    }

    /// The pair with the smallest gap, if any is in lubrication range.
    pub fn closest(&self) -> Option<&Neighbours<S>> {
        let pairs = self.resistance.neighbours().iter();
        pairs.min_by(|a, b| a.gap.total_cmp(&b.gap))
    }

    /// Takes positions: pairs and hydrodynamics, without the factor, to which a repulsion still adds.
    ///
    /// # Errors
    /// Overlaps, an indefinite mobility, memory.
    pub fn assemble(&mut self, cell: &Cell<S>, centres: &[S::Vector]) -> Result<(), Error> {
        self.resistance.assemble(cell, centres)?;
        match &mut self.far {
            Some(far) => far.update(cell, centres),
            None => Ok(()),
        }
    }

    /// Solves for the velocities at the positions taken under external forces and torques (empty: none).
    ///
    /// `pass`: [`Pass::First`] once for every [`StageSolver::assemble`]; the others solve again under the same external forces, with
    /// another contact law, which must neither repel nor adhere.
    ///
    /// # Errors
    /// An indefinite matrix, a far field that does not converge, velocities that are not finite.
    pub fn solve(
        &mut self,
        background: &S::Background,
        external: &[f64],
        contact: Contact<'_, S>,
        pass: Pass,
    ) -> Result<Quality, Error> {
        if pass == Pass::First {
            self.begin(background, external, &contact)?;
        }
        let (resistance, contacts) = (&self.resistance, &mut self.contacts);
        let (forces, velocities) = (&self.forces, &mut self.velocities);
        let (strain, mut nothing) = (background.strain_components(), ContactMemory::default());
        let contact = match contact {
            Contact::None if self.far.is_none() => Contact::Laws {
                laws: &Laws::NONE,
                span: Span::alone(1.0),
                memory: &mut nothing,
            },
            other => other,
        };
        let quality = match contact {
            Contact::None => {
                contacts.list.clear();
                if let Some(far) = &mut self.far {
                    far.solve(resistance, &strain, forces, velocities)?;
                }
                Quality::default()
            }
            Contact::Laws { laws, span, memory } => {
                let input = StageInput {
                    resistance,
                    background,
                    laws,
                    span,
                };
                if let Some(far) = &mut self.far {
                    let mut map = ContactMap {
                        input,
                        contacts,
                        memory,
                        applied: &mut self.applied,
                        pass,
                        quality: Quality::default(),
                        changes: 0,
                        decided: f64::INFINITY,
                    };
                    let found =
                        far.solve_fixed_point(resistance, &mut map, &strain, forces, velocities)?;
                    let mut quality = map.quality;
                    if !found.converged {
                        // A flow that the spheres are subjected to besides the background.
                        quality.residual = quality.residual.max(found.residual);
                        if !quality.jammed() {
                            quality.status = Status::Failed;
                        }
                    }
                    quality
                } else {
                    let applied = AppliedForces::both(forces);
                    contacts.solve(&input, applied, memory, pass, velocities)?.0
                }
            }
            Contact::Procedure { surface, listed } => {
                let spheres = resistance.radii().len();
                let input = ProcedureInput {
                    resistance,
                    background,
                    surface: &surface,
                    forces,
                };
                self.procedure
                    .get_or_insert_with(|| Box::new(ProcedureSolver::new(spheres)))
                    .solve(&input, listed, &mut contacts.list, velocities)?
            }
        };
        self.repelled.finish(&self.velocities);
        for contact in self
            .contacts
            .list
            .iter_mut()
            .chain(&mut self.adhering.pairs)
        {
            contact.take_velocities(&self.velocities);
        }
        match self.velocities.iter().position(|v| !v.is_finite()) {
            Some(at) => Err(Error::NotFinite {
                quantity: "the velocity",
                sphere: at / S::MODES,
            }),
            None => Ok(quality),
        }
    }

    /// The forces on the spheres besides those of contact, and the factor of the resistance, to which a repulsion adds.
    fn begin(
        &mut self,
        background: &S::Background,
        external: &[f64],
        contact: &Contact<'_, S>,
    ) -> Result<(), Error> {
        let (resistance, forces) = (&mut self.resistance, &mut self.forces);
        resistance.background_forces(&background.strain_components(), forces);
        for (force, x) in forces.iter_mut().zip(external) {
            *force += x;
        }
        self.repelled.pairs.clear();
        self.adhering.pairs.clear();
        if let Contact::Laws { laws, span, .. } = contact {
            if let Some(repulsion) = &laws.repulsion {
                self.repelled
                    .add(repulsion, resistance, background, span, forces);
            }
            if laws.adhesion > 0.0 {
                self.adhering
                    .add(laws, resistance, background, span, forces);
            }
        }
        resistance.factor()
    }
}

/// The contact problem under an iterated far field.
struct ContactMap<'a, S: Fluid> {
    /// What it is input in.
    input: StageInput<'a, S>,
    /// Its solver.
    contacts: &'a mut ContactSolver<S>,
    /// What contacts remember.
    memory: &'a mut ContactMemory<S>,
    /// Forces of both parts together,.
    applied: &'a mut Vec<f64>,
    /// Which solve of the stage it is.
    pass: Pass,
    /// How well it was solved last.
    quality: Quality,
    /// How often the contacts on which friction acts have changed.
    changes: u32,
    /// Relative residual when that was last decided.
    decided: f64,
}

impl<S: Fluid> FixedPointMap for ContactMap<'_, S> {
    fn evaluate(
        &mut self,
        forces: &[f64],
        progress: Progress,
        velocities: &mut [f64],
    ) -> Result<bool, Error> {
        let half = velocities.len() / 2;
        let (normal, by_friction) = forces.split_at(half);
        self.applied.clear();
        self.applied
            .extend(normal.iter().zip(by_friction).map(|(n, t)| n + t));
        let applied = AppliedForces {
            all: self.applied,
            frictionless: normal,
            relative_tolerance: STRICT * progress.residual.min(FIRST),
        };
        let (v, v_t) = velocities.split_at_mut(half);
        let first = progress.evaluations == 0;
        let closer = progress.residual < CLOSER * self.decided;
        let deciding = self.changes < MOST_CHANGES && (first || closer);
        if closer {
            self.decided = progress.residual;
        }
        let pass = match self.pass {
            pass if first => pass,
            Pass::First | Pass::Again if deciding => Pass::Again,
            _ => Pass::Held,
        };
        let (quality, changed) = self
            .contacts
            .solve(&self.input, applied, self.memory, pass, v)?;
        self.changes += u32::from(changed && !first);
        self.quality = Quality {
            systems: self.quality.systems + quality.systems,
            ..quality
        };
        // Friction belongs to part T where the law reads the motion without it.
        match self.contacts.isolated_motion(&self.input) {
            Some(isolated) => {
                for ((v, v_t), v_n) in v.iter_mut().zip(v_t).zip(isolated) {
                    *v_t = *v - v_n;
                    *v = *v_n;
                }
            }
            None => v_t.fill(0.0),
        }
        Ok(changed)
    }
}
