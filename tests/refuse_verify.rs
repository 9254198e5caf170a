//! Program texts that must not be read, each with its exact message: a file's first line is the
//! message, the rest is the text (after `text:`), with \xNN for bytes and \ at its end for no last
//! new line.

use screenmill::verify::{Options, Reading};

fn bytes(text: &str) -> Vec<u8> {
    let text = text.strip_suffix('\n').unwrap_or(text);
    let text = text.strip_suffix('\\').map_or(format!("{text}\n"), str::to_string);
    let mut out = Vec::new();
    let mut rest = text.as_str();
    while let Some(at) = rest.find("\\x") {
        out.extend(rest[..at].bytes());
        out.push(u8::from_str_radix(&rest[at + 2..at + 4], 16).expect("two hex digits"));
        rest = &rest[at + 4..];
    }
    out.extend(rest.bytes());
    out
}

#[test]
fn every_text_is_refused_with_its_message() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/refuse/verify");
    let mut cases: Vec<_> =
        std::fs::read_dir(folder).expect("the folder").map(|e| e.expect("an entry").path()).collect();
    cases.sort();
    assert!(cases.len() > 40, "{} cases", cases.len());
    let mut wrong = Vec::new();
    for case in cases {
        let all = std::fs::read_to_string(&case).expect("a case");
        let (message, text) = all.split_once("\ntext:\n").expect("a message and a text");
        let got = match Reading::of(&bytes(text), &Options::default()) {
            Ok(reading) => format!("read {} motions", reading.motions.len()),
            Err(error) => error.to_string(),
        };
        if got != message {
            wrong.push(format!("{}\n  wanted {message}\n  got    {got}", case.display()));
        }
        assert!(got.lines().count() <= 12);
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_line_without_end_is_refused() {
    let text = vec![b'X'; 100_000];
    let error = Reading::of(&text, &Options::default()).expect_err("too long");
    assert_eq!(error.to_string(), "line 1: longer than 4096 bytes; hint: is this a program?");
}
