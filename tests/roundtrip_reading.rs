//! What texts mean: the same path said in other ways reads as the same motions.

use proptest::prelude::*;
use screenmill::resume;
use screenmill::verify::{Language, Motion, Note, Options, Reading, language};

fn read(text: &str) -> Reading {
    Reading::of(text.as_bytes(), &Options::default()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn ends(reading: &Reading) -> Vec<[f64; 3]> {
    reading.motions.iter().map(|m| m.to_mm).collect()
}

#[track_caller]
fn same(a: &str, b: &str) {
    let (a, b) = (read(a), read(b));
    assert_eq!(a.motions.len(), b.motions.len());
    for (a, b) in a.motions.iter().zip(&b.motions) {
        assert_eq!(a.rapid(), b.rapid());
        assert!(a.rapid() || (a.feed_mm_min - b.feed_mm_min).abs() < 1e-3, "{a:?} {b:?}");
        for axis in 0..3 {
            let apart = (a.to_mm[axis] - b.to_mm[axis]).abs();
            assert!(apart < 1e-9 || (a.to_mm[axis].is_nan() && b.to_mm[axis].is_nan()), "{a:?} {b:?}");
        }
    }
}

const PLAIN: &str = "G21 G90 G17 M3\nG0 Z5\nG0 X0 Y0\nG1 Z-0.5 F300\nG1 X25.4 Y12.7\nG1 X-1.5\nG0 Z5\nM2\n";

#[test]
fn units_distances_and_spelling_do_not_matter() {
    same(
        PLAIN,
        "G20 G90 M3\nG0 Z0.196850393700787\nG0 X0 Y0\nG1 Z-0.019685039370079 F11.811023622047\nG1 X1 Y0.5\n\
         G1 X-0.059055118110236\nG0 Z0.196850393700787\nM2\n",
    );
    same(PLAIN, "G21 G90 M3\nG0 Z5\nG0 X0 Y0\nG91\nG1 Z-5.5 F300\nG1 X25.4 Y12.7\nG1 X-26.9\nG0 Z5.5\nM30\n");
    same(
        PLAIN,
        "%\nO0001 \n(part)\ng21g90g017m03\nN10 g00 z + 5.\nN20 x0y0\ng01z-.5f300 ; down\nX2 5.4Y12.70(along)\nx-01.5\ng0z5\nm02\nG1 X99\n",
    );
    // What ends a scaling, a macro, a rotation and polar coordinates that no block began.
    same(PLAIN, &PLAIN.replace("G17", "G17 G40 G49 G80 G69 G15 G50 G67 G97"));
    for end in ["\r\n", "\r"] {
        same(PLAIN, &PLAIN.replace('\n', end));
        assert_eq!(lines_of(PLAIN), lines_of(&PLAIN.replace('\n', end)));
    }
    same(PLAIN, &(PLAIN.replace("M2\n", "%\n").replace("G21", "%\nG21")));
}

#[test]
fn numbers_are_the_nearest_doubles() {
    let reading = read("G21 G90\nG0 X0.1 Y-123.4567 Z25.0001\nG0 X0.30000000000000004\nM2\n");
    assert_eq!(ends(&reading)[0], [0.1, -123.4567, 25.0001]);
    assert!((ends(&reading)[1][0] - 0.3).abs() < 1e-15);
}

fn lines_of(text: &str) -> Vec<u32> {
    read(text).motions.iter().map(|motion| motion.line).collect()
}

/// Old editors and some senders end lines with CR alone; a stopped program is taken up in its own ends.
#[test]
fn lone_carriage_returns_end_lines() {
    let rml = "^DF\n^PA\nV15.0\n!MC1\n!ZM200\nZ0,0,200\nZ0,0,-100\nV5.0\nZ100,0,-100\nV15.0\nZ100,0,200\nV30.0\n\
        Z0,50,200\nV15.0\nZ0,50,-100\nV5.0\nZ100,50,-100\nV15.0\nZ100,50,200\n!MC0\nH\n";
    let gcode =
        "G21 G90\nM3 S9000\nG0 Z5\nG0 X0 Y0\nG1 Z-1 F80\nX9 F400\nG0 Z5\nX0 Y5\nG1 Z-1 F80\nX9\nG0 Z5\nM2\n";
    let options = Options::default();
    for text in [rml, gcode] {
        let old = text.replace('\n', "\r");
        same(text, &old);
        assert_eq!(lines_of(text), lines_of(&old));
        let resumed = |text: &str| {
            let again = resume::resume(text.as_bytes(), 2, &options).expect("two passes");
            String::from_utf8(again.text).expect("text")
        };
        assert_eq!(resumed(text).replace('\n', "\r"), resumed(&old));
    }
    let refusal = |text: &str| {
        Reading::of(text.as_bytes(), &options).err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert!(refusal("G21\rG0 Z5\r\rG0 X1 $\r").starts_with("line 4, column 7: "), "a place in G-code");
    assert!(refusal("^DF\r^PA\rV5\r!QQ1\r").starts_with("line 4, column 1: "), "a place in RML-1");
}

/// A transfer that broke off between two lines leaves a text that runs, and the cutter in the part.
#[test]
fn rml_that_ends_with_the_spindle_on_is_told() {
    let text = |end: &str| format!("^DF\n^PA\nV5\n!MC1\n!ZM200\nZ0,0,200\nZ0,0,-10\n{end}");
    assert_eq!(read(&text("")).summary.notes, [Note::SpindleOn { line: 7 }]);
    assert_eq!(read(&text("H\n!MC\n")).summary.notes, [Note::SpindleOn { line: 9 }]);
    for end in ["H\n", "!MC0\n", "^DF\n"] {
        assert_eq!(read(&text(end)).summary.notes, []);
    }
}

#[test]
fn a_start_is_not_known_until_named() {
    let reading = read(PLAIN);
    assert!(reading.motions[0].to_mm[0].is_nan() && reading.motions[0].to_mm[2] == 5.0);
    let extent = reading.extent();
    assert_eq!((extent.low_mm, extent.high_mm), ([-1.5, 0.0, -0.5], [25.4, 12.7, 5.0]));
    let cutting = 5.5 + (25.4f64 * 25.4 + 12.7 * 12.7).sqrt() + 26.9;
    assert!((extent.cutting_mm - cutting).abs() < 1e-12);
    assert!((extent.rapid_mm - 5.5).abs() < 1e-12);
    assert_eq!(reading.summary.blocks, 8);
    assert_eq!(reading.summary.bytes, PLAIN.len() as u64);
}

#[test]
fn home_is_not_a_place() {
    let reading = read("G21 G90 M3\nG0 Z5\nG0 X1 Y2\nG91 G28 Z0.\nG90\nG53 G0 Z0\nG0 X5\nG28 X0 Y0\nM30\n");
    let last = reading.motions.last().expect("motions").to_mm;
    assert!(last.iter().all(|v| v.is_nan()), "{last:?}");
    // G28 passes through the point its words name.
    assert!(ends(&reading).iter().any(|p| p[0] == 0.0 && p[1] == 0.0));
    assert!(reading.extent().high_mm[2] == 5.0);
}

fn arc_ends(reading: &Reading, radius: f64, centre: [f64; 2], axes: [usize; 2]) {
    let chords = &reading.motions[reading.arcs[0].first..][..reading.arcs[0].chords];
    let mut before = reading.motions[reading.arcs[0].first - 1].to_mm;
    for Motion { to_mm, .. } in chords {
        let off = |p: &[f64; 3]| (p[axes[0]] - centre[0]).hypot(p[axes[1]] - centre[1]);
        assert!((off(to_mm) - radius).abs() < 1e-6, "{to_mm:?}");
        let middle: [f64; 3] = std::array::from_fn(|i| 0.5 * (before[i] + to_mm[i]));
        assert!(radius - off(&middle) < 1.01e-4, "{middle:?}");
        before = *to_mm;
    }
}

#[test]
fn arcs_are_chords_within_a_tenth_of_a_micrometre() {
    let head = "G21 G90 M3\nG0 Z0\nG0 X10 Y0\nF100\n";
    let quarter = read(&format!("{head}G3 X0 Y10 I-10 J0\nM2\n"));
    arc_ends(&quarter, 10.0, [0.0, 0.0], [0, 1]);
    assert_eq!(quarter.motions.last().expect("motions").to_mm, [0.0, 10.0, 0.0]);
    assert!((quarter.extent().cutting_mm - 5.0 * std::f64::consts::PI).abs() < 1e-3);
    // By R, by absolute centre, in inches and the long way round.
    for other in
        ["G3 X0 Y10 R10", "G90.1 G3 X0 Y10 I0 J0", "G20\nG3 X0 Y0.393700787401575 I-0.393700787401575 J0"]
    {
        let other = read(&format!("{head}{other} F100\nM2\n"));
        assert!((other.extent().cutting_mm - quarter.extent().cutting_mm).abs() < 1e-6);
    }
    let long = read(&format!("{head}G3 X0 Y10 R-10\nM2\n"));
    assert!((long.extent().cutting_mm - 15.0 * std::f64::consts::PI).abs() < 1e-3);
    let back = read(&format!("{head}G2 X0 Y10 I-10\nM2\n"));
    assert!((back.extent().cutting_mm - 15.0 * std::f64::consts::PI).abs() < 1e-3);
    let whole = read(&format!("{head}G2 I-10\nM2\n"));
    assert!((whole.extent().cutting_mm - 20.0 * std::f64::consts::PI).abs() < 1e-3);
    let turns = read(&format!("{head}G2 X10 Z-2 I-10 P2\nM2\n"));
    let length = (40.0f64 * std::f64::consts::PI).hypot(2.0);
    assert!((turns.extent().cutting_mm - length).abs() < 2e-3);
}

#[test]
fn planes_turn_by_the_right_hand() {
    // G18: seen from +Y, counterclockwise goes from Z to X.
    let reading = read("G21 G90 M3\nG0 Z1\nG0 X0 Y0\nG18 G3 X1 Z0 K-1 F100\nM2\n");
    arc_ends(&reading, 1.0, [0.0, 0.0], [0, 2]);
    assert!((reading.extent().cutting_mm - 0.5 * std::f64::consts::PI).abs() < 1e-3);
    let reading = read("G21 G90 M3\nG0 Z0\nG0 X0 Y1\nG19 G3 Y0 Z1 J-1 F100\nM2\n");
    assert!((reading.extent().cutting_mm - 0.5 * std::f64::consts::PI).abs() < 1e-3);
}

#[test]
fn rml_and_gcode_of_one_path_read_alike() {
    let gcode = "G21 G90 M3\nG0 Z5\nG0 X1 Y1\nG1 Z-0.12 F60\nG1 X2 Z-0.07 F300\nG1 X1 Z5 F1800\nM2\n";
    let rml = ";;^DF\r\n^PA\r\n!RC8\r\nV 30;F 30\r\n!MC1\r\n!ZM 500\r\nZ 100,100,500\r\nW3000\r\nZ 100,100,500\r\nW0\r\n\
        V 1.0\r\nZ 100,100,-12\r\nV 5.0\r\nZ 200,100,-7\r\nV30\r\nZ 100,100,500\r\nH\r\n";
    let (gcode, rml) = (read(gcode), read(rml));
    assert_eq!((gcode.summary.language, rml.summary.language), (Language::GCode, Language::Rml1));
    let known: Vec<_> = ends(&rml).into_iter().filter(|p| p.iter().all(|v| v.is_finite())).collect();
    // The point of the dwell is named twice.
    assert_eq!(known[1..], ends(&gcode)[1..]);
    assert_eq!(rml.dwells, vec![(2, 3.0)]);
    let extent = rml.extent();
    assert!((extent.rapid_mm - 1f64.hypot(5.07)).abs() < 1e-9, "{extent:?}");
    assert!((extent.cutting_mm - 5.12 - 1f64.hypot(0.05)).abs() < 1e-9);
}

#[test]
fn rml_modes_and_ways_of_moving() {
    let up_down = "PA;!PZ-20,300;VS10;!VZ5;!MC1;PU100,200;PD300,200,300,400;PU;!MC0;\n";
    let reading = read(up_down);
    let known: Vec<_> = ends(&reading).into_iter().filter(|p| p[0].is_finite()).collect();
    assert_eq!(
        known,
        [[1.0, 2.0, 3.0], [1.0, 2.0, -0.2], [3.0, 2.0, -0.2], [3.0, 4.0, -0.2], [3.0, 4.0, 3.0]]
    );
    let feeds: Vec<f32> = reading.motions.iter().filter(|m| !m.rapid()).map(|m| m.feed_mm_min).collect();
    assert_eq!(feeds, [300.0, 600.0, 600.0]);
    let mode_1 = "^PA;@-20,300;F10;V5;!MC1;M100,200;D300,200,300,400;M;!MC0;\n";
    same(up_down, mode_1);
    // A second call for PA at the start of mode 2 names the same path in steps.
    same(
        "^PA;V10;Z100,100,100;Z200,100,100,200,300,50;H;\n",
        "^PA;V10;Z100,100,100;^PR;Z100,0,0,0,200,-50;H;\n",
    );
}

#[test]
fn coarse_units_are_an_option() {
    let options = Options { rml_unit_mm: 0.025, ..Options::default() };
    let reading = Reading::of(b"^IN;V 15;Z 40,80,-4;\n", &options).expect("a sound program");
    assert_eq!(reading.motions[0].to_mm, [1.0, 2.0, -0.1]);
}

#[test]
fn a_text_tells_its_language() {
    for text in
        [";;^IN;!MC1;", "^DF\n", "PA;PA;VS4;", "\r\n;;IN;", "V 30;F 30\n", "Z 1,2,3\n", "F 3;\nZ1,2,3;"]
    {
        assert_eq!(language(text.as_bytes()), Language::Rml1, "{text}");
    }
    for text in [
        "; PA part\nG0 X1",
        "%\nO1",
        "(V 30)\nG1",
        "; comment\nM3",
        "N1 G0",
        "F100\nG1 X1",
        "; IN inches\nG20",
    ] {
        assert_eq!(language(text.as_bytes()), Language::GCode, "{text}");
    }
}

#[test]
fn what_an_operator_should_know_is_noted() {
    let reading = read("G21 G90\nG0 Z1\nG0 X0 Y0\nG4 P3000\nG1 X1 F100\nM2\n");
    assert_eq!(
        reading.summary.notes,
        [Note::LongDwell { line: 4, seconds: 3000.0 }, Note::SpindleOff { line: 5 }]
    );
}

#[test]
fn a_replay_gives_the_events_again() {
    let text = "G21 G90 M3\nG0 Z1\nG0 X0 Y0\nG64 P0.002\nG4 P1\nG1 X1 F100\nM0\nG2 X2 I0.5\nG4 P2\nM2\n";
    let mut direct = Vec::new();
    let mut source = text.as_bytes();
    screenmill::verify::read(&mut source, &Options::default(), &mut |e| {
        direct.push(format!("{e:?}"));
        Ok(())
    })
    .expect("a sound program");
    let mut again = Vec::new();
    read(text).replay(&mut |e| again.push(format!("{e:?}")));
    let plain = |events: &[String]| -> Vec<String> {
        events
            .iter()
            .map(|e| {
                if e.starts_with("Dwell") { e.split(", line").next().unwrap_or(e).into() } else { e.clone() }
            })
            .collect()
    };
    assert_eq!(plain(&direct), plain(&again));
}

/// Bytes that make up programs, so that random ones get past the first character.
fn scraps() -> impl Strategy<Value = Vec<u8>> {
    let words: Vec<&'static str> = vec![
        "G0",
        "G1",
        "G2",
        "G3",
        "G20",
        "G21",
        "G90",
        "G91",
        "G17",
        "G18",
        "G28",
        "G43 H1",
        "G53",
        "G64 P0.001",
        "G4 P1",
        "G187 P3 E0.01",
        "X1",
        "Y-2.5",
        "Z5",
        "Z-1",
        "I1",
        "J0.5",
        "R2",
        "F300",
        "S9000",
        "M3",
        "M5",
        "M2",
        "M30",
        "T1 M6",
        "N10",
        "O1",
        "%",
        "(pass 1)",
        "(pass 2)",
        "; pass 3",
        "\n",
        "\r\n",
        " ",
        "^DF",
        "^PA",
        "^PR",
        "PU",
        "PD1,2;",
        "Z0,0,500",
        "Z100,50,-20",
        "!ZM500",
        "!MC1",
        "!RC8",
        "V15.0",
        "W3000",
        "W0",
        "H",
        ";",
        ",",
        "-",
        ".",
        "1e9",
        "9999999999",
        "#1",
        "[",
        "/",
        "\u{e9}",
        "\0",
    ];
    let piece = prop_oneof![
        8 => prop::sample::select(words).prop_map(|word| word.as_bytes().to_vec()),
        1 => prop::collection::vec(any::<u8>(), 0..4),
    ];
    prop::collection::vec(piece, 0..60).prop_map(|pieces| pieces.concat())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A reading or a refusal, never a panic, for both languages and for what is resumed of them.
    #[test]
    fn any_bytes_are_read_or_refused(text in scraps(), rml in any::<bool>(), at in 0u64..4) {
        let text = if rml { [b"^DF\n^PA\nV15.0\nZ0,0,500\n".as_slice(), &text].concat() } else { text };
        let options = Options::default();
        if let Err(refusal) = Reading::of(&text, &options) {
            let message = refusal.to_string();
            prop_assert!(!message.is_empty() && message.lines().count() <= 12);
        }
        if let Ok(resumed) = resume::resume(&text, at, &options) {
            prop_assert!(Reading::of(&resumed.text, &options).is_ok());
        }
    }
}
