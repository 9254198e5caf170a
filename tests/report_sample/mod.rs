//! A small job's report and setup sheet, with something in every place.

use screenmill::report::pages::{CavityRow, Limits, Page, Picture};
use screenmill::report::setup_sheet::{SetupSheet, SheetProgram, SheetTile, SheetTool};
use screenmill::report::{
    Bounds, ByCause, Fidelity, GougeBudget, Light, MapFiles, Part, Parts, Program, Report, Severity, Tile,
    Times, finding,
};

fn fidelity() -> Fidelity {
    Fidelity {
        gouge_max_mm: 0.00042,
        gouge_budget_mm: GougeBudget {
            raster: 0.0004,
            simplify: 0.0008,
            rounding: 0.0003,
            controller: 0.0005,
        },
        excess_max_mm: 0.1833,
        deviation_p50_mm: Some(0.000612),
        deviation_p99_mm: Some(0.011402),
        within_limit_fraction: Some(0.9934),
        normal_p50_deg: Some(0.081),
        normal_p95_deg: Some(3.7),
        cavity_area_fraction: Some(0.0312),
        cavity_max_depth_mm: Some(0.1478),
        cavities: Some(12345),
        by_cause: Some(ByCause { unreachable: Some(0.0007), scallop: 0.0004, rounding: Some(-0.0001) }),
    }
}

pub fn bounds() -> Bounds {
    Bounds { x: [-1.0, 201.0], y: [-1.0, 201.0], z: [-0.856, 5.0] }
}

pub fn report() -> Report {
    let mut report = Report::new(Part {
        width_mm: 200.0,
        height_mm: 200.0,
        columns: 20_000,
        rows: 20_000,
        step_mm: 0.01,
        z_min_mm: -0.6228,
    });
    let program = |file: &str, operation: &str, tool: &str, cutter: &str, time_s: f64| Program {
        file: file.to_string(),
        post: "linuxcnc".to_string(),
        operation: operation.to_string(),
        tool: tool.to_string(),
        cutter: cutter.to_string(),
        blocks: 182_331,
        bytes: 4_211_008,
        cutting_mm: 801_234.5,
        rapid_mm: 2210.0,
        time_s,
        deepest_bite_mm: 0.0834,
        bounds_mm: bounds(),
    };
    report.tiles.push(Tile {
        name: "r0c0".to_string(),
        row: 0,
        column: 0,
        x_mm: 0.0,
        y_mm: 0.0,
        width_mm: 200.0,
        height_mm: 200.0,
        z_range_mm: 0.6228,
        program_zero_mm: [0.0, 0.0, 0.2],
        wedge_deg: [0.0, 0.0],
        programs: vec![
            program("programs/r0c0-01-rough-flat-3.ngc", "rough", "flat-3", "flat:3", 5321.0),
            program("programs/r0c0-02-finish-ball-1.ngc", "finish", "ball-1", "ball:1", 150_330.0),
        ],
        maps: Some(MapFiles {
            design: "maps/r0c0-design.tif".to_string(),
            machined: "maps/r0c0-machined.tif".to_string(),
            deviation: "maps/r0c0-deviation.tif".to_string(),
            cavity: "maps/r0c0-cavity.tif".to_string(),
        }),
        fidelity: Some(fidelity()),
    });
    report.fidelity = Some(fidelity());
    report.light = Some(Light {
        on_audience_designed: 0.991,
        on_audience_machined: 0.9612,
        leak_designed: 0.003,
        leak_machined: 0.0322,
        absorbed_designed: 0.005,
        absorbed_machined: 0.0056,
        unresolved_designed: 0.001,
        unresolved_machined: 0.001,
        gain_designed: Some(8.1),
        gain_machined: Some(7.84),
        uniformity_designed: Some(0.97),
        uniformity_machined: None,
        screen_uniformity_designed: None,
        screen_uniformity_machined: None,
        shadowed_designed: Some(0.0),
        shadowed_machined: Some(0.0),
        standard_error: None,
        polished: None,
    });
    report.time_s = Times {
        total: 155_651.0,
        by_operation: Parts(vec![("rough".to_string(), 5321.0), ("finish".to_string(), 150_330.0)]),
        by_tool: Parts(vec![("flat-3".to_string(), 5321.0), ("ball-1".to_string(), 150_330.0)]),
    };
    report.finding(finding(
        Severity::Warning,
        "post",
        "the EGX-600 does not read <linuxcnc>; it is meant for another controller",
    ));
    report.finding(
        finding(Severity::Error, "normal", "95 % of the normals are within 3.70 degrees, the limit is 3.00")
            .on("r0c0")
            .at(&[12.345, 100.005]),
    );
    report
}

pub fn page(report: &Report) -> Page<'_> {
    let picture = |name: &str| Picture {
        tile: "r0c0".to_string(),
        name: name.to_string(),
        file: format!("maps/r0c0-{name}.png"),
        map_file: format!("maps/r0c0-{name}.tif"),
    };
    Page {
        title: "theatre-prototype".to_string(),
        subtitle: "Roland EGX-600, aluminium 6082, 200 x 200 x 20 mm".to_string(),
        report,
        limits: Limits {
            gouge_mm: Some(0.002),
            deviation_mm: Some(0.020),
            normal_p95_deg: Some(3.0),
            on_audience_min: Some(0.95),
            hours_max: Some(48.0),
        },
        screen_map: None,
        pictures: ["design", "machined", "deviation", "cavity"].map(picture).to_vec(),
        cavities: vec![CavityRow {
            tile: "r0c0".to_string(),
            centre_mm: [44.0, 16.2],
            area_mm2: 0.12,
            depth_mm: 0.1478,
            volume_mm3: 0.0042,
            reached_by: "ball:0.3".to_string(),
        }],
        cavities_listed: 10_000,
        commands: vec![
            "screenmill simulate programs/r0c0-01-rough-flat-3.ngc programs/r0c0-02-finish-ball-1.ngc --cutter flat:3 \
             ball:1 --part maps/r0c0-design.tif --out check"
                .to_string(),
        ],
        accuracy: vec!["Percentiles are exact to 1 nm.".to_string()],
    }
}

pub fn setup_sheet() -> SetupSheet {
    let tool = |number: u32, name: &str, cutter: &str, feed_mm_min: f64| SheetTool {
        number,
        name: name.to_string(),
        cutter: cutter.to_string(),
        flutes: Some(2),
        neck_mm: Some([2.9, 12.0]),
        shank_mm: Some(3.175),
        tool_life_m: Some(300.0),
        stick_out_mm: Some(22.0),
        spindle_rpm: 20_000.0,
        spindle_code: Some("!RC15".to_string()),
        feed_mm_min,
        plunge_mm_min: feed_mm_min / 4.0,
    };
    let program = |file: &str, operation: &str, tool_number: u32, tool: &str, time_s: f64| SheetProgram {
        file: file.to_string(),
        begins_post: None,
        operation: operation.to_string(),
        tool_number,
        tool: tool.to_string(),
        time_s,
        bounds_mm: bounds(),
        sha256: "ab".repeat(32),
        turn: None,
        re_zero_z: true,
    };
    let words = |line: &str| vec![line.to_string()];
    SetupSheet {
        title: "theatre-prototype".to_string(),
        machine: "Roland EGX-600".to_string(),
        material: "aluminium 6082".to_string(),
        made_by: "screenmill 0.1.0".to_string(),
        warnings: words("95 % of the normals are within 3.70 degrees, the limit is 3.00"),
        unconfirmed: words("acceleration 500 mm/s2: verify against your machine"),
        machine_notes: words("Set XY home and Z0 on the panel."),
        abort: words("Press the emergency stop; from the computer send ESC.K, then raise Z."),
        safety: words("Covers closed, eye protection; 43 h unattended need a fire watch."),
        tiles: vec![SheetTile {
            name: "r0c0".to_string(),
            place_mm: [0.0, 0.0],
            size_mm: [200.0, 160.0],
            blank_mm: [206.0, 166.0, 20.0],
            margin_mm: 3.0,
            origin_on_blank_mm: [3.0, 3.0],
            fixture: "two side clamps".to_string(),
            fixture_notes: words("clamps reach 6 mm above the blank"),
            keep_out_mm: vec![[-3.0, 60.0, 4.0, 100.0], [196.0, 60.0, 203.0, 100.0]],
            wcs: "G54".to_string(),
            xy_zero: "lower left corner of the tile, 3 mm inside the blank's edges".to_string(),
            z_zero: "top of the blank, by paper 0.1 mm".to_string(),
            re_zero: "On the rim that stays, 4 mm outside the tile.".to_string(),
            clamped: "on the left and the right side".to_string(),
            wedge_deg: [0.125, -0.75],
            tools: vec![tool(1, "flat-3", "flat:3", 600.0), tool(2, "ball-1", "ball:1", 320.0)],
            programs: vec![
                program("programs/r0c0-01-rough-flat-3.ngc", "rough", 1, "flat-3", 5321.0),
                program("programs/r0c0-02-finish-ball-1.ngc", "finish", 2, "ball-1", 150_330.0),
            ],
            time_s: 155_651.0,
            checks: words(
                "after roughing: depth at the centre 0.57 mm below the blank's top, within 0.05 mm",
            ),
            limits: words("heights are rounded to 0.01 mm: a facet 1 mm long may tilt by up to 0.57 degrees"),
            notes: words("deburr the rim only; polish along y"),
        }],
    }
}
