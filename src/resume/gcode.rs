//! G-code: the modal groups as the text spells them.

use std::collections::BTreeMap;

use super::{Error, Whole};

/// Modal groups, in the order in which they are written out. Motion, feed and distance come after
/// the way to the pass, which is in absolute rapids.
const GROUPS: [&str; 14] = [
    "units",
    "plane",
    "feed mode",
    "side",
    "length",
    "offset",
    "path",
    "arcs",
    "return",
    "speed",
    "spindle",
    "coolant",
    "mist",
    "air",
];

/// The words that hold at some line.
#[derive(Clone, Default)]
struct State {
    groups: BTreeMap<&'static str, String>,
    relative: bool,
    motion: Option<String>,
    feed: Option<String>,
}

pub(super) fn resumed(whole: &Whole) -> Result<Vec<u8>, Error> {
    let lines = whole.lines();
    let at = whole.pass.number;
    let start = whole.first.line as usize - 1;
    let descent = whole.pass.line as usize - 1;
    let mut spelling = Spelling::default();
    let mut state = State::default();
    let mut begun = State::default();
    for (index, line) in lines[..descent].iter().enumerate() {
        if index == start {
            begun = state.clone();
        }
        let words = words(line);
        if index >= start && words.iter().any(|word| word == &(b'M', "6".into())) {
            return Err(Error::Tool { at, line: index + 1 });
        }
        state.take(&words);
        spelling.take(&words);
    }
    let before = whole.reading.motions[..whole.pass.motion].last();
    let unit_mm = if state.groups.get("units").is_some_and(|code| code == "G20") { 25.4 } else { 1.0 };
    let mut out: Vec<u8> = Vec::with_capacity(whole.text.len());
    // Above the first block, below the number of the program.
    let begins = |line: &&[u8]| words(line).first().is_some_and(|word| word.0 != b'O');
    let header = lines[..start].iter().position(begins).unwrap_or(start);
    let comment = Style::of(&lines[..start]);
    for (index, line) in lines[..start].iter().enumerate() {
        if index == header
            && let Some(style) = comment
        {
            out.extend(style.line(&format!("resumed at pass {at}"), whole.ending()));
        }
        if !super::passes::marked(line) {
            out.extend(if index < header { of_the_whole(line) } else { line.to_vec() });
        }
    }
    let mut push = |text: &str| {
        if !text.is_empty() {
            out.extend_from_slice(text.as_bytes());
            out.extend_from_slice(whole.ending());
        }
    };
    for group in GROUPS {
        if let Some(word) = state.groups.get(group).filter(|word| begun.groups.get(group) != Some(word)) {
            push(word);
        }
    }
    if before.is_some() {
        if state.relative || begun.relative {
            push("G90");
        }
        let (from, to) = (whole.started_mm(), whole.pass.before_mm);
        let lateral =
            format!("G0 X{} Y{}", spelling.number(to[0] / unit_mm), spelling.number(to[1] / unit_mm));
        let z = format!("Z{}", spelling.number(to[2] / unit_mm));
        if to[2] > from[2] {
            push(&format!("G0 {z}"));
            push(&lateral);
        } else if to[2] == from[2] {
            push(&format!("{lateral} {z}"));
        } else {
            push(&lateral);
            push(&z);
        }
        if state.relative {
            push("G91");
        }
    }
    if let Some(feed) = &state.feed {
        push(feed);
    }
    if let Some(motion) = state.motion.as_ref().filter(|motion| *motion != "G0") {
        push(motion);
    }
    if let Some(style) = comment.filter(|_| super::passes::marked(whole.text)) {
        out.extend(style.line(&format!("pass {at}"), whole.ending()));
    }
    for line in &lines[descent..] {
        out.extend_from_slice(line);
    }
    Ok(out)
}

/// A line of the header whose figure is no longer that of the text: it is said to be of the whole, in no more letters.
fn of_the_whole(line: &[u8]) -> Vec<u8> {
    let mut line = line.to_vec();
    for (said, instead) in
        [("sha256 of all lines below", "sha256 of the whole body"), ("estimated time", "time in whole")]
    {
        let found = line.windows(said.len()).position(|part| part.eq_ignore_ascii_case(said.as_bytes()));
        if let Some(at) = found {
            let capitals = line[at].is_ascii_uppercase();
            let text = if capitals { instead.to_ascii_uppercase() } else { instead.into() };
            line.splice(at..at + said.len(), text.bytes());
        }
    }
    line
}

impl State {
    fn take(&mut self, words: &[(u8, String)]) {
        let with = |code: &str, letters: &[u8]| {
            let mut text = code.to_string();
            for (letter, number) in words.iter().filter(|word| letters.contains(&word.0)) {
                text.push_str(&format!(" {}{number}", *letter as char));
            }
            text
        };
        for (letter, number) in words {
            let word = format!("{}{number}", *letter as char);
            let group = match word.as_str() {
                "G0" | "G1" | "G2" | "G3" => {
                    self.motion = Some(word);
                    continue;
                }
                "G90" | "G91" => {
                    self.relative = word == "G91";
                    continue;
                }
                "G20" | "G21" => "units",
                "G17" | "G18" | "G19" => "plane",
                "G94" => "feed mode",
                "G40" => "side",
                "G43" | "G49" => {
                    self.groups.insert("length", with(&word, b"H"));
                    continue;
                }
                "G61" | "G61.1" | "G64" | "G187" => {
                    self.groups.insert("path", with(&word, b"PQE"));
                    continue;
                }
                "G90.1" | "G91.1" => "arcs",
                "G98" | "G99" => "return",
                "M3" | "M4" | "M5" => "spindle",
                "M7" => "mist",
                "M8" => "coolant",
                "M9" => {
                    self.groups.remove("mist");
                    "coolant"
                }
                "M12" | "M13" => "air",
                _ if *letter == b'S' => "speed",
                _ if *letter == b'F' => {
                    self.feed = Some(word);
                    continue;
                }
                _ if word.starts_with("G5") && word.len() > 2 && word != "G53" => "offset",
                _ => continue,
            };
            self.groups.insert(group, word);
        }
    }
}

/// How the text writes coordinates.
struct Spelling {
    decimals: usize,
    pointed: bool,
}

impl Default for Spelling {
    fn default() -> Spelling {
        Spelling { decimals: 3, pointed: true }
    }
}

impl Spelling {
    fn take(&mut self, words: &[(u8, String)]) {
        for (_, number) in words.iter().filter(|word| b"XYZ".contains(&word.0)) {
            match number.split_once('.') {
                Some((_, fraction)) => self.decimals = self.decimals.max(fraction.len()),
                None => self.pointed = false,
            }
        }
    }

    fn number(&self, value: f64) -> String {
        let text = format!("{value:.*}", self.decimals.min(9));
        let short = text.trim_end_matches('0').trim_end_matches('.');
        let short = if short == "-0" { "0" } else { short };
        if self.pointed && !short.contains('.') { format!("{short}.0") } else { short.into() }
    }
}

/// How the text writes comments.
#[derive(Clone, Copy)]
struct Style {
    brackets: bool,
    upper_case: bool,
}

impl Style {
    /// None where no comment stands in these lines.
    fn of(lines: &[&[u8]]) -> Option<Style> {
        let comments = || lines.iter().filter(|line| line.starts_with(b"(") || line.starts_with(b";"));
        let brackets = comments().next()?.starts_with(b"(");
        let upper_case = !comments().any(|line| line.iter().any(u8::is_ascii_lowercase));
        Some(Style { brackets, upper_case })
    }

    fn line(self, text: &str, ending: &[u8]) -> Vec<u8> {
        let text = if self.upper_case { text.to_ascii_uppercase() } else { text.into() };
        let mut line = if self.brackets { format!("({text})") } else { format!("; {text}") }.into_bytes();
        line.extend_from_slice(ending);
        line
    }
}

/// Letters and numbers of a line that the reader has taken, codes without leading zeros.
fn words(line: &[u8]) -> Vec<(u8, String)> {
    let mut words: Vec<(u8, String)> = Vec::new();
    let mut inside = false;
    for byte in line.iter().map(u8::to_ascii_uppercase) {
        match byte {
            b'(' => inside = true,
            b')' => inside = false,
            _ if inside => {}
            b';' | b'%' => break,
            b'A'..=b'Z' => words.push((byte, String::new())),
            b'0'..=b'9' | b'.' | b'-' | b'+' => {
                if let Some((_, number)) = words.last_mut() {
                    number.push(byte as char);
                }
            }
            _ => {}
        }
    }
    for (letter, number) in &mut words {
        if b"GM".contains(letter) {
            let plain = number.trim_start_matches('0');
            *number = if plain.is_empty() { "0".into() } else { plain.trim_end_matches('.').into() };
        }
    }
    words
}
