//! The sweep against a search along every motion for every sample, and against itself in other blocks.

use proptest::prelude::*;
use screenmill::cutter::Shape;
use screenmill::grid::{Heights, Window};
use screenmill::verify::{Blank, Judged, Options, Reading, sweep};

const STEP_MM: f64 = 0.02;

fn read(text: &str) -> Reading {
    Reading::of(text.as_bytes(), &Options::default()).expect("the program is sound")
}

/// The lowest the cutter comes over a point on one straight move: the part of the move within R by
/// algebra, the minimum of the convex height over it by golden section.
fn lowest(shape: &Shape, from: [f64; 3], to: [f64; 3], x: f64, y: f64) -> Option<f64> {
    let radius = shape.radius_mm();
    // A sample at distance exactly R counts, and decimals are not exact.
    let reach = radius + 1e-10;
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let (px, py) = (from[0] - x, from[1] - y);
    let (a, b, c) = (dx * dx + dy * dy, px * dx + py * dy, px * px + py * py - reach * reach);
    let height = |t: f64| {
        let r = (px + t * dx).hypot(py + t * dy).min(radius);
        from[2] + t * (to[2] - from[2]) + shape.height_mm(r).expect("within the rim")
    };
    if a < 1e-18 {
        return (c <= 0.0).then(|| height(0.0).min(height(1.0)));
    }
    let root = b * b - a * c;
    if root < 0.0 {
        return None;
    }
    let (mut low, mut high) = (((-b - root.sqrt()) / a).max(0.0), ((-b + root.sqrt()) / a).min(1.0));
    if low > high {
        return None;
    }
    let ends = height(low).min(height(high));
    for _ in 0..90 {
        let (t, u) = (low + 0.381_966 * (high - low), low + 0.618_034 * (high - low));
        if height(t) < height(u) { high = u } else { low = t }
    }
    Some(ends.min(height(0.5 * (low + high))))
}

/// Distance of a sample from the rim's track, where a flat's height jumps.
fn near_rim(shape: &Shape, from: [f64; 3], to: [f64; 3], x: f64, y: f64) -> bool {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let a = dx * dx + dy * dy;
    let t = if a == 0.0 { 0.0 } else { (((x - from[0]) * dx + (y - from[1]) * dy) / a).clamp(0.0, 1.0) };
    let to_rim = |t: f64| ((from[0] + t * dx - x).hypot(from[1] + t * dy - y) - shape.radius_mm()).abs();
    to_rim(t) < 1e-3 || to_rim(0.0) < 1e-3 || to_rim(1.0) < 1e-3
}

fn brute(shape: &Shape, reading: &Reading, stock: &Heights) -> (Vec<f64>, Vec<bool>) {
    let window = stock.window;
    let mut z: Vec<f64> = stock.z_mm.iter().map(|z| f64::from(*z)).collect();
    let mut rim = vec![false; z.len()];
    let mut last: Option<[f64; 3]> = None;
    for motion in &reading.motions {
        if !motion.known() {
            last = None;
            continue;
        }
        let (from, to) = (last.unwrap_or(motion.to_mm), motion.to_mm);
        last = Some(to);
        for row in 0..window.rows {
            for column in 0..window.columns {
                let x = ((window.column + column as i64) as f64 + 0.5) * STEP_MM;
                let y = ((window.row + row as i64) as f64 + 0.5) * STEP_MM;
                let i = row * window.columns + column;
                if let Some(low) = lowest(shape, from, to, x, y).filter(|_| !z[i].is_nan()) {
                    z[i] = z[i].min(low);
                }
                rim[i] |= near_rim(shape, from, to, x, y);
            }
        }
    }
    (z, rim)
}

fn cutters() -> Vec<Shape> {
    [
        "ball:0.5",
        "flat:0.5",
        "bull:0.6:0.1",
        "bull:0.6:0.3",
        "vee:60:0.1:0.7",
        "vee:120:0:0.5",
        "taper:0.2:10:0.6",
    ]
    .iter()
    .map(|c| c.parse().expect("a cutter"))
    .collect()
}

const WINDOW: Window = Window { column: -10, row: -15, columns: 83, rows: 71 };

fn blank() -> Blank {
    Blank { low_mm: [-0.15, -1.0], high_mm: [5.0, 5.0], top_mm: 0.0 }
}

/// Points of a path, some in line with the axes, some straight down or up, as text.
fn program(points: &[(u8, i32, i32, i32)]) -> String {
    let mut text = String::from("G21 G90 G17 M3 S10000\nG0 Z1\nG0 X0.1 Y0.1\nF300\n");
    let mut at = [1000, 1000, 10_000];
    for &(kind, x, y, z) in points {
        match kind {
            0 | 1 => at[0] = x,
            2 => at[1] = y,
            3 => at[2] = z,
            4 | 5 => (at[0], at[2]) = (x, z),
            6 => (at[1], at[2]) = (y, z),
            _ => at = [x, y, z],
        }
        let word = if kind == 9 { "G0" } else { "G1" };
        let mm = at.map(|v| f64::from(v) / 1e4);
        text += &format!("{word} X{:.4} Y{:.4} Z{:.4}\n", mm[0], mm[1], mm[2]);
    }
    text + "M2\n"
}

fn check(text: &str, shape: &Shape) {
    let reading = read(text);
    let stock = blank().heights(WINDOW, STEP_MM, 0.0);
    let (wanted, rim) = brute(shape, &reading, &stock);
    let judged = [Judged::new(&reading, *shape, [0.0; 3])];
    let swept = sweep(stock, STEP_MM, 0.0, &judged);
    for (i, (&got, &want)) in swept.heights.z_mm.iter().zip(&wanted).enumerate() {
        assert_eq!(got.is_nan(), want.is_nan(), "{shape} sample {i}: the blank's edge");
        let smooth = matches!(shape, Shape::Ball { .. }) || !rim[i];
        assert!(
            !smooth || got.is_nan() || (f64::from(got) - want).abs() < 5e-6,
            "{shape} sample {i} (column {}, row {}): swept {got}, searched {want}\n{text}",
            i % WINDOW.columns,
            i / WINDOW.columns
        );
    }
}

fn block(reading: &Reading, shape: Shape, window: Window) -> screenmill::verify::Swept {
    let judged = [Judged::new(reading, shape, [0.0; 3])];
    sweep(blank().heights(window, STEP_MM, 0.0), STEP_MM, 0.0, &judged)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_cutter_equals_the_search(
        points in prop::collection::vec((0u8..10, -4000i32..14000, -4000i32..14000, -4000i32..2000), 1..14)
    ) {
        let text = program(&points);
        for shape in cutters() {
            check(&text, &shape);
        }
    }

    #[test]
    fn a_sample_is_the_same_in_any_block(
        points in prop::collection::vec((0u8..10, -4000i32..14000, -4000i32..14000, -4000i32..2000), 1..30),
        split in (5usize..70, 5usize..60),
    ) {
        let reading = read(&program(&points));
        for shape in cutters() {
            let whole = block(&reading, shape, WINDOW);
            let mut merged = screenmill::verify::ProgramCut::default();
            let (columns, rows) = split;
            for (column, width) in [(0, columns), (columns, WINDOW.columns - columns)] {
                for (row, height) in [(0, rows), (rows, WINDOW.rows - rows)] {
                    let part = Window {
                        column: WINDOW.column + column as i64,
                        row: WINDOW.row + row as i64,
                        columns: width,
                        rows: height,
                    };
                    let swept = block(&reading, shape, part);
                    merged.merge(&swept.programs[0]);
                    let same = whole.heights.crop(part);
                    let bits = |h: &Heights| h.z_mm.iter().map(|z| z.to_bits()).collect::<Vec<_>>();
                    prop_assert!(bits(&same) == bits(&swept.heights), "{shape}");
                }
            }
            prop_assert_eq!(merged, whole.programs[0]);
        }
    }

    #[test]
    fn cutting_a_path_in_pieces_changes_no_bite(
        ends in prop::collection::vec((0i32..100, -300i32..0), 2..6),
        pieces in 2i32..9,
    ) {
        // Along x in whole, then the same in pieces of the same lines.
        let at = |v: i32| f64::from(v) / 100.0;
        let mut whole = String::from("G21 G90 M3\nG0 Z1\nG0 X0 Y0.3\nF100\nG1 Z0\n");
        let mut parts = whole.clone();
        let mut x = 0.0;
        let mut z = 0.0;
        for (dx, dz) in ends {
            let to = (x + at(dx) + 0.09, at(dz));
            whole += &format!("G1 X{:.6} Z{:.6}\n", to.0, to.1);
            for piece in 1..=pieces {
                let share = f64::from(piece) / f64::from(pieces);
                parts += &format!("G1 X{:.12} Z{:.12}\n", x + (to.0 - x) * share, z + (to.1 - z) * share);
            }
            (x, z) = to;
        }
        let end = "M2\n";
        let (whole, parts) = (read(&(whole + end)), read(&(parts + end)));
        for shape in cutters() {
            let (a, b) = (block(&whole, shape, WINDOW), block(&parts, shape, WINDOW));
            let bite = |s: &screenmill::verify::Swept| s.programs[0].deepest_bite_mm();
            prop_assert!((bite(&a) - bite(&b)).abs() < 1e-5, "{shape}: {} and {}", bite(&a), bite(&b));
        }
    }
}

#[test]
fn a_sample_at_distance_exactly_r_is_cut() {
    // Samples stand at odd hundredths; x = 0.21 lies exactly 0.25 from 0.46, which no double holds.
    let text = "G21 G90 M3\nG0 Z1\nG0 X0.46 Y0.21\nG1 Z-0.1 F100\nG1 X0.86\nM2\n";
    let reading = read(text);
    let swept = block(&reading, "flat:0.5".parse().expect("a cutter"), WINDOW);
    let row = swept.heights.row(10);
    assert_eq!(row[(10 + 10) as usize], -0.1, "x = 0.21");
    assert_eq!(row[(9 + 10) as usize], 0.0, "x = 0.19");
}

#[test]
fn a_descent_back_along_the_axis() {
    let text = "G21 G90 G17 M3 S10000\nG0 Z1\nG0 X0.1 Y0.1\nF300\nG1 X0.9948 Y0.1000 Z1.0000\n\
        G1 X-0.2263 Y0.1000 Z-0.3334\nG1 X-0.2263 Y0.0000 Z0.0000\nM2\n";
    for shape in cutters() {
        check(text, &shape);
    }
}
