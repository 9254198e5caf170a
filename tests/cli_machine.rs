//! The commands on data files, as sentences.

use assert_cmd::Command;
use predicates::prelude::PredicateBooleanExt as _;
use predicates::str::contains;

fn screenmill(arguments: &str) -> assert_cmd::assert::Assert {
    Command::cargo_bin("screenmill").expect("built").args(arguments.split(' ')).assert()
}

fn json(arguments: &str) -> serde_json::Value {
    let output = screenmill(arguments).success().get_output().stdout.clone();
    assert_eq!(output.iter().filter(|&&b| b == b'\n').count(), 1, "one object on one line");
    serde_json::from_slice(&output).expect("JSON")
}

#[test]
fn each_list_names_what_comes_along() {
    screenmill("machines").success().stdout(contains("roland-egx-600").and(contains("610 x 407 x 42.5*")));
    screenmill("posts").success().stdout(contains("rml1").and(contains("roland-mdx-540, roland-srm-20")));
    screenmill("fixtures").success().stdout(contains("vacuum-plate").and(contains("clamps")));
    screenmill("tools").success().stdout(contains("ball-0.5").and(contains("320, 80")));
}

#[test]
fn each_list_is_one_json_object() {
    assert_eq!(json("machines roland-egx-600 --json")["travel"]["z_mm"], 42.5);
    assert_eq!(json("posts --json")["posts"][7]["unit_mm"], 0.01);
    assert_eq!(json("fixtures --json")["fixtures"][0]["clamp"][0]["reach_mm"], 6.0);
    assert_eq!(json("tools --json --library tools-srm-20")["tools"][0]["spindle_rpm"], 7000.0);
}

#[test]
fn one_machine_is_shown_whole_with_what_nobody_confirms() {
    screenmill("machines roland-egx-600")
        .success()
        .stdout(contains("set = \"code-0-15\"").and(contains("verify against your machine")));
    assert_eq!(json("tools ball-1 --json")["max_depth_mm"], 0.15);
    screenmill("posts rml1").success().stdout(contains("!MC0"));
    screenmill("posts fanuc").success().stdout(
        contains("# x         X       mm             3 decimals, point   when changed  X1.5 is 1.5 mm")
            .and(contains("# comments   (TEXT), capital letters"))
            .and(contains("no source confirms limits.line_max: verify against your machine")),
    );
    screenmill("fixtures clamps").success().stdout(contains("reach_mm = 6.0"));
}

#[test]
fn what_is_shown_of_a_machine_is_a_profile_again() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    for (command, name) in [
        ("machines", "roland-srm-20"),
        ("machines", "grbl-router"),
        ("posts", "grbl"),
        ("posts", "fanuc"),
        ("fixtures", "clamps"),
    ] {
        let shown = screenmill(&format!("{command} {name}")).success().get_output().stdout.clone();
        let file = folder.path().join("own.toml");
        std::fs::write(&file, &shown).expect("writable");
        let again =
            screenmill(&format!("{command} {}", file.display())).success().get_output().stdout.clone();
        assert_eq!(String::from_utf8(again).ok(), String::from_utf8(shown).ok());
    }
}

#[test]
fn a_machine_is_calibrated_by_three_times() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let (out, mine) = (folder.path().join("measure"), folder.path().join("mine.toml"));
    let (out, mine) = (out.display(), mine.display());
    let written = json(&format!("calibrate-machine --machine roland-egx-600 --out {out} --json"));
    let seconds: Vec<f64> =
        (0..3).map(|i| written["programs"][i]["expected_s"].as_f64().expect("seconds")).collect();
    let sheet = std::fs::read_to_string(format!("{out}/sheet.txt")).expect("the sheet");
    assert!(sheet.contains("1-acceleration.rml") && sheet.contains("Take the tool out"), "{sheet}");
    // What a program takes by the profile is what estimate says of it.
    let estimated = json(&format!("estimate {out}/2-corners.rml --machine roland-egx-600 --json"));
    let off = estimated["time_s"].as_f64().expect("seconds") / seconds[1] - 1.0;
    assert!(off.abs() < 1e-9, "{off}");
    // Also where a unit of RML-1 is not 0.01 mm.
    let coarse = json(&format!("calibrate-machine --machine roland-mdx-20 --out {out}/mdx-20 --json"));
    let estimated = json(&format!("estimate {out}/mdx-20/3-blocks.rml --machine roland-mdx-20 --json"));
    let wanted = coarse["programs"][2]["expected_s"].as_f64().expect("seconds");
    let off = estimated["time_s"].as_f64().expect("seconds") / wanted - 1.0;
    assert!(off.abs() < 1e-9, "{off}");
    // A slower machine: a profile of its own, which estimate takes.
    let [a, b, c] = [1.1 * seconds[0], 1.2 * seconds[1], 2.0 * seconds[2]];
    let times = format!("--times {a} {b} {c}");
    let found = json(&format!("calibrate-machine --machine roland-egx-600 {times} --out {mine} --json"));
    assert!(found["acceleration_mm_s2"]["x"].as_f64() < Some(500.0), "{found}");
    for (program, wanted) in [("1-acceleration", a), ("2-corners", b), ("3-blocks", c)] {
        let estimated = json(&format!("estimate {out}/{program}.rml --machine {mine} --json"));
        let seconds = estimated["time_s"].as_f64().expect("seconds");
        assert!((seconds / wanted - 1.0).abs() < 1e-3, "{program}: {seconds} is not {wanted}");
        assert!(!estimated["unconfirmed"].as_array().expect("a list").contains(&"motion".into()));
    }
    screenmill(&format!("calibrate-machine --machine roland-egx-600 {times} --out {out}"))
        .code(2)
        .stderr(contains("is a folder"));
}

/// docs/adding-a-machine.md to the letter: its commands in their order, and between them the changes that it asks for.
#[test]
fn the_guide_to_adding_a_machine_works_as_it_is_written() {
    let guide = include_str!("../docs/adding-a-machine.md");
    let folder = tempfile::tempdir().expect("a scratch folder");
    let mine = folder.path().join("mine");
    let samples = concat!(env!("CARGO_MANIFEST_DIR"), "/samples");
    std::fs::create_dir_all(&mine).expect("writable");
    let change = |file: &str, from: &str, to: &str| {
        let path = mine.join(file);
        let text = std::fs::read_to_string(&path).expect("there");
        assert!(text.contains(from), "{file}: {from}");
        std::fs::write(&path, text.replacen(from, to, 1)).expect("writable");
    };
    let asked = |said: &str| assert!(guide.contains(said), "{said}");
    let blocks = guide.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next());
    let mut run = 0;
    for line in blocks.flat_map(str::lines) {
        let command = line.split('#').next().unwrap_or(line).trim();
        run += 1;
        if let Some(files) = command.strip_prefix("cp ") {
            for file in files.trim_end_matches(" .").split(' ') {
                let from = file.replace("../screenmill/samples", samples);
                let name = from.rsplit('/').next().expect("a name");
                std::fs::copy(&from, mine.join(name)).expect("a sample");
            }
            asked("`screen = \"theatre.toml\"`, `name = \"my-mill\"`, and take the line with `post` out");
            change("job.toml", "\"../theatre.toml\"", "\"theatre.toml\"");
            change("job.toml", "name = \"roland-egx-600\"\npost", "name = \"my-mill\"\n# post");
            // For the test's sake only: one cell in coarse steps on a flat screen.
            change("job.toml", "327, 152]", "325, 150]\nstep_mm = 0.02");
            change("theatre.toml", "method = \"poisson\"", "method = \"flat\"");
            continue;
        }
        let (command, output) = command.split_once(" > ").unwrap_or((command, ""));
        let arguments = command.strip_prefix("screenmill ").expect("one of ours");
        let done = Command::cargo_bin("screenmill")
            .expect("built")
            .args(arguments.split(' '))
            .current_dir(&mine)
            .assert()
            .success();
        match output {
            "" => {}
            file => std::fs::write(mine.join(file), &done.get_output().stdout).expect("writable"),
        }
        match output {
            "my-mill.toml" => change(output, "name = \"linuxcnc-mill\"", "name = \"my-mill\""),
            "my-dialect.toml" => {
                change(output, "name = \"mach3\"", "name = \"my-dialect\"");
                asked("`dialects = [\"my-dialect\"]`");
                change("my-mill.toml", "dialects = [\"linuxcnc\"]", "dialects = [\"my-dialect\"]");
            }
            _ => {}
        }
    }
    assert_eq!(run, 10);
    let program =
        std::fs::read_to_string(mine.join("out/programs/r0c0-01-rough-flat-3.tap")).expect("written");
    assert!(
        program.starts_with("(screenmill: ") && program.contains("post my-dialect, machine my-mill)"),
        "{program}"
    );
    // A dialect that is nowhere is told when the machine is read.
    change("my-mill.toml", "dialects = [\"my-dialect\"]", "dialects = [\"my-dialct\"]");
    let file = mine.join("my-mill.toml");
    screenmill(&format!("machines {}", file.display()))
        .code(2)
        .stderr(contains("post \"my-dialct\" is not known"));
}
