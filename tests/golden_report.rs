//! What a report looks like: keys in their order, maps reduced as promised, pictures and pages that hold something.

mod report_sample;

use std::fs;

use geo::{MultiPolygon, polygon};
use image::{GenericImageView, ImageReader};
use screenmill::fidelity::{Cavity, Found, Outline};
use screenmill::report::cavity_list::{TileCavities, write_csv, write_geojson};
use screenmill::report::maps::{FULL_SAMPLES, MapRow, Reducer, Strip};
use screenmill::report::pages::{key_figures, write_report};
use screenmill::report::picture::{Caption, Kind, Preview, write_png};
use screenmill::report::setup_sheet::write_setup_sheet;
use screenmill::report::{Error, write_json, write_whole};
use serde_json::Value;

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().expect("an object").keys().map(String::as_str).collect()
}

#[test]
fn a_reports_keys_stand_in_their_order() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.json");
    write_json(&path, &report_sample::report()).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.ends_with("}\n"));
    let report: Value = serde_json::from_str(&text).unwrap();
    let of = |path: &str| keys(report.pointer(path).unwrap());
    let whole =
        ["schema", "screenmill", "verdict", "part", "tiles", "fidelity", "light", "time_s", "findings"];
    assert_eq!(of(""), whole);
    assert_eq!(of("/part"), ["width_mm", "height_mm", "columns", "rows", "step_mm", "z_min_mm"]);
    let tile = [
        "name",
        "row",
        "column",
        "x_mm",
        "y_mm",
        "width_mm",
        "height_mm",
        "z_range_mm",
        "program_zero_mm",
        "wedge_deg",
        "programs",
        "maps",
        "fidelity",
    ];
    assert_eq!(of("/tiles/0"), tile);
    let program = [
        "file",
        "post",
        "operation",
        "tool",
        "cutter",
        "blocks",
        "bytes",
        "cutting_mm",
        "rapid_mm",
        "time_s",
        "deepest_bite_mm",
        "bounds_mm",
    ];
    assert_eq!(of("/tiles/0/programs/0"), program);
    assert_eq!(of("/tiles/0/programs/0/bounds_mm"), ["x", "y", "z"]);
    assert_eq!(of("/tiles/0/maps"), ["design", "machined", "deviation", "cavity"]);
    let fidelity = [
        "gouge_max_mm",
        "gouge_budget_mm",
        "excess_max_mm",
        "deviation_p50_mm",
        "deviation_p99_mm",
        "within_limit_fraction",
        "normal_p50_deg",
        "normal_p95_deg",
        "cavity_area_fraction",
        "cavity_max_depth_mm",
        "cavities",
        "by_cause",
    ];
    assert_eq!(of("/fidelity"), fidelity);
    assert_eq!(of("/tiles/0/fidelity"), fidelity);
    assert_eq!(of("/fidelity/gouge_budget_mm"), ["raster", "simplify", "rounding", "controller"]);
    assert_eq!(of("/fidelity/by_cause"), ["unreachable", "scallop", "rounding"]);
    assert_eq!(of("/time_s"), ["total", "by_operation", "by_tool"]);
    assert_eq!(of("/time_s/by_operation"), ["rough", "finish"]);
    assert_eq!(of("/findings/1"), ["severity", "code", "message", "tile", "where_mm"]);
    assert_eq!(report["schema"], 1);
    assert_eq!(report["verdict"], "fail");
    assert_eq!(report["findings"][0]["tile"], Value::Null);
    let mut without = report_sample::report();
    without.light = None;
    assert!(serde_json::to_value(&without).unwrap().get("light").is_none());
}

/// Pushes strips of `rows_each` rows and collects what comes out.
fn reduced(mut reducer: Reducer, columns: usize, layers: [&[f32]; 3], rows_each: usize) -> Vec<MapRow> {
    let mut rows = Vec::new();
    let size = columns * rows_each;
    for start in (0..layers[0].len()).step_by(size) {
        let [design, machined, cavity] = layers.map(|layer| &layer[start..(start + size).min(layer.len())]);
        let pushed: Result<(), Error> = reducer.push(Strip { design, machined, cavity }, |row| {
            rows.push(row.clone());
            Ok(())
        });
        pushed.unwrap();
    }
    rows
}

#[test]
fn a_reduced_sample_is_the_blocks_worst_and_the_first_on_ties() {
    let nan = f32::NAN;
    // Two rows of blocks, the upper and the right ones cut short.
    #[rustfmt::skip]
    let design = [
        1.0, 2.0, 3.0, 4.0, nan,
        5.0, 6.0, 7.0, 8.0, 9.0,
        1.5, nan, nan, nan, 2.5,
    ];
    #[rustfmt::skip]
    let machined = [
        1.25, 1.75, 3.0,  4.0, 1.0,
        5.25, 6.0,  6.0,  9.0, nan,
        1.5,  1.0,  nan,  nan, 2.0,
    ];
    #[rustfmt::skip]
    let cavity = [
        0.1, 0.2, nan, nan, 0.0,
        0.4, 0.3, nan, nan, 0.7,
        0.5, nan, 0.0, 0.1, nan,
    ];
    for rows_each in [1, 2, 3] {
        let rows = reduced(Reducer::by_factor(5, 3, 2), 5, [&design, &machined, &cavity], rows_each);
        assert_eq!(rows.len(), 2);
        let same = |got: &[f32], wanted: [f32; 3]| {
            let bits =
                |values: &[f32]| values.iter().map(|v| if v.is_nan() { 0 } else { v.to_bits() }).collect();
            let (got, wanted): (Vec<u32>, Vec<u32>) = (bits(got), bits(&wanted));
            assert_eq!(got, wanted);
        };
        same(&rows[0].design, [1.0, 7.0, 9.0]);
        same(&rows[0].machined, [1.25, 6.0, nan]);
        same(&rows[0].deviation, [0.25, -1.0, nan]);
        same(&rows[0].cavity, [0.4, nan, 0.7]);
        same(&rows[1].design, [1.5, nan, 2.5]);
        same(&rows[1].deviation, [0.0, nan, -0.5]);
        same(&rows[1].cavity, [0.5, 0.1, nan]);
    }
}

#[test]
fn maps_are_whole_up_to_64_megasamples() {
    assert_eq!(Reducer::within(8000, 8000, FULL_SAMPLES).factor(), 1);
    assert_eq!(Reducer::within(8001, 8000, FULL_SAMPLES).factor(), 2);
    let tile = Reducer::within(20_000, 20_000, FULL_SAMPLES);
    assert_eq!((tile.factor(), tile.columns(), tile.rows()), (3, 6667, 6667));
}

#[test]
fn pictures_have_their_size_and_are_not_blank() {
    let (columns, rows) = (60, 40);
    let mut preview = Preview::new(columns, rows, 0.01);
    let mut reducer = Reducer::by_factor(columns, rows, 1);
    let z = |index: usize| -0.3 * ((index % columns) as f32 / 60.0) * ((index / columns) as f32 / 40.0);
    let design: Vec<f32> = (0..columns * rows).map(z).collect();
    let machined: Vec<f32> =
        design.iter().enumerate().map(|(index, z)| z + 0.001 * (index % 7) as f32).collect();
    let cavity: Vec<f32> = (0..columns * rows).map(|index| 0.002 * (index % 5) as f32).collect();
    reducer
        .push(Strip { design: &design, machined: &machined, cavity: &cavity }, |row| preview.take(row))
        .unwrap();
    let folder = tempfile::tempdir().unwrap();
    let caption = Caption { part: "part".to_string(), tile: "r0c0".to_string(), ..Caption::default() };
    for kind in Kind::ALL {
        let path = folder.path().join(format!("{}.png", kind.name()));
        write_png(&path, &preview.draw(kind, &caption)).unwrap();
        let picture = ImageReader::open(&path).unwrap().decode().unwrap();
        // Twenty pixels a sample, the margins beside and below.
        assert_eq!(picture.dimensions(), (1200 + 92 + 190, 124 + 800 + 74 + 25 + 14), "{kind:?}");
        let colors: std::collections::BTreeSet<[u8; 4]> = picture
            .pixels()
            .filter(|&(x, y, _)| x > 92 && x < 1292 && y > 124 && y < 924)
            .map(|p| p.2.0)
            .collect();
        assert!(colors.len() >= 5, "{kind:?} has {} colours", colors.len());
    }
}

#[test]
fn a_picture_of_nothing_is_drawn_all_the_same() {
    let preview = Preview::new(3, 2000, 0.01);
    let picture = preview.draw(Kind::Design, &Caption::default());
    assert!(picture.width() >= 860 && picture.height() > 1000);
}

#[test]
fn figures_stand_beside_their_limits() {
    let report = report_sample::report();
    let figures = key_figures(&report, &report_sample::page(&report).limits);
    let figure = |label: &str| figures.iter().find(|figure| figure.label == label).expect(label);
    assert_eq!(figure("Deepest gouge").within, Some(true));
    let normals = figure("Normals' error, 95 % within");
    assert_eq!((normals.value.as_str(), normals.limit.as_str()), ("3.70°", "at most 3.00°"));
    assert_eq!(normals.within, Some(false));
    assert_eq!(figure("Machine time").value, "43 h 14 min");
    assert_eq!(figure("Light on the audience").limit, "at least 95.0 %");
    assert_eq!(figure("Deepest cavity").within, None);
}

#[test]
fn pages_hold_verdict_findings_programs_and_escape_what_they_are_given() {
    let folder = tempfile::tempdir().unwrap();
    let report = report_sample::report();
    let path = folder.path().join("report.html");
    write_report(&path, &report_sample::page(&report)).unwrap();
    let page = fs::read_to_string(&path).unwrap();
    for part in [
        "FAIL",
        "does not read &lt;linuxcnc&gt;",
        "programs&#x2f;r0c0-02-finish-ball-1.ngc",
        "12\u{2009}345",
        "7.840 (design 8.100)",
        "maps&#x2f;r0c0-deviation.png",
        "ball:0.3",
        "not met",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(page.find("the limit is 3.00") < page.find("does not read"), "errors come first");
    assert!(!page.contains("undefined") && !page.contains("<linuxcnc>"));

    let path = folder.path().join("setup-sheet.html");
    write_setup_sheet(&path, &report_sample::setup_sheet()).unwrap();
    let sheet = fs::read_to_string(&path).unwrap();
    for part in [
        "Tile r0c0",
        "320 mm/min<br>5.3 mm/s",
        "!RC15",
        "Set Z0 again",
        "verify against your machine",
        "ESC.K",
        "206.00",
        "2.90 × 12.0 mm",
        "3.175 mm",
        "change after 300 m",
        "sha256 abab",
        "4 mm outside the tile",
        "tilt by up to 0.57 degrees",
        "43 h 14 min",
    ] {
        assert!(sheet.contains(part), "{part}");
    }
}

fn square(x_mm: f64) -> Cavity {
    Cavity {
        centre_mm: [x_mm + 0.005, 0.005],
        deepest_mm: [x_mm + 0.005, 0.005],
        area_mm2: 1e-4,
        depth_mm: 0.02,
        volume_mm3: 2e-6,
        outline: Outline {
            polygons: MultiPolygon(vec![
                polygon![(x: x_mm, y: 0.0), (x: x_mm + 0.01, y: 0.0), (x: x_mm + 0.01, y: 0.01), (x: x_mm, y: 0.01)],
            ]),
            traced: true,
        },
        residuals_mm: vec![0.01, 0.0004],
    }
}

#[test]
fn cavities_are_listed_as_csv_and_geojson() {
    let found =
        Found { cavities: vec![square(1.0), square(2.0)], count: 5, area_mm2: 1e-3, volume_mm3: 1e-5 };
    let candidates = ["ball:0.5".to_string(), "ball:0.2".to_string()];
    let tiles = [TileCavities { tile: "r0c0", found: &found, candidates: &candidates }];
    let folder = tempfile::tempdir().unwrap();
    let (csv, geojson) = (folder.path().join("cavities.csv"), folder.path().join("cavities.geojson"));
    write_csv(&csv, &tiles).unwrap();
    write_geojson(&geojson, &tiles).unwrap();
    let text = fs::read_to_string(&csv).unwrap();
    assert_eq!(
        text.lines().nth(1),
        Some(
            "r0c0,1.005000,0.005000,0.000100,0.020000,0.000002000,1.005000,0.005000,1.000000,0.000000,1.010000,\
             0.010000,ball:0.2"
        )
    );
    assert_eq!(text.lines().count(), 3);
    let collection: Value = serde_json::from_str(&fs::read_to_string(&geojson).unwrap()).unwrap();
    assert_eq!((collection["cavities"].as_u64(), collection["unlisted"].as_u64()), (Some(5), Some(3)));
    let feature = &collection["features"][1];
    assert_eq!(feature["geometry"]["type"], "Polygon");
    assert_eq!(feature["geometry"]["coordinates"][0][1], serde_json::json!([2.01, 0.0]));
    assert_eq!(feature["properties"]["reached_by"], "ball:0.2");

    write_geojson(&geojson, &[]).unwrap();
    let empty: Value = serde_json::from_str(&fs::read_to_string(&geojson).unwrap()).unwrap();
    assert_eq!(empty["features"], serde_json::json!([]));
}

#[test]
fn a_file_that_fails_leaves_nothing_and_keeps_what_was_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.json");
    fs::write(&path, "before").unwrap();
    let failed = write_whole(&path, |writer| {
        writer.write_all(b"half").expect("there is room");
        Err(Error::Io { path: "report.json".to_string(), source: std::io::Error::other("disk full") })
    });
    let refused = failed.expect_err("the writer failed").to_string();
    assert_eq!(refused, "report.json: disk full; hint: the output folder must be writable and have room");
    assert_eq!(fs::read_to_string(&path).unwrap(), "before");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    let nowhere = folder.path().join("none").join("report.json");
    assert!(write_json(&nowhere, &report_sample::report()).is_err());
}
