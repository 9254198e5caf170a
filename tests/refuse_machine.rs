//! Bad data files and names on the command line: tests/refuse/machine/*.txt. The first line of a
//! case is the message, the second the arguments, the rest the file `bad.toml` beside them.
//! `{profile}`, `{dialect}`, `{fixture}` and `{library}` stand for a good file, with the
//! replacements `old => new` that follow; `\n` in one begins a line.

use std::path::PathBuf;

use assert_cmd::Command;

fn good(name: &str) -> String {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let file = match name {
        "{profile}" => "posts/machines/roland-egx-600.toml",
        "{dialect}" => "posts/linuxcnc.toml",
        "{fixture}" => "fixtures/clamps.toml",
        "{library}" => "samples/tools.toml",
        _ => panic!("{name} stands for no file"),
    };
    std::fs::read_to_string(root.join(file)).expect("a file of the repository")
}

fn content(lines: &[&str]) -> String {
    let Some(first) = lines.first().filter(|line| line.starts_with('{')) else {
        return lines.iter().map(|line| format!("{line}\n")).collect();
    };
    let mut text = good(first);
    for line in &lines[1..] {
        let (old, new) = line.split_once(" => ").expect("old => new");
        assert!(text.contains(old), "{old} is not in the good file");
        text = text.replacen(old, &new.replace("\\n", "\n"), 1);
    }
    text
}

#[test]
fn bad_files_and_names_are_refused_in_one_message() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/refuse/machine");
    let mut cases: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("cases").map(|entry| entry.expect("a file").path()).collect();
    cases.sort();
    assert!(cases.len() > 15);
    for case in cases {
        let text = std::fs::read_to_string(&case).expect("a case");
        let lines: Vec<&str> = text.lines().collect();
        let arguments = lines[1].strip_prefix("args: ").expect("args: in the second line");
        let scratch = tempfile::tempdir().expect("a scratch folder");
        std::fs::write(scratch.path().join("bad.toml"), content(&lines[2..])).expect("writable");
        let output = Command::cargo_bin("screenmill")
            .expect("built")
            .args(arguments.split(' '))
            .current_dir(scratch.path())
            .output()
            .expect("runs");
        let message = String::from_utf8_lossy(&output.stderr);
        let first = message.lines().next().unwrap_or_default();
        assert_eq!(first, format!("error: {}", lines[0]), "{}", case.display());
        assert_eq!(output.status.code(), Some(2), "{}", case.display());
        assert!(message.lines().count() <= 12 && output.stdout.is_empty(), "{}", case.display());
    }
}
