//! LinuxCNC's own interpreter accepts every G-code program that a job writes for it.

mod job;

use std::process::{Command, Stdio};

use job::{Bench, programs};

#[test]
fn linuxcnc_accepts_every_program() {
    if Command::new("rs274").arg("-v").stdin(Stdio::null()).output().is_err() {
        assert!(std::env::var_os("CI").is_none(), "rs274 of linuxcnc-uspace is needed in CI");
        println!("skipped: rs274 of linuxcnc-uspace is not installed");
        return;
    }
    let finish = "tool = \"ball-1\"\nstepover_mm = 0.1";
    let step = "step_mm = 0.02";
    let cases: [&[(&str, &str)]; 6] = [
        &[],
        &[
            ("cells = [324, 149, 325, 150]", "cells = [10, 20, 12, 21]"),
            (finish, "tool = \"bull-2\"\nstepover_mm = 0.2"),
        ],
        &[(finish, "tool = \"ball-1\"\nstepover_mm = 0.1\npattern = \"one-way\"\ndirection_deg = 90")],
        &[
            (step, "step_mm = 0.02\nedge = \"wall\""),
            ("min_floor_mm = 2", "min_floor_mm = 2\nz_zero = \"part-top\""),
        ],
        &[(step, "step_mm = 0.02\nform = \"die\"")],
        &[
            ("name = \"linuxcnc-mill\"", "name = \"linuxcnc-mill\"\nwcs = \"G57\""),
            (
                "tool = \"flat-3\"",
                "tool = \"flat:3\"\nfeed_mm_min = 800\nplunge_mm_min = 200\nspindle_rpm = 12000",
            ),
        ],
    ];
    for changes in cases {
        let bench = Bench::with(changes);
        for file in programs(&bench.mill(0)) {
            let output = Command::new("rs274")
                .arg("-g")
                .arg(bench.path("out").join(&file))
                .current_dir(bench.path("out"))
                .stdin(Stdio::null())
                .output()
                .expect("rs274 runs");
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success() && said.trim() == "executing", "{changes:?} {file}: {said}");
            let canonical = String::from_utf8_lossy(&output.stdout);
            assert!(canonical.contains("PROGRAM_END()"), "{changes:?} {file}: does not end");
            assert!(canonical.contains("STRAIGHT_FEED("), "{changes:?} {file}: cuts nothing");
        }
    }
}
