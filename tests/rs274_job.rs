//! LinuxCNC's own interpreter accepts every G-code program that a job writes for it.

mod job;

use std::process::{Command, Stdio};

use job::{Bench, programs};

fn installed() -> bool {
    let found = Command::new("rs274").arg("-v").stdin(Stdio::null()).output().is_ok();
    assert!(found || std::env::var_os("CI").is_none(), "rs274 of linuxcnc-uspace is needed in CI");
    if !found {
        println!("skipped: rs274 of linuxcnc-uspace is not installed");
    }
    found
}

#[test]
fn linuxcnc_accepts_every_program() {
    if !installed() {
        return;
    }
    let beside = "[[operation]]\nkind = \"outline\"\ntool = \"flat-3\"\n[[operation]]\nkind = \"drill\"\nface = \"underside\"\n\
        tool = \"flat-2\"\nplaces = [\"left\"]\ndiameter_mm = 3\ndepth_mm = 2\n[[operation]]\nkind = \"mark\"\ntool = \"ball-0.5\"\n\
        depth_mm = 0.1\n[[operation]]\nkind = \"rough\"";
    let finish = "tool = \"ball-1\"\nstepover_mm = 0.1";
    let step = "step_mm = 0.02";
    let cases: [&[(&str, &str)]; 7] = [
        &[],
        &[("[[operation]]\nkind = \"rough\"", beside)],
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
            accepted(&bench, &file);
        }
    }
}

/// `rs274 -g` runs a program to its end without a message.
fn accepted(bench: &Bench, file: &str) {
    let output = Command::new("rs274")
        .arg("-g")
        .arg(bench.path("out").join(file))
        .current_dir(bench.path("out"))
        // It keeps its tool table there, and two at once would cut it off under each other.
        .env("HOME", bench.path("out"))
        .stdin(Stdio::null())
        .output()
        .expect("rs274 runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.trim() == "executing", "{file}: {said}");
    let canonical = String::from_utf8_lossy(&output.stdout);
    assert!(canonical.contains("PROGRAM_END()"), "{file}: does not end");
    assert!(canonical.contains("STRAIGHT_FEED("), "{file}: cuts nothing");
}

/// One job in all dialects: none gouges on its grid of 0.0001, 0.001, 0.01 or 0.025 mm, as read back. LinuxCNC runs the
/// programs in the other G-codes, as they are where LinuxCNC has all their words, and with its own in place of
/// `G4 X` (dwell) and `G187` (corner mode) where it has not.
#[test]
fn every_dialect_cuts_and_linuxcnc_reads_the_others_too() {
    if !installed() {
        return;
    }
    let posts = "post = [\"grbl\", \"grblhal\", \"fluidnc\", \"mach3\", \"fanuc\", \"haas\", \"roland-nc\", \"rml1\", \"rml1-25um\", \"linuxcnc\"]";
    let machine = format!("name = \"linuxcnc-mill\"\n{posts}");
    let bench = Bench::with(&[("name = \"linuxcnc-mill\"", &machine)]);
    let files = programs(&bench.mill(0));
    assert_eq!(files.len(), 20);
    for file in files.into_iter().filter(|file| !file.ends_with(".rml")) {
        let path = format!("out/{file}");
        let foreign =
            ["fanuc", "haas", "roland-nc"].into_iter().find(|post| file.contains(&format!("/{post}/")));
        if foreign.is_some() {
            let text = bench.text(&path);
            let spelled = text.lines().filter(|line| !line.starts_with("G187")).map(|line| {
                let dwell = line.trim_start_matches("G04").trim_start_matches("G4");
                if dwell.len() < line.len() { line.replace('X', "P") } else { line.to_string() }
            });
            let spelled: Vec<String> = spelled.collect();
            bench.write(&path, spelled.join("\n") + "\n");
        }
        accepted(&bench, &file);
    }
}
