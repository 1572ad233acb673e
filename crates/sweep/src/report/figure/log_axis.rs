//! A logarithmic axis, with the values 0 and ∞ at its edges.

use super::scale::{count, extent};

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

    /// Place of a value.
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

/// Ten to a power: 10⁻³.
pub(in crate::report) fn power_of_ten(power: &str) -> String {
    let digits: String = power
        .chars()
        .map(|digit| match digit {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            digit => digit
                .to_digit(10)
                .and_then(|value| char::from_u32(0x2070 + value))
                .unwrap_or(digit),
        })
        .collect();
    format!("10{digits}")
}

#[cfg(test)]
mod tests {
    use super::{LogAxis, decade_words};

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
