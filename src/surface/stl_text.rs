//! The ASCII form of STL, word by word.

use std::io::{BufRead, Bytes};

use super::Error;

/// Longer than any word of the format or its numbers; what goes on is no text of it.
const LONGEST_WORD: usize = 64;

/// The corners of every solid in the text. Words may be in capitals, names are in any
/// encoding: both come out of exporters.
///
/// stl_io reads binary files here, but of a text it takes the first solid only, and would cut an
/// assembly short without a word.
///
/// # Errors
/// A word that does not belong there, or an end before `endsolid`.
pub(super) fn corners(text: impl BufRead, name: &str) -> Result<Vec<[[f32; 3]; 3]>, Error> {
    let mut words =
        Words { bytes: text.bytes(), name, line: 1, line_ended: false, triangles: 0, word: String::new() };
    let mut corners = Vec::new();
    while words.next()? {
        words.is("solid")?;
        words.skip_line()?;
        loop {
            words.next()?;
            if words.word == "endsolid" {
                words.skip_line()?;
                break;
            }
            words.is("facet or endsolid")?;
            corners.push(words.triangle()?);
            words.triangles += 1;
        }
    }
    Ok(corners)
}

struct Words<'a, R> {
    bytes: Bytes<R>,
    name: &'a str,
    line: u64,
    line_ended: bool,
    triangles: u64,
    word: String,
}

impl<R: BufRead> Words<'_, R> {
    fn triangle(&mut self) -> Result<[[f32; 3]; 3], Error> {
        self.expect("normal")?;
        for _ in 0..3 {
            self.number()?;
        }
        self.expect("outer")?;
        self.expect("loop")?;
        let mut corners = [[0.0; 3]; 3];
        for corner in &mut corners {
            self.expect("vertex")?;
            for coordinate in corner.iter_mut() {
                *coordinate = self.number()?;
            }
        }
        self.expect("endloop")?;
        self.expect("endfacet")?;
        Ok(corners)
    }

    fn expect(&mut self, wanted: &'static str) -> Result<(), Error> {
        self.next()?;
        self.is(wanted)
    }

    /// Refuses the word at hand unless it is the first of `wanted`.
    fn is(&self, wanted: &'static str) -> Result<(), Error> {
        if wanted.split(' ').next() == Some(self.word.as_str()) { Ok(()) } else { Err(self.refused(wanted)) }
    }

    fn number(&mut self) -> Result<f32, Error> {
        self.next()?;
        self.word.parse().map_err(|_| self.refused("a number"))
    }

    fn refused(&self, wanted: &'static str) -> Error {
        let found =
            if self.word.is_empty() { "the end of the file".into() } else { format!("{:?}", self.word) };
        Error::StlText { path: self.name.into(), line: self.line, triangles: self.triangles, wanted, found }
    }

    /// Reads the next word in lower case; an empty one, and false, at the end of the file.
    fn next(&mut self) -> Result<bool, Error> {
        self.word.clear();
        self.line += u64::from(std::mem::take(&mut self.line_ended));
        while let Some(byte) = self.byte()? {
            match byte {
                b'\n' if self.word.is_empty() => self.line += 1,
                b' ' | b'\t' | b'\r' if self.word.is_empty() => {}
                b' ' | b'\t' | b'\r' | b'\n' => {
                    self.line_ended = byte == b'\n';
                    return Ok(true);
                }
                _ => self.word.push(byte.to_ascii_lowercase().into()),
            }
            if self.word.len() > LONGEST_WORD {
                return Err(self.refused("a word"));
            }
        }
        Ok(!self.word.is_empty())
    }

    fn skip_line(&mut self) -> Result<(), Error> {
        while !self.line_ended {
            match self.byte()? {
                Some(b'\n') | None => self.line_ended = true,
                Some(_) => {}
            }
        }
        Ok(())
    }

    fn byte(&mut self) -> Result<Option<u8>, Error> {
        self.bytes.next().transpose().map_err(|source| Error::Io { path: self.name.into(), source })
    }
}
