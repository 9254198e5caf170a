//! What is written is read back by a reader of its own, and has to be the toolpath, unit by unit.

use proptest::prelude::*;
use screenmill::machine::{Library, Machine, Tool};
use screenmill::post::{self, Dialect, Point, Program, StockFacts, ZZero};
use screenmill::resume;
use screenmill::toolpath::{GridPoint, Kind, Move, Toolpath};
use screenmill::verify::{Options, Reading};

/// Dialect, machine, and how it spells 320 and 80 mm/min, then 30 and 15 mm/s where rapids need them.
const DIALECTS: [(&str, &str, [&str; 4]); 10] = [
    ("linuxcnc", "linuxcnc-mill", ["320", "80", "", ""]),
    ("grbl", "grbl-router", ["320", "80", "", ""]),
    ("grblhal", "grbl-router", ["320", "80", "", ""]),
    ("fluidnc", "grbl-router", ["320", "80", "", ""]),
    ("mach3", "linuxcnc-mill", ["320", "80", "", ""]),
    ("haas", "linuxcnc-mill", ["320.0", "80.0", "", ""]),
    ("fanuc", "linuxcnc-mill", ["320.", "80.", "", ""]),
    ("roland-nc", "linuxcnc-mill", ["320.0", "80.0", "", ""]),
    ("rml1", "roland-egx-600", ["5.3", "1.3", "30.0", "15.0"]),
    ("rml1-25um", "roland-egx-600", ["5.3", "1.3", "30.0", "15.0"]),
];

fn text_of(path: &Toolpath, tool: &Tool, dialect: &Dialect, machine: &Machine) -> Vec<u8> {
    texts_of(path, tool, dialect, machine, false).swap_remove(0)
}

/// The program of a path, or its sections.
fn texts_of(
    path: &Toolpath,
    tool: &Tool,
    dialect: &Dialect,
    machine: &Machine,
    in_sections: bool,
) -> Vec<Vec<u8>> {
    let stock = StockFacts {
        material: "aluminium".into(),
        width_mm: 10.0,
        height_mm: 10.0,
        thickness_mm: 10.0,
        top_allowance_mm: 0.2,
    };
    let program = Program {
        path,
        part: "p",
        tile: "r0c0",
        operation: "finish",
        number: 1,
        section: None,
        tool,
        stock: &stock,
        spindle: true,
        z_zero: ZZero::StockTop,
        wcs: "G55",
        clearance_mm: 5.0,
        notes: &[],
    };
    let whole = vec![(None, std::borrow::Cow::Borrowed(path))];
    let pieces =
        if in_sections { post::sections(&program, dialect, machine).expect("sections") } else { whole };
    let texts = pieces.iter().map(|(section, path)| {
        let mut text = Vec::new();
        let program = Program { path, section: *section, ..program.clone() };
        post::write(&program, dialect, machine, &mut text).expect("written");
        text
    });
    texts.collect()
}

/// A motion as read: where to, and the feed in mm/min (None: rapid).
#[derive(Debug, PartialEq)]
struct Read {
    to: GridPoint,
    feed: Option<String>,
}

fn units(text: &str, decimals: usize) -> i32 {
    let (sign, digits) = text.strip_prefix('-').map_or((1, text), |rest| (-1, rest));
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    assert!(fraction.len() <= decimals, "{text} is finer than the grid");
    sign * format!("{whole}{fraction:0<decimals$}").parse::<i32>().expect("digits")
}

fn read_g_code(text: &str, decimals: usize) -> Vec<Read> {
    let mut at = [0; 3];
    let (mut rapid, mut feed) = (true, String::new());
    let mut motions = Vec::new();
    // From the first pass mark on, the first motion names everything; M5 begins the end.
    let body = text.lines().skip_while(|line| !line.eq_ignore_ascii_case("(pass 1)"));
    for line in body.take_while(|line| *line != "M5").filter(|line| !line.starts_with('(')) {
        let mut moved = false;
        for word in line.split(' ') {
            let (letter, value) = word.split_at(1);
            match letter {
                "X" | "Y" | "Z" => {
                    at["XYZ".find(letter).expect("one of them")] = units(value, decimals);
                    moved = true;
                }
                "F" => feed = value.into(),
                "G" if value == "0" => rapid = true,
                "G" if value == "1" => rapid = false,
                _ => {}
            }
        }
        if moved {
            motions.push(Read { to: at, feed: (!rapid).then(|| feed.clone()) });
        }
    }
    motions
}

fn read_rml(text: &str) -> Vec<Read> {
    let mut feed = String::new();
    let mut motions: Vec<Read> = Vec::new();
    for line in text.split("\r\n") {
        if let Some(speed) = line.strip_prefix('V') {
            feed = speed.into();
        } else if let Some(point) = line.strip_prefix('Z') {
            let words: Vec<i32> = point.split(',').map(|word| word.parse().expect("an integer")).collect();
            let to = [words[0], words[1], words[2]];
            if motions.last().is_none_or(|last| last.to != to) {
                motions.push(Read { to, feed: Some(feed.clone()) });
            }
        }
    }
    motions
}

fn path(unit_mm: f64, steps: &[(u8, i32, i32, i32)]) -> Toolpath {
    let clearance = (5.0 / unit_mm).round() as i32;
    let mut at = [steps[0].1, steps[0].2, clearance];
    let mut moves = vec![Move { kind: Kind::Rapid, to: at }];
    for &(kind, x, y, z) in steps {
        match kind % 4 {
            0 => {
                moves.push(Move { kind: Kind::Rapid, to: [at[0], at[1], clearance] });
                moves.push(Move { kind: Kind::Rapid, to: [x, y, clearance] });
                at = [x, y, clearance];
            }
            1 => {
                at[2] = -z.abs();
                moves.push(Move { kind: Kind::Plunge, to: at });
            }
            _ => {
                at = [x, y, -z.abs()];
                moves.push(Move { kind: Kind::Cut, to: at });
            }
        }
    }
    Toolpath { unit_mm, moves, pass_starts: vec![0], tilt: None }
}

fn wanted(path: &Toolpath, clearance: i32, feeds: [&str; 4], rapids: bool) -> Vec<Read> {
    let mut motions: Vec<Read> = Vec::new();
    let mut moves = path.moves.clone();
    let last = moves[moves.len() - 1].to;
    moves.push(Move { kind: Kind::Rapid, to: [last[0], last[1], clearance] });
    for one in moves {
        let from = motions.last().map(|m| m.to);
        if from == Some(one.to) {
            continue;
        }
        let feed = match one.kind {
            Kind::Cut => Some(feeds[0]),
            Kind::Plunge => Some(feeds[1]),
            Kind::Rapid if !rapids => None,
            Kind::Rapid if from.is_none_or(|from| from[2] != one.to[2]) => Some(feeds[3]),
            Kind::Rapid => Some(feeds[2]),
        };
        motions.push(Read { to: one.to, feed: feed.map(String::from) });
    }
    motions
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn every_dialect_says_the_toolpath_and_keeps_its_limits(
        steps in prop::collection::vec((any::<u8>(), -60_000..60_000i32, -40_000..40_000i32, 0..4_000i32), 1..60)
    ) {
        let library = Library::find("tools", None).expect("embedded");
        let tool = library.tool("ball-1").expect("in it");
        for (name, machine, feeds) in DIALECTS {
            let dialect = Dialect::find(name, None).expect("embedded");
            let machine = Machine::find(machine, None).expect("embedded");
            let path = path(dialect.unit_mm, &steps);
            let text = text_of(&path, tool, &dialect, &machine);
            let clearance = (5.0 / dialect.unit_mm).round() as i32;
            let ending = dialect.line_ending.bytes();
            prop_assert!(text.ends_with(ending), "the last byte ends a line");
            let text = String::from_utf8(text).expect("ASCII");
            let lines: Vec<&str> = text.split(std::str::from_utf8(ending).expect("ASCII")).collect();
            for line in &lines[..lines.len() - 1] {
                prop_assert!(!line.is_empty() && line.len() <= dialect.limits.line_max, "{name}: {line}");
                prop_assert!(line.bytes().all(|b| (b' '..=b'~').contains(&b)), "{name}: {line}");
                prop_assert!(!line.contains(|c| dialect.limits.forbidden.contains(c)), "{name}: {line}");
                for word in line.split([' ', ',', ';']).filter(|_| !line.starts_with('(')) {
                    prop_assert!(!dialect.limits.missing.iter().any(|m| m == word), "{name}: {line}");
                }
            }
            if dialect.word.x.point == Point::Always {
                let bare = |word: &str| "XYZF".contains(&word[..1]) && !word.contains('.');
                for line in lines.iter().filter(|line| !line.starts_with('(') && !line.is_empty()) {
                    prop_assert!(!line.split(' ').any(bare), "{name}: a number without a point: {line}");
                }
            }
            let read = match dialect.comment {
                Some(_) => read_g_code(&text, dialect.word.x.decimals as usize),
                None => read_rml(&text),
            };
            let want = wanted(&path, clearance, feeds, dialect.word.feed.rapids);
            prop_assert_eq!(read, want, "{}", name);
        }
    }
}

/// LinuxCNC's own interpreter accepts what is written and sees the same end points.
#[test]
fn linuxcnc_reads_it_as_meant() {
    let probe = std::process::Command::new("rs274").arg("-v").stdin(std::process::Stdio::null()).output();
    if probe.is_err() {
        assert!(std::env::var_os("CI").is_none(), "rs274 of linuxcnc-uspace is needed in CI");
        println!("skipped: rs274 of linuxcnc-uspace is not installed");
        return;
    }
    let dialect = Dialect::find("linuxcnc", None).expect("embedded");
    let machine = Machine::find("linuxcnc-mill", None).expect("embedded");
    let library = Library::find("tools", None).expect("embedded");
    let steps: Vec<(u8, i32, i32, i32)> = (0..200)
        .map(|i| ((i as u8).wrapping_mul(7), i * 977 % 50_001, i * 613 % 30_001, i * 37 % 3001))
        .collect();
    let path = path(dialect.unit_mm, &steps);
    let text = text_of(&path, library.tool("ball-1").expect("in it"), &dialect, &machine);
    let folder = tempfile::tempdir().expect("a scratch folder");
    let file = folder.path().join("p.ngc");
    std::fs::write(&file, &text).expect("writable");
    let output = std::process::Command::new("rs274")
        .arg("-g")
        .arg(&file)
        .current_dir(folder.path())
        .env("HOME", folder.path())
        .stdin(std::process::Stdio::null())
        .output()
        .expect("rs274 runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8_lossy(&output.stderr).trim(), "executing");
    let canonical = String::from_utf8(output.stdout).expect("text");
    assert!(canonical.contains("SET_MOTION_CONTROL_MODE(CANON_CONTINUOUS, 0.001000)"), "{canonical}");
    assert!(canonical.contains("START_SPINDLE_CLOCKWISE") && canonical.contains("DWELL(3.0000)"));
    assert!(canonical.contains("PROGRAM_END()"));
    let ends: Vec<GridPoint> = canonical
        .lines()
        .filter(|line| line.contains("STRAIGHT_"))
        .map(|line| {
            let inside = &line[line.find('(').expect("arguments") + 1..];
            let words: Vec<i32> = inside.split(", ").take(3).map(|word| units(word, 4)).collect();
            [words[0], words[1], words[2]]
        })
        .collect();
    // rs274 -g has the origin of its G55 at zero, and the lift of the start block comes first.
    let want: Vec<GridPoint> =
        wanted(&path, 50_000, ["", "", "", ""], false).into_iter().map(|read| read.to).collect();
    // The last goes to the back left corner of the motions, on the clearance plane.
    let (park, cut) = ends[1..].split_last().expect("motions");
    assert_eq!(cut, want);
    let edge = |axis: usize, pick: fn(i32, i32) -> i32| want.iter().map(|to| to[axis]).reduce(pick);
    assert_eq!(Some(*park), edge(0, i32::min).zip(edge(1, i32::max)).map(|(x, y)| [x, y, 50_000]));
}

/// Twenty passes of 5 mm, each from the clearance plane and back to it.
fn twenty_passes(unit_mm: f64) -> Toolpath {
    let mm = |mm: f64| (mm / unit_mm).round() as i32;
    let (mut moves, mut pass_starts) = (Vec::new(), Vec::new());
    for pass in 0..20 {
        let y = mm(0.25 * f64::from(pass));
        pass_starts.push(moves.len());
        moves.push(Move { kind: Kind::Rapid, to: [0, y, mm(5.0)] });
        moves.push(Move { kind: Kind::Rapid, to: [0, y, mm(0.5)] });
        moves.push(Move { kind: Kind::Plunge, to: [0, y, -mm(0.1 + 0.025 * f64::from(pass))] });
        moves.push(Move { kind: Kind::Cut, to: [mm(2.0), y, -mm(0.2)] });
        moves.push(Move { kind: Kind::Cut, to: [mm(5.0), y, -mm(0.1)] });
        moves.push(Move { kind: Kind::Rapid, to: [mm(5.0), y, mm(5.0)] });
    }
    Toolpath { unit_mm, moves, pass_starts, ..Toolpath::default() }
}

fn reading(text: &[u8], dialect: &Dialect) -> Reading {
    let options = Options { rml_unit_mm: dialect.unit_mm, ..Options::default() };
    Reading::of(text, &options).unwrap_or_else(|e| panic!("{}: {e}", dialect.name))
}

/// Ends of the motions that lie below the clearance plane.
fn below(reading: &Reading) -> Vec<[f64; 3]> {
    reading.motions.iter().map(|motion| motion.to_mm).filter(|to| to[2] < 5.0 - 1e-9).collect()
}

#[test]
fn sections_cut_what_the_whole_cuts_and_each_within_its_limits() {
    let library = Library::find("tools", None).expect("embedded");
    let mut tool = library.tool("ball-1").expect("in it").clone();
    for (name, machine, _) in DIALECTS {
        let dialect = Dialect::find(name, None).expect("embedded");
        let mut machine = Machine::find(machine, None).expect("embedded");
        let path = twenty_passes(dialect.unit_mm);
        let whole = reading(&text_of(&path, &tool, &dialect, &machine), &dialect);
        tool.tool_life_m = Some(0.05);
        let worn = texts_of(&path, &tool, &dialect, &machine, true);
        tool.tool_life_m = Some(1e6);
        let most = if dialect.comment.is_some() { 2400 } else { 700 };
        machine.transfer.memory_bytes = Some(most);
        let stored = texts_of(&path, &tool, &dialect, &machine, true);
        machine.transfer.memory_bytes = None;
        assert_eq!(
            texts_of(&path, &tool, &dialect, &machine, true).len(),
            1,
            "{name}: nothing asks for sections"
        );
        // 5.6 to 6.1 mm of plunge and cut a pass: eight of them are less than 50 mm.
        assert_eq!(worn.len(), 3, "{name}");
        assert!(stored.iter().all(|text| text.len() as u64 <= most), "{name}");
        for texts in [&worn, &stored] {
            let readings: Vec<Reading> = texts.iter().map(|text| reading(text, &dialect)).collect();
            let cut: Vec<[f64; 3]> = readings.iter().flat_map(below).collect();
            assert_eq!(cut, below(&whole), "{name}");
            for reading in &readings {
                let last = reading.motions.iter().rev().find(|m| m.known()).expect("motions");
                assert_eq!(last.to_mm[2], 5.0, "{name}: ends on the clearance plane");
            }
        }
        if dialect.comment.is_some() {
            let text = String::from_utf8(worn[1].clone()).expect("ASCII").to_lowercase();
            assert!(text.contains("2 of 3, fit a fresh cutter and set z0 again"), "{name}: {text}");
            assert!(text.contains("section 2 of 3 ends here"), "{name}");
        }
    }
}

#[test]
fn a_program_is_resumed_at_every_pass_in_every_dialect() {
    let library = Library::find("tools", None).expect("embedded");
    let tool = library.tool("ball-1").expect("in it");
    for (name, machine, _) in DIALECTS {
        let dialect = Dialect::find(name, None).expect("embedded");
        let machine = Machine::find(machine, None).expect("embedded");
        let options = Options { rml_unit_mm: dialect.unit_mm, ..Options::default() };
        let path = twenty_passes(dialect.unit_mm);
        let text = text_of(&path, tool, &dialect, &machine);
        let whole = reading(&text, &dialect);
        for at in [1, 2, 7, 20] {
            let resumed = resume::resume(&text, at, &options).unwrap_or_else(|e| panic!("{name} {at}: {e}"));
            assert_eq!((resumed.first, resumed.last), (1, 20), "{name}");
            let again = reading(&resumed.text, &dialect);
            let skipped = 4 * (at as usize - 1);
            assert_eq!(below(&again), below(&whole)[skipped..], "{name} {at}");
            // Nothing but the way there comes before, and none of it under the clearance plane.
            let first = again.motions.iter().position(|m| m.to_mm[2] < 5.0 - 1e-9).expect("a descent");
            assert!(
                again.motions[..first].iter().all(|m| m.to_mm[2].is_nan() || m.to_mm[2] >= 5.0 - 1e-9),
                "{name} {at}"
            );
            let over = again.motions[first - 1].to_mm;
            assert_eq!(over, [0.0, 0.25 * (at - 1) as f64, 5.0], "{name} {at}");
            let feed = again.motions[first].feed_mm_min;
            assert!(feed.is_infinite() || feed >= 900.0, "{name} {at}: comes down at {feed}");
            assert_eq!(again.dwells.len(), whole.dwells.len(), "{name} {at}: waits for the spindle");
            for line in resumed.text.split(|b| *b == b'\n') {
                assert!(line.len() <= dialect.limits.line_max + 1, "{name} {at}");
            }
            // The whole's hash and time are not those of what is left; from the first pass on it is the whole.
            let said = String::from_utf8_lossy(&resumed.text).to_ascii_lowercase();
            let part = at > 1 && dialect.comment.is_some();
            assert_eq!(said.contains("sha256 of the whole body"), part, "{name} {at}");
            assert!(
                !part || !(said.contains("of all lines below") || said.contains("estimated time")),
                "{said}"
            );
            // And again from there: marks keep their numbers, RML-1 is counted from 1.
            let next = if dialect.comment.is_some() { at } else { 1 };
            let twice = resume::resume(&resumed.text, next, &options).expect("again");
            assert_eq!(twice.text, resumed.text, "{name} {at}");
        }
    }
}
