//! Numbers, durations and bytes as text.

use std::time::Duration;

/// A number to so many significant digits, with an exponent where that is shorter.
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

/// A time in words: `12 s`, `3 min 20 s`, `5 h 10 min`, `2 d 4 h`.
pub fn duration(seconds: f64) -> String {
    if !seconds.is_finite() || seconds < 0.0 {
        return "–".into();
    }
    if seconds < 10.0 {
        return format!("{seconds:.1} s");
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

/// Reads a time such as `90s`, `15m`, `2h` or `1h 30m`; a bare number is seconds.
///
/// # Errors
/// What may be written.
pub fn parse_duration(text: &str) -> Result<Duration, String> {
    let seconds = text.trim().parse::<f64>().ok();
    let read = match seconds {
        Some(seconds) => Duration::try_from_secs_f64(seconds).ok(),
        None => humantime::parse_duration(text).ok(),
    };
    read.ok_or_else(|| "write a time such as 90s, 15m or 2h".to_owned())
}

/// The same, but not none at all.
///
/// # Errors
/// What may be written.
pub fn parse_positive_duration(text: &str) -> Result<Duration, String> {
    parse_duration(text).and_then(|time| {
        if time.is_zero() {
            Err("a time above 0, such as 90s, 15m or 2h".into())
        } else {
            Ok(time)
        }
    })
}

/// Bytes in words.
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

#[cfg(test)]
mod tests {
    use super::*;

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
            ("0.5", 0.5),
            ("60", 60.0),
        ] {
            assert_eq!(parse_duration(text).unwrap().as_secs_f64(), seconds);
        }
        for text in ["", "-1", "2 hours ago", "nan", "1e300"] {
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
