//! The font of figures: DejaVu Sans, of which every figure carries what it needs.
//!
//! The file holds the Latin and Greek letters and the signs of mathematics of DejaVu Sans 2.37, without hints; its
//! licence lies beside it.

use std::sync::LazyLock;
use ttf_parser::{Face, GlyphId};

/// The font file.
pub(super) static BYTES: &[u8] = include_bytes!("font/DejaVuSans.ttf");
/// Its name where a file carries it, so that no other font takes its place.
pub(super) const EMBEDDED_NAME: &str = "DejaVu Sans of sweep";

/// The font, read.
pub(super) static FACE: LazyLock<Face<'static>> = LazyLock::new(|| {
    #[expect(clippy::expect_used, reason = "the file is part of the program")]
    Face::parse(BYTES, 0).expect("the font of figures is a font")
});

/// The glyph of a character; a question mark's for one the font does not have.
pub(super) fn glyph(character: char) -> GlyphId {
    let of = |character| FACE.glyph_index(character);
    of(character).or_else(|| of('?')).unwrap_or(GlyphId(0))
}

/// The width of a glyph over the size of the font.
pub(super) fn advance(glyph: GlyphId) -> f64 {
    let width = FACE.glyph_hor_advance(glyph).unwrap_or(0);
    f64::from(width) / f64::from(FACE.units_per_em())
}

/// The width of a line of text, in the unit of its size.
pub(super) fn width(text: &str, size: f64) -> f64 {
    size * text.chars().map(|c| advance(glyph(c))).sum::<f64>()
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
}
