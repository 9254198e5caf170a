//! Every planted gouge is found, and none is invented.

use proptest::prelude::*;
use screenmill::cutter::Shape;
use screenmill::grid::Window;
use screenmill::verify::{Blank, Judged, Options, Reading, Swept, sweep};

const STEP_MM: f64 = 0.01;
const WINDOW: Window = Window { column: 0, row: 0, columns: 120, rows: 90 };

/// Parallel passes over a plane of slope `tilt` along x, whose contact with the plane is exact; the
/// vertex `planted` is lowered by `depth_mm`.
fn passes(shape: &Shape, tilt: f64, vertices: &[f64], planted: Option<(usize, usize, f64)>) -> String {
    // On a slope a corner of radius r about a flat of radius f stands f t + r (1/cos - 1) above the plane.
    let corner = match *shape {
        Shape::Ball { diameter_mm } => 0.5 * diameter_mm,
        Shape::Bull { corner_radius_mm, .. } => corner_radius_mm,
        Shape::Taper { tip_diameter_mm, .. } => 0.5 * tip_diameter_mm,
        _ => 0.0,
    };
    // The cones are steeper than the plane, so a vee stands on its tip and a taper on its ball.
    let flat = match *shape {
        Shape::Vee { tip_diameter_mm, .. } => 0.5 * tip_diameter_mm,
        Shape::Taper { .. } => 0.0,
        _ => shape.radius_mm() - corner,
    };
    let lift = flat * tilt.abs() + corner * ((1.0 + tilt * tilt).sqrt() - 1.0);
    let mut text = String::from("G21 G90 M3\nG0 Z2\nG0 X-0.5 Y0.1\nF300\n");
    for pass in 0..8 {
        let y = 0.1 + 0.1 * f64::from(pass);
        text += &format!("G0 Z2\nG0 X-0.5 Y{y:.4}\n");
        for (index, x) in vertices.iter().enumerate() {
            let mut z = tilt * x + lift - 1.0;
            if let Some((p, v, depth_mm)) = planted
                && p == pass as usize
                && v == index
            {
                z -= depth_mm;
            }
            text += &format!("G1 X{x:.4} Y{y:.4} Z{z:.9}\n");
        }
    }
    text + "G0 Z2\nM2\n"
}

fn gouge_mm(text: &str, shape: Shape, tilt: f64) -> f64 {
    let reading = Reading::of(text.as_bytes(), &Options::default()).expect("a sound program");
    let blank = Blank { low_mm: [-5.0; 2], high_mm: [5.0; 2], top_mm: 1.5 };
    let judged = [Judged::new(&reading, shape, [0.0; 3])];
    let Swept { heights, .. } = sweep(blank.heights(WINDOW, STEP_MM, 0.0), STEP_MM, 0.0, &judged);
    let mut deepest = 0.0f64;
    for (i, z) in heights.z_mm.iter().enumerate() {
        let x = ((i % WINDOW.columns) as f64 + 0.5) * STEP_MM;
        deepest = deepest.max(tilt * x - 1.0 - f64::from(*z));
    }
    deepest
}

fn shapes() -> impl Strategy<Value = Shape> {
    prop::sample::select(vec![
        "ball:0.4",
        "ball:1",
        "flat:0.3",
        "bull:0.5:0.1",
        "vee:60:0.2:0.8",
        "taper:0.3:10:0.6",
    ])
    .prop_map(|text| text.parse().expect("a cutter"))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn planted_gouges_are_found_and_none_invented(
        shape in shapes(),
        tilt in -0.5f64..0.5,
        gaps in prop::collection::vec(0.02f64..0.3, 12..20),
        pass in 0usize..8,
        depth_um in 0.5f64..50.0,
    ) {
        let mut x = -0.5;
        let mut vertices = vec![x];
        for gap in gaps {
            x += gap;
            vertices.push((x * 1e4f64).round() / 1e4);
        }
        let depth_mm = 1e-3 * depth_um;
        // The rim of a flat, and of a vee's tip, is sharp: on a slope its gouge may fall between samples.
        let tilt = if matches!(shape, Shape::Flat { .. } | Shape::Vee { .. }) { 0.0 } else { tilt };
        let vertex = vertices.partition_point(|x| *x < 0.5);
        prop_assume!(vertex < vertices.len() && vertices[vertex] < 0.85);
        let sound = gouge_mm(&passes(&shape, tilt, &vertices, None), shape, tilt);
        prop_assert!(sound < 2e-7, "invented {sound} mm");
        let found = gouge_mm(&passes(&shape, tilt, &vertices, Some((pass, vertex, depth_mm))), shape, tilt);
        // What the raster can miss: the cutter's contact lies up to half a step from a sample.
        let slack = 0.25 * depth_mm + 3e-4;
        prop_assert!(found > 1e-4 && found >= depth_mm - slack.min(0.8 * depth_mm), "{found} of {depth_mm} mm");
        prop_assert!(found <= depth_mm + 2e-7, "{found} of {depth_mm} mm");
    }
}
