//! Exact cutter locations against OpenCAMLib's drop-cutter, which works on the triangles alone: on
//! the nine designed cells of tests/cases, with the steps between them, ridges and corners.
//!
//! `tests/run` installs OpenCAMLib and names its Python in SCREENMILL_PYTHON. Without it this test
//! says that it was skipped; in CI it must run.

use std::path::Path;
use std::process::Command;

/// Rows that are compared: every so many, which stands beside both seams.
const EVERY: &str = "133";

/// In um, as docs/accuracy.md has it.
const LIMIT_UM: f64 = 0.05;

fn python() -> Option<String> {
    let python = std::env::var("SCREENMILL_PYTHON").unwrap_or_else(|_| "python3".into());
    let found = Command::new(&python).args(["-c", "import numpy, opencamlib"]).output();
    found.is_ok_and(|output| output.status.success()).then_some(python)
}

#[test]
fn exact_locations_are_the_drop_on_the_triangles() {
    let Some(python) = python() else {
        assert!(std::env::var_os("CI").is_none(), "OpenCAMLib is missing, and in CI nothing is skipped");
        println!(
            "skipped: cutter locations are not compared with OpenCAMLib's (pip install opencamlib numpy)"
        );
        return;
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mesh = root.join("tests/cases/theatre-3x3-bump.stl");
    let scratch = tempfile::tempdir().expect("a scratch folder");
    let mut compare = Command::new(python);
    compare.arg(root.join("tests/opencamlib/drop.py")).arg(&mesh).args(["0.01", EVERY]);
    let cutters = ["ball:0.5", "ball:2", "flat:0.6", "bull:1:0.2"];
    for (i, cutter) in cutters.iter().enumerate() {
        compare.arg(cutter);
        for sampled in [false, true] {
            let file = scratch.path().join(format!("{i}-{sampled}.npy"));
            let mut run = assert_cmd::Command::cargo_bin("screenmill").expect("the program");
            run.arg("compensate").arg(&mesh).args(["--cutter", cutter, "--every", EVERY, "--quiet", "--cl"]);
            run.arg(&file);
            if sampled {
                run.arg("--sampled");
            }
            run.assert().success();
            compare.arg(file);
        }
    }
    let output = compare.output().expect("a run of OpenCAMLib");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(said.lines().count(), cutters.len(), "{said}");
    for line in said.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        let um = |i: usize| words[i].parse::<f64>().expect("a length in um");
        assert!(um(2) < LIMIT_UM, "below the drop: {line}");
        assert!(um(3) < LIMIT_UM, "above drop and samples: {line}");
        // Samples alone gouge here, or the comparison shows nothing.
        assert!(um(4) > 2.0 * LIMIT_UM, "{line}");
    }
}
