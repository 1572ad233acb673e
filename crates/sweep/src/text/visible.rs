//! Text for people, with control sequences made visible.
//!
//! Names of files, excerpts and contents of stores are untrusted. A control character in them, such
//! as the escape that begins a command to the terminal, is written as `\u001b`, which JSON reads as
//! the same character.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::{self, Write};

/// Whether a character controls the terminal: control characters except line ends and tabs, and
/// those that change the direction of writing.
fn is_control_sequence(c: char) -> bool {
    (c.is_control() && c != '\n' && c != '\t')
        || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// The visible form of a text.
pub(crate) fn visible(text: &str) -> Cow<'_, str> {
    if !text.contains(is_control_sequence) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_control_sequence(c) {
            // Writing to a string does not fail.
            let _ = write!(shown, "\\u{:04x}", u32::from(c));
        } else {
            shown.push(c);
        }
    }
    Cow::Owned(shown)
}

/// The visible form with an equal number of bytes, so that positions in the text remain valid.
pub(crate) fn visible_in_place(text: &str) -> Cow<'_, str> {
    if !text.contains(is_control_sequence) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len());
    let mut characters = text.chars().peekable();
    while let Some(c) = characters.next() {
        let ends_line = c == '\r' && characters.peek() == Some(&'\n');
        if is_control_sequence(c) && !ends_line {
            shown.extend(std::iter::repeat_n('?', c.len_utf8()));
        } else {
            shown.push(c);
        }
    }
    Cow::Owned(shown)
}

/// Output for people: text passes through [`visible`].
#[derive(Debug)]
pub(crate) struct Visible<W> {
    to: W,
    /// Bytes of an incomplete character at the end of the last write.
    begun: Vec<u8>,
}

impl<W: Write> Visible<W> {
    pub(crate) const fn new(to: W) -> Self {
        Self {
            to,
            begun: Vec::new(),
        }
    }
}

/// Text output with direct access for binary data.
pub(crate) trait TextOutput: Write {
    /// The underlying output, unfiltered.
    fn raw(&mut self) -> &mut dyn Write;
}

impl<W: Write> TextOutput for Visible<W> {
    fn raw(&mut self) -> &mut dyn Write {
        &mut self.to
    }
}

impl<W: Write> Write for Visible<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.begun.extend_from_slice(bytes);
        let written = std::mem::take(&mut self.begun);
        let mut rest = written.as_slice();
        loop {
            match std::str::from_utf8(rest) {
                Ok(text) => {
                    self.to.write_all(visible(text).as_bytes())?;
                    return Ok(bytes.len());
                }
                Err(error) => {
                    let (whole, after) = rest.split_at(error.valid_up_to());
                    let text = String::from_utf8_lossy(whole);
                    self.to.write_all(visible(&text).as_bytes())?;
                    let Some(bad) = error.error_len() else {
                        after.clone_into(&mut self.begun);
                        return Ok(bytes.len());
                    };
                    self.to.write_all("\u{fffd}".as_bytes())?;
                    rest = &after[bad..];
                }
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

/// Standard error for people.
pub(crate) fn stderr() -> Visible<io::Stderr> {
    Visible::new(io::stderr())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn control_sequences_are_made_visible() {
        let evil = "a\u{1b}[31mred\u{1b}]0;title\u{7}\r\u{9b}2J\u{7f}\u{202e}b\tc\n";
        let shown = visible(evil);
        assert_eq!(
            shown,
            "a\\u001b[31mred\\u001b]0;title\\u0007\\u000d\\u009b2J\\u007f\\u202eb\tc\n"
        );
        assert_eq!(visible_in_place(evil).len(), evil.len());
        assert!(!visible_in_place(evil).contains(is_control_sequence));
    }

    #[test]
    fn json_means_the_same() {
        let name = "\u{9b}2J\u{7f}";
        let mut out = Visible::new(Vec::new());
        serde_json::to_writer(&mut out, name).unwrap();
        let back: String = serde_json::from_slice(&out.to).unwrap();
        assert_eq!(back, name);
        assert!(out.to.is_ascii());
    }

    proptest! {
        #[test]
        fn no_control_sequence_crashes_or_passes_at_any_cut(
            bytes in proptest::collection::vec(any::<u8>(), 0..60), cut in 0usize..60,
        ) {
            let cut = cut.min(bytes.len());
            let mut out = Visible::new(Vec::new());
            out.write_all(&bytes[..cut]).unwrap();
            out.write_all(&bytes[cut..]).unwrap();
            let text = String::from_utf8(out.to.clone()).unwrap();
            prop_assert!(!text.contains(is_control_sequence), "{:?}", text);
        }
    }
}
