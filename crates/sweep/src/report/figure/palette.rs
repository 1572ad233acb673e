//! Colours and markers of curves, declared once for every program that draws them.
//!
//! The eight colours are distinct for readers with deuteranopia, and dark enough on white. In grey
//! print, markers distinguish the curves; every second marker is hollow. More curves use a map of
//! increasing lightness (viridis without its yellow end), so that their order is visible.

use serde::{Deserialize, Serialize};

/// Maximum number of curves with unordered colours.
pub(super) const CURVES: usize = 8;
/// Maximum number of curves: with more, markers are not recognizable.
pub(super) const ORDERED_CURVES: usize = 32;

/// Colours of curves, the first for the first.
pub(in crate::report) const COLOURS: [Colour; CURVES] = [
    Colour(0x0072b2),
    Colour(0xd55e00),
    Colour(0x000000),
    Colour(0x00b4b4),
    Colour(0x961e0f),
    Colour(0xa55aff),
    Colour(0xe1a578),
    Colour(0x0000e1),
];

/// The same for a dark background.
pub(in crate::report) const COLOURS_ON_DARK: [Colour; CURVES] = [
    Colour(0x4aa8e0),
    Colour(0xf0803c),
    Colour(0xf2f2f2),
    Colour(0x00c8b8),
    Colour(0xe0685c),
    Colour(0xc49cff),
    Colour(0xe1c08a),
    Colour(0x7a86ff),
];

/// Markers of curves.
pub(in crate::report) const MARKERS: [Marker; CURVES] = [
    Marker::Circle,
    Marker::HollowSquare,
    Marker::Triangle,
    Marker::HollowDiamond,
    Marker::TriangleDown,
    Marker::HollowCircle,
    Marker::Square,
    Marker::HollowTriangle,
];

/// Nodes of a map of increasing lightness, evenly spaced. Its yellow end is left out on white.
pub(in crate::report) const HEAT: [Colour; 9] = [
    Colour(0x440154),
    Colour(0x46327e),
    Colour(0x365c8d),
    Colour(0x277f8e),
    Colour(0x1fa187),
    Colour(0x35b779),
    Colour(0x4ac16d),
    Colour(0x6ccd5a),
    Colour(0xfde725),
];

/// A colour, 0xRRGGBB.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Colour(pub(super) u32);

impl Colour {
    /// For axes and text.
    pub(in crate::report) const INK: Self = Self(0x1a1a1a);
    /// For lines other than curves.
    pub(in crate::report) const GREY: Self = Self(0x555555);
    /// For breaks of an axis.
    pub(super) const PALE: Self = Self(0xbbbbbb);
    /// For the background.
    pub(super) const SHADE: Self = Self(0xebebeb);
    /// For paper.
    pub(in crate::report) const WHITE: Self = Self(0xffffff);

    /// The colour of curve `place` of `number` ordered curves.
    pub(super) fn ordered(place: usize, number: usize) -> Self {
        Self::along(&HEAT[..8], place as f64 / (number - 1).max(1) as f64)
    }

    /// The colour of a number on a scale from 0 to 1, clamped at the ends.
    pub(in crate::report) fn heat(part: f64) -> Self {
        Self::along(&HEAT, part.clamp(0.0, 1.0))
    }

    /// The colour at a position from 0 to 1 along a map.
    fn along(map: &[Self], part: f64) -> Self {
        let along = part * (map.len() - 1) as f64;
        let below = (0..map.len() - 1)
            .rev()
            .find(|index| *index as f64 <= along)
            .unwrap_or(0);
        map[below].mixed(map[below + 1], along - below as f64)
    }

    /// A colour between two, 0 for the first and 1 for the second.
    pub(super) fn mixed(self, other: Self, part: f64) -> Self {
        let [low, high] = [self.channels(), other.channels()];
        let mixed = |channel: usize| {
            let [a, b] = [f64::from(low[channel]), f64::from(high[channel])];
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "between two channels"
            )]
            let value = (a + part * (b - a)).round() as u32;
            value
        };
        Self(mixed(0) << 16 | mixed(1) << 8 | mixed(2))
    }

    /// Red, green and blue.
    pub(super) fn channels(self) -> [u8; 3] {
        let [_, red, green, blue] = self.0.to_be_bytes();
        [red, green, blue]
    }
}

/// As `#rrggbb`.
impl std::fmt::Display for Colour {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "#{:06x}", self.0)
    }
}

impl Serialize for Colour {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl TryFrom<String> for Colour {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.strip_prefix('#')
            .filter(|digits| digits.len() == 6)
            .and_then(|digits| u32::from_str_radix(digits, 16).ok())
            .map(Self)
            .ok_or_else(|| format!("a colour is written as \"#0072b2\", not {text:?}"))
    }
}

/// The marker of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Marker {
    /// A disc.
    Circle,
    /// A filled square.
    Square,
    /// A filled triangle on its base.
    Triangle,
    /// A filled square on its corner.
    Diamond,
    /// A filled triangle on its tip.
    TriangleDown,
    /// A circle.
    HollowCircle,
    /// A square.
    HollowSquare,
    /// A triangle on its base.
    HollowTriangle,
    /// A square on its corner.
    HollowDiamond,
    /// Two diagonals.
    Cross,
    /// An upright cross.
    Plus,
    /// A vertical line, which marks a position on the axis and no point of a curve.
    #[serde(skip_deserializing)]
    Bar,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CIELAB of linear RGB under D65.
    fn lab(rgb: [f64; 3]) -> [f64; 3] {
        let dot = |row: [f64; 3]| row.iter().zip(rgb).map(|(a, b)| a * b).sum::<f64>();
        let f = |t: f64| {
            if t > 0.008856 {
                t.cbrt()
            } else {
                7.787 * t + 16.0 / 116.0
            }
        };
        let x = f(dot([0.4124, 0.3576, 0.1805]) / 0.95047);
        let y = f(dot([0.2126, 0.7152, 0.0722]));
        let z = f(dot([0.0193, 0.1192, 0.9505]) / 1.08883);
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    fn linear(colour: Colour) -> [f64; 3] {
        colour.channels().map(|channel| {
            let c = f64::from(channel) / 255.0;
            if c <= 0.04045 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        })
    }

    /// The colour as seen with deuteranopia (Machado, Oliveira and Fernandes 2009, severity 1).
    fn without_green(rgb: [f64; 3]) -> [f64; 3] {
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
        .map(|row: [f64; 3]| {
            let sum: f64 = row.iter().zip(rgb).map(|(a, b)| a * b).sum();
            sum.clamp(0.0, 1.0)
        })
    }

    fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
        a.iter()
            .zip(b)
            .map(|(a, b)| (a - b).powi(2))
            .sum::<f64>()
            .sqrt()
    }

    #[test]
    fn colours_stay_apart_without_green_and_dark_on_white() {
        for (n, colour) in COLOURS.iter().enumerate() {
            assert!(lab(linear(*colour))[0] < 74.0, "{colour} is lost on white");
            for other in &COLOURS[..n] {
                let pair = [*colour, *other].map(linear);
                let seen = pair.map(without_green).map(lab);
                assert!(distance(seen[0], seen[1]) > 25.0, "{colour} and {other}");
                let [a, b] = pair.map(lab);
                assert!(distance(a, b) > 25.0, "{colour} and {other}");
            }
        }
        for (n, marker) in MARKERS.iter().enumerate() {
            assert!(!MARKERS[..n].contains(marker), "{marker:?} twice");
        }
    }

    #[test]
    fn the_lightness_of_ordered_colours_rises() {
        let lightness: Vec<f64> = (0..20)
            .map(|n| lab(linear(Colour::ordered(n, 20)))[0])
            .collect();
        assert!(lightness.windows(2).all(|pair| pair[1] > pair[0] + 0.5));
        assert!(lightness[19] < 76.0, "{}", lightness[19]);
    }

    #[test]
    fn colours_are_read_as_they_are_written() {
        for colour in COLOURS {
            assert_eq!(Colour::try_from(colour.to_string()), Ok(colour));
        }
        assert!(Colour::try_from("blue".to_owned()).is_err());
    }
}
