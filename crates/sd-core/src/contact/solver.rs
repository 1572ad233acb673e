//! The contact problem of one stage: which pairs take part, what their laws ask for, and the forces that answer.

use super::laws::{COMPLIANCE, Laws, Overlap, Phase, Span};
use super::pair::{Contact, ContactState};
use super::row::Row;
use super::solve::dense::DenseSystem;
use super::solve::newton::{BoxSolver, Onset, Outcome};
use super::solve::problem::{self, Forces, Grip, Problem, System};
use super::solve::sparse::{OnNetwork, SparseSystem};
use super::springs::Stretches;
use super::warm_start::{SpringForces, WarmStart};
use super::{Quality, most_contacts};
use crate::error::Error;
use crate::geometry::modes::Background;
use crate::hydrodynamics::resistance::Resistance;
use crate::law::Halt;

/// Approach velocity, in a·rate, that the first choice of candidates allows for.
const EXPECTED_APPROACH: f64 = 3.0;
/// Change of a normal velocity from one stage to the next, in a·rate, that the next choice of candidates allows for.
const EXPECTED_CHANGE: f64 = 0.3;
/// Rounds of adding pairs that turned out to close after all.
const MOST_ROUNDS: u32 = 20;
/// Distance of a force from a curved law, over the largest force or 1, at which linearisations end.
const LINEARISED: f64 = 1e-9;

/// What a contact problem is posed in.
#[derive(Clone, Copy)]
pub struct Posed<'a> {
    /// Hydrodynamics, factored where they are.
    pub resistance: &'a Resistance,
    /// Imposed flow.
    pub background: &'a Background,
    /// Laws.
    pub laws: &'a Laws,
    /// Time ahead.
    pub span: Span<'a>,
}

/// What drives the spheres besides contacts, `[3N]` each.
#[derive(Clone, Copy)]
pub struct Driving<'a> {
    /// All external and background forces.
    pub all: &'a [f64],
    /// Those of them that count for the motion that normal forces alone leave.
    pub isolated: &'a [f64],
    /// Relative residual that is enough; 0: as exact as can be.
    pub enough: f64,
}

impl<'a> Driving<'a> {
    /// The same forces for both motions.
    pub fn by(forces: &'a [f64]) -> Self {
        Self {
            all: forces,
            isolated: forces,
            enough: 0.0,
        }
    }
}

/// What contacts remember from stage to stage and from step to step.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactMemory {
    /// Forces of the stage before: where the next begins.
    pub warm_start: WarmStart,
    /// Forces of tangential springs; none under laws without.
    pub springs: SpringForces,
}

impl ContactMemory {
    /// Room for that many contacts.
    pub(crate) fn reserve(&mut self, contacts: usize) {
        self.warm_start.forces.reserve(contacts);
        self.springs.0.reserve(contacts);
    }
}

/// The linear algebra behind the problem.
pub(super) enum Backend {
    /// Small dense matrices of contacts.
    Dense(Box<DenseSystem>),
    /// A sparse factor of all spheres.
    Sparse(Box<SparseSystem>),
}

/// The contact problem with its workspace. Reused, it allocates only when the layer has more contacts than ever before.
pub struct ContactSolver {
    /// Candidate pairs, ordered by (i, j), with the forces and velocities of the last solution.
    pub list: Vec<Contact>,
    /// Their overlaps.
    overlaps: Vec<Overlap>,
    /// Entries.
    pub(super) problem: Problem,
    /// States and forces.
    pub(super) solver: BoxSolver,
    /// Linear algebra.
    pub(super) backend: Backend,
    /// Tangential springs within a step.
    stretches: Stretches,
}

impl ContactSolver {
    /// Workspace with room for all contacts of the spheres. Pages never written to cost no memory.
    pub fn new(resistance: &Resistance) -> Self {
        let spheres = resistance.radii().len();
        let most = most_contacts(spheres);
        let backend = if resistance.pairwise().is_some() {
            Backend::Sparse(Box::default())
        } else {
            Backend::Dense(Box::new(DenseSystem::new(spheres, most)))
        };
        let mut solver = Self {
            list: Vec::with_capacity(most),
            overlaps: Vec::with_capacity(most),
            problem: Problem::default(),
            solver: BoxSolver::default(),
            backend,
            stretches: Stretches::default(),
        };
        solver.problem.normal.reserve(most);
        solver.problem.tangential.reserve(2 * most);
        let dense = matches!(solver.backend, Backend::Dense(_));
        solver.solver.reserve(most, dense);
        solver.stretches.reserve(most);
        solver
    }

    /// Begins a step: what is known of the motion from stages before is forgotten.
    pub fn begin_step(&mut self) {
        if let Backend::Sparse(system) = &mut self.backend {
            system.forget();
        }
    }

    /// Solves one stage. `velocities`: disturbances `[3N]` that come out.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub fn solve(
        &mut self,
        posed: &Posed<'_>,
        driving: Driving<'_>,
        memory: &mut ContactMemory,
        velocities: &mut [f64],
    ) -> Result<Quality, Error> {
        self.begin(posed, memory);
        let (quality, _) = self.evaluate(posed, driving, memory, true, velocities)?;
        self.keep_springs(posed, &mut memory.springs);
        Ok(quality)
    }

    /// Solves the stage that was solved last once more, under laws with other numbers: friction acts where it did then.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(crate) fn solve_held(
        &mut self,
        posed: &Posed<'_>,
        driving: Driving<'_>,
        memory: &mut ContactMemory,
        velocities: &mut [f64],
    ) -> Result<Quality, Error> {
        let (quality, _) = self.evaluate(posed, driving, memory, false, velocities)?;
        self.keep_springs(posed, &mut memory.springs);
        Ok(quality)
    }

    /// Whether friction would act on the same contacts above another critical load.
    pub(crate) fn acts_alike(&self, load: f64) -> bool {
        self.list
            .iter()
            .all(|contact| contact.friction_acts == (contact.normal_force > load))
    }

    /// Brings the forces of tangential springs into another unit.
    pub(crate) fn rescale_springs(&mut self, springs: &mut SpringForces, factor: f64) {
        springs.rescale(factor);
        self.stretches.rescale(factor);
    }

    /// Takes the positions of a stage, and its first candidates.
    pub(crate) fn begin(&mut self, posed: &Posed<'_>, memory: &ContactMemory) {
        if let Backend::Sparse(system) = &mut self.backend {
            system.start();
        }
        self.choose(posed, &memory.warm_start);
    }

    /// Solves the problem of the stage once, from the forces of the last time: under other driving forces than before, if need be.
    ///
    /// `deciding`: whether it may still change on which contacts friction acts. Returns with the quality whether it did.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(crate) fn evaluate(
        &mut self,
        posed: &Posed<'_>,
        driving: Driving<'_>,
        memory: &mut ContactMemory,
        deciding: bool,
        velocities: &mut [f64],
    ) -> Result<(Quality, bool), Error> {
        let mut quality = Quality::default();
        let mut changed = false;
        for _ in 0..MOST_ROUNDS {
            let (found, decided) =
                self.solve_candidates(posed, driving, memory, deciding, velocities)?;
            changed |= decided;
            quality = Quality {
                systems: quality.systems + found.systems,
                ..found
            };
            if !self.add_closing(posed, velocities, &mut memory.warm_start) {
                return Ok((quality, changed));
            }
            changed = true;
        }
        // By how much pairs still close counts as a violation.
        let closing = self.list.iter().filter(|c| c.normal_force == 0.0);
        let closing = closing.map(|c| parting_velocity(posed, c) - c.normal_velocity);
        quality.residual = closing.fold(quality.residual, f64::max);
        Ok((quality, changed))
    }

    /// Velocities `[3N]` of the spheres without contacts.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(crate) fn solve_free(
        &mut self,
        resistance: &Resistance,
        forces: &[f64],
        velocities: &mut [f64],
    ) -> Result<(), Error> {
        self.list.clear();
        self.problem.normal.clear();
        self.problem.tangential.clear();
        self.problem.isolated = false;
        let (problem, solver) = (&mut self.problem, &mut self.solver);
        match &mut self.backend {
            Backend::Dense(system) => {
                system.begin(resistance, problem, forces);
                solver.forces.clear();
                system.finish(resistance, &solver.forces, velocities);
            }
            Backend::Sparse(system) => {
                system.start();
                let mut on_network =
                    OnNetwork::begin(resistance, system, problem, Driving::by(forces))?;
                solver.forces.clear();
                on_network.measure(problem, &mut solver.forces);
                velocities.copy_from_slice(system.velocities()[0]);
            }
        }
        Ok(())
    }

    /// The motion `[3N]` that normal forces alone leave, where the law reads it.
    pub(crate) fn isolated_motion(&self, posed: &Posed<'_>) -> Option<&[f64]> {
        match (&self.backend, posed.laws.reads_isolated_motion()) {
            (Backend::Sparse(system), true) => Some(system.velocities()[1]),
            _ => None,
        }
    }

    /// Takes the velocities of the contacts in a motion with disturbances `[3N]`.
    pub(crate) fn take_motion(&mut self, velocities: &[f64]) {
        for contact in &mut self.list {
            contact.take_velocities(velocities);
        }
    }

    /// Keeps the springs of a solved stage.
    pub(crate) fn keep_springs(&mut self, posed: &Posed<'_>, springs: &mut SpringForces) {
        if posed.laws.tangential.has_spring() {
            self.stretches.take(&self.list, springs, posed.span.phase);
        }
    }

    /// The first candidates: pairs that touched or were about to in the stage before, or all near ones where there was none.
    fn choose(&mut self, posed: &Posed<'_>, warm_start: &WarmStart) {
        let (radii, pairs) = (posed.resistance.radii(), posed.resistance.neighbours());
        self.list.clear();
        if !posed.laws.normal.law.touches() {
            return;
        }
        if warm_start.is_empty() {
            let reach = posed.laws.surface.roughness + EXPECTED_APPROACH * posed.span.time;
            let near = pairs.iter().filter(|pair| pair.gap < reach);
            self.list
                .extend(near.map(|pair| Contact::new(*pair, radii, posed.background)));
            return;
        }
        for (pair, [f, t]) in warm_start.known(pairs) {
            let mut contact = Contact::new(*pair, radii, posed.background);
            (contact.normal_force, contact.tangential_force) = (f, t);
            self.list.push(contact);
        }
    }

    /// Adds to `list` the pairs left out that would close within the time span after all; whether there were any.
    ///
    /// Remembers the forces of all others, and who may touch in the next stage.
    fn add_closing(
        &mut self,
        posed: &Posed<'_>,
        velocities: &[f64],
        warm_start: &mut WarmStart,
    ) -> bool {
        warm_start.forces.clear();
        if !posed.laws.normal.law.touches() {
            return false;
        }
        let radii = posed.resistance.radii();
        let before = self.list.len();
        let mut known = 0;
        // Pairs and list are both ordered by (i, j).
        for pair in posed.resistance.neighbours() {
            let (forces, parting, velocity);
            if let Some(contact) = self.list[..before].get(known)
                && contact.pair.key() == pair.key()
            {
                known += 1;
                forces = [contact.normal_force, contact.tangential_force];
                parting = parting_velocity(posed, contact);
                velocity = contact.normal_velocity;
            } else {
                let contact = Contact::new(*pair, radii, posed.background);
                forces = [0.0, 0.0];
                parting = parting_velocity(posed, &contact);
                velocity = contact.background[0] + contact.normal_row().read(velocities);
                if velocity < parting {
                    self.list.push(contact);
                }
            }
            // The next time span may be twice as long.
            if forces[0] > 0.0 || velocity - parting.max(0.5 * parting) < EXPECTED_CHANGE {
                warm_start.keep(pair, forces);
            }
        }
        let added = self.list.len() > before;
        if added {
            self.list.sort_unstable_by_key(|contact| contact.pair.key());
        }
        added
    }

    /// Forces of the candidates at hand, put into `list`, and the motion.
    fn solve_candidates(
        &mut self,
        posed: &Posed<'_>,
        driving: Driving<'_>,
        memory: &ContactMemory,
        deciding: bool,
        velocities: &mut [f64],
    ) -> Result<(Quality, bool), Error> {
        self.pose(posed);
        let (laws, resistance) = (posed.laws, posed.resistance);
        let friction = laws.surface.has_friction();
        let load = laws.surface.critical_load;
        let sparse = matches!(self.backend, Backend::Sparse(_));
        let onset = Onset {
            critical_load: load,
            smooth: laws.is_smooth(),
            admits: friction && !sparse,
            deciding,
        };
        if friction {
            let loaded = self.list.iter().filter(|c| c.normal_force > load).count();
            // Rows cost a dense system much: the solution says who needs one. The few others cost less now than later.
            let all = sparse || 10 * loaded >= 9 * self.list.len();
            self.add_rows(posed, memory, deciding, |_, contact| {
                all || contact.normal_force > load || contact.friction_acts && !deciding
            });
        }
        let solver = &mut self.solver;
        solver.forces.normal.clear();
        solver
            .forces
            .normal
            .extend(self.list.iter().map(|contact| contact.normal_force));
        self.take_rows();
        let mut systems = 0;
        let mut begun = false;
        loop {
            let (problem, solver) = (&mut self.problem, &mut self.solver);
            let overlaps = &mut self.overlaps;
            let refine = |problem: &mut Problem, forces: &Forces| {
                refine(posed, problem, overlaps, forces, driving.enough)
            };
            let outcome = match &mut self.backend {
                Backend::Dense(system) => {
                    if begun {
                        system.begin_rows(resistance, problem);
                    } else {
                        system.begin(resistance, problem, driving.all);
                    }
                    solver.solve(problem, &mut **system, onset, refine)
                }
                Backend::Sparse(system) => {
                    let mut on_network = OnNetwork::begin(resistance, system, problem, driving)?;
                    solver.solve(problem, &mut on_network, onset, refine)
                }
            };
            begun = true;
            match outcome {
                Outcome::Admit { systems: more, all } => {
                    systems += more;
                    self.keep_forces();
                    let normal = std::mem::take(&mut self.solver.forces.normal);
                    self.add_rows(posed, memory, deciding, |k, contact| {
                        all || normal[k] > load || contact.slip_resistance > 0.0
                    });
                    self.solver.forces.normal = normal;
                    self.take_rows();
                }
                Outcome::Solved {
                    merit,
                    jammed,
                    systems: more,
                } => {
                    self.keep_forces();
                    match &mut self.backend {
                        Backend::Dense(system) => {
                            system.finish(resistance, &self.solver.forces, velocities);
                        }
                        Backend::Sparse(system) => {
                            velocities.copy_from_slice(system.velocities()[0]);
                        }
                    }
                    self.take_motion(velocities);
                    let quality = Quality {
                        residual: merit.residual,
                        friction_error: merit.friction_error,
                        jammed,
                        systems: systems + more,
                    };
                    return Ok((quality, self.keep_activity() && !onset.smooth));
                }
            }
        }
    }

    /// The normal entries of the candidates at hand.
    fn pose(&mut self, posed: &Posed<'_>) {
        let laws = posed.laws;
        let held = posed.span.phase != Phase::Alone;
        self.problem.friction = laws.friction();
        self.problem.offset = laws.offset();
        self.problem.isolated = laws.reads_isolated_motion() && laws.surface.has_friction();
        self.problem.tangential.clear();
        self.problem.normal.clear();
        self.overlaps.clear();
        for contact in &self.list {
            let mut overlap = overlap_of(posed, contact);
            overlap.reference = laws
                .normal
                .first_reference(overlap.now, contact.normal_force);
            let [bias, compliance] = laws.normal.entry(&overlap, posed.span.time, held);
            self.overlaps.push(overlap);
            self.problem.normal.push(problem::Normal {
                row: contact.normal_row(),
                bias,
                compliance,
            });
        }
    }

    /// The tangential rows of the candidates that `wanted` names.
    fn add_rows(
        &mut self,
        posed: &Posed<'_>,
        memory: &ContactMemory,
        deciding: bool,
        wanted: impl Fn(usize, &Contact) -> bool,
    ) {
        let rows = &mut self.problem.tangential;
        rows.clear();
        for (k, contact) in self.list.iter_mut().enumerate() {
            if !wanted(k, contact) {
                continue;
            }
            if contact.slip_resistance == 0.0 {
                contact.slip_resistance = posed.resistance.slip_resistance(&contact.pair);
            }
            let mut row = problem::Tangential {
                contact: k,
                row: contact.slip_row(),
                shift: contact.background[1],
                compliance: COMPLIANCE,
                acts: false,
            };
            match posed.laws.tangential.halts() {
                Halt::IsolatedSlip => row.compliance = contact.slip_resistance.recip(),
                Halt::SpringSlip => {
                    let (springs, phase) = (&memory.springs, posed.span.phase);
                    let base = self.stretches.base(contact, springs, phase);
                    let ahead = posed.laws.tangential_stiffness * posed.span.time;
                    row.compliance += ahead.recip();
                    row.shift += base / ahead;
                }
                Halt::Slip => {}
                Halt::SlipAndRotation => {
                    rows.push(row);
                    // The background turns both spheres alike.
                    row.shift = 0.0;
                    row.row = Row::spin([contact.pair.i, contact.pair.j]);
                }
            }
            rows.push(row);
        }
        let load = posed.laws.surface.critical_load;
        for row in rows {
            let contact = &self.list[row.contact];
            row.acts = posed.laws.is_smooth()
                || if deciding {
                    contact.normal_force > load
                } else {
                    contact.friction_acts
                };
        }
    }

    /// Remembers on which contacts friction acts; whether that has changed.
    fn keep_activity(&mut self) -> bool {
        let mut changed = false;
        let mut rows = self.problem.tangential.iter().peekable();
        for (k, contact) in self.list.iter_mut().enumerate() {
            let mut acts = false;
            while let Some(row) = rows.next_if(|row| row.contact == k) {
                acts = row.acts;
            }
            changed |= acts != contact.friction_acts;
            contact.friction_acts = acts;
        }
        changed
    }

    /// Tangential forces to begin with, and the states that all forces show.
    fn take_rows(&mut self) {
        let (list, rows) = (&self.list, &self.problem.tangential);
        let forces = &mut self.solver.forces;
        forces.tangential.clear();
        let mut before = None;
        forces.tangential.extend(rows.iter().map(|row| {
            let first = before != Some(row.contact);
            before = Some(row.contact);
            if first {
                list[row.contact].tangential_force
            } else {
                0.0
            }
        }));
        self.solver.read_states(&self.problem);
    }

    /// Puts the forces found, and what their contacts do, into `list`.
    fn keep_forces(&mut self) {
        for (contact, &f) in self.list.iter_mut().zip(&self.solver.forces.normal) {
            contact.normal_force = f;
            contact.tangential_force = 0.0;
            contact.state = ContactState::Frictionless;
        }
        let mut before = None;
        for (m, row) in self.problem.tangential.iter().enumerate() {
            let first = before != Some(row.contact);
            before = Some(row.contact);
            // The second row of a contact is that of its spin.
            if first {
                let contact = &mut self.list[row.contact];
                contact.tangential_force = self.solver.forces.tangential[m];
                contact.state = match self.solver.states.grip[m] {
                    Grip::Off => ContactState::Frictionless,
                    Grip::Stick => ContactState::Rolling,
                    Grip::Plus | Grip::Minus => ContactState::Slipping,
                };
            }
        }
    }
}

/// How much nearer than h a pair is, with what the first stage's motion takes back.
fn overlap_of(posed: &Posed<'_>, contact: &Contact) -> Overlap {
    let roughness = posed.laws.surface.roughness;
    let taken_back = posed.span.time * posed.span.taken_back(contact);
    let now = roughness - (contact.pair.gap - taken_back);
    Overlap {
        now,
        reference: now,
        touching: contact.pair.gap < roughness,
        background: contact.background[0],
    }
}

/// The normal velocity above which a pair bears no force.
fn parting_velocity(posed: &Posed<'_>, contact: &Contact) -> f64 {
    let (overlap, held) = (overlap_of(posed, contact), posed.span.phase != Phase::Alone);
    let normal = &posed.laws.normal;
    normal.parting_velocity(&overlap, posed.span.time, held)
}

/// Linearises curved laws about where the contacts are now, where they are not near enough; how many were not.
fn refine(
    posed: &Posed<'_>,
    problem: &mut Problem,
    overlaps: &mut [Overlap],
    forces: &Forces,
    enough: f64,
) -> usize {
    let law = &posed.laws.normal;
    if law.is_rigid() {
        return 0;
    }
    let time = posed.span.time;
    let largest = forces.normal.iter().fold(1.0_f64, |most, f| most.max(*f));
    let near = LINEARISED.max(enough) * largest;
    let mut found = 0;
    for (k, (entry, overlap)) in problem.normal.iter_mut().zip(overlaps).enumerate() {
        let f = forces.normal[k];
        let velocity = forces.slack[k] - entry.bias - entry.compliance * f + overlap.background;
        if let Some(refined) = law.refine(overlap, [velocity, f.max(0.0)], time, near) {
            [entry.bias, entry.compliance] = refined;
            found += 1;
        }
    }
    found
}

/// The paper's protocol asks for parts of the problem.
impl ContactSolver {
    /// Forces of either sign that halt all candidates at once, without friction; the largest velocity left.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(super) fn halt_all(
        &mut self,
        resistance: &Resistance,
        forces: &[f64],
    ) -> Result<f64, Error> {
        let (problem, solver) = (&mut self.problem, &mut self.solver);
        solver.states.closed.clear();
        solver.states.closed.resize(problem.normal.len(), true);
        solver.states.grip.clear();
        solver.forces.clear();
        let solved = match &mut self.backend {
            Backend::Dense(system) => {
                system.begin(resistance, problem, forces);
                solver.solve_states(problem, &mut **system).0
            }
            Backend::Sparse(system) => {
                system.start();
                let driving = Driving::by(forces);
                let mut on_network = OnNetwork::begin(resistance, system, problem, driving)?;
                solver.solve_states(problem, &mut on_network).0
            }
        };
        if !solved {
            solver.forces.normal.fill(0.0);
            return Ok(f64::INFINITY);
        }
        Ok(problem::largest(&solver.forces.slack))
    }

    /// The slip that the normal forces at hand leave, in the tangential rows of the problem.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(super) fn measure_slip(
        &mut self,
        resistance: &Resistance,
        forces: &[f64],
    ) -> Result<(), Error> {
        let (problem, solver) = (&self.problem, &mut self.solver);
        solver.forces.tangential.clear();
        solver
            .forces
            .tangential
            .resize(problem.tangential.len(), 0.0);
        match &mut self.backend {
            Backend::Dense(system) => {
                system.begin_rows(resistance, problem);
                system.measure(problem, &mut solver.forces);
            }
            Backend::Sparse(system) => {
                let driving = Driving::by(forces);
                OnNetwork::begin(resistance, system, problem, driving)?
                    .measure(problem, &mut solver.forces);
            }
        }
        Ok(())
    }

    /// Velocities `[3N]` under the forces at hand.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(super) fn move_under_forces(
        &mut self,
        resistance: &Resistance,
        forces: &[f64],
        velocities: &mut [f64],
    ) -> Result<(), Error> {
        match &mut self.backend {
            Backend::Dense(system) => system.finish(resistance, &self.solver.forces, velocities),
            Backend::Sparse(system) => {
                let driving = Driving::by(forces);
                OnNetwork::begin(resistance, system, &self.problem, driving)?
                    .measure(&self.problem, &mut self.solver.forces);
                velocities.copy_from_slice(system.velocities()[0]);
            }
        }
        self.take_motion(velocities);
        Ok(())
    }
}
