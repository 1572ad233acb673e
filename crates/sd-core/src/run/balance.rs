//! The critical load at which a stage carries the imposed stress.
//!
//! ```text
//! σ* = σ a²/F_crit  imposed;   in units of the flow σ = η and F_crit = φ = 6π/Γ:     h(φ) = η(φ)/σ* − φ = 0
//! ```
//!
//! η decreases with φ, since fewer contacts then have friction. If friction sets in with a jump, η
//! jumps too, and h may change sign without a zero. Springs and a repulsion are in units of F_crit:
//! with them η increases with φ, and if it grows so fast that no φ is large enough, the
//! spheres carry the stress at rest.

use crate::stress::JAM_VISCOSITY;

/// Maximum ratio of successive loads while only one side is known.
const STRIDE: f64 = 8.0;
/// Viscosity, over that of a jammed run, at which the search stops.
const CEILING: f64 = 1e3;

/// The next action after a trial load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Next {
    /// The spheres carry the stress at this load.
    Found,
    /// Try this load.
    Try(f64),
    /// The spheres carry the stress at rest.
    AtRest,
}

/// A search for the load, from an initial guess.
#[derive(Debug, Clone, Copy)]
pub(super) struct Balance {
    /// σ*.
    stress: f64,
    /// Tolerance of h over φ.
    close: f64,
    /// Largest load at which h > 0, and smallest at which h < 0.
    low: Option<f64>,
    high: Option<f64>,
    /// The previous load and its h.
    last: Option<[f64; 2]>,
}

impl Balance {
    pub(super) fn new(stress: f64, close: f64) -> Self {
        Self {
            stress,
            close,
            low: None,
            high: None,
            last: None,
        }
    }

    /// The load in balance with a viscosity.
    pub(super) fn load_of(&self, viscosity: f64) -> f64 {
        viscosity / self.stress
    }

    /// Adds the viscosity computed at a load.
    pub(super) fn after(&mut self, load: f64, viscosity: f64) -> Next {
        let excess = self.load_of(viscosity) - load;
        if excess.abs() <= self.close * load {
            return Next::Found;
        }
        let secant = self.last.and_then(|[before, excess_before]| {
            let slope = (excess - excess_before) / (load - before);
            (slope < 0.0).then(|| load - excess / slope)
        });
        // Secants that do not reduce h are postponed until the bracket is narrower.
        let slow = self
            .last
            .is_some_and(|[_, before]| excess.abs() > 0.5 * before.abs());
        self.last = Some([load, excess]);
        if excess > 0.0 {
            self.low = Some(load);
        } else {
            self.high = Some(load);
        }
        let guess = secant.unwrap_or(load + excess);
        Next::Try(match (self.low, self.high) {
            (Some(low), Some(high)) => {
                if guess > low && guess < high && !slow {
                    guess
                } else {
                    (low * high).sqrt()
                }
            }
            (Some(low), None) => {
                if low >= self.load_of(CEILING * JAM_VISCOSITY) {
                    return Next::AtRest;
                }
                // The guess of an unbracketed search is often slightly too small.
                guess.clamp(low * (1.0 + 2.0 * self.close), STRIDE * low)
            }
            (None, Some(high)) => {
                // The load in balance with this viscosity is a good guess from any distance above.
                let needed = self.load_of(viscosity);
                let least = if needed > 0.0 {
                    needed.min(high / STRIDE)
                } else {
                    high / STRIDE
                };
                guess.clamp(least, high * (1.0 - 2.0 * self.close))
            }
            (None, None) => unreachable!("one side was just found"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLOSE: f64 = 1e-10;

    /// The resulting load, if any, and the number of viscosities evaluated.
    fn search(stress: f64, from: f64, viscosity: impl Fn(f64) -> f64) -> (Option<f64>, u32) {
        let mut balance = Balance::new(stress, CLOSE);
        let mut load = from;
        for count in 1..200 {
            match balance.after(load, viscosity(load)) {
                Next::Found => return (Some(load), count),
                Next::AtRest => return (None, count),
                Next::Try(next) => load = next,
            }
        }
        (None, 200)
    }

    #[test]
    fn springs_without_look_ahead_are_found_in_closed_form() {
        // η = 5 + 0.3 φ at σ* = 2: φ = 5/(2 − 0.3), found by one secant.
        let (load, count) = search(2.0, 1.0, |load| 5.0 + 0.3 * load);
        assert!((load.unwrap() - 5.0 / 1.7).abs() < 1e-9);
        assert_eq!(count, 3);
    }

    #[test]
    fn smooth_thickening_is_found_in_a_few_steps() {
        let viscosity = |load: f64| 6.0 + 14.0 / (1.0 + load * load / 9.0);
        for (stress, from) in [(0.1, 3.0), (1.0, 3.0), (3.0, 3.0), (30.0, 3.0), (3.0, 1e6)] {
            let (load, count) = search(stress, from, viscosity);
            let load = load.unwrap();
            assert!((viscosity(load) / (stress * load) - 1.0).abs() < 1e-9);
            assert!(count < 12, "{count} at {stress}");
        }
    }

    #[test]
    fn stress_that_springs_bear_at_rest_has_no_load() {
        assert_eq!(search(2.0, 1.0, |load| 5.0 + 2.5 * load).0, None);
    }

    #[test]
    fn jump_over_the_balance_is_bracketed() {
        // h jumps from above to below 0 at φ = 4.
        let viscosity = |load: f64| if load < 4.0 { 10.0 } else { 6.0 };
        let mut balance = Balance::new(2.0, CLOSE);
        let mut load = 1.0;
        for _ in 0..60 {
            match balance.after(load, viscosity(load)) {
                Next::Try(next) => load = next,
                other => panic!("{other:?}"),
            }
        }
        assert!((load - 4.0).abs() < 1e-6, "{load}");
    }

    #[test]
    fn viscosity_below_zero_requires_a_smaller_load() {
        // Repulsion that pulls along the flow: η = 5 − 3 φ.
        let (load, _) = search(2.0, 10.0, |load| 5.0 - 3.0 * load);
        assert!((load.unwrap() - 1.0).abs() < 1e-9);
    }
}
