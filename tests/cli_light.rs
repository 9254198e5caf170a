//! `light` as a designer uses it.

use std::path::Path;

use assert_cmd::Command;
use screenmill::grid::{Heights, Window};
use screenmill::surface::{HeightWriter, Options, open};
use serde_json::Value;

fn scene(name: &str) -> String {
    format!("{}/samples/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

fn run(dir: &Path, words: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("screenmill").expect("the binary").current_dir(dir).args(words).arg("--quiet").assert()
}

/// 2 x 2 cells and their samples.
fn design(dir: &Path, scene_name: &str, step_mm: &str) {
    let scene = scene(scene_name);
    let words = ["design", &scene, "--out", "d.npz", "--cells", "325", "150", "327", "152"];
    run(dir, &words).success();
    run(dir, &["raster", "d.npz", "--out", "d.tif", "--step-mm", step_mm]).success();
}

fn light(dir: &Path, surface: &str, scene_path: &str, more: &[&str]) -> Value {
    let mut words = vec!["light", "d.npz", "--surface", surface, "--screen", scene_path, "--out", "out"];
    words.extend(more);
    run(dir, &words).success();
    let text = std::fs::read_to_string(dir.join("out/report.json")).expect("a report");
    serde_json::from_str(&text).expect("JSON")
}

fn figure(report: &Value, key: &str) -> f64 {
    report["light"][key].as_f64().unwrap_or_else(|| panic!("{key} in {report}"))
}

fn whole(report: &Value, of: &str) -> f64 {
    ["on_audience", "leak", "absorbed", "unresolved"]
        .iter()
        .map(|k| figure(report, &format!("{k}_{of}")))
        .sum()
}

fn refusal(name: &str) -> String {
    let path = format!("{}/tests/refuse/light/{name}.txt", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    format!("error: {}\n", text.lines().next().expect("a message"))
}

#[test]
fn a_design_against_itself_loses_nothing() {
    let dir = tempfile::tempdir().expect("a folder");
    design(dir.path(), "theatre", "0.02");
    let report = light(dir.path(), "d.tif", &scene("theatre"), &[]);
    for of in ["designed", "machined"] {
        assert!((whole(&report, of) - 1.0).abs() < 1e-9, "{report}");
        let reflected = 1.0 - figure(&report, &format!("absorbed_{of}"));
        assert!((reflected - 0.911).abs() < 0.001, "{report}");
        // Steps between cells are walls that central differences at 20 um see as steep faces.
        assert!(figure(&report, &format!("on_audience_{of}")) > 0.97 * reflected, "{report}");
    }
    // A file of floats moves the normals a little.
    let lost = figure(&report, "on_audience_designed") - figure(&report, "on_audience_machined");
    assert!(lost.abs() < 0.001, "{report}");
    let planes = &report["design_by_planes"];
    let [on, leak] = ["on_audience", "leak"].map(|key| planes[key].as_f64().expect("a share"));
    assert!(on / (on + leak) > 0.98, "{report}");
    // Within 2 % of pi R / L with L of the theatre's centre.
    let gain = figure(&report, "gain_designed") / figure(&report, "on_audience_designed");
    assert!((gain / (std::f64::consts::PI / 0.319) - 1.0).abs() < 0.05, "{report}");
    for map in ["lost", "room"] {
        let path = dir.path().join("out").join(report["maps"][map].as_str().expect("a file"));
        assert!(image::open(path).expect("a picture").width() > 600);
    }
}

/// The reference's table: what a ball leaves of bumps leaks into the gap of a split audience; bumps of one audience
/// leak little, and stitched dishes nothing. Its cells have a groove on every side, these four only between them,
/// so that half of the figures remains.
#[test]
fn balls_of_several_sizes_leak_as_the_reference_says() {
    let dir = tempfile::tempdir().expect("a folder");
    for (name, cutter, low, high) in [
        ("home-theatre", "ball:2", 0.5 * 0.045, 0.5 * 0.070),
        ("theatre", "ball:2", 0.0, 0.003),
        ("theatre-dish/screen", "ball:2", 0.0, 0.001),
    ] {
        design(dir.path(), name, "0.01");
        let words = [
            "compensate",
            "d.npz",
            "--cutter",
            cutter,
            "--closing",
            "c.tif",
            "--sampled",
            "--step-mm",
            "0.01",
        ];
        run(dir.path(), &words).success();
        let report = light(dir.path(), "c.tif", &scene(name), &["--far-field"]);
        assert_eq!(report["far_field"], true);
        let leak = figure(&report, "leak_machined") / (1.0 - figure(&report, "absorbed_machined"));
        assert!((low..=high).contains(&leak), "{name} {cutter}: {leak}, {report}");
    }
}

#[test]
fn rough_and_matte_metal_spreads_the_light() {
    let dir = tempfile::tempdir().expect("a folder");
    design(dir.path(), "theatre", "0.02");
    let mirror = std::fs::read_to_string(scene("theatre")).expect("a scene");
    let rough = mirror
        .replace("material = \"aluminium\"", "material = \"aluminium\"\nroughness = 0.1\ndiffuse = 0.05");
    std::fs::write(dir.path().join("rough.toml"), rough).expect("a scene");
    let polished = light(dir.path(), "d.tif", &scene("theatre"), &[]);
    let report = light(dir.path(), "d.tif", "rough.toml", &[]);
    assert!((whole(&report, "machined") - 1.0).abs() < 1e-9);
    assert!(figure(&report, "standard_error") < 0.002);
    assert!(polished["light"].get("standard_error").is_none());
    let (before, after) =
        (figure(&polished, "on_audience_machined"), figure(&report, "on_audience_machined"));
    assert!(after < 0.9 * before && after > 0.3 * before, "{before} {after}");
    // The planes stand for mirrors whatever the metal.
    assert_eq!(polished["design_by_planes"], report["design_by_planes"]);
}

#[test]
fn a_surface_of_another_zero_or_another_part_is_told() {
    let dir = tempfile::tempdir().expect("a folder");
    design(dir.path(), "theatre", "0.02");
    let opened = open(&dir.path().join("d.tif"), &Options::at_step(0.02)).expect("heights");
    let lattice = opened.surface.lattice();
    let datum_mm = opened.surface.top_mm();
    let shifted = opened.surface.heights(lattice.window(), datum_mm).expect("heights");
    let write = |name: &str, heights: &Heights| {
        let Window { columns, rows, .. } = heights.window;
        let mut writer =
            HeightWriter::create(&dir.path().join(name), columns, rows, 0.02, [0.0, 1.0]).expect(name);
        writer.write(heights).expect("a band");
        writer.finish().expect("whole");
    };
    write("zero.tif", &shifted);
    let report = light(dir.path(), "zero.tif", &scene("theatre"), &[]);
    assert!(report["notes"][0].as_str().expect("a note").contains("another zero"), "{report}");
    let [before, after] = ["designed", "machined"].map(|of| figure(&report, &format!("on_audience_{of}")));
    assert!((before - after).abs() < 0.001, "{report}");

    write("s.tif", &shifted.crop(Window { column: 0, row: 0, columns: 300, rows: 200 }));
    let refused = |words: &[&str]| {
        let mut all = vec!["light", "d.npz", "--out", "refused"];
        all.extend(words);
        let assert = run(dir.path(), &all).code(2);
        assert!(!dir.path().join("refused").exists());
        String::from_utf8(assert.get_output().stderr.clone()).expect("text")
    };
    let theatre = scene("theatre");
    assert_eq!(refused(&["--surface", "s.tif", "--screen", &theatre]), refusal("another-size"));
    let small = std::fs::read_to_string(&theatre).expect("a scene");
    let small = small.replace("width_m = 2.0", "width_m = 1.0").replace("height_m = 1.0", "height_m = 0.5");
    std::fs::write(dir.path().join("small.toml"), small).expect("a scene");
    assert_eq!(refused(&["--surface", "d.tif", "--screen", "small.toml"]), refusal("another-screen"));
    assert!(refused(&["--surface", "d.tif", "--screen", "none.toml"]).contains("none.toml"));
    assert!(refused(&["--surface", "d.tif"]).contains("--screen"));
}
