//! A sheet cut whole, or in four setups on a machine that holds a quarter of it.

mod job;

use job::Bench;

const SIDE: usize = 400;

fn whole() -> Bench {
    let bench = Bench::with(&[
        ("cells = [324, 149, 325, 150]", "cells = [324, 149, 326, 151]"),
        ("min_floor_mm = 2", "min_floor_mm = 2\nblanks = \"one\""),
    ]);
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let mill = std::fs::read_to_string(root.join("posts/machines/linuxcnc-mill.toml")).expect("a profile");
    let small = mill
        .replace("name = \"linuxcnc-mill\"", "name = \"small\"")
        .replace("x_mm = 400", "x_mm = 21")
        .replace("y_mm = 300", "y_mm = 21");
    bench.write("small.toml", small);
    let job = bench.text("job.toml");
    bench.write("split.toml", job.replace("name = \"linuxcnc-mill\"", "name = \"small\""));
    bench.mill(0);
    bench.run("mill split.toml --out split --quiet").success();
    assert_eq!(bench.json("split/report.json")["tiles"].as_array().map(Vec::len), Some(4));
    bench
}

/// The four tiles' maps side by side.
fn joined(bench: &Bench, map: &str) -> Vec<f32> {
    let half = SIDE / 2;
    let mut z_mm = vec![f32::NAN; SIDE * SIDE];
    for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let tile = bench.heights(&format!("split/maps/r{row}c{column}-{map}.tif"));
        assert_eq!(tile.len(), half * half);
        for (i, z) in tile.into_iter().enumerate() {
            z_mm[(row * half + i / half) * SIDE + column * half + i % half] = z;
        }
    }
    z_mm
}

#[test]
fn four_setups_of_one_sheet_cut_what_one_cuts() {
    let bench = whole();
    let apart = |map: &str| -> Vec<f64> {
        let one = bench.heights(&format!("out/maps/r0c0-{map}.tif"));
        assert_eq!(one.len(), SIDE * SIDE);
        let four = joined(&bench, map);
        one.iter().zip(&four).map(|(a, b)| f64::from(b - a)).collect()
    };
    // Neighbours are the halo: design and what no cutter reaches are the same to a float's last bits.
    for map in ["design", "cavity"] {
        let most = apart(map).into_iter().map(f64::abs).fold(0.0, f64::max);
        assert!(most < 1e-6, "{map}: {most} mm");
    }
    let machined = apart("machined");
    // Passes are the same; each is simplified from its own first point, within the gouge's budget.
    let deeper = machined.iter().copied().fold(0.0, |most: f64, d| most.max(-d));
    assert!(deeper < 0.002, "four setups cut {deeper} mm deeper");
    let higher = machined.iter().copied().fold(0.0, f64::max);
    assert!(higher < 0.002, "four setups leave {higher} mm more");
}
