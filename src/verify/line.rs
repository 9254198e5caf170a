//! Lines of a program's text. They end with LF, CR LF, or CR alone, as old editors and some senders write it.

use std::io::{self, BufRead};

/// Reads the next line without its end into `text`, but no more than a little past `most` bytes of it.
/// Gives the bytes taken from the source, 0 at its end.
pub(super) fn next(source: &mut dyn BufRead, text: &mut Vec<u8>, most: usize) -> io::Result<usize> {
    text.clear();
    let mut taken = 0;
    while text.len() <= most {
        let buffer = source.fill_buf()?;
        if buffer.is_empty() {
            break;
        }
        let found = memchr::memchr2(b'\n', b'\r', buffer);
        let end = found.unwrap_or(buffer.len());
        text.extend_from_slice(&buffer[..end]);
        let carriage = found.is_some_and(|at| buffer[at] == b'\r');
        // Where both bytes of the end are held, they are taken at once.
        let both = carriage && buffer.get(end + 1) == Some(&b'\n');
        let last = end + 1 == buffer.len();
        let used = end + usize::from(found.is_some()) + usize::from(both);
        source.consume(used);
        taken += used;
        if found.is_some() {
            if carriage && last && source.fill_buf()?.first() == Some(&b'\n') {
                source.consume(1);
                taken += 1;
            }
            break;
        }
    }
    Ok(taken)
}

/// The lines of a whole text with their ends, counted as the readers count them.
pub fn lines(text: &[u8]) -> Vec<&[u8]> {
    let mut lines = Vec::new();
    let mut rest = text;
    while !rest.is_empty() {
        let end = memchr::memchr2(b'\n', b'\r', rest).map_or(rest.len(), |at| {
            at + if rest[at] == b'\r' && rest.get(at + 1) == Some(&b'\n') { 2 } else { 1 }
        });
        let (line, after) = rest.split_at(end);
        lines.push(line);
        rest = after;
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::BufReader;

    /// Every way to end lines, whatever the size of the source's buffer.
    #[test]
    fn all_ends_are_read_alike() {
        for text in ["a\nbc\n\nd", "a\r\nbc\r\n\r\nd", "a\rbc\r\rd", "a\nbc\r\n\rd", "a\rbc\n\nd\n"] {
            for capacity in 1..8 {
                let mut source = BufReader::with_capacity(capacity, text.as_bytes());
                let (mut line, mut found, mut bytes) = (Vec::new(), Vec::new(), 0);
                loop {
                    match next(&mut source, &mut line, 100).expect("read") {
                        0 => break,
                        taken => bytes += taken,
                    }
                    found.push(String::from_utf8_lossy(&line).into_owned());
                }
                assert_eq!(found, ["a", "bc", "", "d"], "{text:?} {capacity}");
                assert_eq!(bytes, text.len());
            }
            let whole = lines(text.as_bytes());
            assert_eq!(whole.concat(), text.as_bytes());
            assert_eq!(whole.len(), 4);
        }
    }

    #[test]
    fn a_line_past_its_most_is_given_up() {
        let text = "X".repeat(100);
        let mut line = Vec::new();
        let taken = next(&mut BufReader::with_capacity(8, text.as_bytes()), &mut line, 20).expect("read");
        assert!(taken == line.len() && (21..30).contains(&taken), "{taken}");
    }
}
