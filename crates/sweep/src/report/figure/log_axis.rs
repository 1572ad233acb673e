//! A logarithmic axis, with the values 0 and ∞ at its edges.

/// A logarithmic axis: decades as whole numbers, 0 and ∞ one decade beyond the others.
#[derive(Debug, Clone, Copy)]
pub(super) struct LogAxis {
    /// Decade at the left end.
    pub(super) low: f64,
    /// Decade at the right end.
    pub(super) high: f64,
    /// Whether 0 occurs.
    pub(super) zero: bool,
    /// Whether ∞ occurs.
    pub(super) infinite: bool,
}

impl LogAxis {
    /// The axis that holds these values.
    pub(super) fn of(values: &[f64]) -> Self {
        let decades = || {
            values
                .iter()
                .filter(|value| value.is_finite() && **value > 0.0)
                .map(|value| value.log10())
        };
        let (low, high) = (
            decades().fold(f64::INFINITY, f64::min).floor(),
            decades().fold(f64::NEG_INFINITY, f64::max).ceil(),
        );
        let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
        Self {
            low,
            high,
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

    /// Words for a tick.
    pub(super) fn tick(self, place: f64) -> String {
        if self.zero && place < self.low - 0.5 {
            "0".into()
        } else if self.infinite && place > self.high + 0.5 {
            "∞".into()
        } else if place < self.low - 0.5 || place > self.high + 0.5 {
            String::new()
        } else {
            decade(place)
        }
    }
}

/// A power of ten: 0.1, 1, 10, 10³.
fn decade(place: f64) -> String {
    if (-1.5..1.5).contains(&place) {
        return format!("{}", 10_f64.powf(place.round()));
    }
    let digits: String = format!("{place:.0}")
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
    use super::{LogAxis, decade};

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
        assert_eq!(values.tick(-3.0), "0");
        assert_eq!(values.tick(3.0), "∞");
        let only = LogAxis::of(&[0.0, f64::INFINITY]);
        assert_eq!((only.place(0.0), only.place(f64::INFINITY)), (-1.0, 1.0));
    }

    #[test]
    fn decades_are_written_as_powers() {
        assert_eq!(decade(-1.0), "0.1");
        assert_eq!(decade(3.0), "10³");
        assert_eq!(decade(-2.0), "10⁻²");
    }
}
