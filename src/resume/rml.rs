//! RML-1: the modal commands as the text spells them.

use super::{Error, Whole};
use crate::verify::Options;

/// Speed of three axes, speed of a lowered tool, dwell, spindle, speed code, heights: the last
/// spelling of each.
#[derive(Clone, Default, PartialEq)]
struct State {
    modal: [Option<String>; 6],
    relative: bool,
}

pub(super) fn resumed(whole: &Whole, options: &Options) -> Result<Vec<u8>, Error> {
    let lines = whole.lines();
    let at = whole.pass.number;
    let start = whole.first.line as usize - 1;
    let descent = whole.pass.line as usize - 1;
    let (mut state, mut begun) = (State::default(), State::default());
    for (index, line) in lines[..descent].iter().enumerate() {
        if index == start {
            begun = state.clone();
        }
        state.take(line);
    }
    if state.relative {
        return Err(Error::Relative { at, line: descent });
    }
    let moves = commands(lines[descent]).into_iter().find(|command| command.0 == "Z" || command.0 == "!ZZ");
    let Some((command, _)) = moves else { return Err(Error::Flat { at }) };
    let mut out: Vec<u8> = Vec::with_capacity(whole.text.len());
    lines[..start].iter().for_each(|line| out.extend_from_slice(line));
    let mut push = |text: &str| {
        out.extend_from_slice(text.as_bytes());
        // A semicolon ends a command in either mode, the line end too in mode 1.
        out.extend_from_slice(if command == "Z" { b"" } else { b";" });
        out.extend_from_slice(whole.ending());
    };
    let units = |mm: f64| (mm / options.rml_unit_mm).round() as i64;
    let (from, to) = (whole.started_mm(), whole.pass.before_mm);
    let place = |x: f64, y: f64, z: f64| format!("{command}{},{},{}", units(x), units(y), units(z));
    if to[2] > from[2] {
        push(&place(from[0], from[1], to[2]));
    }
    push(&place(to[0], to[1], from[2].max(to[2])));
    if to[2] < from[2] {
        push(&place(to[0], to[1], to[2]));
    }
    for (now, then) in state.modal.iter().zip(&begun.modal) {
        if let Some(text) = now.as_ref().filter(|_| now != then) {
            push(text);
        }
    }
    lines[descent..].iter().for_each(|line| out.extend_from_slice(line));
    Ok(out)
}

impl State {
    fn take(&mut self, line: &[u8]) {
        for (name, text) in commands(line) {
            let group = match name.trim_start_matches('^') {
                "DF" | "IN" => {
                    *self = State::default();
                    continue;
                }
                "PA" | "PR" => {
                    self.relative = name.ends_with("PR");
                    continue;
                }
                "V" | "!VZ" => 0,
                "F" | "VS" => 1,
                "W" | "!DW" => 2,
                "!MC" => 3,
                "!RC" => 4,
                "@" | "!PZ" => 5,
                _ => continue,
            };
            self.modal[group] = Some(text);
        }
    }
}

/// The commands of a line that the reader has taken: name, and name with parameters.
fn commands(line: &[u8]) -> Vec<(String, String)> {
    const PAIRS: [&[u8]; 7] = [b"DF", b"IN", b"PA", b"PD", b"PR", b"PU", b"VS"];
    let line = line.to_ascii_uppercase();
    let mut commands = Vec::new();
    let mut at = 0;
    while at < line.len() {
        let rest = &line[at..];
        let name = match rest[0] {
            b'!' | b'^' => 3,
            b'A'..=b'Z' | b'@' if rest.len() > 1 && PAIRS.contains(&&rest[..2]) => 2,
            b'A'..=b'Z' | b'@' => 1,
            _ => {
                at += 1;
                continue;
            }
        }
        .min(rest.len());
        let numbers = rest[name..].iter().take_while(|byte| b"0123456789+-., ".contains(byte)).count();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_string();
        commands.push((text(&rest[..name]), text(&rest[..name + numbers])));
        at += name + numbers;
    }
    commands
}
