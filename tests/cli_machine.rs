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
