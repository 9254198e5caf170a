//! Jobs that `mill` refuses: tests/refuse/job/*.txt. The first line of a case is the message, with {dir} for the
//! scratch folder; then come `args: ...` where they differ, and changes `old => new` of the job, with \n for a new
//! line. `BLESS=1` writes the messages anew; read what has changed.

mod job;

use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;

use job::Bench;

/// Files that cases name.
fn furnish(bench: &Bench) {
    let stl = |count: u32, triangles: &[[f32; 9]]| {
        let mut bytes = vec![0; 80];
        bytes.extend(count.to_le_bytes());
        for triangle in triangles {
            bytes.extend([0; 12]);
            bytes.extend(triangle.iter().flat_map(|v| v.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    };
    let slope = |size: f32, rise: f32| [0.0, 0.0, 0.0, size, 0.0, 0.0, 0.0, size, rise];
    bench.write("empty.stl", "");
    bench.write("cut.stl", stl(3, &[slope(8.0, 1.0)]));
    bench.write("none.stl", stl(0, &[]));
    bench.write("nan.stl", stl(1, &[slope(8.0, f32::NAN)]));
    bench.write("huge.stl", stl(1, &[slope(10_000.0, 1.0)]));
    bench.write("deep.stl", stl(1, &[slope(8.0, 60.0)]));
    bench.write("floor.stl", stl(1, &[slope(8.0, 9.0)]));
    bench.write("text.stl", "solid part\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 zero 0\n");
    bench.write("in-the-way", "a file");
    let scene = bench.text("screen.toml");
    let behind = scene.replacen("[-1.0, -0.65, 2.0]", "[-1.0, -0.65, -0.5]", 1);
    assert_ne!(behind, scene);
    bench.write("behind.toml", behind);
    let start = scene.find("vertices_m").expect("corners");
    let end = scene.find("[microgeometry]").expect("a table");
    let audience = |points: &str| format!("{}vertices_m = [{points}]\n\n{}", &scene[..start], &scene[end..]);
    bench.write("flat.toml", audience("[-1, -1, 2], [1, -1, 2], [1, 1, 2], [-1, 1, 2]"));
    let around =
        "[-2, -1, 0], [2, -1, 0], [-2, 1, 0], [2, 1, 0], [-2, -1, 2], [2, -1, 2], [-2, 1, 2], [2, 1, 2]";
    bench.write("around.toml", audience(around));
}

fn cases() -> Vec<PathBuf> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/refuse/job");
    let mut cases: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("cases").map(|entry| entry.expect("a file").path()).collect();
    cases.sort();
    cases
}

#[test]
fn bad_jobs_are_refused_in_one_message_and_leave_nothing() {
    let bless = std::env::var_os("BLESS").is_some();
    let mut wrong = Vec::new();
    let cases = cases();
    assert!(cases.len() > 25);
    for case in cases {
        let text = std::fs::read_to_string(&case).expect("a case");
        let (message, rest) = text.split_once('\n').expect("a message and what makes it");
        let mut line = "mill job.toml --out out --quiet";
        let mut changes = Vec::new();
        for made_by in rest.lines() {
            match made_by.strip_prefix("args: ") {
                Some(arguments) => line = arguments,
                None => {
                    let (from, to) = made_by.split_once(" => ").expect("old => new");
                    changes.push((from.replace("\\n", "\n"), to.replace("\\n", "\n")));
                }
            }
        }
        let changes: Vec<(&str, &str)> = changes.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
        let bench = Bench::with(&changes);
        furnish(&bench);
        let before = bench.files("");
        let folder = bench.path("").display().to_string();
        let folder = folder.trim_end_matches('/');
        let started = std::time::Instant::now();
        let output = bench.run(&line.replace("{dir}", folder)).get_output().clone();
        let said = String::from_utf8_lossy(&output.stderr).replace(folder, "{dir}");
        let name = case.display();
        assert!(started.elapsed().as_secs() < 20, "{name} takes long");
        assert_eq!(output.status.code(), Some(2), "{name}: {said}");
        assert!(output.stdout.is_empty() && said.lines().count() <= 12, "{name}: {said}");
        assert!(bench.files("") == before && !bench.path("out").exists(), "{name} leaves something");
        let first = said.lines().next().and_then(|first| first.strip_prefix("error: ")).unwrap_or_default();
        if bless {
            std::fs::write(&case, format!("{first}\n{rest}")).expect("writable");
        } else if first != message {
            wrong.push(format!("{name}\n  found {first}\n  want  {message}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The interrupt key in the middle: what an earlier run left stays, what this one began goes.
#[cfg(unix)]
#[test]
fn an_interrupted_job_leaves_nothing() {
    // Large enough that the key comes before roughing ends.
    let bench = Bench::with(&[
        ("cells = [324, 149, 325, 150]", "cells = [324, 149, 330, 155]"),
        ("step_mm = 0.02", "step_mm = 0.01"),
    ]);
    let binary = env!("CARGO_BIN_EXE_screenmill");
    let mut child = std::process::Command::new(binary)
        .args(["mill", "job.toml", "--out", "out", "--threads", "1"])
        .current_dir(bench.path(""))
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("runs");
    let mut said = BufReader::new(child.stderr.take().expect("piped")).lines();
    let rough = said.by_ref().find(|line| line.as_ref().is_ok_and(|line| line.starts_with("rough")));
    assert!(rough.is_some());
    let killed = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.expect("kill runs").success());
    let last = said.map_while(Result::ok).last();
    let output = child.wait_with_output().expect("ends");
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(last.as_deref(), Some("error: interrupted; nothing was written"));
    assert!(output.stdout.is_empty() && !bench.path("out").exists());
}
