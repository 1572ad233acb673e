//! The font of figures: DejaVu Sans, of which every figure embeds the glyphs it needs.
//!
//! The file holds the Latin and Greek letters and the signs of mathematics of DejaVu Sans 2.37,
//! without hints; its licence lies beside it.

use std::sync::LazyLock;
use ttf_parser::{Face, GlyphId};

/// The font file.
pub(super) static BYTES: &[u8] = include_bytes!("font/DejaVuSans.ttf");
/// Its name in files that embed it, so that it is not replaced by another font.
pub(super) const EMBEDDED_NAME: &str = "DejaVu Sans of sweep";

/// The font, read.
pub(super) static FACE: LazyLock<Face<'static>> = LazyLock::new(|| {
    #[expect(clippy::expect_used, reason = "the file is part of the program")]
    Face::parse(BYTES, 0).expect("the font of figures is a font")
});

/// The glyph of a character, or of a question mark for a character that the font lacks.
pub(super) fn glyph(character: char) -> GlyphId {
    let of = |character| FACE.glyph_index(character);
    of(character).or_else(|| of('?')).unwrap_or(GlyphId(0))
}

/// The width of a glyph over the size of the font.
pub(super) fn advance(glyph: GlyphId) -> f64 {
    let width = FACE.glyph_hor_advance(glyph).unwrap_or(0);
    f64::from(width) / f64::from(FACE.units_per_em())
}

/// Size of a subscript over that of the letters before it.
pub(super) const SUBSCRIPT: f64 = 0.72;

/// Splits a line of text into pieces with a flag for subscripts: letters after an underscore that
/// follows a single letter, as in `F_crit/a²`. Names of several letters keep their underscores.
pub(super) fn pieces(text: &str) -> Vec<(&str, bool)> {
    let mut pieces = Vec::new();
    let mut rest = text;
    let mut from = 0;
    while let Some(place) = rest[from..].find('_').map(|place| from + place) {
        let mut before = rest[..place].chars().rev();
        let is_symbol = before.next().is_some_and(char::is_alphabetic)
            && !before.next().is_some_and(char::is_alphanumeric);
        let after = &rest[place + 1..];
        let end = after
            .find(|c: char| !c.is_alphabetic())
            .unwrap_or(after.len());
        if is_symbol && end > 0 {
            pieces.push((&rest[..place], false));
            pieces.push((&after[..end], true));
            (rest, from) = (&after[end..], 0);
        } else {
            from = place + 1;
        }
    }
    if !rest.is_empty() || pieces.is_empty() {
        pieces.push((rest, false));
    }
    pieces
}

/// The width of a line of text, in the unit of its size.
pub(super) fn width(text: &str, size: f64) -> f64 {
    let width = |text: &str| text.chars().map(|c| advance(glyph(c))).sum::<f64>();
    let each = |(text, is_subscript)| {
        let part = if is_subscript { SUBSCRIPT } else { 1.0 };
        part * width(text)
    };
    size * pieces(text).into_iter().map(each).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sign_of_labels_and_ticks_is_there() {
        for character in "0123456789.,−-–+±×·ηνΓσμ∞=()/*₁₂⁰¹²³⁴⁵⁶⁷⁸⁹⁻ΠφκÅéü°".chars()
        {
            assert!(FACE.glyph_index(character).is_some(), "{character}");
        }
        assert!((width("mm", 10.0) / width("m", 10.0) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn symbols_have_subscripts_and_names_do_not() {
        for (text, wanted) in [
            ("plain", vec![("plain", false)]),
            ("", vec![("", false)]),
            (
                "stress (F_crit/a²)",
                vec![("stress (F", false), ("crit", true), ("/a²)", false)],
            ),
            (
                "k_t/k = 0.5, ξ_max = 1",
                vec![
                    ("k", false),
                    ("t", true),
                    ("/k = 0.5, ξ", false),
                    ("max", true),
                    (" = 1", false),
                ],
            ),
            (
                "run_a of my_campaign_b",
                vec![("run_a of my_campaign_b", false)],
            ),
            ("x_1, _y", vec![("x_1, _y", false)]),
        ] {
            assert_eq!(pieces(text), wanted);
        }
        let small = width("crit", SUBSCRIPT * 8.0);
        assert!((width("F_crit", 8.0) - width("F", 8.0) - small).abs() < 1e-9);
    }
}
