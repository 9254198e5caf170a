//! A job's verdict again, from its files alone: `simulate` by the command that `mill` prints.

mod job;

use job::{Bench, STEP_MM, figure, programs};
use screenmill::machine::{Library, Machine};
use screenmill::verify::{Options, Reading};

/// The printed command without the program's name.
fn printed(output: &[u8]) -> String {
    let text = String::from_utf8_lossy(output);
    let line = text.lines().find_map(|line| line.strip_prefix("check     screenmill "));
    line.expect("a command").to_string()
}

const OTHERS: &str = "name = \"roland-egx-600\"\npost = [\"rml1\", \"linuxcnc\"]";

#[test]
fn simulate_finds_the_figures_of_the_report() {
    let cases: [&[(&str, &str)]; 5] = [
        &[],
        &[("name = \"linuxcnc-mill\"", OTHERS)],
        &[("min_floor_mm = 2", "min_floor_mm = 2\nz_zero = \"part-top\"")],
        &[("step_mm = 0.02", "step_mm = 0.02\nform = \"die\"")],
        &[("step_mm = 0.02", "step_mm = 0.02\nlevel = \"plane\"")],
    ];
    for changes in cases {
        let bench = Bench::with(changes);
        let output = bench.run("mill job.toml --out out --quiet").success().get_output().stdout.clone();
        let report = bench.json("out/report.json");
        bench.run(&printed(&output)).success();
        let again = bench.json("out/simulate-r0c0/report.json");
        for key in ["gouge_max_mm", "excess_max_mm", "deviation_p50_mm", "deviation_p99_mm"] {
            let (told, found) = (figure(&report, key), figure(&again, key));
            assert!((told - found).abs() < 2e-4, "{changes:?} {key}: {told} and {found}");
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
