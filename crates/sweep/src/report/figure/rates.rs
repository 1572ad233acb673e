//! The logarithmic axis of shear rates, with the plateaus at its edges.

/// The axis of shear rates: decades as whole numbers, the plateaus one beyond the edges.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rates {
    /// Decade at the left end.
    pub(super) low: f64,
    /// Decade at the right end.
    pub(super) high: f64,
    /// Whether Γ = 0 occurs.
    pub(super) zero: bool,
    /// Whether Γ = ∞ occurs.
    pub(super) infinite: bool,
}

impl Rates {
    /// The axis that holds these rates.
    pub(super) fn of(rates: &[f64]) -> Self {
        let decades = || {
            rates
                .iter()
                .filter(|rate| rate.is_finite() && **rate > 0.0)
                .map(|rate| rate.log10())
        };
        let (low, high) = (
            decades().fold(f64::INFINITY, f64::min).floor(),
            decades().fold(f64::NEG_INFINITY, f64::max).ceil(),
        );
        let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
        Self {
            low,
            high,
            zero: rates.contains(&0.0),
            infinite: rates.contains(&f64::INFINITY),
        }
    }

    /// Place of a rate.
    pub(super) fn place(self, rate: f64) -> f64 {
        if rate <= 0.0 {
            self.low - 1.0
        } else if rate.is_infinite() {
            self.high + 1.0
        } else {
            rate.log10()
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
    use super::{Rates, decade};

    #[test]
    fn plateaus_lie_one_decade_beyond_the_edges() {
        let rates = Rates::of(&[0.0, 0.05, 1.0, 100.0, f64::INFINITY]);
        assert_eq!((rates.low, rates.high), (-2.0, 2.0));
        let bits = |places: &[f64]| places.iter().map(|p| p.to_bits()).collect::<Vec<_>>();
        let places = [
            rates.place(0.0),
            rates.place(10.0),
            rates.place(f64::INFINITY),
        ];
        assert_eq!(bits(&places), bits(&[-3.0, 1.0, 3.0]));
        assert_eq!(rates.tick(-3.0), "0");
        assert_eq!(rates.tick(3.0), "∞");
        let only = Rates::of(&[0.0, f64::INFINITY]);
        assert_eq!((only.place(0.0), only.place(f64::INFINITY)), (-1.0, 1.0));
    }

    #[test]
    fn decades_are_written_as_powers() {
        assert_eq!(decade(-1.0), "0.1");
        assert_eq!(decade(3.0), "10³");
        assert_eq!(decade(-2.0), "10⁻²");
    }
}
