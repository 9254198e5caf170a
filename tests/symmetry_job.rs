//! A sheet cut whole, or in four setups on a machine that holds a quarter of it.

mod job;

use glam::{DMat3, DVec3};
use job::{Bench, STEP_MM};
use screenmill::surface::{Options, Surface};

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

/// Rx(about_x) Ry(about_y) of a wedge.
fn turn(wedge_deg: [f64; 2]) -> DMat3 {
    let [x, y] = wedge_deg.map(f64::to_radians);
    DMat3::from_rotation_x(x) * DMat3::from_rotation_y(y)
}

fn numbers<const N: usize>(value: &serde_json::Value) -> [f64; N] {
    std::array::from_fn(|k| value[k].as_f64().expect("a number"))
}

/// Samples of a levelled tile, pressed back by its wedge about the program's zero, lie on the tile as it was; and
/// normals do, since one rotation takes all of it.
#[test]
fn a_levelled_tile_turned_back_by_its_wedge_is_the_tile() {
    for form in ["part", "die"] {
        let form_key = format!("step_mm = 0.02\nform = \"{form}\"");
        let level_key = format!("{form_key}\nlevel = \"plane\"");
        let plain = Bench::with(&[("step_mm = 0.02", &form_key)]);
        plain.mill(0);
        let levelled = Bench::with(&[("step_mm = 0.02", &level_key)]);
        let tile = levelled.mill(0)["tiles"][0].clone();
        let wedge = numbers(&tile["wedge_deg"]);
        assert!(wedge[0].hypot(wedge[1]) > 1.0, "{form}: {wedge:?}, a test needs something to turn");
        let back = turn(wedge).transpose();
        let zero = DVec3::from(numbers(&tile["program_zero_mm"]));
        let open = |bench: &Bench| {
            screenmill::surface::open(&bench.path("out/maps/r0c0-design.tif"), &Options::at_step(STEP_MM))
                .expect("a map")
                .surface
        };
        let (source, turned) = (open(&plain), open(&levelled));
        let map = |surface: &dyn Surface| {
            let lattice = surface.lattice();
            (lattice, surface.heights(lattice.window(), 0.0).expect("heights").z_mm)
        };
        let ((was, was_z), (is, is_z)) = (map(&*source), map(&*turned));
        // The blank is for the tile as it lies, which is wider than its place, with a margin of 3 mm; a map has whole samples.
        let file = tile["programs"][0]["file"].as_str().expect("a file");
        let header = levelled.text(&format!("out/{file}"));
        let stock = header.lines().find(|line| line.starts_with("(stock")).expect("its stock");
        let blank: Vec<f64> = stock.split(' ').filter_map(|word| word.parse().ok()).collect();
        assert!(
            (blank[0] - is.width_mm - 6.0).abs() < STEP_MM && (blank[1] - is.height_mm - 6.0).abs() < STEP_MM,
            "{stock}"
        );
        // The map's z counts from where the tile's highest point is turned back to; the program's zero is 0.2 mm over
        // that point.
        let top = zero.z - (back * DVec3::new(0.0, 0.0, 0.2)).z;
        let mut apart = Vec::new();
        for row in 0..is.rows as i64 {
            for column in 0..is.columns as i64 {
                let z = f64::from(is_z[row as usize * is.columns + column as usize]);
                let tip = DVec3::new(is.x_mm(column), is.y_mm(row), z - top - 0.2);
                let p = zero + back * tip;
                let (u, v) = (p.x / STEP_MM - 0.5, p.y / STEP_MM - 0.5);
                let (i, j) = (u.floor(), v.floor());
                if z.is_nan()
                    || i < 0.0
                    || j < 0.0
                    || i as usize + 1 >= was.columns
                    || j as usize + 1 >= was.rows
                {
                    continue;
                }
                let at = |di: usize, dj: usize| {
                    f64::from(was_z[(j as usize + dj) * was.columns + i as usize + di])
                };
                let (a, b) = (u - i, v - j);
                let low = (1.0 - a) * at(0, 0) + a * at(1, 0);
                let high = (1.0 - a) * at(0, 1) + a * at(1, 1);
                apart.push(p.z - (1.0 - b) * low - b * high);
            }
        }
        assert!(apart.len() > 30_000, "{form}: {}", apart.len());
        apart.sort_by(f64::total_cmp);
        let [low, middle, high] = [0.2, 0.5, 0.8].map(|part| apart[(part * apart.len() as f64) as usize]);
        // On faces bilinear heights are exact to a float's last bits; ridges and valleys are on both sides of them.
        assert!(low > -1e-6 && high < 1e-6, "{form}: {low} {middle} {high}");
    }
}

/// A design on one sheet is turned as a whole, its neighbours with it: where one tile is the whole, it lies and sends
/// its light as the tile on a blank of its own does.
#[test]
fn one_sheet_of_a_design_is_turned_as_its_only_tile_is() {
    let of = |blanks: &str| {
        let bench = Bench::with(&[
            ("cells = [324, 149, 325, 150]", "cells = [10, 20, 12, 21]"),
            ("step_mm = 0.02", "step_mm = 0.02\nlevel = \"plane\""),
            ("margin_mm = 3", &format!("margin_mm = 5\nblanks = \"{blanks}\"")),
        ]);
        let report = bench.mill(0);
        (report, bench.heights("out/maps/r0c0-design.tif"))
    };
    let ((own, own_z), (sheet, sheet_z)) = (of("per-tile"), of("one"));
    let wedge: [[f64; 2]; 2] = [&own, &sheet].map(|report| numbers(&report["tiles"][0]["wedge_deg"]));
    assert!(wedge[0] == wedge[1] && wedge[0][0] > 4.0, "{wedge:?}");
    // A sheet's frame is that of the sheet as it lies.
    assert_eq!(numbers::<3>(&sheet["tiles"][0]["program_zero_mm"]), [0.0, 0.0, 0.2]);
    let apart = own_z.iter().zip(&sheet_z).filter(|(a, _)| !a.is_nan()).map(|(a, b)| f64::from(a - b));
    let (low, high) = apart.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), d| (d.min(l), d.max(h)));
    assert!(own_z.len() == sheet_z.len() && high - low < 1e-6, "{low} {high}");
    for key in ["on_audience_designed", "leak_designed", "gain_designed"] {
        let [a, b] = [&own, &sheet].map(|report| report["light"][key].as_f64().expect("a figure"));
        assert!((a / b - 1.0).abs() < 1e-9, "{key}: {a} and {b}");
    }
}
