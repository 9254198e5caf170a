//! Imports run downwards only, and the judge shares no code with the judged.

use std::fs;
use std::path::{Path, PathBuf};

/// Top to bottom; a room imports from rooms above it only.
const ORDER: [&str; 24] = [
    "settings",
    "catalogue",
    "progress",
    "whole",
    "in_order",
    "grid",
    "memory",
    "tolerance",
    "cutter",
    "optics",
    "screen",
    "surface",
    "compensation",
    "machine",
    "toolpath",
    "post",
    "verify",
    "resume",
    "fidelity",
    "evaluation",
    "report",
    "job",
    "pipeline",
    "cli",
];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("src is readable") {
        let path = entry.expect("src is readable").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// The room a file stands in: its folder under src, or its own name.
fn room(path: &Path) -> String {
    let relative = path.strip_prefix(Path::new(env!("CARGO_MANIFEST_DIR")).join("src")).expect("under src");
    let first = relative.components().next().expect("a file").as_os_str().to_string_lossy().into_owned();
    first.trim_end_matches(".rs").to_string()
}

/// Rooms named after `crate::` or `screenmill::` in a file.
fn imports(text: &str) -> Vec<String> {
    let mut rooms = Vec::new();
    for prefix in ["crate::", "screenmill::"] {
        for (at, _) in text.match_indices(prefix) {
            let rest = &text[at + prefix.len()..];
            if let Some(group) = rest.strip_prefix('{') {
                let inside = group.split('}').next().unwrap_or_default();
                rooms.extend(
                    inside
                        .split(',')
                        .map(|word| word.trim().split("::").next().unwrap_or_default().to_string()),
                );
            } else {
                rooms.push(rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect());
            }
        }
    }
    rooms
}

#[test]
fn imports_run_downwards() {
    let mut files = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut files);
    let mut wrong = Vec::new();
    for path in &files {
        let room = room(path);
        if room == "lib" || room == "main" {
            continue;
        }
        let place = ORDER.iter().position(|name| *name == room);
        let Some(place) = place else {
            wrong.push(format!("{}: room {room} is not in the order", path.display()));
            continue;
        };
        for import in imports(&fs::read_to_string(path).expect("readable")) {
            if let Some(other) = ORDER.iter().position(|name| *name == import)
                && other > place
            {
                wrong.push(format!("{}: {room} imports {import}, which stands below it", path.display()));
            }
        }
    }
    assert!(files.len() > 20, "only {} files found", files.len());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_judge_shares_no_code_with_the_judged() {
    let mut files = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src/verify"), &mut files);
    assert!(!files.is_empty());
    for path in &files {
        for import in imports(&fs::read_to_string(path).expect("readable")) {
            assert!(
                !["toolpath", "post", "compensation", "job", "pipeline"].contains(&import.as_str()),
                "{}: verify imports {import}",
                path.display()
            );
        }
    }
}
