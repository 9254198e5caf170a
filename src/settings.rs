//! Strict TOML: scenes, jobs, machines, dialects, fixtures and tool libraries are read through here,
//! so that every unknown key, missing key and wrong value is refused with its file, its line and
//! the nearest thing that would have been right.
//!
//! Types that are read this way carry `#[serde(deny_unknown_fields)]` and neither `flatten` nor
//! `untagged`, which lose the line. Fixed lists of numbers are [`Numbers`], since a plain array
//! takes a list that is too long in silence.

use std::io::Read as _;
use std::path::Path;

use serde::de::{DeserializeOwned, Deserializer, Error as _};
use toml::de::{DeTable, DeValue};

/// The longest settings file that is read, in bytes.
pub const LONGEST_BYTES: u64 = 4 << 20;

/// Why a settings file was refused.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("{path}: {source}")]
    Read { path: String, source: std::io::Error },
    #[error(
        "{path} is longer than {limit} bytes; hint: settings files are short TOML text, is this the right file?"
    )]
    Long { path: String, limit: u64 },
    #[error(
        "{path} is not UTF-8 text from byte {byte}; hint: settings files are TOML, is this the right file?"
    )]
    Text { path: String, byte: usize },
    #[error(
        "{path}:{line}: column {column}: {message}; hint: a line of TOML is key = value, [table] or [[list]]"
    )]
    Syntax { path: String, line: usize, column: usize, message: String },
    #[error("{path}:{line}: unknown key \"{key}\"{place}; hint: {hint}")]
    UnknownKey { path: String, line: usize, key: String, place: String, hint: String },
    #[error("{path}:{line}: {key}\"{value}\" is not known; hint: {hint}")]
    UnknownValue { path: String, line: usize, key: String, value: String, hint: String },
    #[error("{path}:{line}: the key \"{key}\" is missing{place}; hint: add it, there is no default")]
    MissingKey { path: String, line: usize, key: String, place: String },
    #[error("{path}:{line}: {key}{message}")]
    Type { path: String, line: usize, key: String, message: String },
    #[error(
        "{path}:{line}: {key} is {}; hint: it must lie in {} .. {}",
        plain(value),
        plain(low),
        plain(high)
    )]
    Range { path: String, line: usize, key: String, value: f64, low: f64, high: f64 },
    #[error("{path}:{line}: schema is {found}, this version reads schema {known}; hint: schema = {known}")]
    Schema { path: String, line: usize, found: u32, known: u32 },
}

/// Reads a TOML file into `T`.
pub fn read<T: DeserializeOwned>(path: &Path) -> Result<T, Error> {
    Source::read(path)?.parse()
}

/// Reads TOML text into `T`; `path` names it in errors.
pub fn parse<T: DeserializeOwned>(text: &str, path: &str) -> Result<T, Error> {
    Source::new(text, path).parse()
}

/// The text of a settings file with its name, kept so that checks after parsing can name the line.
#[derive(Clone, Debug)]
pub struct Source {
    path: String,
    text: String,
}

impl Source {
    /// Text that is already in memory; `path` names it in errors.
    pub fn new(text: &str, path: &str) -> Source {
        Source { path: path.into(), text: text.into() }
    }

    /// Reads a file of at most [`LONGEST_BYTES`].
    pub fn read(path: &Path) -> Result<Source, Error> {
        let name = path.display().to_string();
        let refuse = |source| Error::Read { path: path.display().to_string(), source };
        let mut bytes = Vec::new();
        std::fs::File::open(path)
            .map_err(refuse)?
            .take(LONGEST_BYTES + 1)
            .read_to_end(&mut bytes)
            .map_err(refuse)?;
        if bytes.len() as u64 > LONGEST_BYTES {
            return Err(Error::Long { path: name, limit: LONGEST_BYTES });
        }
        let text = String::from_utf8(bytes)
            .map_err(|e| Error::Text { path: name.clone(), byte: e.utf8_error().valid_up_to() })?;
        Ok(Source { path: name, text })
    }

    /// The name that errors carry.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Reads the text into `T`.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, Error> {
        toml::from_str(&self.text).map_err(|error| self.explain(&error))
    }

    /// The line, from 1, of a key written as `screen.width_m` or `audience[1].vertices_m`: that of
    /// its longest part that the file holds.
    pub fn line_of(&self, key: &str) -> usize {
        let Ok(root) = DeTable::parse(&self.text) else { return 1 };
        let mut value = DeValue::Table(root.into_inner());
        let mut start = 0;
        for part in key.split(['.', '[']) {
            let index = part.strip_suffix(']').and_then(|digits| digits.parse::<usize>().ok());
            let next = match (&value, index) {
                (DeValue::Array(list), Some(i)) => list.get(i).map(|v| (v.span().start, v.get_ref().clone())),
                (DeValue::Table(table), None) => {
                    table.get_key_value(part).map(|(k, v)| (k.span().start, v.get_ref().clone()))
                }
                _ => None,
            };
            match next {
                Some((at, inner)) => (start, value) = (at, inner),
                None => break,
            }
        }
        self.position(start).0
    }

    /// `value` if it lies in `low ..= high`; NaN never does. `key` as in [`Source::line_of`].
    pub fn within(&self, key: &str, value: f64, low: f64, high: f64) -> Result<f64, Error> {
        if value >= low && value <= high {
            return Ok(value);
        }
        let line = self.line_of(key);
        Err(Error::Range { path: self.path.clone(), line, key: key.into(), value, low, high })
    }

    /// Refuses a file whose `schema` is not the one known.
    pub fn schema(&self, found: u32, known: u32) -> Result<(), Error> {
        if found == known {
            return Ok(());
        }
        Err(Error::Schema { path: self.path.clone(), line: self.line_of("schema"), found, known })
    }

    /// Refuses a value that is none of the names known, with the nearest of them.
    pub fn unknown_value(&self, key: &str, value: &str, known: &[&str]) -> Error {
        let line = self.line_of(key);
        let key = format!("{key} = ");
        Error::UnknownValue {
            path: self.path.clone(),
            line,
            key,
            value: shortened(value),
            hint: hint(value, known),
        }
    }

    fn explain(&self, error: &toml::de::Error) -> Error {
        let at = error.span().map_or(0, |span| span.start);
        let (line, column) = self.position(at);
        let path = self.path.clone();
        let message = error.message();
        let place = self.table(at);
        let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
        if message.starts_with("unknown field") {
            let key = quoted.first().copied().unwrap_or_default();
            let hint = hint(key, quoted.get(1..).unwrap_or_default());
            Error::UnknownKey { path, line, key: shortened(key), place, hint }
        } else if message.starts_with("unknown variant") {
            let value = quoted.first().copied().unwrap_or_default();
            let hint = hint(value, quoted.get(1..).unwrap_or_default());
            Error::UnknownValue { path, line, key: self.key_before(at, " = "), value: shortened(value), hint }
        } else if message.starts_with("missing field") {
            let key = quoted.first().copied().unwrap_or_default().into();
            Error::MissingKey { path, line, key, place }
        } else if toml::from_str::<toml::Table>(&self.text).is_ok() {
            let message = shortened(&in_plain_words(message));
            Error::Type { path, line, key: self.key_before(at, ": "), message }
        } else {
            Error::Syntax { path, line, column, message: shortened(message) }
        }
    }

    /// Line and column, from 1, of a byte.
    fn position(&self, at: usize) -> (usize, usize) {
        let before = &self.text.as_bytes()[..at.min(self.text.len())];
        let line_start = before.iter().rposition(|&b| b == b'\n').map_or(0, |i| i + 1);
        let line = before.iter().filter(|&&b| b == b'\n').count() + 1;
        (line, String::from_utf8_lossy(&before[line_start..]).chars().count() + 1)
    }

    /// ` in [table]` for the header at or above a byte; empty above the first.
    fn table(&self, at: usize) -> String {
        let line = self.position(at).0;
        let name = |l: &'_ str| -> Option<String> {
            let inner = l.split('#').next()?.trim().strip_prefix('[')?.strip_suffix(']')?;
            let inner = inner.trim_matches(['[', ']']);
            inner.chars().all(|c| c.is_alphanumeric() || "_-.\"' ".contains(c)).then(|| inner.to_string())
        };
        let header = self.text.lines().take(line).filter_map(name).last();
        header.map_or(String::new(), |name| format!(" in [{}]", shortened(&name)))
    }

    /// The key that stands before a value on its line, and what follows it; empty if none does.
    fn key_before(&self, at: usize, then: &str) -> String {
        let before = self.text.get(..at).unwrap_or_default();
        let line = before.rsplit('\n').next().unwrap_or_default();
        line.split_once('=').map_or(String::new(), |(key, _)| format!("{}{then}", key.trim()))
    }
}

/// A number without a row of zeros.
fn plain(value: &f64) -> String {
    let size = value.abs();
    if size > 0.0 && !(1e-4..1e9).contains(&size) && size.is_finite() {
        format!("{value:e}")
    } else {
        format!("{value}")
    }
}

fn shortened(text: &str) -> String {
    let one_line = text.escape_debug().to_string().replace("\\\"", "\"").replace("\\'", "'");
    match one_line.char_indices().nth(160) {
        Some((end, _)) => format!("{}...", &one_line[..end]),
        None => one_line,
    }
}

fn in_plain_words(message: &str) -> String {
    match message.split_once(", expected ") {
        Some((found, wanted)) => {
            let wanted = match wanted {
                "f64" | "f32" => "a number".into(),
                "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number of 0 or more".into(),
                "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number".into(),
                _ if wanted.starts_with("struct ") => "a table".into(),
                _ if wanted.contains("enum ") => "a name in quotes".into(),
                _ => wanted.replace("an array", "a list").replace("a sequence", "a list"),
            };
            format!("{}; hint: it must be {wanted}", found.replace('`', ""))
        }
        None => message.into(),
    }
}

/// The nearest of the names known, else all of them. A key without its unit is nearest to the same
/// key with one.
fn hint(word: &str, known: &[&str]) -> String {
    let likeness = |name: &str| {
        let with_unit = !word.is_empty() && name.strip_prefix(word).is_some_and(|rest| rest.starts_with('_'));
        if with_unit { 1.0 } else { strsim::jaro_winkler(&word.to_lowercase(), &name.to_lowercase()) }
    };
    let nearest =
        known.iter().map(|name| (likeness(name), name)).fold(None, |best: Option<(f64, &&str)>, it| {
            if best.is_none_or(|b| it.0 > b.0) { Some(it) } else { best }
        });
    match nearest {
        Some((likeness, name)) if likeness > 0.75 => format!("did you mean \"{name}\"?"),
        Some(_) => {
            let names: Vec<String> = known.iter().map(|name| format!("\"{name}\"")).collect();
            format!("known here: {}", shortened(&names.join(", ")))
        }
        None => "no key is known here".into(),
    }
}

/// A list of exactly N finite numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers<const N: usize>(pub [f64; N]);

impl<'de, const N: usize> serde::Deserialize<'de> for Numbers<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let list = Vec::<f64>::deserialize(deserializer)?;
        if let Some(bad) = list.iter().find(|v| !v.is_finite()) {
            return Err(D::Error::custom(format!(
                "a number of the list is {bad}, expected {N} finite numbers"
            )));
        }
        let numbers = <[f64; N]>::try_from(list)
            .map_err(|list| D::Error::custom(format!("a list of {}, expected {N} numbers", list.len())))?;
        Ok(Numbers(numbers))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Deserialize, Debug)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Sheet {
        schema: u32,
        pattern: Option<Pattern>,
        tool: Tool,
    }

    #[derive(Deserialize, Debug)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Tool {
        stepover_mm: f64,
        at_mm: Numbers<2>,
    }

    #[derive(Deserialize, Debug)]
    #[serde(rename_all = "kebab-case")]
    enum Pattern {
        Zigzag,
        OneWay,
    }

    fn refusal(text: &str) -> String {
        parse::<Sheet>(text, "s.toml").expect_err("must be refused").to_string()
    }

    #[test]
    fn refusals_name_the_line_and_the_nearest_name() {
        let cases = [
            (
                "schema = 1\n[tool]\nstepover = 1\nat_mm = [0, 0]\n",
                "s.toml:3: unknown key \"stepover\" in [tool]; hint: did you mean \"stepover_mm\"?",
            ),
            (
                "schema = 1\nqq = 2\n",
                "s.toml:2: unknown key \"qq\"; hint: known here: \"schema\", \"pattern\", \"tool\"",
            ),
            (
                "schema = 1\n\n[tool]\nat_mm = [0, 0]\n",
                "s.toml:3: the key \"stepover_mm\" is missing in [tool]; hint: add it, there is no default",
            ),
            ("schema = 1\n", "s.toml:1: the key \"tool\" is missing; hint: add it, there is no default"),
            (
                "schema = 1\npattern = \"one_way\"\n",
                "s.toml:2: pattern = \"one_way\" is not known; hint: did you mean \"one-way\"?",
            ),
            (
                "schema = 1\n[tool]\nstepover_mm = \"a\"\n",
                "s.toml:3: stepover_mm: invalid type: string \"a\"; hint: it must be a number",
            ),
            (
                "schema = 1\n[tool]\nstepover_mm = 1\nat_mm = [1, 2, 3]\n",
                "s.toml:4: at_mm: a list of 3; hint: it must be 2 numbers",
            ),
            (
                "schema = 1\n[tool]\nstepover_mm = 1\nat_mm = [1, nan]\n",
                "s.toml:4: at_mm: a number of the list is NaN; hint: it must be 2 finite numbers",
            ),
            (
                "schema = 1\n[tool\n",
                "s.toml:2: column 6: unclosed table, expected `]`; hint: a line of TOML is key = value, [table] or [[list]]",
            ),
            (
                "schema = 1\nschema = 1\n",
                "s.toml:2: column 1: duplicate key; hint: a line of TOML is key = value, [table] or [[list]]",
            ),
        ];
        for (text, message) in cases {
            assert_eq!(refusal(text), message);
        }
    }

    #[test]
    fn checks_after_parsing_name_their_line() {
        let source =
            Source::new("schema = 2\n[a]\nb = [[1,\n 2], [3, 4]]\n[[c]]\nd = 1\n[[c]]\nd = 5\n", "x.toml");
        assert_eq!(source.line_of("a.b"), 3);
        assert_eq!(source.line_of("a.b[1]"), 4);
        assert_eq!(source.line_of("c[1].d"), 8);
        assert_eq!(source.line_of("c[1].missing"), 7);
        assert_eq!(source.within("c[1].d", 5.0, 0.0, 5.0).ok(), Some(5.0));
        let error = source.within("c[1].d", 5.0, 0.0, 4.0).expect_err("out of range");
        assert_eq!(error.to_string(), "x.toml:8: c[1].d is 5; hint: it must lie in 0 .. 4");
        assert!(source.within("c[1].d", f64::NAN, 0.0, 4.0).is_err());
        let error = source.schema(2, 1).expect_err("unknown schema");
        assert_eq!(error.to_string(), "x.toml:1: schema is 2, this version reads schema 1; hint: schema = 1");
    }
}
