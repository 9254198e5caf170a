//! `simulate` and `estimate` as a shop floor uses them.

use std::path::Path;

use assert_cmd::Command;
use predicates::prelude::*;
use screenmill::grid::{Heights, Window};
use screenmill::surface::{HeightWriter, Options, open};
use serde_json::Value;

const COLUMNS: usize = 300;
const ROWS: usize = 200;
const STEP_MM: f64 = 0.02;

/// 6 x 4 mm: a plane that falls to the right from z = 5.4 to z = 4.8.
fn height(x_mm: f64) -> f64 {
    5.4 - 0.1 * x_mm
}

fn part(dir: &Path) {
    let window = Window { column: 0, row: 0, columns: COLUMNS, rows: ROWS };
    let row = (0..COLUMNS).map(|c| height((c as f64 + 0.5) * STEP_MM) as f32);
    let z_mm = row.cycle().take(COLUMNS * ROWS).collect();
    let mut writer =
        HeightWriter::create(&dir.join("H.tif"), COLUMNS, ROWS, STEP_MM, [0.0, 1.0]).expect("H.tif");
    writer.write(&Heights { window, z_mm }).expect("a band");
    writer.finish().expect("whole");
}

/// Ball passes on the plane, in a frame whose zero is the lower left corner at z = 5.4.
fn program(shift_mm: f64) -> String {
    let lift = 0.5 * (1.01f64.sqrt() - 1.0) + 0.0002;
    let mut text = String::from("G21 G90 G17 G64 P0.001\nM3 S20000\nG4 P2\nG0 Z2\nG0 X-1 Y-0.6\n");
    let mut y = -0.6;
    while y < 4.6 {
        text += &format!("G0 Z2\nG0 X{:.4} Y{y:.4}\n", shift_mm - 1.0);
        text += &format!("G1 Z{:.4} F100\nG1 X{:.4} Z{:.4} F320\n", 0.1 + lift, shift_mm + 7.0, -0.7 + lift);
        y += 0.05;
    }
    text + "G0 Z2\nM5\nM2\n"
}

fn screenmill() -> Command {
    Command::cargo_bin("screenmill").expect("the binary")
}

fn simulate(dir: &Path, more: &[&str]) -> assert_cmd::assert::Assert {
    let mut command = screenmill();
    command.current_dir(dir).args(["simulate", "p.ngc", "--part", "H.tif", "--out", "out"]);
    if !more.contains(&"--cutter") {
        command.args(["--cutter", "ball:1"]);
    }
    if !more.contains(&"--zero") {
        command.args(["--zero", "0", "0", "5.4"]);
    }
    command.args(["--stock-top-mm", "5.6", "--quiet"]).args(more).assert()
}

fn report(dir: &Path) -> Value {
    let text = std::fs::read_to_string(dir.join("out/report.json")).expect("a report");
    serde_json::from_str(&text).expect("JSON")
}

fn heights(path: &Path) -> Vec<f32> {
    let opened = open(path, &Options::at_step(STEP_MM)).expect("a map");
    opened.surface.heights(opened.surface.lattice().window(), 0.0).expect("heights").z_mm
}

fn figure(report: &Value, key: &str) -> f64 {
    report["fidelity"][key].as_f64().unwrap_or_else(|| panic!("{key} in {report}"))
}

#[test]
fn a_sound_program_passes() {
    let dir = tempfile::tempdir().expect("a folder");
    part(dir.path());
    std::fs::write(dir.path().join("p.ngc"), program(0.0)).expect("a program");
    simulate(dir.path(), &["--machine", "linuxcnc-mill"]).success();
    let report = report(dir.path());
    assert_eq!(report["verdict"], "pass");
    assert_eq!(figure(&report, "gouge_max_mm"), 0.0);
    let bytes = || std::fs::read(dir.path().join("out/report.json")).expect("a report");
    let before = bytes();
    let after_its_cutter =
        ["--cutter", "ball:1", "p.ngc", "--part", "H.tif", "--out", "out", "--zero", "0", "0", "5.4"];
    screenmill()
        .current_dir(dir.path())
        .arg("simulate")
        .args(after_its_cutter)
        .args(["--stock-top-mm", "5.6", "--machine", "linuxcnc-mill", "--quiet"])
        .assert()
        .success();
    assert!(bytes() == before, "the same wherever the program stands");
    // 0.2 um of lift and the scallop of 0.05 mm passes, 0.63 um.
    assert!(figure(&report, "excess_max_mm") < 0.0009, "{report}");
    assert!(figure(&report, "normal_p95_deg") < 3.0, "{report}");
    assert!(report["time_s"]["total"].as_f64().expect("a time") > 150.0);
    let bite = report["programs"][0]["deepest_bite_mm"].as_f64().expect("a bite");
    assert!((0.3..0.81).contains(&bite), "{bite}");
    let machined = heights(&dir.path().join("out/machined.tif"));
    let deviation = heights(&dir.path().join("out/deviation.tif"));
    for (i, (z, d)) in machined.iter().zip(&deviation).enumerate() {
        let design = height(((i % COLUMNS) as f64 + 0.5) * STEP_MM);
        // Floats at 5 mm hold half a micrometre's thousandth.
        assert!((f64::from(*z) - design - f64::from(*d)).abs() < 2e-6, "sample {i}");
    }
}

#[test]
fn one_wrong_z_word_changes_the_verdict() {
    let dir = tempfile::tempdir().expect("a folder");
    part(dir.path());
    let wrong = program(0.0).replacen("Z-0.69", "Z-0.79", 50).replacen("Z-0.79", "Z-0.69", 49);
    assert_ne!(wrong, program(0.0));
    std::fs::write(dir.path().join("p.ngc"), wrong).expect("a program");
    simulate(dir.path(), &[]).code(1).stdout(predicate::str::contains("error: the cut goes 0.0"));
    let report = report(dir.path());
    assert_eq!(report["verdict"], "fail");
    assert_eq!(report["findings"][0]["code"], "gouge");
    assert!(figure(&report, "gouge_max_mm") > 0.05);
}

#[test]
fn a_program_for_another_origin_is_told() {
    let dir = tempfile::tempdir().expect("a folder");
    part(dir.path());
    std::fs::write(dir.path().join("p.ngc"), program(20.0)).expect("a program");
    simulate(dir.path(), &[])
        .code(1)
        .stdout(predicate::str::contains("hint: another part, or another --zero"));
    // As scripts print numbers.
    simulate(dir.path(), &["--zero", "-2e+01", "-1e-17", "5.4"]).success();
    // Zero far above the part: nothing is cut.
    simulate(dir.path(), &["--zero", "-20", "0", "15.4"]).success().stdout(
        predicate::str::contains("cuts nothing").and(predicate::str::contains("100.0 % of the part")),
    );
}

/// What a program may do and should not, each told by its code.
#[test]
fn what_a_program_should_not_do_is_told() {
    let dir = tempfile::tempdir().expect("a folder");
    part(dir.path());
    let sound = program(0.0);
    let codes = |text: &str, more: &[&str]| -> Vec<String> {
        std::fs::write(dir.path().join("p.ngc"), text).expect("a program");
        let _ = std::fs::remove_dir_all(dir.path().join("out"));
        simulate(dir.path(), more);
        let report = report(dir.path());
        let findings = report["findings"].as_array().expect("findings");
        findings.iter().map(|finding| finding["code"].as_str().expect("a code").to_string()).collect()
    };
    let machine = ["--machine", "linuxcnc-mill"];
    let odd = ["feed", "plunge", "ends-low", "off-centre", "elsewhere"];
    let plain = codes(&sound, &machine);
    assert!(plain.iter().all(|code| !odd.contains(&code.as_str())), "{plain:?}");
    let told = |code: &str, text: &str, more: &[&str]| {
        let codes = codes(text, more);
        assert!(codes.iter().any(|found| found == code), "{code} is not in {codes:?}");
    };
    told("feed", &sound.replacen("F320", "F90000", 1), &machine);
    told("feed", &sound.replacen("F100", "F90000", 1), &machine);
    // 0.7 mm straight down, with a ball of 0.5 mm radius.
    told("plunge", &sound.replacen("G0 Z2\n", "G0 Z2\nG0 X5.5 Y2\nG1 Z-0.5 F100\nG0 Z2\n", 1), &[]);
    let end = sound.rfind("G0 Z2").expect("a retract");
    told("ends-low", &format!("{}M5\nM2\n", &sound[..end]), &[]);
    told("off-centre", &sound, &["--zero", "3", "0", "5.4"]);
    told("elsewhere", &sound, &["--zero", "30", "0", "5.4"]);
}

#[test]
fn another_cutter_shows_as_gouge() {
    let dir = tempfile::tempdir().expect("a folder");
    part(dir.path());
    std::fs::write(dir.path().join("p.ngc"), program(0.0)).expect("a program");
    simulate(dir.path(), &["--cutter", "flat:1"]).code(1).stdout(predicate::str::contains("below the part"));
}

#[test]
fn a_rapid_through_stock_is_a_collision() {
    let dir = tempfile::tempdir().expect("a folder");
    part(dir.path());
    let text =
        program(0.0).replacen("G0 X-1.0000 Y1.0000", "G0 X-1.0000 Y1.0000\nG0 Z-0.05\nG0 X1\nG0 X-1", 1);
    std::fs::write(dir.path().join("p.ngc"), text).expect("a program");
    simulate(dir.path(), &[]).code(1).stdout(predicate::str::contains("a rapid cuts 0."));
    let report = report(dir.path());
    let findings = report["findings"].as_array().expect("findings");
    assert!(findings.iter().any(|f| f["code"] == "rapid-through-stock"), "{report}");
}

#[test]
fn what_cannot_be_judged_is_refused_and_leaves_nothing() {
    let dir = tempfile::tempdir().expect("a folder");
    part(dir.path());
    let whole = program(0.0);
    std::fs::write(dir.path().join("p.ngc"), &whole[..whole.len() / 2]).expect("a program");
    simulate(dir.path(), &[]).code(2).stderr(predicate::str::starts_with("error: p.ngc: line "));
    std::fs::write(dir.path().join("p.ngc"), &whole).expect("a program");
    simulate(dir.path(), &["--cutter", "ball:1", "ball:0.5"]).code(2).stderr(
        "error: 1 programs and 2 cutters; hint: --cutter takes one cutter per program, in their order\n",
    );
    let cutter = |words: &[&str]| {
        screenmill()
            .current_dir(dir.path())
            .args(["simulate", "--part", "H.tif", "--out", "out"])
            .args(words)
            .assert()
    };
    cutter(&["--cutter", "ball:1", "no.ngc"]).code(2).stderr(predicate::str::starts_with(
        "error: --cutter no.ngc names no file, and as a cutter: cutter \"no.ngc\" has no known profile; hint: ball:D, ",
    ));
    std::fs::write(dir.path().join("q.ngc"), &whole).expect("a program");
    cutter(&["q.ngc", "--cutter", "ball:1", "p.ngc"]).code(2).stderr(
        "error: p.ngc stands after --cutter and q.ngc does not, so which runs first is not clear; hint: all programs before --cutter\n",
    );
    cutter(&["--cutter", "ball:1"]).code(2);
    simulate(dir.path(), &["--cutter", "ball:1", "--machine", "nothing"]).code(2);
    simulate(dir.path(), &["--zero", "0", "0", "1e9"])
        .code(2)
        .stderr("error: --zero names 1000000000 mm; hint: it must lie in -100000 .. 100000\n");
    assert!(!dir.path().join("out").exists());
}

#[test]
fn threads_change_no_byte() {
    let dir = tempfile::tempdir().expect("a folder");
    part(dir.path());
    std::fs::write(dir.path().join("p.ngc"), program(0.0)).expect("a program");
    let files = ["machined.tif", "deviation.tif", "report.json"];
    let run = |threads: &str| {
        simulate(dir.path(), &["--threads", threads]).success();
        files.map(|name| std::fs::read(dir.path().join("out").join(name)).expect("a file"))
    };
    assert!(run("1") == run("3"));
}

#[test]
fn an_estimate_says_what_limits() {
    let dir = tempfile::tempdir().expect("a folder");
    std::fs::write(dir.path().join("p.ngc"), program(0.0)).expect("a program");
    let rml = "^DF;!MC1;V30;Z0,0,500;V5;Z0,0,-10,3000,0,-10;V30;Z3000,0,500;H;\n";
    std::fs::write(dir.path().join("p.rml"), rml).expect("a program");
    let output = screenmill()
        .current_dir(dir.path())
        .args(["estimate", "p.ngc", "p.rml", "--machine", "roland-egx-600", "--json"])
        .assert()
        .success();
    let report: Value = serde_json::from_slice(&output.get_output().stdout).expect("one JSON object");
    let total = report["time_s"].as_f64().expect("a time");
    let programs = report["programs"].as_array().expect("programs");
    let sum: f64 = programs.iter().map(|p| p["time_s"].as_f64().expect("a time")).sum();
    assert!((total - sum).abs() < 1e-9 && total > 150.0, "{report}");
    assert_eq!(report["limited_by"], "feed");
    assert_eq!(programs[1]["language"], "RML-1");
    assert_eq!(programs[0]["notes"][0], "is G-code, roland-egx-600 reads rml1");
    assert_eq!(programs[1]["notes"], serde_json::json!([]));
    assert_eq!(programs[1]["rapid_mm"], 5.1);
    assert_eq!(programs[1]["bounds_mm"]["z"], serde_json::json!([-0.1, 5.0]));
    screenmill()
        .current_dir(dir.path())
        .args(["estimate", "p.ngc", "--machine", "linuxcnc-mill"])
        .assert()
        .success()
        .stdout(
            predicate::str::contains("cutting").and(predicate::str::contains("verify against your machine")),
        );
    // At 10 mm/s and 500 mm/s2: 10 s and the two ramps.
    let short = "G21 G90\nM3 S9000\nG1 X100 F600\nM2\n";
    std::fs::write(dir.path().join("short.ngc"), short).expect("a program");
    screenmill()
        .current_dir(dir.path())
        .args(["estimate", "short.ngc", "--machine", "linuxcnc-mill"])
        .assert()
        .success()
        .stdout(predicate::str::contains("10.0 s cutting 100.0 mm").and(predicate::str::contains(
            "line 3: moves before it has positioned, it is taken to start at its zero",
        )));
    let far = "G21 G90\nM3 S9000\nG0 Z5\nG0 X0 Y0\nG1 Z-1 F80\nX900\nG0 Z5\nM2\n";
    std::fs::write(dir.path().join("far.ngc"), far).expect("a program");
    screenmill()
        .current_dir(dir.path())
        .args(["estimate", "far.ngc", "--machine", "linuxcnc-mill"])
        .assert()
        .code(1)
        .stdout(
            predicate::str::contains("cutting 906.0 mm, 0.7 s rapids 6.0 mm")
                .and(predicate::str::contains("error: line 6: moves 900.000 mm in X, from 0.000 (line 4) to 900.000 (line 6), linuxcnc-mill travels 400 mm\n")),
        );
}

/// What a controller takes of a line is known with its machine; an unconfirmed length is only noted.
#[test]
fn lines_longer_than_the_machines_controller_takes_are_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let comment = "c".repeat(300);
    let part = "G1 X1.000 Y1.000 Z-0.100 F100 ";
    for (name, line) in
        [("comment.nc", format!("({comment})")), ("words.nc", part.to_owned() + &" ".repeat(60))]
    {
        let text = format!("G21 G90\nM3 S9000\nG0 Z5\nG0 X0 Y0\n{line}\n{part}\nG0 Z5\nM2\n");
        std::fs::write(dir.path().join(name), text).expect("a program");
    }
    let zeros = format!("G1 X1.{} Y1 Z-0.1 F100", "0".repeat(70));
    let text = format!("G21 G90\nM3 S9000\nG0 Z5\nG0 X0 Y0\n{zeros}\nG0 Z5\nM2\n");
    std::fs::write(dir.path().join("zeros.nc"), text).expect("a program");
    let estimate = |file: &str, machine: &str| {
        screenmill().current_dir(dir.path()).args(["estimate", file, "--machine", machine]).assert()
    };
    let refused = |column: usize, most: &str| {
        format!(
            ": line 5, column {column}: the line goes on past the {most} that this machine's controller takes; hint: shorten its \
             comment, or put its words on two lines\n"
        )
    };
    let ends = |end: String| predicate::str::ends_with(end);
    estimate("comment.nc", "linuxcnc-mill").code(2).stderr(ends(refused(253, "252 bytes")));
    estimate("words.nc", "linuxcnc-mill").success();
    // Grbl's buffer takes neither blanks nor comments.
    estimate("comment.nc", "grbl-router").success();
    estimate("words.nc", "grbl-router").success();
    let words = "79 bytes without blanks and comments";
    estimate("zeros.nc", "grbl-router").code(2).stderr(ends(refused(83, words)));
    estimate("zeros.nc", "linuxcnc-mill").success();
    estimate("zeros.nc", "roland-mdx-50").success().stdout(predicate::str::contains(
        "note: line 5, column 81: longer than 80 bytes, which no source confirms this controller takes",
    ));
}

#[test]
fn a_stopped_program_is_resumed_at_a_pass() {
    let dir = tempfile::tempdir().expect("a folder");
    std::fs::write(dir.path().join("p.ngc"), program(0.0)).expect("a program");
    let resume = |arguments: &str| {
        screenmill().current_dir(dir.path()).args(["resume", "p.ngc"]).args(arguments.split(' ')).assert()
    };
    resume("--at 7 --out q.ngc")
        .success()
        .stdout(predicate::str::contains("q.ngc: from pass 7 of 1 to 105 (line 32), at X -1 Y -0.3 Z 2"));
    let text = std::fs::read_to_string(dir.path().join("q.ngc")).expect("written");
    assert!(text.starts_with("G21 G90 G17 G64 P0.001\nM3 S20000\nG4 P2\nG0 Z2\nG0 X-1 Y-0.6\n"), "{text}");
    assert!(text.contains("G0 X-1 Y-0.3 Z2\nF320\nG1 Z"), "{text}");
    resume("--at 7").success().stdout(text);
    resume("--at 500").code(2).stderr(
        "error: p.ngc: pass 500 is asked for, the program has passes 1 to 105; hint: --at 1 .. 105\n",
    );
    resume("--at 7 --out p.ngc")
        .code(2)
        .stderr("error: p.ngc is the program itself; hint: --out names another file\n");
}
