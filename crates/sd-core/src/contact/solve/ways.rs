//! Ways to the solution where Newton's method goes in circles: paths, the shortest first.
//!
//! Mostly a path from the forces at hand is short, and if it is not, one from those of contacts that open as they slide. Those are found
//! without fail where the layer can move at all, and from them one convex problem after the other leads near the solution.

use super::cone::Cones;
use super::newton::{BoxSolver, Ended, Onset, PATIENCE};
use super::path::{Begin, PathEnd};
use super::problem::{Forces, Problem, System};
use crate::contact::Quality;

/// Convex problems on the way from one in which contacts open as they slide, after which a path is tried.
const APPROACHES: [u32; 3] = [16, 64, 256];

/// Ways to the solution, in the order in which they are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    /// From the forces at hand.
    Here,
    /// From the solution for contacts that open as they slide, if there is one.
    Cones,
    /// Without forces, on the longest path, where the layer can move.
    Apart,
    /// Without forces: what is left, and where the layer may be jammed.
    Open,
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
        let mut cones = self.cones.take().unwrap_or_default();
        let (mut systems, mut can_move) = (0, None);
        let mut found = (Ended::Failed, false);
        for way in [Way::Here, Way::Cones, Way::Apart, Way::Open] {
            let (end, more) = match way {
                Way::Here => self.follow_path(problem, system, Begin::Here),
                Way::Cones => {
                    can_move = cones.jam(problem, system).map(|jams| !jams);
                    if can_move != Some(true) {
                        continue;
                    }
                    self.approach(&mut cones, problem, system)
                }
                Way::Apart if can_move == Some(true) => {
                    self.follow_path(problem, system, Begin::Apart)
                }
                Way::Apart => continue,
                Way::Open => self.follow_path(problem, system, Begin::Open),
            };
            systems += more;
            // The ray of a path that does not begin without forces says nothing.
            if end == PathEnd::Ray && way == Way::Open && can_move != Some(true) {
                found = (Ended::Failed, true);
                break;
            }
            if end == PathEnd::Solved {
                let (ended, more) = self.newton(problem, system, onset, PATIENCE, refine);
                systems += more;
                // Forces that only the compliance of rigid contacts bounds are rounding errors, and contradict the conditions.
                if ended != Ended::Failed
                    && !(self.is_unbounded()
                        && self.merit(problem, system).residual > Quality::RESIDUAL_LIMIT)
                {
                    found = (ended, false);
                    break;
                }
            }
        }
        if found == (Ended::Failed, false) && can_move == Some(false) {
            found.1 = true;
            self.forces.copy_from(cones.forces());
            self.clip(problem);
            system.measure(problem, &mut self.forces);
        }
        self.cones = Some(cones);
        (found.0, found.1, systems)
    }

    /// From the solution for contacts that open as they slide to that of the problem, where the layer can move.
    fn approach(
        &mut self,
        cones: &mut Cones,
        problem: &mut Problem,
        system: &mut impl System,
    ) -> (PathEnd, u32) {
        let mut systems = 0;
        for count in 1..=APPROACHES[APPROACHES.len() - 1] {
            if !cones.approach(problem, system) {
                break;
            }
            if APPROACHES.contains(&count) {
                self.forces.copy_from(cones.forces());
                let (end, more) = self.follow_path(problem, system, Begin::Here);
                systems += more;
                if end == PathEnd::Solved {
                    return (end, systems);
                }
            }
        }
        (PathEnd::Lost, systems)
    }
}
