//! `screenmill design`, `limits`, `calibrate` and `evaluate` as sentences.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use glam::{DVec2, DVec3};
use predicates::prelude::*;
use screenmill::screen::{self, Design, Scene};

fn sample(name: &str) -> String {
    format!("{}/samples/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

fn screenmill(arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("screenmill").expect("the program").args(arguments).assert()
}

/// The theatre with coarse cells, and perhaps another change.
fn coarse(folder: &Path, from: &str, to: &str) -> String {
    let text = fs::read_to_string(sample("theatre")).expect("a sample");
    assert!(text.contains(from));
    let path = folder.join("screen.toml");
    fs::write(&path, text.replace("width_mm = 4.0", "width_mm = 50.0").replace(from, to)).expect("written");
    path.to_str().expect("text").into()
}

fn design(arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("screenmill").expect("the program").arg("design").args(arguments).assert()
}

fn is_empty(folder: &Path) -> bool {
    fs::read_dir(folder).expect("a folder").next().is_none()
}

#[test]
fn designing_a_few_cells_writes_them_and_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let (npz, stl) = (folder.path().join("a.npz"), folder.path().join("a.stl"));
    let (npz, stl) = (npz.to_str().expect("text"), stl.to_str().expect("text"));
    design(&[&sample("theatre"), "--out", npz, "--stl", stl, "--cells", "324", "149", "327", "152"])
        .success()
        .stdout(predicate::str::contains("9 cells of 4 mm: columns 324 to 327, rows 149 to 152, 12 x 12 mm"))
        .stdout(predicate::str::contains("200 facets a cell, 1800 in all"));
    assert_eq!(Design::read(npz.as_ref()).expect("a design").cells.len(), 9);
    // The reference's solids of the same cells have as many triangles.
    assert_eq!(fs::metadata(stl).expect("a file").len(), 84 + 50 * 8138);
}

#[test]
fn stitched_cells_become_one_solid_that_can_be_read_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = coarse(folder.path(), "\"step\" ", "\"stitched\" ");
    let [npz, stl, tif] = ["a.npz", "a.stl", "a.tif"].map(|name| folder.path().join(name));
    let [npz, stl, tif] = [&npz, &stl, &tif].map(|path| path.to_str().expect("text"));
    design(&[&scene, "--out", npz, "--stl", stl, "--cells", "3", "2", "5", "4"]).success().stdout(
        predicate::str::is_match("no steps between cells; .* off by [0-9.]+ % rms, [0-9]+ % at most")
            .expect("a pattern"),
    );
    screenmill(&["raster", stl, "--out", tif, "--step-mm", "5"]).success();
}

#[test]
fn the_thread_count_does_not_change_a_byte() {
    let folder = tempfile::tempdir().expect("a folder");
    let made = ["1", "3"].map(|threads| {
        let path = folder.path().join(threads);
        let out = path.to_str().expect("text");
        let output = design(&[
            &sample("home-theatre"),
            "--out",
            out,
            "--cells",
            "0",
            "0",
            "6",
            "4",
            "--threads",
            threads,
            "--quiet",
            "--json",
        ])
        .success()
        .stderr("");
        let json: serde_json::Value =
            serde_json::from_slice(&output.get_output().stdout).expect("one JSON object");
        assert_eq!(json["cells"], 24);
        assert_eq!(json["facets_per_cell"], serde_json::json!([200, 200]));
        fs::read(path).expect("bytes")
    });
    assert!(made[0] == made[1]);
}

#[test]
fn stages_are_timed_on_request() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("a.npz");
    let arguments = ["--out", out.to_str().expect("text"), "--cells", "0", "0", "2", "1", "--quiet", "-v"];
    let mut all = vec![sample("conference")];
    all.extend(arguments.map(String::from));
    let all: Vec<&str> = all.iter().map(String::as_str).collect();
    let stages = ["elevation", "sampling", "solving", "writing"];
    let lines = stages.map(|stage| format!("{stage}: [0-9.]+ s\n")).concat();
    design(&all).success().stderr(predicate::str::is_match(format!("^{lines}$")).expect("a pattern"));
}

#[test]
fn a_given_elevation_is_taken_as_it_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("a.npz");
    let npy = folder.path().join("e.npy");
    let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (250, 500), }";
    let mut bytes = b"\x93NUMPY\x01\x00v\x00".to_vec();
    bytes.extend(format!("{text:<117}\n").bytes());
    bytes.extend((0..125_000u32).flat_map(|at| ((at % 500) as f32 + 0.5 * (at / 500) as f32).to_le_bytes()));
    fs::write(&npy, bytes).expect("written");
    let (out, npy) = (out.to_str().expect("text"), npy.to_str().expect("text"));
    design(&[&sample("theatre"), "--out", out, "--elevation", npy, "--cells", "7", "10", "9", "11"])
        .success();
    let design = Design::read(out.as_ref()).expect("a design");
    assert_eq!(design.cells.iter().map(|cell| cell.elevation_mm).collect::<Vec<_>>(), [12.0, 13.0]);
}

#[test]
fn a_refusal_is_one_message_and_leaves_nothing_behind() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("a.npz");
    let out = out.to_str().expect("text");
    design(&[&sample("theatre"), "--out", out, "--cells", "499", "0", "501", "1"]).code(2).stderr(
        predicate::str::starts_with("error: cells 499 0 501 1 do not lie in the screen's 500 x 250 cells"),
    );
    assert!(is_empty(folder.path()));
    design(&[&sample("missing"), "--out", out]).code(2).stderr(predicate::str::contains("missing.toml"));
    design(&[&sample("theatre"), "--out", out, "--elevation", &sample("theatre")]).code(2);
    assert!(is_empty(folder.path()));
    let nowhere = folder.path().join("no/such/a.npz");
    design(&[&sample("theatre"), "--out", nowhere.to_str().expect("text")])
        .code(2)
        .stderr(predicate::str::contains("cannot be written"));
    design(&[&sample("theatre"), "--out", folder.path().to_str().expect("text")])
        .code(2)
        .stderr(predicate::str::contains("is a folder"));
    design(&[&sample("theatre"), "--out", out, "--stl", out])
        .code(2)
        .stderr(predicate::str::contains("a.npz is asked for twice"));
    for threads in ["0", "1000000", "-1", "two"] {
        design(&[&sample("theatre"), "--out", out, "--threads", threads])
            .code(2)
            .stderr(predicate::str::contains("--threads"));
    }
    assert!(is_empty(folder.path()));
}

/// The command with files of at most so many bytes, as on a disk that is full.
#[cfg(target_os = "linux")]
fn on_a_full_disk(kib: u32, arguments: &[&str]) -> assert_cmd::assert::Assert {
    let program = assert_cmd::cargo::cargo_bin("screenmill");
    let limited = format!("ulimit -f {}; exec \"$0\" \"$@\"", 2 * kib);
    Command::new("sh").args(["-c", &limited]).arg(program).args(arguments).assert()
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_leaves_neither_of_two_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = coarse(folder.path(), "\"poisson\"", "\"flat\"");
    let out = tempfile::tempdir().expect("a folder");
    let [npz, stl, png] = ["a.npz", "a.stl", "m.png"].map(|name| out.path().join(name));
    let [npz, stl, png] = [&npz, &stl, &png].map(|path| path.to_str().expect("text"));
    let two = ["design", &scene, "--out", npz, "--stl", stl, "--cells", "0", "0", "2", "2", "--quiet"];
    for kib in [0, 40] {
        on_a_full_disk(kib, &two).code(2).stderr(predicate::str::is_match("^error: .*a.stl cannot be written: File too large .*; hint: its folder must be writable and have room\n$").expect("a pattern"));
        assert!(is_empty(out.path()));
    }
    on_a_full_disk(8, &[&two[..4], &two[6..]].concat())
        .code(2)
        .stderr(predicate::str::contains("a.npz cannot be written: File too large"));
    on_a_full_disk(4, &["calibrate", &scene, "--out", png, "--pixels", "300", "150"])
        .code(2)
        .stderr(predicate::str::contains(".png: File too large"));
    let within = out.path().join("figures");
    on_a_full_disk(4, &["limits", &scene, "--out", within.to_str().expect("text"), "--quiet"])
        .code(2)
        .stderr(predicate::str::contains("figures/design-space.png: File too large"));
    assert!(is_empty(out.path()));
}

#[test]
#[cfg(unix)]
fn what_is_no_file_is_not_replaced_by_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let pipe = folder.path().join("a.npz");
    std::process::Command::new("mkfifo").arg(&pipe).status().expect("a pipe");
    design(&[&sample("theatre"), "--out", pipe.to_str().expect("text")])
        .code(2)
        .stderr(predicate::str::contains("it is a device and no file"));
    assert!(!fs::metadata(&pipe).expect("still there").is_file());
}

#[test]
#[cfg(target_os = "linux")]
fn an_interrupted_design_leaves_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = coarse(folder.path(), "facets = 200", "facets = 3000");
    for signal in ["-INT", "-TERM"] {
        ends_with_nothing(&scene, signal);
    }
}

#[cfg(target_os = "linux")]
fn ends_with_nothing(scene: &str, signal: &str) {
    let out = tempfile::tempdir().expect("a folder");
    let [npz, stl] = ["a.npz", "a.stl"].map(|name| out.path().join(name));
    let program = std::process::Command::new(assert_cmd::cargo::cargo_bin("screenmill"))
        .args(["design", scene, "--quiet", "--out"])
        .arg(&npz)
        .arg("--stl")
        .arg(&stl)
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("started");
    while is_empty(out.path()) {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let kill = std::process::Command::new("kill").args([signal, &program.id().to_string()]).status();
    assert!(kill.expect("sent").success());
    let ended = program.wait_with_output().expect("ended");
    assert_eq!(ended.status.code(), Some(2));
    assert_eq!(String::from_utf8_lossy(&ended.stderr), "error: interrupted; nothing was written\n");
    assert!(is_empty(out.path()));
}

#[test]
fn a_screen_within_its_limits_says_what_would_break_first() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = coarse(folder.path(), "schema", "schema");
    let out = folder.path().join("out");
    let out = out.to_str().expect("text");
    let said = screenmill(&["limits", &scene, "--out", out, "--json"]).success();
    let json: serde_json::Value = serde_json::from_slice(&said.get_output().stdout).expect("one JSON object");
    assert_eq!(json["verdict"], "pass");
    let sentence = json["sentence"].as_str().expect("text");
    assert!(
        sentence.contains("of audience \"stalls\"") && sentence.contains("degrees of margin"),
        "{sentence}"
    );
    for file in json["files"].as_array().expect("files") {
        let path = Path::new(out).join(file.as_str().expect("text"));
        assert!(fs::metadata(&path).expect("written").len() > 1000, "{}", path.display());
    }
    let first = fs::read(Path::new(out).join("design-space.png")).expect("a picture");
    let svg = fs::read_to_string(Path::new(out).join("design-space.svg")).expect("a picture");
    assert!(svg.contains("Design space: screen") && svg.contains("Eq. 11"));
    screenmill(&["limits", &scene, "--out", out, "--threads", "1"])
        .success()
        .stdout(predicate::str::contains("no point of the"));
    assert!(first == fs::read(Path::new(out).join("design-space.png")).expect("a picture"));
    // A flat screen has no second picture, and none of an earlier run stays.
    assert!(Path::new(out).join("design-space-elevated.png").exists());
    let flat = coarse(folder.path(), "\"poisson\"", "\"flat\"");
    screenmill(&["limits", &flat, "--out", out]).success();
    assert!(!Path::new(out).join("design-space-elevated.png").exists());
}

#[test]
fn a_screen_that_shadows_itself_ends_with_1_and_says_where() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = coarse(folder.path(), "[-1.0, -0.65, 2.0]", "[-9.0, -0.65, 2.0]");
    screenmill(&["limits", &scene]).code(1).stdout(predicate::str::contains("degrees beyond the limit"));
    screenmill(&["limits", &sample("missing")]).code(2).stderr(predicate::str::contains("missing.toml"));
}

#[test]
fn a_mask_is_written_in_16_and_in_8_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = coarse(folder.path(), "schema", "schema");
    let out = folder.path().join("mask.png");
    let path = out.to_str().expect("text");
    let said = screenmill(&["calibrate", &scene, "--out", path, "--pixels", "64", "32", "--json"]).success();
    let json: serde_json::Value = serde_json::from_slice(&said.get_output().stdout).expect("one JSON object");
    let figure = |key: &str| json["figures"][key].as_f64().expect("a number");
    assert!((figure("gain_attenuation") - 8.18).abs() < 0.05);
    let fine = image::open(&out).expect("a picture").into_luma16();
    let coarse = image::open(folder.path().join("mask-8bit.png")).expect("a picture").into_luma8();
    assert_eq!((fine.dimensions(), coarse.dimensions()), ((64, 32), (64, 32)));
    for (a, b) in fine.pixels().zip(coarse.pixels()) {
        assert!((f64::from(a.0[0]) / 65535.0 - f64::from(b.0[0]) / 255.0).abs() <= 0.5 / 255.0 + 1e-4);
    }
    // The top row of the picture is the top of the screen.
    let coarse = Scene::read(scene.as_ref()).expect("a scene");
    let l = |x: f64, y: f64| screen::projected_sr(&coarse.audience, DVec3::new(x, y, 0.0), DVec2::ZERO);
    let of_pixel = |c: u32, r: u32| l((f64::from(c) + 0.5) / 32.0 - 1.0, 0.5 - (f64::from(r) + 0.5) / 32.0);
    let most = figure("l_max_sr");
    for (c, r) in [(3, 2), (3, 29), (50, 10)] {
        let mask = f64::from(fine.get_pixel(c, r).0[0]) / 65535.0;
        assert!((mask - of_pixel(c, r) / most).abs() < 2e-3, "{c} {r}: {mask}");
    }
    assert!((of_pixel(3, 2) / of_pixel(3, 29) - 1.0).abs() > 0.02);
    // A picture twice as wide as the screen is black beside it.
    let wide =
        ["--frustum", "-2", "-0.5", "2", "0.5", "--pixels", "64", "16", "--elevated", "--gamma", "2.2"];
    screenmill(&[&["calibrate", &scene, "--out", path], &wide[..]].concat())
        .success()
        .stdout(predicate::str::contains("by redirection"));
    let wide = image::open(&out).expect("a picture").into_luma16();
    assert_eq!(wide.get_pixel(15, 8).0[0], 0);
    assert!(wide.get_pixel(16, 8).0[0] > 30_000 && wide.get_pixel(47, 8).0[0] > 30_000);
}

#[test]
fn a_mask_that_makes_no_sense_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = sample("theatre");
    let refuse = |case: &str, flags: &[&str]| {
        let file = format!("{}/tests/refuse/calibrate/{case}.txt", env!("CARGO_MANIFEST_DIR"));
        let text = fs::read_to_string(&file).unwrap_or_else(|error| panic!("{file}: {error}"));
        let message = text.lines().next().expect("a message");
        Command::cargo_bin("screenmill")
            .expect("the program")
            .current_dir(folder.path())
            .args([&["calibrate", scene.as_str(), "--quiet"], flags].concat())
            .assert()
            .code(2)
            .stderr(format!("error: {message}\n"));
        assert!(is_empty(folder.path()), "{case}");
    };
    refuse("kind", &["--out", "mask.tif"]);
    refuse("no-pixels", &["--out", "mask.png", "--pixels", "0", "5"]);
    refuse("too-many-pixels", &["--out", "mask.png", "--pixels", "4096", "40000"]);
    refuse("frustum-turned", &["--out", "mask.png", "--frustum", "1", "0", "-1", "1"]);
    refuse("frustum-nan", &["--out", "mask.png", "--frustum", "nan", "0", "1", "1"]);
    refuse("frustum-beside", &["--out", "mask.png", "--frustum", "5", "5", "6", "6"]);
    refuse("gamma", &["--out", "mask.png", "--gamma", "0"]);
    let nowhere = format!("{}/no/m.png", folder.path().display());
    screenmill(&["calibrate", &scene, "--out", &nowhere, "--pixels", "2", "2"])
        .code(2)
        .stderr(predicate::str::contains("no/m-8bit.png"));
    assert!(is_empty(folder.path()));
}

#[test]
fn an_evaluation_sets_the_papers_words_beside_the_scenes_figures() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = coarse(folder.path(), "schema", "schema");
    let made = ["1", "2"].map(|threads| {
        let out = folder.path().join(threads);
        let path = out.to_str().expect("text");
        let said =
            screenmill(&["evaluate", &scene, "--out", path, "--threads", threads, "--json", "--quiet"])
                .success();
        let json: serde_json::Value =
            serde_json::from_slice(&said.get_output().stdout).expect("one JSON object");
        (out, json)
    });
    let [(out, json), (other, _)] = &made;
    let gain = json["flat"]["gain_attenuation"].as_f64().expect("a number");
    assert!((gain - 8.18).abs() < 0.05, "{gain}");
    for view in json["seats"].as_array().expect("seats") {
        let own = view["deviation"].as_f64().expect("a number");
        assert!(own < 0.3 * view["high_gain_deviation"].as_f64().expect("a number"), "{view}");
    }
    let page = fs::read_to_string(out.join("evaluation.html")).expect("a page");
    assert!(page.contains("more than 8 times") && page.contains("gain.png"));
    let files = json["files"].as_array().expect("files");
    assert!(files.len() > 18, "{files:?}");
    for file in files {
        let [one, two] =
            [out, other].map(|out| fs::read(out.join(file.as_str().expect("text"))).expect("a file"));
        assert!(one.len() > 500 && one == two, "{file}");
    }
    screenmill(&["evaluate", &sample("missing"), "--out", &format!("{}/x", folder.path().display())]).code(2);
    assert!(!folder.path().join("x").exists());
}
