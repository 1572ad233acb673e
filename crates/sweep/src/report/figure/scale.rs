//! Axes of a figure: their ends, ticks and breaks.

use crate::text::format::power_of_ten;
use serde::Serialize;

/// An axis.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Scale {
    pub(super) label: String,
    /// Its ends, in the units of the points.
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) logarithmic: bool,
    /// Positions of ticks and their labels.
    pub(super) ticks: Vec<(f64, String)>,
    /// Positions of short ticks without labels.
    pub(super) minor: Vec<f64>,
    /// Positions where the axis is broken, next to 0 and infinity.
    pub(super) breaks: Vec<f64>,
}

impl Scale {
    /// A horizontal axis of decades with plateaus at its ends, in coordinates of [`LogAxis`].
    pub(super) fn of_decades(label: String, log: LogAxis) -> Self {
        // Without a plateau an axis ends close to its numbers, if two decades remain to be
        // labelled.
        let [first, last] = [log.ends[0] - 0.3, log.ends[1] + 0.3];
        let is_enough = last.floor() > first.ceil();
        let [mut low, mut high] = if is_enough {
            [first, last]
        } else {
            [log.low - 0.4, log.high + 0.4]
        };
        if log.zero {
            low = log.low - 1.4;
        }
        if log.infinite {
            high = log.high + 1.4;
        }
        let crowded = if high - low > 8.5 { 2.0 } else { 1.0 };
        let is_inside = |place: &f64| (low..=high).contains(place);
        // Adding 0 makes 0 of -0, which would be shown with its sign.
        let first = (low.max(log.low - 0.5) / crowded).ceil() * crowded + 0.0;
        let places = std::iter::successors(Some(first), |place| Some(place + crowded));
        let decades: Vec<f64> = places
            .take_while(|p| *p <= high.min(log.high + 0.5))
            .collect();
        let words = decade_words(&decades);
        let zero = log.zero.then(|| (log.low - 1.0, "0".to_owned()));
        let infinite = log.infinite.then(|| (log.high + 1.0, "∞".to_owned()));
        let named = decades.into_iter().zip(words);
        let ticks = zero.into_iter().chain(named).chain(infinite);
        let sides = [
            log.zero.then_some(log.low - 0.5),
            log.infinite.then_some(log.high + 0.5),
        ];
        let minor = if crowded > 1.0 {
            Vec::new()
        } else {
            between_decades(low.max(log.low - 0.4), high.min(log.high + 0.4))
        };
        Self {
            label,
            low,
            high,
            logarithmic: false,
            ticks: ticks.filter(|(place, _)| is_inside(place)).collect(),
            minor,
            breaks: sides.into_iter().flatten().filter(is_inside).collect(),
        }
    }

    /// An axis between two numbers, with ticks at round ones.
    pub(super) fn linear(label: String, low: f64, high: f64) -> Self {
        let (step, fine) = step(high - low, 5.0);
        let places = |step: f64| -> Vec<f64> {
            let first = (low / step - 1e-6).ceil();
            let number = count((high / step + 1e-6).floor() - first + 1.0);
            (0..number).map(|n| (first + n as f64) * step).collect()
        };
        let ticks = places(step);
        let [_, largest] = extent(ticks.iter().map(|tick| tick.abs()));
        let decimals = count((-step.log10() - 1e-9).ceil().min(12.0));
        let word = |tick: &f64| {
            if (1e-3..1e5).contains(&largest) {
                format!("{tick:.decimals$}").replace('-', "−")
            } else {
                power_word(*tick)
            }
        };
        Self {
            label,
            low,
            high,
            logarithmic: false,
            ticks: ticks.iter().map(|tick| (*tick, word(tick))).collect(),
            minor: places(fine)
                .into_iter()
                .filter(|place| !ticks.iter().any(|tick| (tick - place).abs() < 0.1 * fine))
                .collect(),
            breaks: Vec::new(),
        }
    }

    /// A logarithmic axis between two positive numbers.
    pub(super) fn logarithmic(label: String, low: f64, high: f64) -> Self {
        let [from, to] = [low.log10(), high.log10()];
        let first = from.floor();
        let decades = std::iter::successors(Some(first), |decade| Some(decade + 1.0))
            .take_while(|decade| *decade <= to);
        let mut all: Vec<f64> = decades.filter(|decade| *decade >= from - 1e-9).collect();
        let span = to - from;
        while all.len() > 7 {
            all = all.into_iter().step_by(2).collect();
        }
        let (ticks, minor) = if span > 1.3 && all.len() > 1 {
            let words = decade_words(&all);
            let ticks = all.iter().map(|decade| 10_f64.powf(*decade)).zip(words);
            let minor = if span > 8.0 {
                Vec::new()
            } else {
                between_decades(from, to)
            };
            (ticks.collect(), minor)
        } else if span > 0.3 {
            // A range so short that 2 and 5 are ticks too.
            let factors: &[f64] = if span > 0.8 {
                &[1.0, 2.0, 5.0]
            } else {
                &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0]
            };
            let places = (0..3).flat_map(|n| {
                let decade = 10_f64.powf(first + f64::from(n));
                factors.iter().map(move |factor| factor * decade)
            });
            let ticks = places
                .filter(|place| (low * (1.0 - 1e-9)..=high * (1.0 + 1e-9)).contains(place))
                .map(|place| (place, plain_word(place)))
                .collect();
            (ticks, between_decades(from, to))
        } else {
            (Self::linear(String::new(), low, high).ticks, Vec::new())
        };
        Self {
            label,
            low,
            high,
            logarithmic: true,
            minor: minor.into_iter().map(|place| 10_f64.powf(place)).collect(),
            ticks,
            breaks: Vec::new(),
        }
    }

    /// Position of a number: 0 at the lower end, 1 at the upper.
    pub(super) fn part(&self, number: f64) -> f64 {
        if self.logarithmic {
            (number / self.low).ln() / (self.high / self.low).ln()
        } else {
            (number - self.low) / (self.high - self.low)
        }
    }

    /// Whether a break lies between two positions.
    pub(super) fn breaks_between(&self, a: f64, b: f64) -> bool {
        let [low, high] = if a < b { [a, b] } else { [b, a] };
        self.breaks.iter().any(|place| (low..high).contains(place))
    }
}

/// The least and the largest of some numbers.
pub(super) fn extent(numbers: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let ends = [f64::INFINITY, f64::NEG_INFINITY];
    let widen = |[low, high]: [f64; 2], number: f64| [low.min(number), high.max(number)];
    numbers.into_iter().fold(ends, widen)
}

/// A small whole number as an integer.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "0 for what is negative"
)]
pub(in crate::report) fn count(number: f64) -> usize {
    number as usize
}

/// Logarithms of 2 to 9 times powers of ten between two logarithms.
fn between_decades(low: f64, high: f64) -> Vec<f64> {
    let first = low.floor();
    std::iter::successors(Some(first), |decade| Some(decade + 1.0))
        .take_while(|decade| *decade <= high)
        .flat_map(|decade| (2..10).map(move |n| decade + f64::from(n).log10()))
        .filter(|place| (low..=high).contains(place))
        .collect()
}

/// A round step that divides a length into about this many parts, and a finer one.
fn step(length: f64, number: f64) -> (f64, f64) {
    let raw = length / number;
    let power = 10_f64.powf(raw.log10().floor());
    let (factor, fine) = match raw / power {
        ..1.5 => (1.0, 0.2),
        ..3.5 => (2.0, 0.5),
        ..7.5 => (5.0, 1.0),
        _ => (10.0, 2.0),
    };
    (factor * power, fine * power)
}

/// A number with the fewest digits that represent it.
fn plain_word(number: f64) -> String {
    if (1e-3..1e5).contains(&number) {
        let digits = format!("{number:.3e}");
        digits
            .parse::<f64>()
            .map_or(digits, |number| number.to_string())
    } else {
        power_word(number)
    }
}

/// A number as a multiple of a power of ten.
fn power_word(number: f64) -> String {
    if number == 0.0 {
        return "0".into();
    }
    let text = format!("{number:e}");
    let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
    let digits = digits
        .parse::<f64>()
        .map_or(digits.to_owned(), |n| ((n * 1e3).round() / 1e3).to_string())
        .replace('-', "−");
    format!("{digits}·{}", power_of_ten(power))
}

/// A logarithmic axis: decades as whole numbers, with 0 and ∞ one decade beyond the ends.
#[derive(Debug, Clone, Copy)]
pub(super) struct LogAxis {
    /// Decade at the left end.
    pub(super) low: f64,
    /// Decade at the right end.
    pub(super) high: f64,
    /// Logarithms of the least and the largest of the others.
    pub(super) ends: [f64; 2],
    /// Whether 0 occurs.
    pub(super) zero: bool,
    /// Whether ∞ occurs.
    pub(super) infinite: bool,
}

impl LogAxis {
    /// The axis of these values.
    pub(super) fn of(values: &[f64]) -> Self {
        let finite = values.iter().filter(|v| v.is_finite() && **v > 0.0);
        let ends = extent(finite.map(|value| value.log10()));
        let ends = if ends[0] <= ends[1] { ends } else { [0.0; 2] };
        Self {
            low: ends[0].floor(),
            high: ends[1].ceil(),
            ends,
            zero: values.contains(&0.0),
            infinite: values.contains(&f64::INFINITY),
        }
    }

    pub(super) fn place(self, value: f64) -> f64 {
        if value <= 0.0 {
            self.low - 1.0
        } else if value.is_infinite() {
            self.high + 1.0
        } else {
            value.log10()
        }
    }
}

/// Labels for the decades of one axis, all in one style: 0.01, 0.1, 1, 10, or 10⁻⁴, 10⁻², 10⁰ where
/// numbers would be long.
pub(super) fn decade_words(decades: &[f64]) -> Vec<String> {
    let short = decades.iter().all(|decade| (-3.5..4.5).contains(decade));
    let word = |decade: &f64| {
        if short {
            let decimals = count(-decade.round());
            format!("{:.decimals$}", 10_f64.powf(decade.round()))
        } else {
            power_of_ten(&format!("{decade:.0}"))
        }
    };
    decades.iter().map(word).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(scale: &Scale) -> Vec<&str> {
        scale.ticks.iter().map(|tick| tick.1.as_str()).collect()
    }

    #[test]
    fn ticks_of_an_axis_have_one_style() {
        let axis = |low, high| Scale::logarithmic(String::new(), low, high);
        assert_eq!(
            words(&axis(0.008, 200.0)),
            ["0.01", "0.1", "1", "10", "100"]
        );
        assert_eq!(
            words(&axis(1e-6, 50.0)),
            ["10⁻⁶", "10⁻⁴", "10⁻²", "10⁰"],
            "too many for each of them"
        );
        assert_eq!(words(&axis(2.5, 23.0)), ["5", "10", "20"]);
        assert_eq!(words(&axis(10.0, 14.0)), ["10", "11", "12", "13", "14"]);
        let log = LogAxis::of(&[0.0, 0.02, 30.0, f64::INFINITY]);
        let scale = Scale::of_decades(String::new(), log);
        assert_eq!(words(&scale), ["0", "0.01", "0.1", "1", "10", "100", "∞"]);
        assert!(scale.breaks_between(-3.0, -1.0) && !scale.breaks_between(-1.0, 1.0));
    }

    #[test]
    fn linear_ticks_are_round_and_inside() {
        let scale = Scale::linear(String::new(), 0.0, 9.3);
        assert_eq!(words(&scale), ["0", "2", "4", "6", "8"]);
        let scale = Scale::linear(String::new(), -0.013, 0.021);
        let wanted = [
            "−0.010", "−0.005", "0.000", "0.005", "0.010", "0.015", "0.020",
        ];
        assert_eq!(words(&scale), wanted);
        assert!((scale.part(0.021) - 1.0).abs() < 1e-12);
        assert_eq!(words(&Scale::linear(String::new(), 0.0, 5.0))[1], "1");
        let scale = Scale::linear(String::new(), 0.0, 3e5);
        assert_eq!(words(&scale)[1], "5·10⁴");
        let log = Scale::logarithmic(String::new(), 1.0, 100.0);
        assert!((log.part(10.0) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn plateaus_lie_one_decade_beyond_the_edges() {
        let values = LogAxis::of(&[0.0, 0.05, 1.0, 100.0, f64::INFINITY]);
        assert_eq!((values.low, values.high), (-2.0, 2.0));
        let bits = |places: &[f64]| places.iter().map(|p| p.to_bits()).collect::<Vec<_>>();
        let places = [
            values.place(0.0),
            values.place(10.0),
            values.place(f64::INFINITY),
        ];
        assert_eq!(bits(&places), bits(&[-3.0, 1.0, 3.0]));
        let only = LogAxis::of(&[0.0, f64::INFINITY]);
        assert_eq!((only.place(0.0), only.place(f64::INFINITY)), (-1.0, 1.0));
    }

    #[test]
    fn decades_are_written_in_one_style() {
        assert_eq!(decade_words(&[-1.0, 0.0, 3.0]), ["0.1", "1", "1000"]);
        assert_eq!(decade_words(&[-4.0, 0.0, 2.0]), ["10⁻⁴", "10⁰", "10²"]);
    }
}
