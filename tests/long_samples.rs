//! Every sample job, on a coarser step so that it fits, in its own dialect and in G-code: judged without a gouge
//! by its own read-back, and accepted by LinuxCNC's interpreter.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;

const SAMPLES: [(&str, &str); 8] = [
    ("quickstart", "0.02"),
    ("theatre-prototype", "0.1"),
    ("theatre-dish", "0.1"),
    ("home-prototype", "0.05"),
    ("split", "0.1"),
    ("stl", "0.02"),
    ("relief", "0.02"),
    ("die", "0.02"),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The sample's job with another step and other posts, its paths made absolute.
fn job(name: &str, step_mm: &str, posts: &str, folder: &Path) -> PathBuf {
    let home = root().join("samples").join(name);
    let text = fs::read_to_string(home.join("job.toml")).expect("the sample is there");
    let mut lines = Vec::new();
    for line in text.lines() {
        let key = line.split('=').next().unwrap_or_default().trim();
        match key {
            "step_mm" | "post" => {}
            // A quarter of the sheet, still in four tiles: the whole would take longer than all other samples.
            "cells" if name == "split" => lines.push("cells = [390, 140, 440, 190]".to_string()),
            "screen" | "mesh" | "heights" => {
                let file = line.split('"').nth(1).expect("a path in quotes");
                lines.push(format!("{key} = {:?}", home.join(file)));
                lines.push(format!("step_mm = {step_mm}"));
            }
            // The limit on the whole shape is for the true step.
            "deviation_mm" | "hours_max" => {}
            "name" => {
                lines.push(line.to_string());
                lines.push(format!("post = [{posts}]"));
            }
            _ => lines.push(line.to_string()),
        }
    }
    let path = folder.join(format!("{name}.toml"));
    fs::write(&path, lines.join("\n")).expect("scratch is writable");
    path
}

#[test]
fn every_sample_is_cut_without_a_gouge() {
    let scratch = tempfile::tempdir().expect("scratch");
    let interpreter = Command::new("rs274").arg("-h").output().is_ok();
    assert!(interpreter || std::env::var_os("CI").is_none(), "rs274 is missing in CI");
    if !interpreter {
        println!("skipped: rs274 is missing, programs are not shown to LinuxCNC's interpreter");
    }
    for (name, step_mm) in SAMPLES {
        let job = job(name, step_mm, "\"rml1\", \"linuxcnc\"", scratch.path());
        let out = scratch.path().join(name);
        let run = Command::new(env!("CARGO_BIN_EXE_screenmill"))
            .args(["mill", "--quiet", "--out"])
            .arg(&out)
            .arg(&job)
            .output()
            .expect("screenmill runs");
        assert!(run.status.success(), "{name}: {}", String::from_utf8_lossy(&run.stderr));
        let text = fs::read_to_string(out.join("report.json")).expect("a report");
        let report: Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(report["verdict"], "pass", "{name}");
        for tile in report["tiles"].as_array().expect("tiles") {
            let gouge_mm = tile["fidelity"]["gouge_max_mm"].as_f64().expect("a gouge");
            assert!(gouge_mm <= 0.002, "{name} {}: {gouge_mm}", tile["name"]);
            for program in tile["programs"].as_array().expect("programs") {
                let file = program["file"].as_str().expect("a file");
                assert!(program["blocks"].as_u64().expect("blocks") > 10, "{name}: {file}");
                if interpreter && file.ends_with(".ngc") {
                    accepted(&out.join(file));
                }
            }
        }
        println!("{name}: {} tiles", report["tiles"].as_array().map_or(0, Vec::len));
    }
}

fn accepted(program: &Path) {
    let folder = program.parent().expect("a folder");
    let mut rs274 = Command::new("rs274");
    // It keeps its tool table in the home folder.
    rs274.env("HOME", folder);
    let read =
        rs274.arg("-g").arg(program).current_dir(folder).stdin(Stdio::null()).output().expect("rs274 runs");
    let said = String::from_utf8_lossy(&read.stderr);
    assert!(read.status.success() && said.trim() == "executing", "{}: {said}", program.display());
    assert!(String::from_utf8_lossy(&read.stdout).contains("PROGRAM_END()"), "{}", program.display());
}
