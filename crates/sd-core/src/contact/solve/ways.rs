//! Ways to the solution where Newton's method goes in circles: paths, the shortest first.
//!
//! Mostly a path from the forces at hand is short, and if it is not, one from those of contacts that open as they slide. Those are found
//! without fail where the layer can move at all, and from them one convex problem after the other leads near the solution.

use super::cone::Cones;
use super::newton::{BoxSolver, Ended, Onset, PATIENCE};
use super::path::{Begin, Effort, MOST_FRICTION, PathEnd};
use super::problem::{Forces, Problem, System};
use crate::contact::Quality;

/// Convex problems on the way from one in which contacts open as they slide, after which a path is tried: after few, and then time and again.
const FIRST_TRIES: [u32; 3] = [16, 64, 256];
const TRIES: u32 = 512;
/// Such problems at most.
const MOST_APPROACHES: u32 = 8192;
/// The same where friction is steep, and leaps lead past most of these problems: mostly they are seen to arrive. Where they are not, they lead
/// around the solution, and a path from any of them may lead there.
const FIRST_STEEP_TRY: u32 = 256;
const STEEP_TRIES: u32 = 128;
const MOST_STEEP_APPROACHES: u32 = 2048;
/// Times that what rounding left in the forces at the end of a path is taken off.
const MOST_REFINEMENTS: u32 = 5;

/// The problem whose solution is looked for, and how many systems that took so far.
struct Search<'a, S, R> {
    problem: &'a mut Problem,
    system: &'a mut S,
    onset: Onset,
    refine: &'a mut R,
    systems: u32,
}

impl BoxSolver {
    /// Tries one way after the other, the shortest first, until one leads to the solution or shows that there is none; whether the layer is
    /// jammed, and how many systems that took.
    pub(super) fn find_out(
        &mut self,
        problem: &mut Problem,
        system: &mut impl System,
        onset: Onset,
        refine: &mut impl FnMut(&mut Problem, &Forces) -> usize,
    ) -> (Ended, bool, u32) {
        let mut search = Search {
            problem,
            system,
            onset,
            refine,
            systems: 0,
        };
        if self.effort == Effort::Last {
            // Friction without a limit can leave no states that agree: it holds on to contacts that bear nothing.
            search.problem.friction = search.problem.friction.min(MOST_FRICTION);
        }
        let mut cones = self.cones.take().unwrap_or_default();
        let (ended, jammed) = self.try_ways(&mut search, &mut cones);
        self.cones = Some(cones);
        (ended, jammed, search.systems)
    }

    /// How it ended, and whether the layer is jammed.
    fn try_ways<S: System, R: FnMut(&mut Problem, &Forces) -> usize>(
        &mut self,
        search: &mut Search<'_, S, R>,
        cones: &mut Cones,
    ) -> (Ended, bool) {
        if let (_, Some(ended)) = self.try_path(search, Begin::Here) {
            return (ended, false);
        }
        let jams = cones.jam(search.problem, search.system, self.effort);
        if jams == Some(false) {
            let ended = self
                .approach(search, cones)
                .or_else(|| self.try_path(search, Begin::Apart).1);
            if ended.is_none() {
                self.take_forces(search, cones);
            }
            return (ended.unwrap_or(Ended::Failed), false);
        }
        // Forces that balance without motion do not exclude a solution. Where friction is steep one beside them is not worth a long path.
        let begin = if jams == Some(true) && search.problem.is_steep() {
            Begin::Briefly
        } else {
            Begin::Open
        };
        match self.try_path(search, begin) {
            (_, Some(ended)) => (ended, false),
            (PathEnd::Ray, None) => (Ended::Failed, true),
            _ if jams == Some(true) => {
                self.take_forces(search, cones);
                (Ended::Failed, true)
            }
            _ => (Ended::Failed, false),
        }
    }

    /// From the solution for contacts that open as they slide to that of the problem, where the layer can move; how that ended, if there.
    fn approach<S: System, R: FnMut(&mut Problem, &Forces) -> usize>(
        &mut self,
        search: &mut Search<'_, S, R>,
        cones: &mut Cones,
    ) -> Option<Ended> {
        let steep = search.problem.is_steep();
        // At the last effort there are more paths, as they are no longer.
        let most = if steep && self.effort == Effort::Usual {
            MOST_STEEP_APPROACHES
        } else {
            MOST_APPROACHES
        };
        for count in 1..=most {
            if !cones.approach(search.problem, search.system) {
                break;
            }
            let last = cones.are_spent();
            let due = if steep {
                cones.have_arrived()
                    || count >= FIRST_STEEP_TRY && count.is_multiple_of(STEEP_TRIES)
            } else {
                FIRST_TRIES.contains(&count) || count.is_multiple_of(TRIES)
            };
            if last || due {
                self.forces.copy_from(cones.forces());
                if let (_, Some(ended)) = self.try_path(search, Begin::Here) {
                    return Some(ended);
                }
            }
            if last {
                break;
            }
        }
        None
    }

    /// Follows a path and, from its end, Newton's method; how the path ended, and how it all ended if at the solution or where a row is
    /// missing.
    fn try_path<S: System, R: FnMut(&mut Problem, &Forces) -> usize>(
        &mut self,
        search: &mut Search<'_, S, R>,
        begin: Begin,
    ) -> (PathEnd, Option<Ended>) {
        let (problem, system) = (&mut *search.problem, &mut *search.system);
        let (end, more) = self.follow_path(problem, system, begin);
        search.systems += more;
        if end != PathEnd::Solved {
            return (end, None);
        }
        if self.effort == Effort::Last
            && self.settle(problem, system)
            && (search.refine)(problem, &self.forces) == 0
        {
            return (end, Some(Ended::Solved));
        }
        let (ended, more) = self.newton(problem, system, search.onset, PATIENCE, search.refine);
        search.systems += more;
        // Forces that only the compliance of rigid contacts bounds are rounding errors, and contradict the conditions.
        let contradicts =
            self.is_unbounded() && self.merit(problem, system).residual > Quality::RESIDUAL_LIMIT;
        (
            end,
            (ended != Ended::Failed && !contradicts).then_some(ended),
        )
    }

    /// Solves the states at the end of a path by a tableau made anew; whether the conditions hold.
    ///
    /// Where forces of nearly rigid networks answer to hardly any motion, the iterated systems of Newton's method are wrong by more than what
    /// tells one state from another, and lead away from the solution. A tableau is exact but for its rounding errors, which show as
    /// velocities that contradict its states: those are measured, and taken off.
    fn settle(&mut self, problem: &Problem, system: &mut impl System) -> bool {
        self.tableau.clear();
        if !self.tableau.begin(problem, system) {
            return false;
        }
        for _ in 0..MOST_REFINEMENTS {
            if !self.tableau.solve(problem, &self.states, &mut self.forces) {
                return false;
            }
            self.point.copy_all_from(&self.forces);
            system.measure(problem, &mut self.forces);
            let merit = self.merit(problem, system);
            if Quality::holds(merit.residual, merit.friction_error) {
                return true;
            }
            let measured = self.forces.slack.iter().chain(&self.forces.slip);
            let expected = self.point.slack.iter().chain(&self.point.slip);
            self.tableau
                .shift(measured.zip(expected).map(|(y, x)| y - x));
        }
        false
    }

    /// Takes the forces of the last convex problem, within their bounds.
    fn take_forces<S: System, R>(&mut self, search: &mut Search<'_, S, R>, cones: &Cones) {
        self.forces.copy_from(cones.forces());
        self.clip(search.problem);
        search.system.measure(search.problem, &mut self.forces);
    }
}
