//! Numbers, durations and bytes as text.

use super::choices::choices;
use std::fmt::Display;
use std::time::Duration;

/// A number with this many significant digits, with an exponent where that is shorter.
pub fn significant(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return if value.is_nan() {
            "–".into()
        } else {
            format!("{value}")
        };
    }
    if value == 0.0 {
        return "0".into();
    }
    #[expect(clippy::cast_possible_truncation, reason = "a decimal exponent")]
    let exponent = value.abs().log10().floor() as i32;
    if (-3..5).contains(&exponent) {
        let decimals = usize::try_from(digits - 1 - exponent).unwrap_or(0);
        format!("{value:.decimals$}")
    } else {
        let decimals = usize::try_from(digits - 1).unwrap_or(0);
        format!("{value:.decimals$e}")
    }
}

/// A number with the fewest digits that represent it, up to a maximum.
pub fn short(number: f64, digits: i32) -> String {
    let rounded = significant(number, digits);
    let full = if rounded.contains('e') {
        format!("{number:e}")
    } else {
        format!("{number}")
    };
    if full.len() < rounded.len() {
        full
    } else {
        rounded
    }
}

/// A common format for a set of numbers, in which they remain distinct.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Digits {
    /// Maximum number of significant digits.
    pub most: i32,
    /// Whether all have a power of ten, since one of them would be long without.
    powers: bool,
}

impl Digits {
    /// Maximum characters of a short number.
    const SHORT: usize = 7;
    /// Sufficient digits, if they distinguish the numbers.
    const ENOUGH_DIGITS: i32 = 4;

    /// The format for these numbers.
    pub fn of(numbers: impl Iterator<Item = f64>) -> Self {
        let mut numbers: Vec<f64> = numbers.filter(|number| number.is_finite()).collect();
        numbers.sort_by(f64::total_cmp);
        numbers.dedup();
        let are_apart = |most: &i32| {
            let plain = |number: &f64| {
                Self {
                    most: *most,
                    powers: false,
                }
                .write(*number)
            };
            let words: Vec<String> = numbers.iter().map(plain).collect();
            words.windows(2).all(|pair| pair[0] != pair[1])
        };
        let most = (Self::ENOUGH_DIGITS..17).find(are_apart).unwrap_or(17);
        let plain = Self {
            most,
            powers: false,
        };
        Self {
            powers: numbers.iter().any(|n| plain.write(*n).contains('e')),
            ..plain
        }
    }

    /// The number.
    pub fn write(self, number: f64) -> String {
        if !number.is_finite() || number == 0.0 {
            return format!("{number}");
        }
        let full = format!("{number}");
        if full.len() <= Self::SHORT && !self.powers {
            return full;
        }
        let decimals = usize::try_from(self.most - 1).unwrap_or(0);
        let rounded = format!("{number:.decimals$e}").parse().unwrap_or(number);
        let plain = format!("{rounded}");
        // Further digits only serve to distinguish numbers.
        let extra = usize::try_from(self.most - Self::ENOUGH_DIGITS).unwrap_or(0);
        if plain.len() <= Self::SHORT + extra && !self.powers {
            plain
        } else {
            format!("{rounded:e}")
        }
    }
}

choices! {
    /// How numbers with an interval are written.
    NumberFormat {
        Plain = "plain", "9.86 ± 0.79";
        Si = "si", "9.86(79): in brackets half the 95 % interval, in units of the last digit";
    }
}

/// A number and half its interval, both with the same decimals.
pub fn uncertain(value: f64, half: f64, format: NumberFormat) -> String {
    // Rounding alone is no interval.
    if !half.is_finite() || half <= 1e-12 * value.abs() || !value.is_finite() {
        return significant(value, 4);
    }
    let shift = match exponent(value.abs().max(half)) {
        -3..5 => 0,
        power => power,
    };
    let scale = 10_f64.powi(-shift);
    let (value, half) = (value * scale, half * scale);
    // Two digits of the half width; rounding may make it 0.10 of 0.099.
    let first = exponent(half);
    let first = exponent((half * 10_f64.powi(1 - first)).round() * 10_f64.powi(first - 1));
    let decimals = usize::try_from(1 - first).unwrap_or(0);
    let (value, half) = (format!("{value:.decimals$}"), format!("{half:.decimals$}"));
    let power = match shift {
        0 => String::new(),
        shift => format!("e{shift}"),
    };
    match format {
        NumberFormat::Plain if shift != 0 => format!("({value} ± {half}){power}"),
        NumberFormat::Plain => format!("{value} ± {half}"),
        // Half widths above 1 keep their decimal point: 12.3(4.5).
        NumberFormat::Si if decimals > 0 && !half.starts_with("0.") => {
            format!("{value}({half}){power}")
        }
        NumberFormat::Si => {
            let digits = half.trim_start_matches(['0', '.']);
            let digits = if digits.is_empty() { "0" } else { digits };
            format!("{value}({digits}){power}")
        }
    }
}

/// The decimal exponent of a number.
#[expect(clippy::cast_possible_truncation, reason = "a decimal exponent")]
fn exponent(value: f64) -> i32 {
    if value == 0.0 {
        0
    } else {
        // The logarithm of 1000 may come out a little less than 3.
        (value.abs().log10() + 1e-12).floor() as i32
    }
}

/// A time as text: `12 s`, `3 min 20 s`, `5 h 10 min`, `2 d 4 h`.
pub fn duration(seconds: f64) -> String {
    if !seconds.is_finite() || seconds < 0.0 {
        return "–".into();
    }
    if seconds < 10.0 {
        // Without the sign of a negative zero.
        return format!("{:.1} s", seconds + 0.0);
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "finite and not negative; saturates"
    )]
    let s = seconds.round() as u64;
    match s {
        0..60 => format!("{s} s"),
        60..3600 => format!("{} min {} s", s / 60, s % 60),
        3600..86400 => format!("{} h {} min", s / 3600, s % 3600 / 60),
        _ => format!("{} d {} h", s / 86400, s % 86400 / 3600),
    }
}

/// Wraps text for a terminal of this width, at spaces. Lines of tables, which begin with a space or
/// a rule, are unchanged.
pub fn wrapped(text: &str, width: Option<u16>) -> String {
    let Some(width) = width.map(usize::from) else {
        return text.to_owned();
    };
    let options = textwrap::Options::new(width)
        .break_words(false)
        .word_separator(textwrap::WordSeparator::AsciiSpace)
        .word_splitter(textwrap::WordSplitter::NoHyphenation);
    let mut all = String::with_capacity(text.len());
    for line in text.lines() {
        if line.starts_with([' ', '─', '═']) {
            all.push_str(line);
        } else {
            all.push_str(&textwrap::fill(line, &options));
        }
        all.push('\n');
    }
    all
}

/// A number of things, as in "1 task" and "2 tasks".
pub(crate) fn counted<N: Copy + Display + From<u8> + PartialEq>(number: N, thing: &str) -> String {
    let plural = if number == N::from(1) { "" } else { "s" };
    format!("{number} {thing}{plural}")
}

/// Reads a time such as `90s`, `15m`, `2h` or `1h 30m`. A bare number other than 0 is refused, as
/// some programs take it for seconds and others for minutes.
pub(crate) fn parse_duration(text: &str) -> Result<Duration, String> {
    let text = text.trim();
    if let Ok(number) = text.parse::<f64>()
        && number != 0.0
    {
        return Err(format!("give a unit, as in {text}s or {text}m"));
    }
    // Fractions of a second, which programs write.
    let seconds = text.strip_suffix('s').unwrap_or(text).parse::<f64>().ok();
    let read = match seconds {
        Some(seconds) => Duration::try_from_secs_f64(seconds).ok(),
        None => humantime::parse_duration(text).ok(),
    };
    read.ok_or_else(|| "write a time such as 90s, 15m or 2h".to_owned())
}

/// Reads a time above 0.
///
/// # Errors
/// A message with the allowed format.
pub fn parse_positive_duration(text: &str) -> Result<Duration, String> {
    parse_duration(text).and_then(|time| {
        if time.is_zero() {
            Err("a time above 0, such as 90s, 15m or 2h".into())
        } else {
            Ok(time)
        }
    })
}

/// A size in bytes as text.
pub fn bytes(number: f64) -> String {
    let mut number = number;
    for unit in ["B", "kB", "MB", "GB"] {
        if number < 1000.0 {
            return format!("{} {unit}", significant(number.round(), 3));
        }
        number /= 1000.0;
    }
    format!("{} TB", significant(number, 3))
}

/// The whole number nearest to a float that is not negative.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates"
)]
pub fn count(value: f64) -> usize {
    value.round() as usize
}

/// Ten to a power: 10⁻³.
pub(crate) fn power_of_ten(power: &str) -> String {
    let superscript = |digit: char| match digit.to_digit(10) {
        Some(digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit as usize).unwrap_or('⁰'),
        None => '⁻',
    };
    let digits: String = power.chars().map(superscript).collect();
    format!("10{digits}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_has_neither_a_sign_nor_an_interval() {
        assert_eq!(duration(-0.0), "0.0 s");
        assert_eq!(uncertain(1.0, 2e-16, NumberFormat::Plain), "1.000");
    }

    #[test]
    fn whole_words_wrap_to_the_next_line() {
        let text = " a table that is wide\nafter a strain of 0.5 it stays\n";
        assert_eq!(wrapped(text, None), text);
        let narrow = " a table that is wide\nafter a strain of\n0.5 it stays\n";
        assert_eq!(wrapped(text, Some(19)), narrow);
    }

    #[test]
    fn intervals_have_the_decimals_of_their_numbers() {
        for (value, half, plain, si) in [
            (9.863, 0.79, "9.86 ± 0.79", "9.86(79)"),
            (9.863, 0.0991, "9.863 ± 0.099", "9.863(99)"),
            (9.863, 0.0999, "9.86 ± 0.10", "9.86(10)"),
            (123.4, 4.56, "123.4 ± 4.6", "123.4(4.6)"),
            (123.4, 45.6, "123 ± 46", "123(46)"),
            (1234.6, 456.7, "1235 ± 457", "1235(457)"),
            (-0.0212, 0.0031, "-0.0212 ± 0.0031", "-0.0212(31)"),
            (1.234e-5, 4.5e-7, "(1.234 ± 0.045)e-5", "1.234(45)e-5"),
            (7.0, 0.0, "7.000", "7.000"),
        ] {
            assert_eq!(uncertain(value, half, NumberFormat::Plain), plain);
            assert_eq!(uncertain(value, half, NumberFormat::Si), si);
        }
        let digits = Digits::of([0.693].into_iter());
        assert_eq!(digits.write(0.693), "0.693");
    }

    #[test]
    fn digits_are_few_but_distinguish_numbers() {
        let written = |numbers: &[f64]| -> Vec<String> {
            let digits = Digits::of(numbers.iter().copied());
            numbers.iter().map(|number| digits.write(*number)).collect()
        };
        assert_eq!(written(&[0.1, 18.849_555_921]), ["0.1", "18.85"]);
        assert_eq!(
            written(&[0.593_151_1, 0.593_152_9]),
            ["0.593151", "0.593153"]
        );
        assert_eq!(
            written(&[1e4, 1e5, f64::INFINITY]),
            ["10000", "100000", "inf"]
        );
        assert_eq!(written(&[0.0, 1e-8, 0.02]), ["0", "1e-8", "2e-2"]);
        assert_eq!(written(&[5e-4, 0.005]), ["0.0005", "0.005"]);
        assert_eq!(short(18.849_555_921, 4), "18.85");
        assert_eq!(short(0.7, 4), "0.7");
        assert_eq!(short(1e-8, 4), "1e-8");
    }

    #[test]
    fn numbers_keep_their_significant_digits() {
        assert_eq!(significant(7.1234, 4), "7.123");
        assert_eq!(significant(0.00994, 3), "0.00994");
        assert_eq!(significant(1.0e-10, 2), "1.0e-10");
        assert_eq!(significant(123456.0, 4), "1.235e5");
        assert_eq!(significant(f64::INFINITY, 4), "inf");
        assert_eq!(significant(-48.26, 3), "-48.3");
    }

    #[test]
    fn times_are_read_with_their_units() {
        for (text, seconds) in [
            ("90s", 90.0),
            ("15m", 900.0),
            ("2h", 7200.0),
            ("1h 30m", 5400.0),
            ("0.5s", 0.5),
            ("1e-6s", 1e-6),
            ("0", 0.0),
        ] {
            assert_eq!(parse_duration(text).unwrap().as_secs_f64(), seconds);
        }
        for text in ["", "-1s", "2 hours ago", "nan", "1e300s", "30", "0.5", "s"] {
            assert!(parse_duration(text).is_err(), "{text}");
        }
        assert!(parse_positive_duration("0s").is_err());
    }

    #[test]
    fn times_are_in_words() {
        assert_eq!(duration(3.21), "3.2 s");
        assert_eq!(duration(200.0), "3 min 20 s");
        assert_eq!(duration(187_200.0), "2 d 4 h");
        assert_eq!(duration(f64::NAN), "–");
    }
}
