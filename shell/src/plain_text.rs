//! Text of files, paths and arguments, made safe for a terminal: control characters are escaped, lines have a limit.
//!
//! A name may hold the sequences by which a terminal clears its screen, changes its title or hides what stands there, and
//! a defective file one line of a gigabyte. What a program prints shows them and obeys none.

use std::io::{self, Write};

/// Largest length of a line for a person, bytes.
pub const LONGEST_LINE: usize = 300;
/// Bytes of a longer line's end that are kept: an error's mend stands there.
const KEPT_END: usize = 120;
/// Mark in place of what was left out.
const CUT: &str = " … ";

/// The text on one line: line breaks and tabs become spaces, other control characters are escaped (`\u{1b}`), and the
/// middle of a line that is longer than [`LONGEST_LINE`] is left out.
pub fn one_line(text: &str) -> String {
    cut_to(&escaped(text.trim_end()), LONGEST_LINE)
}

/// The text with line breaks and tabs as spaces and other control characters escaped.
pub fn escaped(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\n' | '\t' => plain.push(' '),
            c if is_unprintable(c) => plain.extend(c.escape_unicode()),
            c => plain.push(c),
        }
    }
    plain
}

/// A line of at most so many bytes, 200 or more: the middle of a longer one is left out.
pub fn cut_to(line: &str, longest: usize) -> String {
    if line.len() <= longest {
        return line.to_owned();
    }
    let begin = line.floor_char_boundary(longest.saturating_sub(KEPT_END + CUT.len()));
    let end = line.ceil_char_boundary(line.len() - KEPT_END);
    format!("{}{CUT}{}", &line[..begin], &line[end..])
}

/// Whether a terminal could obey a character or show the text around it in another order.
fn is_unprintable(c: char) -> bool {
    c.is_control() || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Writer of text that escapes control characters, line breaks and tabs excepted.
#[derive(Debug)]
pub struct PlainWriter<W> {
    inner: W,
    /// Whether the last byte begins one of the control characters of two bytes (U+0080 to U+009F).
    is_open: bool,
}

/// First byte of the control characters from U+0080 in UTF-8.
const LEAD: u8 = 0xc2;

impl<W: Write> PlainWriter<W> {
    /// Writer to another one.
    pub fn new(inner: W) -> Self {
        Self { inner, is_open: false }
    }
}

impl<W: Write> Write for PlainWriter<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut plain = Vec::with_capacity(bytes.len());
        for byte in bytes.iter().copied() {
            if std::mem::take(&mut self.is_open) {
                if (0x80..0xa0).contains(&byte) {
                    plain.extend(format!("\\u{{{byte:x}}}").bytes());
                    continue;
                }
                plain.push(LEAD);
            }
            match byte {
                LEAD => self.is_open = true,
                b'\n' | b'\t' => plain.push(byte),
                0..0x20 | 0x7f => plain.extend(format!("\\u{{{byte:x}}}").bytes()),
                byte => plain.push(byte),
            }
        }
        self.inner.write_all(&plain)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_a_terminal_obeys_is_left() {
        let line = one_line("a\u{1b}[2J\u{7}\0b\r\n\tc\u{9b}31m é\u{202e}x\n");
        assert_eq!(line, "a\\u{1b}[2J\\u{7}\\u{0}b\\u{d}  c\\u{9b}31m é\\u{202e}x");
        assert!(!line.chars().any(is_unprintable));
    }

    #[test]
    fn a_long_line_keeps_its_beginning_and_its_end() {
        let long = format!("room.toml: line 1: {}; mend it", "é".repeat(3_000_000));
        let line = one_line(&long);
        assert!((LONGEST_LINE - 8..=LONGEST_LINE).contains(&line.len()), "{}", line.len());
        assert!(line.starts_with("room.toml: line 1: é") && line.ends_with("é; mend it"), "{line}");
        let whole = "x".repeat(LONGEST_LINE);
        assert_eq!(one_line(&whole), whole);
    }

    #[test]
    fn a_writer_escapes_across_its_calls() {
        let mut text = Vec::new();
        let mut writer = PlainWriter::new(&mut text);
        for part in ["é\tzone\n".as_bytes(), b"\x1b[2J\xc2", b"\x9b1\xc2", b"\xa0|\x7f\r"] {
            writer.write_all(part).unwrap();
        }
        assert_eq!(String::from_utf8(text).unwrap(), "é\tzone\n\\u{1b}[2J\\u{9b}1\u{a0}|\\u{7f}\\u{d}");
    }
}
