//! Numbers as they are written in a text.

/// What stands between the numbers of a list.
pub(crate) const JOINTS: [&str; 6] = [", ", " and ", ", and ", " to ", " or ", "/"];

/// A number as it is written.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Number {
    /// Where it is in its text, with its sign.
    pub(crate) start: usize,
    pub(crate) end: usize,
    pub(crate) value: f64,
    /// Decimal exponent of its last digit.
    pub(crate) last: i32,
    pub(crate) signed: bool,
    pub(crate) percent: bool,
    /// Half its interval, and the exponent of the last digit of that.
    pub(crate) half: Option<(f64, i32)>,
}

impl Number {
    /// Whether it is this one of a table: with the same digits, or rounded to three or more.
    pub(crate) fn is(&self, other: &Self) -> bool {
        let value = if self.signed {
            other.value
        } else {
            other.value.abs()
        };
        let half = match (self.half, other.half) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(one), Some(other)) => near(one, other),
        };
        let enough = other.last == self.last || self.digits() >= 3 || self.half.is_some();
        self.percent == other.percent
            && half
            && enough
            && near((self.value, self.last), (value, other.last))
    }

    /// How many digits it has, without zeros before them.
    fn digits(&self) -> i32 {
        #[expect(clippy::cast_possible_truncation, reason = "a decimal exponent")]
        let first = self.value.abs().max(1e-300).log10().floor() as i32;
        first - self.last + 1
    }
}

/// Whether the first number is the second one, which has as many digits or more, rounded.
pub(crate) fn near((one, last): (f64, i32), (other, finer): (f64, i32)) -> bool {
    let slack = if finer < last {
        0.5 * 10_f64.powi(last)
    } else {
        0.0
    };
    finer <= last && (one - other).abs() <= slack + 1e-9 * one.abs()
}

/// A digit above the line.
fn raised(c: char) -> Option<u32> {
    "⁰¹²³⁴⁵⁶⁷⁸⁹"
        .chars()
        .zip(0..)
        .find(|(digit, _)| *digit == c)
        .map(|(_, value)| value)
}

/// The numbers of a text. Digits within a word are none.
pub(crate) fn numbers(text: &str) -> Vec<Number> {
    let mut all: Vec<Number> = Vec::new();
    let mut at = 0;
    while let Some(c) = text[at..].chars().next() {
        if c.is_alphabetic() || c == '_' {
            // A word, with the digits in it.
            let inside = |c: char| c.is_alphanumeric() || c == '_' || c == '\'';
            at += text[at..].find(|c| !inside(c)).unwrap_or(text.len() - at);
        } else if c.is_ascii_digit() {
            let found = number(text, at);
            at = found.end;
            let in_word = text[at..].chars().next().is_some_and(char::is_alphabetic);
            if !in_word {
                all.push(found);
            }
        } else {
            at += c.len_utf8();
        }
    }
    // `7.0 ± 0.3` is one number, and `1 to 2 %` are both shares.
    let mut joined: Vec<Number> = Vec::new();
    for mut number in all.into_iter().rev() {
        if let Some(after) = joined.last() {
            let between = &text[number.end..after.start];
            if between == " ± " {
                number.half = Some((after.value, after.last));
                number.percent = after.percent;
                number.end = after.end;
                joined.pop();
            } else if JOINTS.contains(&between) && number.signed == after.signed {
                number.percent |= after.percent;
            }
        }
        joined.push(number);
    }
    joined.reverse();
    joined
}

/// The number that begins with the digit at this place.
fn number(text: &str, at: usize) -> Number {
    let digits = |from: usize| {
        from + text[from..]
            .chars()
            .take_while(char::is_ascii_digit)
            .count()
    };
    let next = |at: usize| text[at..].chars().next();
    let mut end = digits(at);
    let mut last = 0;
    if next(end) == Some('.') && digits(end + 1) > end + 1 {
        let whole = end;
        end = digits(end + 1);
        last = -i32::try_from(end - whole - 1).unwrap_or(0);
    }
    let mut value: f64 = text[at..end].parse().unwrap_or(f64::NAN);
    if next(end) == Some('e') {
        let sign = usize::from(matches!(next(end + 1), Some('-' | '+')));
        let after = digits(end + 1 + sign);
        if after > end + 1 + sign {
            let power: i32 = text[end + 1..after].parse().unwrap_or(0);
            value *= 10_f64.powi(power);
            last += power;
            end = after;
        }
    }
    let mut power = 0;
    while let Some(digit) = next(end).and_then(raised) {
        power = 10 * power + digit;
        end += next(end).map_or(0, char::len_utf8);
    }
    if power > 0 {
        value = value.powf(f64::from(power));
        last = i32::try_from(power).unwrap_or(0);
    }
    let sign = text[..at]
        .chars()
        .next_back()
        .filter(|c| ['+', '-', '−'].contains(c));
    let before = sign.map_or(at, |sign| at - sign.len_utf8());
    let stands_alone = !text[..before]
        .chars()
        .next_back()
        .is_some_and(char::is_alphanumeric);
    let sign = sign.filter(|_| stands_alone);
    Number {
        start: sign.map_or(at, |_| before),
        end,
        value: if sign.is_some_and(|sign| sign != '+') {
            -value
        } else {
            value
        },
        last,
        signed: sign.is_some(),
        percent: text[end..]
            .trim_start_matches([' ', '\u{a0}'])
            .starts_with('%'),
        half: None,
    }
}
