//! What fidelity and report refuse, and in which words.

use std::fs;
use std::path::Path;

use screenmill::fidelity::cavities::{self, Cavities, label};
use screenmill::fidelity::{Layers, Params, Tally};
use screenmill::grid::{Heights, Window};
use screenmill::report::maps::{Reducer, Strip};
use screenmill::report::{Error, write_json};

const TILE: Window = Window { column: 100, row: -7, columns: 83, rows: 61 };

/// The first line of a case's file.
fn message(case: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/refuse").join(case);
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.lines().next().expect("a message").to_string()
}

#[test]
fn a_surface_of_another_part() {
    let (design, machined) = (Heights::empty(TILE), Heights::empty(Window { columns: 80, ..TILE }));
    let layers = Layers { design: &design, machined: &machined, cavity: None, passes: None };
    let refused = Tally::new(Params { step_mm: 0.01, limit_mm: None }).add(TILE, layers);
    assert_eq!(refused.unwrap_err().to_string(), message("fidelity/another-part.txt"));
}

#[test]
fn blocks_out_of_order() {
    let params = cavities::Params::at_step(0.01);
    let second = Window { column: 140, row: -7, columns: 40, rows: 30 };
    let labelled = label(second, &Heights::empty(TILE), &[], &params).unwrap();
    let refused = Cavities::new(params, TILE).add(labelled);
    assert_eq!(refused.unwrap_err().to_string(), message("fidelity/blocks-out-of-order.txt"));
}

#[test]
fn strips_of_another_tile() {
    let heights = [0.0; 12];
    let push = |design: &[f32], machined: &[f32]| {
        let strip = Strip { design, machined, cavity: &[] };
        Reducer::by_factor(4, 2, 1).push(strip, |_| Ok::<(), Error>(()))
    };
    assert_eq!(push(&heights, &heights).unwrap_err().to_string(), message("report/strip-too-long.txt"));
    let refused = push(&heights[..8], &heights[..4]).unwrap_err();
    assert_eq!(refused.to_string(), message("report/strip-of-another-tile.txt"));
    assert!(push(&heights[..8], &heights[..8]).is_ok());
}

#[test]
fn a_folder_that_is_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let refused = write_json(&folder.path().join("none/report.json"), &1).unwrap_err();
    let wanted = message("report/no-folder.txt").replace("{dir}", &folder.path().display().to_string());
    assert_eq!(refused.to_string(), wanted);
}
