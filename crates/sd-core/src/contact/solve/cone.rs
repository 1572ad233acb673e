//! Whether forces within the bounds of friction balance on all spheres however large they are.
//!
//! Coulomb's problem is not convex, as contacts that slide do not open. If they opened as they slide, at ν times the velocity of the slip, it
//! would be: each contact would push along the edges of its friction cone alone, x ≥ 0, where the edge's own velocity y is at least 0,
//!
//! ```text
//! f = x₊ + x₋,   t = ν (x₊ − x₋),   y = w ∓ ν z,   x y = 0
//! ```
//!
//! and a second row of friction doubles the edges. [Lemke's method](super::path) always ends for that problem, and soon, since hardly any edge
//! changes twice. It ends in a ray exactly where there are forces within the cones that balance on every sphere and that the flow works
//! against: a jammed layer. Otherwise no such forces exist, and Coulomb's problem has a solution too (Acary, Cadoux, Lemaréchal & Malick, Z.
//! Angew. Math. Mech. 91, 2011).
//!
//! That solution is where contacts open by ν times the velocity of their slip less than they would so. What they open too much is added to
//! their slack, at the slips of the problem before, and the convex problem solved again: a fixed point of this is the solution. Each problem
//! differs little from the one before, and its path crosses few boundaries.
//!
//! Where friction is steep that takes thousands of problems. Most of them change nothing but the forces, in the same direction as the one before
//! and by nearly as much, and are left out: as long as no edge changes what it does the fixed point is linear, and all changes to come add up to
//! a geometric series (Aitken). A leap leads to the end of the series, or as far as the first boundary, beyond which the direction is another.
//! Where the changes grow, the end of the series lies behind: at a fixed point that repels.

use super::newton::BoxSolver;
use super::path::{Begin, Effort, PathEnd};
use super::problem::{Forces, Noise, Normal, Problem, States, System, largest};
use crate::linalg::dense::{Matrix, add_scaled, dot};

/// Friction of an edge over its normal force, at most: of friction without a limit too. Forces within narrower cones are within wider ones.
const STEEPEST: f64 = 10.0;
/// Changes of state from one convex problem to the next, over edges, at most.
const MOST_CHANGES: usize = 10;
/// The same through all of them.
const MOST_CHANGES_IN_ALL: usize = 25;
/// Problems between two leaps at least: what changes in other directions dies away in them.
const STEADY: u32 = 2;
/// Cosine between the directions of two changes above which they have one direction.
const ALIGNED: f64 = 0.999;
/// Problems left out by a leap at most, which no boundary ends.
const FARTHEST: f64 = 1e4;
/// What contacts open too much, in a·rate, where a leap has led near the fixed point; and by how much nearer it is before that is said again.
const NEAR: f64 = 0.01;
const NEARER: f64 = 0.1;
/// Compliance of an edge, over its mobility.
const COMPLIANCE: f64 = 1e-10;

/// An edge of the cone of a contact.
#[derive(Debug, Clone, Copy)]
struct Edge {
    /// Its candidate.
    contact: usize,
    /// Rows in which friction acts, and what it is there over the normal force.
    rows: [Option<(usize, f64)>; 2],
}

impl Edge {
    /// Rows in which friction acts.
    fn rows(&self) -> impl Iterator<Item = (usize, f64)> {
        self.rows.into_iter().flatten()
    }
}

/// The edges of all cones as contacts without friction, with their workspace.
#[derive(Debug, Default)]
pub(super) struct Cones {
    edges: Edges,
    /// What is added to the slack of each contact in the problem at hand, and how that changes for each edge.
    added: Vec<f64>,
    change: Vec<f64>,
    /// What each contact opens too much in the solution at hand; that beyond what is added; the same one problem before; and how many
    /// problems there were since the last leap.
    opens: Vec<f64>,
    excess: [Vec<f64>; 2],
    since_leap: u32,
    /// Whether the last leap met no boundary, nor did any problem since; and what counts as near then.
    has_landed: bool,
    near: f64,
    /// Changes of state from one convex problem to the next, of all so far.
    changes: usize,
    /// The convex problem: a normal force for each edge.
    problem: Problem,
    solver: BoxSolver,
}

/// The edges of all contacts, ordered by contact.
#[derive(Debug, Default)]
struct Edges {
    list: Vec<Edge>,
    /// How forces of contacts and rows move them, and how one edge does.
    matrix: Matrix,
    moves: Vec<f64>,
    /// Forces of the contacts that edges push.
    forces: Forces,
}

impl Edges {
    /// The contacts of a problem as edges have them.
    fn seen_in<'a, S>(&'a mut self, problem: &'a Problem, system: &'a mut S) -> OnEdges<'a, S> {
        OnEdges {
            system,
            problem,
            edges: self,
        }
    }

    /// Takes the contacts of a problem, with edges as steep as `friction`.
    fn take(&mut self, problem: &Problem, friction: f64) {
        self.list.clear();
        let mut rows = problem.tangential.iter().enumerate().peekable();
        for contact in 0..problem.normal.len() {
            let first = self.list.len();
            self.list.push(Edge {
                contact,
                rows: [None; 2],
            });
            while let Some((m, row)) = rows.next_if(|(_, row)| row.contact == contact) {
                if !row.acts {
                    continue;
                }
                for at in first..self.list.len() {
                    let mut other = self.list[at];
                    for (edge, slope) in [(&mut self.list[at], friction), (&mut other, -friction)] {
                        if let Some(place) = edge.rows.iter_mut().find(|place| place.is_none()) {
                            *place = Some((m, slope));
                        }
                    }
                    self.list.push(other);
                }
            }
        }
    }

    /// Takes the forces of the contacts of a problem that forces along edges are.
    fn push(&mut self, problem: &Problem, along: &Forces) {
        let both = &mut self.forces;
        for (values, count) in [
            (&mut both.normal, problem.normal.len()),
            (&mut both.tangential, problem.tangential.len()),
        ] {
            values.clear();
            values.resize(count, 0.0);
        }
        for (edge, x) in self.list.iter().zip(&along.normal) {
            both.normal[edge.contact] += x;
            for (m, slope) in edge.rows() {
                both.tangential[m] += slope * x;
            }
        }
    }
}

impl Cones {
    /// Whether there are forces that balance within the bounds and that the flow works against; `None` where that is not known.
    ///
    /// If so, [forces](Self::forces) are then those of contacts that give way as little as they can.
    pub(super) fn jam(
        &mut self,
        problem: &Problem,
        system: &mut impl System,
        effort: Effort,
    ) -> Option<bool> {
        // Friction that is no reaction to the motion has no cone.
        if problem.isolated {
            return None;
        }
        self.take(problem, system);
        self.solver.effort = effort;
        // Where edges are steep, contacts that close one after another come further than those that close as they come.
        let begins: &[Begin] = match effort {
            Effort::Usual => &[Begin::Open, Begin::Apart],
            Effort::Last => &[Begin::Apart],
        };
        let mut on_edges = self.edges.seen_in(problem, system);
        for &begin in begins {
            let (convex, solver) = (&mut self.problem, &mut self.solver);
            match solver.follow_path(convex, &mut on_edges, begin).0 {
                PathEnd::Solved => return Some(false),
                PathEnd::Ray => return Some(true),
                PathEnd::Lost => {}
            }
        }
        None
    }

    /// The forces of the last solution.
    pub(super) fn forces(&self) -> &Forces {
        &self.edges.forces
    }

    /// From the solution of the convex problem at hand to that in which contacts open less, by what they slide now; whether it was found.
    ///
    /// Where friction is steep, to a later one of that kind if those before it change nothing but the forces.
    pub(super) fn approach(&mut self, problem: &Problem, system: &mut impl System) -> bool {
        self.find_excess();
        let steep = problem.is_steep();
        let ahead = if steep { self.problems_ahead() } else { None };
        let mut solved = match ahead {
            // Changes that grow lead away from a fixed point behind, if there is no boundary before it.
            Some(count) if count < 0.0 => {
                self.leap(count) && (self.has_landed || self.leap(FARTHEST))
            }
            Some(count) => self.leap(count),
            None => self.step(problem, system),
        };
        if !solved && steep {
            solved = self.solve_anew(problem, system);
        }
        self.edges.push(problem, &self.solver.forces);
        solved
    }

    /// What contacts open too much, half of what lies between their edges; and how much of that is not added yet.
    fn find_excess(&mut self) {
        self.excess.swap(0, 1);
        let (opens, excess) = (&mut self.opens, &mut self.excess[0]);
        opens.clear();
        let slack = &self.solver.forces.slack;
        let mut first = 0;
        for cone in self.edges.list.chunk_by(|a, b| a.contact == b.contact) {
            let slack = &slack[first..first + cone.len()];
            first += cone.len();
            let least = slack.iter().copied().fold(f64::INFINITY, f64::min);
            let most = slack.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            opens.push(0.5 * (most - least));
        }
        excess.clear();
        excess.extend(opens.iter().zip(&self.added).map(|(x, y)| x - y));
    }

    /// How many problems it is to a fixed point in the direction of the changes, if they have one and no boundary is met before; negative for
    /// one that lies behind.
    fn problems_ahead(&self) -> Option<f64> {
        if self.since_leap < STEADY {
            return None;
        }
        let [now, before] = &self.excess;
        let (product, square) = (dot(now, before), dot(before, before));
        let is_aligned = product > ALIGNED * (dot(now, now) * square).sqrt();
        let slowing = 1.0 - product / square;
        let count = if slowing.abs() * FARTHEST > 1.0 {
            1.0 / slowing
        } else {
            FARTHEST
        };
        is_aligned.then_some(count)
    }

    /// Puts what contacts open too much, so many times, into the change of each edge.
    fn set_change(&mut self, count: f64) {
        let (edges, excess) = (&self.edges.list, &self.excess[0]);
        self.change.clear();
        self.change
            .extend(edges.iter().map(|edge| count * excess[edge.contact]));
    }

    /// Takes what contacts open too much off so many times at once, or as often as no edge changes what it does; whether that has a solution.
    fn leap(&mut self, count: f64) -> bool {
        self.set_change(count);
        let share = self.solver.shift_to_boundary(&self.problem, &self.change);
        let Some(share) = share else {
            return false;
        };
        for (entry, change) in self.problem.normal.iter_mut().zip(&self.change) {
            entry.bias += share * change;
        }
        for (added, excess) in self.added.iter_mut().zip(&self.excess[0]) {
            *added += share * count * excess;
        }
        self.since_leap = 0;
        self.has_landed = share == 1.0 && count < FARTHEST;
        true
    }

    /// Follows the path to the next problem; whether it was found.
    fn step(&mut self, problem: &Problem, system: &mut impl System) -> bool {
        self.set_change(1.0);
        for (entry, change) in self.problem.normal.iter_mut().zip(&self.change) {
            entry.bias += change;
        }
        self.added.clone_from(&self.opens);
        self.solver.tableau.shift(self.change.iter().copied());
        let most = MOST_CHANGES * self.edges.list.len();
        let mut on_edges = self.edges.seen_in(problem, system);
        let (end, changes) = self.solver.follow_shift(&self.problem, &mut on_edges, most);
        self.changes += changes;
        self.since_leap += 1;
        self.has_landed &= changes == 0;
        end == PathEnd::Solved
    }

    /// Solves the problem at hand from the beginning, where rounding errors ended the path to it; whether it was found.
    fn solve_anew(&mut self, problem: &Problem, system: &mut impl System) -> bool {
        self.solver.tableau.clear();
        self.has_landed = false;
        self.since_leap = 0;
        let mut on_edges = self.edges.seen_in(problem, system);
        let (convex, solver) = (&mut self.problem, &mut self.solver);
        solver.follow_path(convex, &mut on_edges, Begin::Open).0 == PathEnd::Solved
    }

    /// Whether leaps have led so near to the fixed point that its states are known; said again only much nearer to it.
    pub(super) fn have_arrived(&mut self) -> bool {
        let arrived = self.has_landed && largest(&self.excess[0]) < self.near;
        if arrived {
            self.near *= NEARER;
        }
        arrived
    }

    /// Whether the convex problems have taken as long as they may.
    pub(super) fn are_spent(&self) -> bool {
        self.changes > MOST_CHANGES_IN_ALL * self.edges.list.len()
    }

    /// Takes the contacts of a problem.
    fn take(&mut self, problem: &Problem, system: &impl System) {
        let friction = problem.friction.min(STEEPEST);
        // Paths among edges ask whether the layer can jam.
        self.problem.friction = friction;
        self.edges.take(problem, friction);
        let normal = &mut self.problem.normal;
        normal.clear();
        // The contacts' own compliance is part of the matrix. Four edges have three directions, which leaves their forces open but for this.
        normal.extend(self.edges.list.iter().map(|edge| {
            let slopes: f64 = edge.rows().map(|(_, slope)| slope * slope).sum();
            Normal {
                compliance: COMPLIANCE * system.mobility(edge.contact) * (1.0 + slopes),
                ..problem.normal[edge.contact]
            }
        }));
        self.changes = 0;
        self.added.clear();
        self.added.resize(problem.normal.len(), 0.0);
        self.since_leap = 0;
        self.has_landed = false;
        self.near = NEAR;
        self.solver.tableau.clear();
        let zeros = &mut self.solver.forces.normal;
        zeros.clear();
        zeros.resize(self.edges.list.len(), 0.0);
    }
}

/// How forces along edges move edges.
struct OnEdges<'a, S> {
    system: &'a mut S,
    problem: &'a Problem,
    edges: &'a mut Edges,
}

impl<S: System> System for OnEdges<'_, S> {
    /// Paths have a tableau here: no system is ever solved.
    fn solve(&mut self, _: &Problem, _: &States, _: bool, _: &mut Forces) -> Option<Noise> {
        None
    }

    fn has_matrix(&self, _: &Problem) -> bool {
        self.system.has_matrix(self.problem)
    }

    fn fill_matrix(&mut self, _: &Problem, matrix: &mut Matrix) -> bool {
        let Edges {
            list,
            matrix: both,
            moves,
            ..
        } = &mut *self.edges;
        if !self.system.fill_matrix(self.problem, both) {
            return false;
        }
        let contacts = self.problem.normal.len();
        for (k, entry) in self.problem.normal.iter().enumerate() {
            both[(k, k)] += entry.compliance;
        }
        for (m, row) in self.problem.tangential.iter().enumerate() {
            both[(contacts + m, contacts + m)] -= row.compliance;
        }
        matrix.reshape(list.len(), list.len());
        for (column, pushed) in list.iter().enumerate() {
            // What the edge moves: its contact's normal force, and the friction that goes with it.
            moves.clear();
            moves.resize(both.rows(), 0.0);
            for (m, slope) in pushed.rows() {
                add_scaled(moves, both.column(contacts + m), slope);
            }
            add_scaled(moves, both.column(pushed.contact), 1.0);
            for (entry, moved) in matrix.column_mut(column).iter_mut().zip(&*list) {
                let slip = moved.rows().map(|(m, slope)| slope * moves[contacts + m]);
                *entry = moves[moved.contact] - slip.sum::<f64>();
            }
        }
        true
    }

    fn measure(&mut self, convex: &Problem, forces: &mut Forces) {
        self.edges.push(self.problem, forces);
        let Edges {
            list, forces: both, ..
        } = &mut *self.edges;
        self.system.measure(self.problem, both);
        forces.slack.clear();
        let pushed = convex.normal.iter().zip(&forces.normal);
        forces
            .slack
            .extend(list.iter().zip(pushed).map(|(edge, (entry, x))| {
                let slip = edge.rows().map(|(m, slope)| slope * both.slip[m]);
                let changed = entry.bias - self.problem.normal[edge.contact].bias;
                both.slack[edge.contact] + changed - slip.sum::<f64>() + entry.compliance * x
            }));
        forces.slip.clear();
    }

    fn mobility(&self, candidate: usize) -> f64 {
        self.system.mobility(self.edges.list[candidate].contact)
    }
}
