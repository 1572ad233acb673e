//! Colours and markers of curves, declared once for every program that draws them.
//!
//! The eight colours are distinct for readers with deuteranopia, and dark enough on white. In grey
//! print, markers distinguish the curves; every second marker is hollow. More curves use a map of
//! increasing lightness (viridis without its yellow end), so that their order is visible.

use serde::Serialize;

/// Maximum number of curves with unordered colours.
pub(super) const CURVES: usize = 8;
/// Maximum number of curves: with more, markers are not recognizable.
pub(super) const ORDERED_CURVES: usize = 32;

/// Colours of curves, the first for the first.
#[rustfmt::skip]
pub(in crate::report) const COLOURS: [Colour; CURVES] = [
    Colour(0x0072b2), Colour(0xd55e00), Colour(0x000000), Colour(0x00b4b4), Colour(0x961e0f),
    Colour(0xa55aff), Colour(0xe1a578), Colour(0x0000e1),
];

/// Markers of curves.
#[rustfmt::skip]
pub(super) const MARKERS: [Marker; CURVES] = [
    Marker::Circle, Marker::HollowSquare, Marker::Triangle, Marker::HollowDiamond,
    Marker::TriangleDown, Marker::HollowCircle, Marker::Square, Marker::HollowTriangle,
];

/// Nodes of a map of increasing lightness, evenly spaced. Its yellow end is left out on white.
#[rustfmt::skip]
pub(in crate::report) const HEAT: [Colour; 9] = [
    Colour(0x440154), Colour(0x46327e), Colour(0x365c8d), Colour(0x277f8e), Colour(0x1fa187),
    Colour(0x35b779), Colour(0x4ac16d), Colour(0x6ccd5a), Colour(0xfde725),
];

/// A colour, 0xRRGGBB.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Colour(pub(super) u32);

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

/// The marker of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Marker {
    /// A disc.
    Circle,
    /// A filled square.
    Square,
    /// A filled triangle on its base.
    Triangle,
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
    /// A circle around another marker.
    Ring,
    /// A square around another marker.
    Frame,
    /// A vertical line, which marks a position on the axis and no point of a curve.
    Bar,
}

impl Marker {
    /// Whether its inside is white.
    pub(super) fn is_hollow(self) -> bool {
        matches!(
            self,
            Self::HollowCircle | Self::HollowSquare | Self::HollowTriangle | Self::HollowDiamond
        )
    }
}
