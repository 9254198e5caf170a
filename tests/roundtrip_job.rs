//! A job's verdict again, from its files alone: `simulate` by the command that `mill` prints.

mod curves;
mod job;

use curves::strays;
use job::{Bench, STEP_MM, figure, programs};
use screenmill::machine::{Library, Machine};
use screenmill::verify::{Options, Reading};
use serde_json::Value;

/// The printed command without the program's name.
fn printed(output: &[u8]) -> String {
    let text = String::from_utf8_lossy(output);
    let line = text.lines().find_map(|line| line.strip_prefix("check     screenmill "));
    line.expect("a command").to_string()
}

const OTHERS: &str = "name = \"roland-egx-600\"\npost = [\"rml1\", \"linuxcnc\"]";

#[test]
fn simulate_finds_the_figures_of_the_report() {
    let cases: [&[(&str, &str)]; 6] = [
        &[],
        &[("name = \"linuxcnc-mill\"", OTHERS)],
        &[("min_floor_mm = 2", "min_floor_mm = 2\nz_zero = \"part-top\"")],
        &[("step_mm = 0.02", "step_mm = 0.02\nform = \"die\"")],
        &[("step_mm = 0.02", "step_mm = 0.02\nlevel = \"plane\"")],
        &[("step_mm = 0.02", "step_mm = 0.02\nedge = \"wall\"")],
    ];
    for changes in cases {
        let bench = Bench::with(changes);
        let output = bench.run("mill job.toml --out out --quiet").success().get_output().stdout.clone();
        let report = bench.json("out/report.json");
        bench.run(&printed(&output)).success();
        let again = bench.json("out/simulate-r0c0/report.json");
        for key in ["gouge_max_mm", "excess_max_mm", "deviation_p50_mm", "deviation_p99_mm", "normal_p95_deg"]
        {
            let (told, found) = (figure(&report, key), figure(&again, key));
            let most = if key.ends_with("deg") { 0.01 } else { 2e-4 };
            assert!((told - found).abs() < most, "{changes:?} {key}: {told} and {found}");
        }
    }
}

#[test]
fn one_wrong_z_word_changes_the_verdict() {
    let bench = Bench::with(&[]);
    let output = bench.run("mill job.toml --out out --quiet").success().get_output().stdout.clone();
    let report = bench.json("out/report.json");
    let file = format!("out/{}", programs(&report)[1]);
    let text = bench.text(&file);
    let lines: Vec<&str> = text.lines().collect();
    // A cut in the middle of the program, well inside the part.
    let is_cut = |line: &&str| line.starts_with('X') && line.contains(" Z-") && !line.starts_with("X-");
    let at = lines.len() / 2 + lines[lines.len() / 2..].iter().position(is_cut).expect("a cut");
    let start = lines[at].find(" Z").expect("a word") + 2;
    let end = lines[at][start..].find(' ').map_or(lines[at].len(), |length| start + length);
    let z: f64 = lines[at][start..end].parse().expect("a number");
    let wrong = format!("{}{:.4}{}", &lines[at][..start], z - 0.05, &lines[at][end..]);
    let mut lines: Vec<&str> = lines;
    lines[at] = &wrong;
    bench.write(&file, lines.join("\n") + "\n");
    bench.run(&printed(&output)).code(1);
    let again = bench.json("out/simulate-r0c0/report.json");
    assert_eq!((&report["verdict"], &again["verdict"]), (&"pass".into(), &"fail".into()));
    assert!(figure(&again, "gouge_max_mm") > figure(&report, "gouge_max_mm") + 0.02, "{again}");
}

/// RML-1 stands on 0.01 mm, G-code on 0.0001 mm; both stay above the design and below its scallop.
#[test]
fn gcode_and_rml_leave_the_same_surface() {
    let of = |machine: &str| {
        let bench = Bench::with(&[("name = \"linuxcnc-mill\"", machine)]);
        bench.mill(0);
        bench.heights("out/maps/r0c0-machined.tif")
    };
    let (rml, gcode) = (of("name = \"roland-egx-600\""), of("name = \"linuxcnc-mill\""));
    assert_eq!(rml.len(), (4.0 / STEP_MM).powi(2) as usize);
    let unit_mm = 0.01;
    let budget_mm = 2.0 * 0.002;
    let apart = rml.iter().zip(&gcode).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max);
    assert!(apart > 0.0 && apart < unit_mm + budget_mm, "{apart} mm");
}

/// Clamps of 8 mm stand higher than the retract plane of 5 mm. Each motion that is read back is walked along in small
/// steps, with every part of the tool, and none may be in a clamp.
#[test]
fn no_motion_of_a_job_that_passes_meets_a_clamp() {
    let bench = Bench::with(&[
        ("margin_mm = 3", "margin_mm = 10.5"),
        ("name = \"linuxcnc-mill\"", "name = \"linuxcnc-mill\"\nfixture = \"clamps\""),
    ]);
    let report = bench.mill(0);
    let machine = Machine::find("linuxcnc-mill", None).expect("comes along");
    let library = Library::find("tools", None).expect("comes along");
    // Of a blank from -10.5 to 14.5 a clamp in the middle of each side, 20 wide and 6 over its edge.
    let (low, high) = (-10.5, 14.5);
    let (before, after, across) = ([low - 40.0, low + 6.0], [high - 6.0, high + 40.0], [-8.0, 12.0]);
    let clamps = [[before, across], [after, across], [across, before], [across, after]];
    let mut lowest_link = f64::INFINITY;
    for program in report["tiles"][0]["programs"].as_array().expect("programs") {
        let text = bench.text(&format!("out/{}", program["file"].as_str().expect("a file")));
        let reading = Reading::of(text.as_bytes(), &Options::default()).expect("readable");
        let tool = library.tool(program["tool"].as_str().expect("a tool")).expect("in the library");
        let columns = tool.columns(machine.spindle.nose_diameter_mm);
        assert_eq!(columns.len(), 3);
        let mut from = [f64::NAN; 3];
        for motion in &reading.motions {
            let to = motion.to_mm;
            let length = (0..3).map(|axis| (to[axis] - from[axis]).powi(2)).sum::<f64>().sqrt();
            let steps = if length.is_finite() { (length / 0.05).ceil().max(1.0) as usize } else { 0 };
            for step in 1..=steps {
                let at: [f64; 3] = std::array::from_fn(|axis| {
                    from[axis] + (to[axis] - from[axis]) * step as f64 / steps as f64
                });
                for (column, clamp) in columns.iter().flat_map(|c| clamps.iter().map(move |clamp| (c, clamp)))
                {
                    let apart =
                        |axis: usize| (clamp[axis][0] - at[axis]).max(at[axis] - clamp[axis][1]).max(0.0);
                    let free = apart(0).hypot(apart(1)) > column.radius_mm || at[2] + column.from_mm >= 8.0;
                    assert!(free, "line {}: the {} at {at:?} is in {clamp:?}", motion.line, column.what);
                }
            }
            let lateral = to[0] != from[0] || to[1] != from[1];
            if motion.rapid() && lateral && from[0].is_finite() {
                lowest_link = lowest_link.min(to[2]);
            }
            from = to;
        }
    }
    assert_eq!(lowest_link, 5.0, "links with no clamp in the way stay on the retract plane");
}

const BESIDE: &str = r#"[[operation]]
kind = "drill"
face = "underside"
tool = "flat-2"
places = ["left"]
holes_mm = [[1.8, 2]]
diameter_mm = 2.5
depth_mm = 2
[[operation]]
kind = "mark"
face = "underside"
tool = "ball-0.5"
height_mm = 0.5
depth_mm = 0.1
[[operation]]
kind = "outline"
tool = "flat-2"
feed_mm_min = 1500
[[operation]]
kind = "drill"
tool = "flat-3"
places = ["front-left", "back-right"]
depth_mm = 3.1
[[operation]]
kind = "mark"
tool = "ball-0.5"
depth_mm = 0.1
[[operation]]
kind = "rough""#;

const CUT_OUT: &str = r#"stepover_mm = 0.1
[[operation]]
kind = "cut-out"
tool = "flat-2"
stepdown_mm = 0.5
through_mm = 0.2
tab_width_mm = 1
tab_height_mm = 0.8
"#;

fn with_all_beside(more: &[(&str, &str)]) -> Bench {
    let mut changes = vec![
        ("[[operation]]\nkind = \"rough\"", BESIDE),
        ("stepover_mm = 0.1\n", CUT_OUT),
        ("margin_mm = 3", "margin_mm = 8"),
        ("thickness_mm = 10", "thickness_mm = 6"),
        ("name = \"linuxcnc-mill\"", "name = \"linuxcnc-mill\"\nfixture = \"tape-board\""),
    ];
    changes.extend(more);
    Bench::with(&changes)
}

/// Each program is read back here and held against what the job asks for, place by place.
#[test]
fn holes_marks_outline_and_slot_are_where_the_job_wants_them() {
    let bench = with_all_beside(&[]);
    let output = bench.run("mill job.toml --out out --quiet").code(0).get_output().stdout.clone();
    let report = bench.json("out/report.json");
    bench.run(&printed(&output)).success();
    let files = programs(&report);
    let names: Vec<&str> = files.iter().map(|file| file.trim_start_matches("programs/r0c0-")).collect();
    assert_eq!(
        names,
        [
            "01-drill-flat-2.ngc",
            "02-mark-ball-0.5.ngc",
            "03-outline-flat-2.ngc",
            "04-drill-flat-3.ngc",
            "05-mark-ball-0.5.ngc",
            "06-rough-flat-3.ngc",
            "07-finish-ball-1.ngc",
            "08-cut-out-flat-2.ngc"
        ]
    );
    let mut sorted = files.clone();
    sorted.sort();
    assert_eq!(sorted, files);
    let read = |nth: usize| {
        let text = bench.text(&format!("out/{}", files[nth]));
        (Reading::of(text.as_bytes(), &Options::default()).expect("readable"), text)
    };
    let lowest_near = |reading: &Reading, x: f64, y: f64, within: f64| {
        let near =
            reading.motions.iter().filter(|m| m.known() && (m.to_mm[0] - x).hypot(m.to_mm[1] - y) <= within);
        near.map(|m| m.to_mm[2]).fold(f64::INFINITY, f64::min)
    };
    // Holes of 2.5 mm by a cutter of 2 mm, at X 1.8 of the top: X 2.2 seen from behind; "left" is right there.
    let (under, text) = read(0);
    for [x, y] in [[2.2, 2.0], [8.0, 2.0]] {
        assert!((lowest_near(&under, x, y, 0.01) + 2.0).abs() < 1e-9);
        let feed =
            |m: &&screenmill::verify::Motion| !m.rapid() && (m.to_mm[0] - x).hypot(m.to_mm[1] - y) < 2.0;
        let widest = under
            .motions
            .iter()
            .filter(feed)
            .map(|m| (m.to_mm[0] - x).hypot(m.to_mm[1] - y))
            .fold(0.0, f64::max);
        assert!((widest - 0.25).abs() < 2e-4, "{widest}");
    }
    assert!(text.contains("turn the blank over left to right"), "{text}");
    let (outline, text) = read(2);
    assert!(!text.contains("M3") && !text.contains("G4 "), "the spindle stays off: {text}");
    assert_eq!(outline.extent().low_mm[2], 5.0);
    let finish = read(6).0.extent();
    assert!(
        outline.extent().low_mm[0] <= finish.low_mm[0] && outline.extent().high_mm[1] >= finish.high_mm[1]
    );
    let (drill, _) = read(3);
    for [x, y] in [[-4.0, -4.0], [8.0, 8.0]] {
        assert!((lowest_near(&drill, x, y, 1e-9) + 3.1).abs() < 1e-9);
    }
    // The middle of each tab is not cut below 0.8 mm over the underside, all else to 0.2 mm under it.
    let (slot, _) = read(7);
    let mut lowest = std::collections::BTreeMap::new();
    let mut from = [f64::NAN; 3];
    for motion in &slot.motions {
        let steps = 400;
        for step in 0..=steps {
            let at: [f64; 3] = std::array::from_fn(|k| {
                from[k] + (motion.to_mm[k] - from[k]) * f64::from(step) / f64::from(steps)
            });
            let place = [0, 1].map(|k| (at[k] * 50.0).round() as i64);
            let z = lowest.entry(place).or_insert(f64::INFINITY);
            *z = at[2].min(*z);
        }
        from = motion.to_mm;
    }
    let depth = |x: f64, y: f64| lowest[&[x, y].map(|mm| (mm * 50.0).round() as i64)];
    for along in [-1.0, -0.5, 0.0, 0.4, 3.6, 4.0, 5.0] {
        for [x, y] in [[along, -1.0], [along, 5.0], [-1.0, along], [5.0, along]] {
            assert!((depth(x, y) + 6.2).abs() < 1e-9, "{x} {y}: {}", depth(x, y));
        }
    }
    // Metal 1 mm wide, and a cutter's radius on each side of it.
    for along in [0.52, 1.0, 2.0, 3.0, 3.48] {
        for [x, y] in [[along, -1.0], [along, 5.0], [-1.0, along], [5.0, along]] {
            assert!((depth(x, y) + 5.2).abs() < 1e-9, "{x} {y}: {}", depth(x, y));
        }
    }
    let sheet = bench.text("out/setup-sheet.html");
    for said in [
        "Turn the blank over left to right",
        "Turn the blank back",
        "4 tabs of 1 mm",
        "03-outline-flat-2.ngc first",
        "engraves &quot;r0c0&quot;",
    ] {
        assert!(sheet.contains(said), "{said}");
    }
}

/// A hole in the underside that comes too near to the part is found on the read-back program.
#[test]
fn an_underside_cut_too_deep_is_rejected() {
    let bench = with_all_beside(&[("depth_mm = 2", "depth_mm = 5.5")]);
    let report = bench.mill(1);
    let findings = report["findings"].as_array().expect("findings");
    let floor = findings.iter().find(|finding| finding["code"] == "floor").expect("found");
    assert_eq!(floor["severity"], "error");
    // 0.3 mm less what the facets lie below their highest point.
    let left: f64 = floor["message"]
        .as_str()
        .and_then(|m| m.split("leaves ").nth(1)?.split(' ').next()?.parse().ok())
        .expect("a figure");
    assert!(left < 0.3 && left > -2.0, "{floor}");
    assert!(programs(&report).iter().all(|file| file.starts_with("rejected/")));
}

/// The same job in RML-1: holes and slot stand on its grid, and the air run leaves the spindle off.
#[test]
fn rml_cuts_the_same_beside_the_surface() {
    let bench = with_all_beside(&[("name = \"linuxcnc-mill\"", "name = \"roland-egx-600\"")]);
    let report = bench.mill(0);
    let text = bench.text(&format!("out/{}", programs(&report)[2]));
    assert!(text.contains("!MC0") && !text.contains("!MC1") && !text.contains("!RC"), "{text}");
    let slot = bench.text(&format!("out/{}", programs(&report)[7]));
    assert!(slot.contains(",-620") && slot.contains(",-520"), "{slot}");
}

/// Where the cutter goes before it has come down and after it has gone up for good differs from controller to controller.
fn path(bench: &Bench, nth: usize, rml_unit_mm: f64) -> Vec<[f64; 3]> {
    let file = programs(&bench.json("out/report.json"))[nth].clone();
    let options = Options { rml_unit_mm, ..Options::default() };
    let reading = Reading::of(bench.text(&format!("out/{file}")).as_bytes(), &options).expect("readable");
    let motions = &reading.motions;
    let low = |m: &screenmill::verify::Motion| m.known() && m.to_mm[2] < 4.9;
    let first = motions.iter().position(low).expect("a cut");
    let last = motions.iter().rposition(low).expect("a cut");
    motions[first - 1..=last + 1].iter().map(|m| m.to_mm).collect()
}

/// The passes of a finish are the same curve in every dialect, links included: no place of one is farther from the
/// other than a unit of the coarser grid and what simplification may take in each. Cuts faster than the axis of Z
/// are told from travels in both.
#[test]
fn gcode_and_rml_move_along_the_same_curve() {
    let finish = "tool = \"ball-1\"\nstepover_mm = 0.1";
    let of = |machine: &str, pattern: &str, unit_mm: f64| {
        let wanted = format!("{finish}\npattern = \"{pattern}\"\nfeed_mm_min = 1200");
        let bench = Bench::with(&[("name = \"linuxcnc-mill\"", machine), (finish, &wanted)]);
        let report = bench.mill(0);
        let simplify = report["fidelity"]["gouge_budget_mm"]["simplify"].as_f64().expect("a share");
        let length = |key: &str| report["tiles"][0]["programs"][1][key].as_f64().expect("mm");
        (path(&bench, 1, unit_mm), simplify, [length("cutting_mm"), length("rapid_mm")])
    };
    for pattern in ["zigzag", "one-way"] {
        let (gcode, first, gcode_mm) = of("name = \"linuxcnc-mill\"", pattern, 0.01);
        let (rml, second, rml_mm) = of("name = \"roland-egx-600\"", pattern, 0.01);
        let most = 0.01 + first + second;
        for (a, b) in [(&gcode, &rml), (&rml, &gcode)] {
            let (distance, at) = strays(a, b);
            assert!(distance <= most, "{pattern}: {distance} of {most} at {at:?}");
        }
        assert!((rml_mm[0] / gcode_mm[0] - 1.0).abs() < 0.01, "{pattern}: {rml_mm:?} and {gcode_mm:?}");
        // The G-code parks at the back left corner of 4 x 4 mm and its overrun.
        assert!((gcode_mm[1] - rml_mm[1]).abs() < 20.0, "{pattern}: {rml_mm:?} and {gcode_mm:?}");
    }
}

/// Slanted passes and what a grid makes of a scallop: the same in all posts of a job, whether the coarser grid meets the
/// passes or not, on facets and, in rest machining, against the walls of steps, steeper than any facet; without a round
/// tip, too. `oracle_toolpath` asks it of many more directions, surfaces and cutters.
#[test]
fn passes_lie_alike_in_all_posts_of_a_job() {
    let finish = "tool = \"ball-1\"\nstepover_mm = 0.1\n";
    let rest = "tool = \"ball-2\"\nstepover_mm = 0.1\n[[operation]]\nkind = \"rest\"\n\
        tool = \"ball-0.5\"\nstepover_mm = 0.05\nleftover_mm = 0.001\n";
    let cases = [
        ("0.02", "tool = \"ball-1\"\nscallop_mm = 0.0007\n".to_string()),
        ("0.02", format!("{finish}direction_deg = 45\npattern = \"one-way\"\n")),
        ("0.02", format!("{finish}direction_deg = 30\n")),
        ("0.02", format!("{finish}direction_deg = 26.57\nstock_to_leave_mm = 0.02\n")),
        ("0.015", format!("{finish}direction_deg = 158\n")),
        ("0.02", format!("{rest}direction_deg = 10\n")),
        ("0.02", format!("{rest}direction_deg = 60\n")),
        ("0.02", format!("{rest}direction_deg = 125\n")),
        ("0.02", "tool = \"flat-2\"\nstepover_mm = 0.2\ndirection_deg = 110\n".to_string()),
    ];
    for (step_mm, wanted) in cases {
        let step = format!("step_mm = {step_mm}");
        let operations = 2 + wanted.matches("[[operation]]").count();
        // Two cells, between which there is something to be left.
        let cells = if operations > 2 { "149, 326, 150" } else { "149, 325, 150" };
        let bench = Bench::with(&[
            ("name = \"linuxcnc-mill\"", OTHERS),
            (finish, &wanted),
            ("step_mm = 0.02", &step),
            ("149, 325, 150", cells),
        ]);
        let report = bench.mill(0);
        let simplify = report["fidelity"]["gouge_budget_mm"]["simplify"].as_f64().expect("a share");
        let count = programs(&report).len() / 2;
        assert_eq!(count, operations);
        for nth in 0..count {
            let (rml, gcode) = (path(&bench, nth, 0.01), path(&bench, nth + count, 0.01));
            for (a, b) in [(&gcode, &rml), (&rml, &gcode)] {
                let (distance, at) = strays(a, b);
                let most = 0.01 + 2.0 * simplify;
                assert!(distance <= most, "{wanted} {nth}: {distance} of {most} at {at:?}");
            }
        }
    }
}

/// Roughing, holes, marks, the slot with its tabs and the run in air too: the same bound as for a finish.
#[test]
fn gcode_and_rml_move_along_the_same_curve_beside_the_surface() {
    let of = |machine: &str| {
        let above = "tool = \"flat-2\"\nfeed_mm_min = 1500";
        let bench = with_all_beside(&[
            ("name = \"linuxcnc-mill\"", machine),
            (above, &format!("{above}\nabove_mm = 2")),
            // Not a whole number of units of RML-1.
            ("stepdown_mm = 0.3\nstock", "stepdown_mm = 0.297\nstock"),
        ]);
        let report = bench.mill(0);
        let simplify = report["fidelity"]["gouge_budget_mm"]["simplify"].as_f64().expect("a share");
        ([0, 1, 2, 3, 4, 5, 6, 7].map(|nth| path(&bench, nth, 0.01)), simplify)
    };
    let (gcode, first) = of("name = \"linuxcnc-mill\"");
    let (rml, second) = of("name = \"roland-egx-600\"");
    for (nth, (gcode, rml)) in gcode.iter().zip(&rml).enumerate() {
        for (a, b) in [(gcode, rml), (rml, gcode)] {
            let (distance, at) = strays(a, b);
            let most = 0.01 + first + second;
            assert!(distance <= most, "{nth}: {distance} of {most} at {at:?}");
        }
    }
}

/// A finer ball goes only where the one before it could not reach: the surface is that of passing everywhere, in a
/// fraction of the way.
#[test]
fn rest_passes_cut_what_was_left_and_little_else() {
    let finish = "tool = \"ball-1\"\nstepover_mm = 0.1\n";
    let fine = |kind: &str| {
        format!(
            "tool = \"ball-2\"\nstepover_mm = 0.1\n[[operation]]\nkind = \"{kind}\"\ntool = \"ball-0.5\"\nstepover_mm = 0.05\n"
        )
    };
    let cut = |kind: &str, more: &str| {
        let bench = Bench::with(&[
            (finish, &format!("{}{more}", fine(kind))),
            ("step_mm = 0.02", "step_mm = 0.02"),
            ("cells = [324, 149, 325, 150]", "cells = [324, 149, 326, 150]"),
        ]);
        let report = bench.mill(0);
        let program = report["tiles"][0]["programs"][2].clone();
        (bench, report, program)
    };
    let (all_bench, _, all) = cut("finish", "");
    let (rest_bench, report, rest) = cut("rest", "leftover_mm = 0.003\n");
    assert_eq!(rest["operation"], "rest");
    assert!(rest["file"].as_str().is_some_and(|file| file.ends_with("03-rest-ball-0.5.ngc")), "{rest}");
    let length = |program: &Value| program["cutting_mm"].as_f64().expect("mm");
    assert!(length(&rest) < 0.7 * length(&all), "{} of {}", length(&rest), length(&all));
    assert!(length(&rest) > 0.0);
    // What stays where it did not go is what the ball before left there: no more than it was told to leave, and the
    // scallop of that ball, 1.25 um on the level.
    let (all, rest) =
        (all_bench.heights("out/maps/r0c0-machined.tif"), rest_bench.heights("out/maps/r0c0-machined.tif"));
    let more = all.iter().zip(&rest).map(|(a, b)| f64::from(b - a)).fold(0.0, f64::max);
    assert!(more < 0.003 + 0.0025, "{more}");
    assert!(figure(&report, "gouge_max_mm") <= 0.002);
}
