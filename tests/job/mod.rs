//! A scratch folder with a small job in it: one cell of the theatre screen, coarse, in two operations.

#![allow(dead_code, reason = "each test file takes what it needs")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use screenmill::surface::{Options, open};
use serde_json::Value;

pub const STEP_MM: f64 = 0.02;

const JOB: &str = r#"schema = 1
[part]
screen = "screen.toml"
cells = [324, 149, 325, 150]
step_mm = 0.02
[stock]
material = "aluminium-6082"
thickness_mm = 10
top_allowance_mm = 0.2
margin_mm = 3
min_floor_mm = 2
[machine]
name = "linuxcnc-mill"
[limits]
gouge_mm = 0.002
[[operation]]
kind = "rough"
tool = "flat-3"
stepdown_mm = 0.3
stock_to_leave_mm = 0.05
[[operation]]
kind = "finish"
tool = "ball-1"
stepover_mm = 0.1
"#;

pub struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    /// The job with each first occurrence of the left text replaced, which must be there.
    pub fn with(changes: &[(&str, &str)]) -> Bench {
        let bench = Bench { folder: tempfile::tempdir().expect("a scratch folder") };
        let theatre = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/theatre.toml");
        let theatre = std::fs::read_to_string(theatre).expect("a sample");
        // The elevation of the whole screen takes longer than the job.
        let flat = theatre.replace("method = \"poisson\"", "method = \"flat\"");
        assert_ne!(flat, theatre);
        bench.write("screen.toml", flat);
        bench.job("job.toml", changes);
        bench
    }

    pub fn job(&self, name: &str, changes: &[(&str, &str)]) {
        let mut text = JOB.to_string();
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            text = text.replacen(from, to, 1);
        }
        self.write(name, text);
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).expect("writable");
    }

    pub fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// Runs the program in the folder.
    pub fn run(&self, line: &str) -> Assert {
        Command::cargo_bin("screenmill")
            .expect("built")
            .args(line.split(' '))
            .current_dir(self.folder.path())
            .assert()
    }

    /// `mill job.toml --out out`, and its report.
    pub fn mill(&self, code: i32) -> Value {
        self.run("mill job.toml --out out --quiet").code(code);
        self.json("out/report.json")
    }

    pub fn json(&self, name: &str) -> Value {
        serde_json::from_str(&self.text(name)).expect("JSON")
    }

    pub fn heights(&self, name: &str) -> Vec<f32> {
        let opened = open(&self.path(name), &Options::at_step(STEP_MM)).expect("a map");
        opened.surface.heights(opened.surface.lattice().window(), 0.0).expect("heights").z_mm
    }

    /// Every file under a folder with its bytes, by relative path.
    pub fn files(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        let root = self.path(folder);
        let mut found = BTreeMap::new();
        let mut left = vec![root.clone()];
        while let Some(folder) = left.pop() {
            for entry in std::fs::read_dir(folder).expect("a folder") {
                let path = entry.expect("an entry").path();
                if path.is_dir() {
                    left.push(path);
                } else {
                    let name = path.strip_prefix(&root).expect("under it").display().to_string();
                    found.insert(name, std::fs::read(&path).expect("readable"));
                }
            }
        }
        found
    }
}

/// The files of all programs in the report's order.
pub fn programs(report: &Value) -> Vec<String> {
    let tiles = report["tiles"].as_array().expect("tiles").iter();
    let programs = tiles.flat_map(|tile| tile["programs"].as_array().expect("programs"));
    programs.map(|program| program["file"].as_str().expect("a file").to_string()).collect()
}

pub fn figure(report: &Value, key: &str) -> f64 {
    report["fidelity"][key].as_f64().unwrap_or_else(|| panic!("{key} in {report}"))
}
