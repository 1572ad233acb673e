//! The solution at the end of a path, where guessing what contacts do goes in circles.
//!
//! All forces at hand solve a problem whose slack and slip have something added. What is added is taken away along a line: while no contact
//! changes what it does, forces, slack and slip move straight to those that Newton's method would take at once. Here they stop where the
//! first contact changes (opens, closes, begins or ceases to slide), and go on from there, forwards or, where the contact would not move
//! into its new state, backwards. No state is ever contradicted, no two points of the path are the same, and so it ends: this is Lemke's
//! method (Cottle, Pang & Stone, *The Linear Complementarity Problem*, 1992), in the form of Cao & Ferris (Math. Oper. Res. 21, 1996).
//!
//! Begun without any force, by contacts that all give way at the velocity λ that they need, the path can end in a ray: forces that grow
//! without bound, within the bounds of friction and against each other, while contacts do not give way any less. Coulomb's problem need not
//! have a solution, as it is not the gradient of anything; the layer is then jammed at that instant. What is left at hand are the
//! forces at the beginning of the ray, and contacts that give way at λ. A path that ends neither way says nothing; [`super::cone`] does.

use super::newton::BoxSolver;
use super::problem::{Forces, Grip, Problem, States, System, largest};

/// Changes of state after which a path from forces at hand is given up where layers can jam: one that leads to the solution mostly takes fewer.
const MOST_CHANGES: usize = 300;
/// The same where there is no tableau. With one, where there is less to try besides, it may be twice the contacts and rows if these are more.
const FEW_CHANGES: usize = 100;
/// Force, in mu·a²·rate, above which it grows without bound.
const UNBOUNDED: f64 = 1e8;
/// What a bound on friction is at most on the way, over the load.
pub(super) const MOST_FRICTION: f64 = 100.0;
/// Spread of what is added to the slack of contacts: no two of them change at once.
const SPREAD: f64 = 0.3;
/// The same, as powers of ten, on a path on which contacts close far apart.
const FAR_APART: f64 = 4.0;
/// Changes of state of a path without forces at hand at most, over contacts and rows: of one on which all give way alike, and of such a path.
const MOST_TURNS: [usize; 2] = [10, 200];
/// Multiplications at most of a path without forces at hand: a sixth of a second; half a second for one on which contacts close far apart; and
/// of paths that are tried from many forces, or where there hardly is a solution: five milliseconds.
const MOST_MULTIPLICATIONS: usize = 1_000_000_000;
const FEW_MULTIPLICATIONS: usize = 30_000_000;
const MANY_MULTIPLICATIONS: usize = 3_000_000_000;
/// Exchanges, over contacts and rows, after which a path makes its tableau anew where layers can jam: rounding errors add up.
const WORN: usize = 3;
/// Linear systems for the same states: iterations may stop early.
const MOST_CALLS: u32 = 8;
/// What slack and slip of the wrong sign are at the beginning of a path, in a·rate.
const LEAST_SLACK: f64 = 0.01;
/// By how much a boundary comes later than another for sure, whatever is rounded.
const LATER: f64 = 1.0 + 1e-9;
/// How much longer than usual, and than half a second, paths may be at the last effort.
const LONGER: usize = 10;

/// How much is done for a solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Effort {
    /// What mostly is enough.
    #[default]
    Usual,
    /// Where that was not enough: much longer paths, whose tableaus are made anew before rounding errors add up, and whose ends are taken as
    /// the tableaus have them.
    Last,
}

/// How a path ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PathEnd {
    /// At the solution.
    Solved,
    /// In a ray.
    Ray,
    /// Nowhere: too long, or where the states have no solution.
    Lost,
}

/// What gives the forces of each state on a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum StatesBy {
    /// A linear system each.
    Systems,
    /// The tableau at hand.
    Tableau,
    /// The same, made anew once it is worn.
    RenewedTableau,
}

/// A path as far as it was followed.
struct Walked {
    end: PathEnd,
    /// Changes of state.
    changes: usize,
    /// Linear systems, where there is no tableau.
    systems: u32,
}

/// Where a path begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Begin {
    /// At the forces at hand.
    Here,
    /// Without forces.
    Open,
    /// The same, not as far, and in small layers alone: for problems that hardly have a solution.
    Briefly,
    /// Without forces either, but contacts give way at velocities so different that they close one after another. Such a path is shorter, and
    /// it may take much longer than the others: it is for problems that have a solution.
    Apart,
}

/// A boundary between two states of a contact, named by what happens there.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Edge {
    /// The force of a closed candidate vanishes.
    Opens(usize),
    /// The slack of an open candidate vanishes.
    Closes(usize),
    /// The load of a row falls to the offset.
    Unloads(usize),
    /// The load of a row rises above the offset.
    Loads(usize),
    /// The force of a sticking row reaches its bound, positive or negative.
    Slides(usize, Grip),
    /// The slip of a sliding row vanishes.
    Sticks(usize),
}

impl Edge {
    /// How far a state is from this boundary of it.
    #[inline(always)]
    fn distance(self, problem: &Problem, grip: &[Grip], forces: &Forces) -> f64 {
        let load = |m: usize| forces.normal[problem.tangential[m].contact] - problem.offset;
        match self {
            Self::Opens(k) => forces.normal[k],
            Self::Closes(k) => forces.slack[k],
            Self::Unloads(m) => load(m),
            Self::Loads(m) => -load(m),
            Self::Slides(m, to) => problem.friction * load(m) - to.sign() * forces.tangential[m],
            Self::Sticks(m) => grip[m].sign() * forces.slip[m],
        }
    }

    /// That distance, and what is added to it on the way from one state to another.
    #[inline(always)]
    fn change(self, problem: &Problem, grip: &[Grip], [from, to]: [&Forces; 2]) -> [f64; 2] {
        let distance = self.distance(problem, grip, from);
        [distance, self.distance(problem, grip, to) - distance]
    }

    /// Crosses the boundary; which one it is from the other side.
    fn cross(self, problem: &Problem, states: &mut States, forces: &Forces) -> Self {
        let rows = |k: usize| {
            let rows = problem.tangential.iter().enumerate();
            rows.filter(move |(_, row)| row.contact == k)
        };
        match self {
            Self::Opens(k) => {
                states.closed[k] = false;
                rows(k).for_each(|(m, _)| states.grip[m] = Grip::Off);
                Self::Closes(k)
            }
            Self::Closes(k) => {
                states.closed[k] = true;
                for (m, row) in rows(k) {
                    if row.acts && problem.offset == 0.0 {
                        states.grip[m] = Grip::sliding(forces.slip[m]);
                    }
                }
                Self::Opens(k)
            }
            Self::Unloads(m) => {
                states.grip[m] = Grip::Off;
                Self::Loads(m)
            }
            Self::Loads(m) => {
                states.grip[m] = Grip::sliding(forces.slip[m]);
                Self::Unloads(m)
            }
            Self::Slides(m, to) => {
                states.grip[m] = to;
                Self::Sticks(m)
            }
            Self::Sticks(m) => {
                let from = states.grip[m];
                states.grip[m] = Grip::Stick;
                Self::Slides(m, from)
            }
        }
    }
}

/// Calls `visit` with the boundaries of all states.
///
/// Inlined, each call knows what kind of boundary it is: on long paths this takes a fifth of the time otherwise.
#[inline(always)]
fn visit_edges(problem: &Problem, states: &States, mut visit: impl FnMut(Edge)) {
    for (k, &closed) in states.closed.iter().enumerate() {
        if closed {
            visit(Edge::Opens(k));
        } else {
            visit(Edge::Closes(k));
        }
    }
    let has_offset = problem.offset > 0.0;
    for (m, row) in problem.tangential.iter().enumerate() {
        if !row.acts || !states.closed[row.contact] {
            continue;
        }
        match states.grip[m] {
            Grip::Off if has_offset => visit(Edge::Loads(m)),
            Grip::Off => {}
            Grip::Stick => {
                visit(Edge::Slides(m, Grip::Plus));
                visit(Edge::Slides(m, Grip::Minus));
            }
            Grip::Plus | Grip::Minus => {
                visit(Edge::Sticks(m));
                if has_offset {
                    visit(Edge::Unloads(m));
                }
            }
        }
    }
}

/// Numbers from 0 to 1 that look random, the same on every machine.
fn spread(number: usize) -> f64 {
    // The golden ratio's multiples are spread evenly.
    (0.618_033_988_749_894_9 * (number + 1) as f64).fract()
}

/// What is added to the slack of a contact, over what all need: such numbers from 1 on.
fn weight(number: usize) -> f64 {
    1.0 + SPREAD * spread(number)
}

impl BoxSolver {
    /// Follows a path to the solution, with friction on the rows where it acts now; how it ended, and how many systems it took.
    ///
    /// The forces left at hand are those of the last point, with the slack and slip that belong to them.
    pub(super) fn follow_path(
        &mut self,
        problem: &mut Problem,
        system: &mut impl System,
        begin: Begin,
    ) -> (PathEnd, u32) {
        let contacts = problem.normal.len() + problem.tangential.len();
        let affordable = |multiplications: usize| multiplications / (contacts * contacts).max(1);
        if begin == Begin::Briefly && affordable(FEW_MULTIPLICATIONS) < contacts {
            // Every contact that bears a force has to close on the way.
            return (PathEnd::Lost, 0);
        }
        let friction = problem.friction;
        problem.friction = friction.min(MOST_FRICTION);
        let has_tableau = self.tableau.begin(problem, system);
        if !has_tableau && begin != Begin::Here {
            // As many systems as there are contacts are never worth it.
            problem.friction = friction;
            return (PathEnd::Lost, 0);
        }
        match begin {
            Begin::Here => self.begin_here(problem, system),
            Begin::Open | Begin::Briefly => self.begin_open(problem, system, weight),
            Begin::Apart => {
                self.begin_open(problem, system, |k| 10_f64.powf(FAR_APART * spread(k)));
            }
        }
        let most = match begin {
            Begin::Here if !has_tableau => FEW_CHANGES,
            Begin::Here if problem.is_steep() => affordable(FEW_MULTIPLICATIONS).min(MOST_CHANGES),
            Begin::Here if problem.can_jam() => MOST_CHANGES,
            Begin::Here => FEW_CHANGES.max(2 * contacts),
            Begin::Open if !problem.can_jam() => MOST_TURNS[0] * contacts,
            Begin::Open => affordable(MOST_MULTIPLICATIONS).min(MOST_TURNS[0] * contacts),
            Begin::Briefly => affordable(FEW_MULTIPLICATIONS).min(MOST_TURNS[0] * contacts),
            Begin::Apart => affordable(MANY_MULTIPLICATIONS).min(MOST_TURNS[1] * contacts),
        };
        let (most, renews) = match self.effort {
            Effort::Usual => (most, problem.can_jam()),
            // More paths, each from other forces, lead there sooner than a long one.
            Effort::Last if begin == Begin::Here && problem.is_steep() => (most, true),
            Effort::Last => {
                let longer = most.min(affordable(MANY_MULTIPLICATIONS));
                (most.max(LONGER * longer), true)
            }
        };
        let states = match (has_tableau, renews) {
            (false, _) => StatesBy::Systems,
            (true, false) => StatesBy::Tableau,
            (true, true) => StatesBy::RenewedTableau,
        };
        let walked = self.walk(problem, system, most, states);
        problem.friction = friction;
        (walked.end, walked.systems)
    }

    /// Follows a path on from the solution at hand, whose problem was [shifted](super::tableau::Tableau::shift) since, to that of the
    /// present one; how it ended, and after how many changes of state.
    pub(super) fn follow_shift(
        &mut self,
        problem: &Problem,
        system: &mut impl System,
        most: usize,
    ) -> (PathEnd, usize) {
        self.point.copy_all_from(&self.forces);
        let walked = self.walk(problem, system, most, StatesBy::RenewedTableau);
        (walked.end, walked.changes)
    }

    /// Goes from the solution at hand towards that of a problem whose slack has `change` added to it, as far as no contact changes what it
    /// does; the share of the way, and so of the change that the problem then has. `None` where the states have no solution.
    pub(super) fn shift_to_boundary(&mut self, problem: &Problem, change: &[f64]) -> Option<f64> {
        self.point.copy_all_from(&self.forces);
        self.tableau.shift(change.iter().copied());
        let solved = self.tableau.solve(problem, &self.states, &mut self.forces);
        let mut share = 1.0_f64;
        visit_edges(problem, &self.states, |edge| {
            let states = [&self.point, &self.forces];
            let [distance, change] = edge.change(problem, &self.states.grip, states);
            if change < 0.0 {
                share = share.min(distance.max(0.0) / -change);
            }
        });
        if !solved || share == 1.0 {
            return solved.then_some(share);
        }
        self.tableau.shift(change.iter().map(|x| (share - 1.0) * x));
        let solved = self.tableau.solve(problem, &self.states, &mut self.forces);
        solved.then_some(share)
    }

    /// Goes on from the point at hand, at most so many changes of state.
    fn walk(
        &mut self,
        problem: &Problem,
        system: &mut impl System,
        most: usize,
        states: StatesBy,
    ) -> Walked {
        let contacts = problem.normal.len() + problem.tangential.len();
        let mut crossed = None;
        let mut walked = Walked {
            end: PathEnd::Lost,
            changes: 0,
            systems: 0,
        };
        while walked.changes < most {
            let is_worn = self.tableau.exchanges() > WORN * contacts;
            if states == StatesBy::RenewedTableau && is_worn {
                self.tableau.clear();
                self.tableau.begin(problem, system);
            }
            let solved = if states == StatesBy::Systems {
                let (solved, more) = self.solve_states(problem, system);
                walked.systems += more;
                solved
            } else {
                self.tableau.solve(problem, &self.states, &mut self.forces)
            };
            if !solved {
                break;
            }
            if let Some(end) = self.go(problem, &mut crossed) {
                walked.end = end;
                break;
            }
            walked.changes += 1;
        }
        if walked.end != PathEnd::Solved {
            self.forces.copy_from(&self.point);
            self.clip(problem);
            system.measure(problem, &mut self.forces);
        }
        walked
    }

    /// Forces of either sign that the states at hand give; whether there are any, and how many systems they took.
    pub(crate) fn solve_states(
        &mut self,
        problem: &Problem,
        system: &mut impl System,
    ) -> (bool, u32) {
        for count in 1..=MOST_CALLS {
            match system.solve(problem, &self.states, true, &mut self.forces) {
                Some(noise) if noise.exact => return (true, count),
                Some(_) => {}
                None => return (false, count),
            }
        }
        (false, MOST_CALLS)
    }

    /// The forces at hand, within their bounds, as the first point, with their states and their own slack and slip.
    fn take_point(&mut self, problem: &Problem, system: &mut impl System) {
        self.clip(problem);
        self.read_states(problem);
        system.measure(problem, &mut self.forces);
        self.point.copy_all_from(&self.forces);
    }

    /// Begins without forces, by contacts that all give way.
    ///
    /// `weight`: of what is added to the slack of each contact.
    fn begin_open(
        &mut self,
        problem: &Problem,
        system: &mut impl System,
        weight: impl Fn(usize) -> f64,
    ) {
        self.forces.normal.fill(0.0);
        self.forces.tangential.fill(0.0);
        self.take_point(problem, system);
        let slack = &mut self.point.slack;
        let needed = slack.iter().enumerate();
        let gives = needed.fold(0.0_f64, |most, (k, w)| most.max(-w / weight(k)));
        for (k, slack) in slack.iter_mut().enumerate() {
            *slack += gives * weight(k);
        }
    }

    /// Begins at the forces at hand, with slack and slip that their states allow.
    fn begin_here(&mut self, problem: &Problem, system: &mut impl System) {
        self.take_point(problem, system);
        let point = &mut self.point;
        for (k, slack) in point.slack.iter_mut().enumerate() {
            *slack = if self.states.closed[k] {
                0.0
            } else {
                slack.max(LEAST_SLACK * weight(k))
            };
        }
        for (m, slip) in point.slip.iter_mut().enumerate() {
            let sign = self.states.grip[m].sign();
            if sign != 0.0 {
                *slip = sign * (sign * *slip).max(LEAST_SLACK * weight(m));
            } else if self.states.grip[m] == Grip::Stick {
                *slip = 0.0;
            }
        }
    }

    /// Goes on towards the forces at hand, or away from them, to the first boundary, and crosses it; how the path ended, if it did.
    fn go(&mut self, problem: &Problem, crossed: &mut Option<Edge>) -> Option<PathEnd> {
        let (from, to) = (&self.point, &self.forces);
        let change = |edge: Edge| edge.change(problem, &self.states.grip, [from, to]);
        // What was crossed is left behind.
        let direction = crossed.map_or(1.0, |edge| change(edge)[1].signum());
        let mut first: Option<(Edge, [f64; 2])> = None;
        visit_edges(
            problem,
            &self.states,
            #[inline(always)]
            |edge| {
                if *crossed == Some(edge) {
                    return;
                }
                let [distance, change] = change(edge);
                let (left, speed) = (distance.max(0.0), -direction * change);
                // Hardly any boundary comes into question: the others are not worth a division.
                if speed > 0.0 && first.is_none_or(|(_, [t, _])| left <= LATER * t * speed) {
                    let time = left / speed;
                    if first.is_none_or(|(_, [t, s])| time < t || time == t && speed > s) {
                        first = Some((edge, [time, speed]));
                    }
                }
            },
        );
        let time = first.map_or(f64::INFINITY, |(_, [time, _])| time);
        if direction < 0.0 && time.is_infinite() {
            return Some(PathEnd::Lost);
        }
        let share = direction * if direction > 0.0 { time.min(1.0) } else { time };
        let reach = |from: &[f64], to: &[f64]| {
            let pairs = from.iter().zip(to);
            pairs.fold(0.0_f64, |most, (a, b)| {
                most.max((a + share * (b - a)).abs())
            })
        };
        if reach(&from.normal, &to.normal) > UNBOUNDED {
            return Some(PathEnd::Ray);
        }
        if share >= 1.0 {
            return Some(PathEnd::Solved);
        }
        let step = |from: &mut [f64], to: &[f64]| {
            for (a, b) in from.iter_mut().zip(to) {
                *a += share * (b - *a);
            }
        };
        step(&mut self.point.normal, &to.normal);
        step(&mut self.point.tangential, &to.tangential);
        step(&mut self.point.slack, &to.slack);
        step(&mut self.point.slip, &to.slip);
        let (edge, _) = first?;
        *crossed = Some(edge.cross(problem, &mut self.states, &self.point));
        None
    }

    /// Whether forces are at hand that only the compliance of rigid contacts bounds.
    pub(super) fn is_unbounded(&self) -> bool {
        largest(&self.forces.normal) > UNBOUNDED
    }
}
