//! Widths of text, so that labels can be placed without the font.
//!
//! Figures name DejaVu Sans, and then Verdana, which has nearly the same widths and is where the
//! first is not.

/// The fonts of figures, the first that is installed.
pub(super) const FAMILY: &str = "'DejaVu Sans', Verdana, sans-serif";
/// Units of the widths over the size of the font.
const PER_SIZE: f64 = 2048.0;
/// Width of the characters not listed.
const OTHERS: u32 = 1255;
/// Widths of characters in DejaVu Sans 2.37.
#[rustfmt::skip]
const WIDTHS: [(u32, &str); 65] = [
    (465, "′"), (563, "'"), (569, "ijl"), (604, "IJ"), (651, " ,.·"), (690, "/:;\\|"),
    (721, "f"), (739, "-"), (799, "()[]"), (803, "t"), (763, "″"), (821, "!₁₂⁰¹²³⁴⁵⁶⁷⁸⁹"),
    (842, "r"), (942, "\""), (1024, "*_`–°"), (1067, "s"), (1075, "z"), (1081, "⁻"),
    (1087, "?"), (1107, "ε"), (1126, "c"), (1141, "LΓ"), (1142, "ξ"), (1144, "ν"), (1178, "F"),
    (1183, "χ"), (1186, "k"), (1207, "κ"), (1212, "vxyγλ"), (1233, "τ"), (1235, "P"),
    (1251, "TY"), (1253, "oθö"), (1255, "aä"), (1260, "eé"), (1294, "EΣ"), (1298, "hnuησü"),
    (1300, "Sbdgpq"), (1303, "$0123456789{}μ"), (1305, "√"), (1307, "β"), (1343, "K"),
    (1350, "α"), (1351, "φψ"), (1401, "AVΔÅ"), (1403, "XZ"), (1405, "B"), (1423, "R"),
    (1430, "C"), (1499, "U"), (1532, "N"), (1540, "HΠ"), (1577, "D"), (1587, "G"), (1597, "&"),
    (1612, "OQ"), (1675, "w"), (1706, "∞"), (1715, "ω"), (1716, "#+<=>^~−±×≥≤"), (1767, "M"),
    (1946, "%"), (1995, "m"), (2025, "W"), (2048, "@"),
];
/// Size of a subscript over that of the letters before it.
pub(super) const SUBSCRIPT: f64 = 0.72;

/// The width of a line of text, in the unit of its size.
pub(super) fn width(text: &str, size: f64) -> f64 {
    let of = |character| {
        let known = WIDTHS.iter().find(|(_, all)| all.contains(character));
        f64::from(known.map_or(OTHERS, |(width, _)| *width)) / PER_SIZE
    };
    let each = |(text, is_subscript): (&str, bool)| {
        let part = if is_subscript { SUBSCRIPT } else { 1.0 };
        part * text.chars().map(of).sum::<f64>()
    };
    size * pieces(text).into_iter().map(each).sum::<f64>()
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sign_of_labels_and_ticks_has_its_width() {
        for character in "0123456789.,−-–+±×·′″ηνΓσμ∞=()/*₁₂⁰¹²³⁴⁵⁶⁷⁸⁹⁻ΠφκÅéü°".chars()
        {
            assert!(
                WIDTHS.iter().any(|(_, all)| all.contains(character)),
                "{character}"
            );
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
