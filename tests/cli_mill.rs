//! `mill` as a shop floor uses it: what it writes, what it says and how it ends.

mod job;

use job::{Bench, figure, programs};
use predicates::prelude::*;
use predicates::str::contains;
use screenmill::grid::{Heights, Window};
use screenmill::job::Job;
use screenmill::pipeline::{self, Look};
use screenmill::progress::Silent;
use screenmill::surface::HeightWriter;
use serde_json::Value;

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().expect("an object").keys().map(String::as_str).collect()
}

fn codes(report: &Value) -> Vec<&str> {
    let findings = report["findings"].as_array().expect("findings");
    findings.iter().map(|finding| finding["code"].as_str().expect("a code")).collect()
}

#[test]
fn a_job_leaves_its_files_and_nothing_else() {
    let bench = Bench::with(&[]);
    bench.run("mill job.toml --out out --quiet").success().stdout(
        contains("verdict   pass; out/report.html")
            .and(contains("check     screenmill simulate out/programs/")),
    );
    let names: Vec<String> = bench.files("out").into_keys().collect();
    let maps = ["cavity", "design", "deviation", "machined"];
    let mut want: Vec<String> = maps
        .iter()
        .flat_map(|map| ["png", "tif"].map(|kind| format!("maps/r0c0-{map}.{kind}")))
        .chain(
            ["cavities.csv", "cavities.geojson", "report.html", "report.json", "run.json"].map(String::from),
        )
        .chain(["maps/r0c0-normals.png", "maps/r0c0-light.png", "maps/light-room.png"].map(String::from))
        .chain(["setup-sheet.html", "programs/r0c0-01-rough-flat-3.ngc"].map(String::from))
        .chain(["programs/r0c0-02-finish-ball-1.ngc".to_string()])
        .collect();
    want.sort();
    assert_eq!(names, want);
}

#[test]
fn the_report_has_the_keys_of_the_contract_in_their_order() {
    let bench = Bench::with(&[]);
    let report = bench.mill(0);
    let top = ["schema", "screenmill", "verdict", "part", "tiles", "fidelity", "light", "time_s", "findings"];
    assert_eq!(keys(&report), top);
    assert_eq!(keys(&report["part"]), ["width_mm", "height_mm", "columns", "rows", "step_mm", "z_min_mm"]);
    let tile = &report["tiles"][0];
    let want = [
        "name",
        "row",
        "column",
        "x_mm",
        "y_mm",
        "width_mm",
        "height_mm",
        "z_range_mm",
        "program_zero_mm",
        "wedge_deg",
        "programs",
        "maps",
        "fidelity",
    ];
    assert_eq!(keys(tile), want);
    let want = [
        "file",
        "post",
        "operation",
        "tool",
        "cutter",
        "blocks",
        "bytes",
        "cutting_mm",
        "rapid_mm",
        "time_s",
        "deepest_bite_mm",
        "bounds_mm",
    ];
    assert_eq!(keys(&tile["programs"][0]), want);
    assert_eq!(keys(&tile["programs"][0]["bounds_mm"]), ["x", "y", "z"]);
    assert_eq!(keys(&tile["maps"]), ["design", "machined", "deviation", "cavity"]);
    let want = [
        "gouge_max_mm",
        "gouge_budget_mm",
        "excess_max_mm",
        "deviation_p50_mm",
        "deviation_p99_mm",
        "within_limit_fraction",
        "normal_p50_deg",
        "normal_p95_deg",
        "cavity_area_fraction",
        "cavity_max_depth_mm",
        "cavities",
        "by_cause",
    ];
    assert_eq!(keys(&report["fidelity"]), want);
    assert_eq!(keys(&tile["fidelity"]), want);
    assert_eq!(
        keys(&report["fidelity"]["gouge_budget_mm"]),
        ["raster", "simplify", "rounding", "controller"]
    );
    assert_eq!(keys(&report["fidelity"]["by_cause"]), ["unreachable", "scallop", "rounding"]);
    assert_eq!(keys(&report["time_s"]), ["total", "by_operation", "by_tool"]);
    assert_eq!(report["part"]["columns"], 200);
    assert!(figure(&report, "gouge_max_mm") <= 0.002);
    let time: f64 =
        tile["programs"].as_array().expect("programs").iter().filter_map(|p| p["time_s"].as_f64()).sum();
    assert!((report["time_s"]["total"].as_f64().expect("a time") - time).abs() < 1e-9);
}

#[test]
fn files_of_the_report_stand_beside_it_and_sort_as_they_run() {
    let bench = Bench::with(&[(
        "name = \"linuxcnc-mill\"",
        "name = \"roland-egx-600\"\npost = [\"rml1\", \"grbl\"]",
    )]);
    let report = bench.mill(0);
    let files = programs(&report);
    assert_eq!(files.len(), 4);
    assert!(files[..2].iter().all(|file| file.starts_with("programs/rml1/")), "{files:?}");
    assert!(files[2..].iter().all(|file| file.starts_with("programs/grbl/")), "{files:?}");
    assert!(files[..2].is_sorted() && files[2..].is_sorted(), "{files:?}");
    let maps = report["tiles"][0]["maps"].as_object().expect("maps").values();
    for file in files.iter().map(String::as_str).chain(maps.map(|map| map.as_str().expect("a path"))) {
        assert!(bench.path("out").join(file).is_file(), "{file}");
    }
    assert!(codes(&report).contains(&"dialect"), "{report}");
}

#[test]
fn neither_threads_nor_a_second_run_change_a_byte() {
    let bench = Bench::with(&[]);
    let run = |line: &str, out: &str| {
        bench.run(line).success();
        let mut files = bench.files(out);
        files.remove("run.json").expect("clocks go there");
        files
    };
    let one = run("mill job.toml --out out --quiet --threads 1", "out");
    let two = run("mill job.toml --out out --quiet --threads 2", "out");
    let elsewhere = run("mill job.toml --out other --quiet", "other");
    assert!(one.len() == 18 && one == two);
    assert!(one == elsewhere);
}

#[test]
fn a_missed_limit_ends_with_1_and_is_named() {
    let limit = "gouge_mm = 0.002";
    let cases = [
        ("hours_max = 0.001", "hours"),
        ("deviation_mm = 0.0005", "deviation"),
        ("normal_p95_deg = 0.1", "normal"),
        ("on_audience_min = 0.999", "audience"),
    ];
    for (key, word) in cases {
        let bench = Bench::with(&[(limit, &format!("{limit}\n{key}"))]);
        let report = bench.mill(1);
        assert_eq!(report["verdict"], "fail");
        assert!(codes(&report).iter().any(|code| code.contains(word)), "{key}: {:?}", codes(&report));
        assert!(bench.path("out/programs/r0c0-02-finish-ball-1.ngc").is_file(), "nothing gouges");
    }
}

#[test]
fn a_refusal_leaves_nothing_and_spares_what_was_there() {
    let bench = Bench::with(&[("ball-1", "ball-9")]);
    bench.run("mill job.toml --out out --quiet").code(2).stdout("");
    assert!(!bench.path("out").exists());
    bench.job("job.toml", &[]);
    bench.mill(0);
    bench.write("out/mine.txt", "mine");
    let before = bench.files("out");
    bench.job("job.toml", &[("thickness_mm = 10", "thickness_mm = 2.5")]);
    bench.run("mill job.toml --out out --quiet").code(2);
    assert!(bench.files("out") == before);
}

#[test]
fn a_second_job_replaces_the_first_and_spares_other_files() {
    let bench = Bench::with(&[]);
    bench.mill(0);
    bench.write("out/mine.txt", "mine");
    bench.job("job.toml", &[("tool = \"ball-1\"", "tool = \"ball-2\"")]);
    let report = bench.mill(0);
    let files = bench.files("out");
    assert_eq!(files["mine.txt"], b"mine");
    let kept: Vec<&String> = files.keys().filter(|name| name.starts_with("programs/")).collect();
    assert_eq!(kept, programs(&report).iter().collect::<Vec<_>>());
    assert_eq!(kept[1], "programs/r0c0-02-finish-ball-2.ngc");
}

#[test]
fn json_is_one_object_and_the_report() {
    let bench = Bench::with(&[]);
    let output = bench.run("mill job.toml --out out --json").success().get_output().stdout.clone();
    let report: Value = serde_json::from_slice(&output).expect("one JSON object");
    assert_eq!(report, bench.json("out/report.json"));
}

#[test]
fn every_way_to_cut_keeps_the_limit() {
    let finish = "tool = \"ball-1\"\nstepover_mm = 0.1";
    let cases: [(&str, &str, &str); 9] = [
        ("wall", "step_mm = 0.02", "step_mm = 0.02\nedge = \"wall\""),
        ("die", "step_mm = 0.02", "step_mm = 0.02\nform = \"die\""),
        ("part-top", "min_floor_mm = 2", "min_floor_mm = 2\nz_zero = \"part-top\""),
        ("along y", finish, "tool = \"ball-1\"\nstepover_mm = 0.1\ndirection_deg = 90"),
        ("climb", finish, "tool = \"ball-1\"\nstepover_mm = 0.1\npattern = \"one-way\""),
        ("scallop", finish, "tool = \"ball-1\"\nscallop_mm = 0.002"),
        ("bull", finish, "tool = \"bull-2\"\nstepover_mm = 0.1"),
        ("level", "step_mm = 0.02", "step_mm = 0.02\nlevel = \"plane\""),
        ("full", "[limits]", "[maps]\nfull = true\n[limits]"),
    ];
    for (name, from, to) in cases {
        let bench = Bench::with(&[(from, to)]);
        let report = bench.mill(0);
        assert!(figure(&report, "gouge_max_mm") <= 0.002, "{name}: {report}");
        assert!(figure(&report, "deviation_p50_mm") < 0.01, "{name}: {report}");
        let top = if name == "part-top" { 0.0 } else { 0.2 };
        let zero = report["tiles"][0]["program_zero_mm"][2].as_f64().expect("a height");
        assert!(name == "level" || (zero - top).abs() < 1e-9, "{name}: {zero}");
        assert_eq!(report.get("light").is_none_or(Value::is_null), name == "die", "{name}");
    }
}

/// Deviation, gouge and light are of what the text of the programs leaves: one Z word changes each.
#[test]
fn one_wrong_z_word_changes_deviation_gouge_and_light() {
    let bench = Bench::with(&[]);
    let said = bench.run("mill job.toml --out out --quiet").success();
    let said = String::from_utf8(said.get_output().stdout.clone()).expect("text");
    let line = said.lines().find_map(|line| line.strip_prefix("check     screenmill ")).expect("a command");
    bench.run("design screen.toml --out d.npz --cells 324 149 325 150 --quiet").success();
    let judged = |code: i32| {
        bench.run(&format!("{line} --quiet")).code(code);
        let folder = "out/simulate-r0c0";
        bench.run(&format!(
            "light d.npz --surface {folder}/machined.tif --screen screen.toml --out lit --quiet"
        ));
        let (cut, lit) = (bench.json(&format!("{folder}/report.json")), bench.json("lit/report.json"));
        let light = lit["light"]["on_audience_machined"].as_f64().expect("a share");
        [figure(&cut, "deviation_p99_mm"), figure(&cut, "gouge_max_mm"), light]
    };
    let sound = judged(0);
    assert!(sound[1] <= 0.002);
    // The report of the job itself says the same of the same files.
    let report = bench.json("out/report.json");
    assert!((figure(&report, "gouge_max_mm") - sound[1]).abs() < 1e-6, "{sound:?} {report}");
    let light = report["light"]["on_audience_machined"].as_f64().expect("a share");
    assert!((light - sound[2]).abs() < 0.002, "{light} {sound:?}");

    let file = "out/programs/r0c0-02-finish-ball-1.ngc";
    let text = bench.text(file);
    // The middle one of the Z words, 0.2 mm deeper.
    let places: Vec<usize> = text.match_indices('Z').map(|(at, _)| at + 1).collect();
    let at = places[places.len() / 2];
    let end = at + text[at..].find(|c: char| !"-.0123456789".contains(c)).expect("more text");
    let z_mm: f64 = text[at..end].parse().expect("a number");
    bench.write(file, format!("{}{:.4}{}", &text[..at], z_mm - 0.2, &text[end..]));
    let wrong = judged(1);
    assert!(wrong[1] > 0.1, "gouge: {sound:?}, then {wrong:?}");
    assert!(wrong[0] > 1.1 * sound[0], "deviation: {sound:?}, then {wrong:?}");
    assert!(wrong[2] < sound[2] - 1e-3, "light: {sound:?}, then {wrong:?}");
}

/// What `check` says a cutter costs in light is what `light` finds on its closing.
#[test]
fn check_says_of_a_cutter_what_light_says_of_its_closing() {
    let bench = Bench::with(&[]);
    let said = bench.run("check job.toml --json --quiet");
    let checked: Value = serde_json::from_slice(&said.get_output().stdout).expect("JSON");
    // A piece of one square is looked at as a whole, whatever the share.
    let shared = bench.run("check job.toml --share 0.3 --json --quiet");
    let shared: Value = serde_json::from_slice(&shared.get_output().stdout).expect("JSON");
    assert_eq!(shared["looked_at_fraction"], 1.0);
    assert_eq!(shared["smallest_set"]["tools"], checked["smallest_set"]["tools"]);
    for share in ["0", "1.5", "nan", "half"] {
        bench.run(&format!("check job.toml --share {share}")).code(2).stderr(contains("share of the area"));
    }
    bench.run("check job.toml --share 0.5 --out checked").code(said.get_output().status.code().unwrap_or(2));
    assert!(bench.path("checked/maps").is_dir(), "maps are of all of it");
    bench.run("design screen.toml --out d.npz --cells 324 149 325 150 --quiet").success();
    let cutters = checked["cutters"].as_array().expect("cutters");
    let mut before = 1.0;
    for shape in ["ball:0.5", "ball:1", "ball:2"] {
        let cutter = cutters.iter().find(|c| c["cutters"][0] == shape).expect("in the library");
        bench
            .run(&format!(
                "compensate d.npz --cutter {shape} --closing c.tif --sampled --step-mm 0.02 --quiet"
            ))
            .success();
        bench.run("light d.npz --surface c.tif --screen screen.toml --out lit --quiet").success();
        let lit = bench.json("lit/report.json");
        for key in ["on_audience_designed", "on_audience_machined", "leak_machined"] {
            let [a, b] = [&cutter["light"][key], &lit["light"][key]].map(|v| v.as_f64().expect("a share"));
            // The file holds z itself, `check` what is below the top: normals differ by the floats.
            assert!((a - b).abs() < 1e-3, "{shape} {key}: {a} by check, {b} by light");
        }
        let now = cutter["light"]["on_audience_machined"].as_f64().expect("a share");
        assert!(now < before, "a larger ball returns less: {shape} {now}, {before}");
        before = now;
    }
}

/// Polishing by hand takes off ridges, here those that a stepover of 0.1 mm leaves: more light comes than from the cut, never
/// more than from the design. What the model says stands beside the cut, which it leaves as it was.
#[test]
fn the_light_of_a_polished_cut_stands_beside_that_of_the_cut() {
    let plain = Bench::with(&[]).mill(0);
    assert!(plain["light"].get("polished").is_none());
    let polished = |um: &str| {
        let bench = Bench::with(&[("[limits]", &format!("[polish]\nremoval_um = {um}\n[limits]"))]);
        let report = bench.mill(0);
        assert_eq!(report["light"]["on_audience_machined"], plain["light"]["on_audience_machined"]);
        assert_eq!(report["fidelity"], plain["fidelity"]);
        let polished = &report["light"]["polished"];
        let shares =
            ["on_audience", "leak", "absorbed", "unresolved"].map(|k| polished[k].as_f64().expect(k));
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{polished}");
        shares[0]
    };
    let (little, much) = (polished("0.5"), polished("20"));
    let [cut, design] =
        ["machined", "designed"].map(|of| plain["light"][format!("on_audience_{of}")].as_f64());
    let lights = [cut.expect("a share"), little, much, design.expect("a share")];
    assert!(lights.is_sorted_by(|a, b| b - a > 0.01), "cut, 0.5 um, 20 um, design: {lights:?}");
    let bench = Bench::with(&[("[limits]", "[polish]\nremoval_um = -1\n[limits]")]);
    bench.run("mill job.toml --out out --quiet").code(2).stderr(contains("polish.removal_um"));
    assert!(!bench.path("out").exists());
    let die = ("step_mm = 0.02", "step_mm = 0.02\nform = \"die\"");
    let report = Bench::with(&[die, ("[limits]", "[polish]\nremoval_um = 1\n[limits]")]).mill(0);
    let findings = report["findings"].as_array().expect("findings");
    assert!(findings.iter().any(|finding| finding["code"] == "polish"), "a die has no light: {findings:?}");
}

#[test]
fn a_wall_is_not_cut_and_an_open_edge_is() {
    let low = |edge: &str| {
        let bench = Bench::with(&[("step_mm = 0.02", &format!("step_mm = 0.02\nedge = \"{edge}\""))]);
        let report = bench.mill(0);
        report["tiles"][0]["programs"][1]["bounds_mm"]["x"][0].as_f64().expect("a bound")
    };
    // Against a wall the ball's axis stays a radius inside; an open edge is overrun.
    assert!(low("open") < 0.0);
    let bench = Bench::with(&[("step_mm = 0.02", "step_mm = 0.02\nedge = \"wall\"")]);
    let report = bench.mill(0);
    assert!(figure(&report, "cavity_area_fraction") > 0.05, "the wall keeps the ball off the edge: {report}");
}

/// A pit 7 mm deep with upright walls, cut with a ball whose neck is 4 mm long after a flat whose neck is 12, and
/// which wears out on the way, so that its operation is several programs.
#[test]
fn a_shank_that_rubs_is_found_and_its_programs_are_set_aside() {
    let bench = Bench::with(&[
        ("[limits]", "[tools]\nlibrary = \"short-lived.toml\"\n[limits]"),
        ("screen = \"screen.toml\"\ncells = [324, 149, 325, 150]", "heights = \"pit.npy\"\npixel_mm = 0.1"),
        ("step_mm = 0.02", "step_mm = 0.1"),
        ("thickness_mm = 10", "thickness_mm = 15"),
        ("gouge_mm = 0.002", "gouge_mm = 0.05"),
        ("stepdown_mm = 0.3", "stepdown_mm = 1.0"),
        ("stepover_mm = 0.1", "stepover_mm = 0.4"),
    ]);
    let side = 120;
    let mut npy = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({side}, {side}), }}");
    npy.extend(format!("{header:<117}\n").bytes());
    let inside = |at: usize| (30..90).contains(&at);
    for row in 0..side {
        for column in 0..side {
            let z: f32 = if inside(row) && inside(column) { -7.0 } else { 0.0 };
            npy.extend(z.to_le_bytes());
        }
    }
    bench.write("pit.npy", npy);
    let library =
        include_str!("../samples/tools.toml").replacen("tool_life_m = 300", "tool_life_m = 0.05", 1);
    bench.write("short-lived.toml", library);
    let report = bench.mill(1);
    let files = programs(&report);
    assert!(files.len() > 4 && files[3].contains("01-rough-flat-3-s04"), "{files:?}");
    let findings = report["findings"].as_array().expect("findings");
    let hits: Vec<_> = findings.iter().filter(|finding| finding["code"] == "holder").collect();
    assert_eq!(hits.len(), 1, "of the ball alone: {hits:?}");
    let message = hits[0]["message"].as_str().expect("a message");
    assert!(
        message.starts_with("rejected/r0c0-02-finish-ball-1")
            && message.contains("the shank of ball-1 is 3."),
        "{message}"
    );
    assert!(programs(&report).iter().all(|file| file.starts_with("rejected/")));
    // It asks for steps of 1 mm, which the flat does not take.
    let steps = findings.iter().find(|finding| finding["code"] == "stepdown").expect("said");
    assert_eq!(
        steps["message"],
        "operation 1 (rough, flat-3) is cut in steps of 0.45 mm, the max_depth_mm of its tool; stepdown_mm asks for 1"
    );
    let roughing = report["tiles"][0]["programs"].as_array().expect("programs").iter();
    let bites = roughing.filter(|p| p["operation"] == "rough").filter_map(|p| p["deepest_bite_mm"].as_f64());
    let deepest = bites.fold(0.0, f64::max);
    assert!((deepest - 0.45).abs() < 1e-6, "{deepest}");
}

/// Of a part in several pieces some may lie at the stock's top as a whole: they are finished all the same.
#[test]
fn roughing_that_finds_nothing_to_cut_is_left_out_of_a_tile_and_said() {
    let designed = "screen = \"screen.toml\"\ncells = [324, 149, 325, 150]";
    let bench = Bench::with(&[
        (designed, "heights = \"flat.npy\"\npixel_mm = 0.02"),
        ("top_allowance_mm = 0.2", "top_allowance_mm = 0"),
    ]);
    let mut flat = HeightWriter::create(&bench.path("flat.npy"), 60, 40, 0.02, [0.0; 2]).unwrap();
    let window = Window { column: 0, row: 0, columns: 60, rows: 40 };
    flat.write(&Heights { window, z_mm: vec![0.0; 2400] }).unwrap();
    flat.finish().unwrap();
    let report = bench.mill(0);
    let programs = report["tiles"][0]["programs"].as_array().expect("programs");
    assert_eq!(programs.len(), 1);
    assert_eq!(programs[0]["file"], "programs/r0c0-02-finish-ball-1.ngc");
    let said = report["findings"].as_array().expect("findings").iter().find(|f| f["code"] == "left-out");
    assert_eq!(
        said.expect("a note")["message"],
        "operation 1 (rough, flat-3) has nothing to cut: no metal stands over its stock_to_leave_mm where it can get"
    );
}

/// A large part is looked at in places under each cutter, and all over under the set that will do.
#[test]
fn a_large_part_is_checked_by_some_of_it_and_its_set_by_all() {
    let bench = Bench::with(&[
        (
            "screen = \"screen.toml\"\ncells = [324, 149, 325, 150]",
            "heights = \"waves.npy\"\npixel_mm = 0.02",
        ),
        ("[machine]", "[tools]\nlibrary = \"./two.toml\"\n[machine]"),
    ]);
    let tools =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/samples/tools.toml")).expect("tools");
    let mut tables = tools.split("[[tool]]");
    let head = tables.next().expect("a head");
    let wanted = ["\"flat-3\"", "\"ball-1\"", "\"ball-2\""];
    let some: Vec<&str> = tables.filter(|table| wanted.iter().any(|name| table.contains(name))).collect();
    assert_eq!(some.len(), wanted.len());
    bench.write("two.toml", format!("{head}[[tool]]{}", some.join("[[tool]]")));
    // Creases, closer together from left to right.
    let (columns, rows) = (4200, 2100);
    let mut waves = HeightWriter::create(&bench.path("waves.npy"), columns, rows, 0.02, [0.0; 2]).unwrap();
    let line: Vec<f32> = (0..columns)
        .map(|k| {
            let x = 0.02 * k as f64;
            (0.25 * (0.5 * x + 0.002 * x * x).sin().abs() - 0.25) as f32
        })
        .collect();
    for row in 0..rows as i64 {
        let window = Window { column: 0, row, columns, rows: 1 };
        waves.write(&Heights { window, z_mm: line.clone() }).unwrap();
    }
    waves.finish().unwrap();
    let job = Job::read(&bench.path("job.toml")).unwrap();
    let check = |look| pipeline::check(&job, &bench.path(""), None, look, &Silent).unwrap();
    let (all, some) = (check(Look::Share(1.0)), check(Look::Most(3_000_000)));
    assert_eq!(all.looked_at_fraction, None);
    let looked_at = some.looked_at_fraction.expect("a part of it");
    assert!((0.2..0.5).contains(&looked_at), "{looked_at}");
    for (all, some) in all.cutters.iter().zip(&some.cutters) {
        let error = some.standard_error.expect("an error").unreachable_fraction;
        let off = (all.unreachable_fraction - some.unreachable_fraction).abs();
        assert!(off <= 4.0 * error, "{:?}: {off} off, {error} said", all.tools);
    }
    let [all, exact] = [&all, &some].map(|checked| checked.smallest_set.as_ref().expect("a set"));
    assert!(exact.standard_error.is_none() && all.unreachable_fraction > 0.0);
    assert_eq!((&all.tools, all.unreachable_fraction), (&exact.tools, exact.unreachable_fraction));
    let shared = check(Look::Share(looked_at)).smallest_set.expect("a set");
    assert!(shared.standard_error.is_some());
}
