//! Figures of the design for docs/: how cells converge, and what stitching does to areas.

use std::path::Path;

use screenmill::report::figure::{self, Axis, BLACK, BLUE, Figure, GREEN, Layer, Legend, ORANGE, RED, Rgb8};
use screenmill::screen::{self, CellRange, Profile, Scene, Seam, Workspace, directions, facets, solve};

const SCENES: [(&str, Rgb8); 3] = [("theatre", RED), ("conference", BLUE), ("home-theatre", GREEN)];
/// Cells along a side of the pieces that are stitched.
const SIDE: i32 = 10;
/// Sweeps that bring their areas back.
const SWEEPS: usize = 5;

fn scene(name: &str) -> Scene {
    let path = format!("{}/samples/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Scene::read(path.as_ref()).expect("a sample scene")
}

pub fn write(folder: &Path) {
    let drawn = |stem: &str, panels: &[Figure], across, size| {
        figure::write(&folder.join(stem), panels, across, size).expect("written");
    };
    drawn("convergence", &[convergence()], 1, [760, 460]);
    drawn("stitched-areas", &stitched(), 2, [1100, 460]);
}

/// As Fig. 9 of the paper: the largest area error against the iteration.
fn convergence() -> Figure {
    let mut layers = Vec::new();
    let cases = [
        ("theatre", 50, ORANGE, false),
        ("theatre", 200, RED, false),
        ("theatre", 1000, BLACK, false),
        ("conference", 200, BLUE, false),
        ("home-theatre", 200, GREEN, false),
        ("home-theatre", 1000, GREEN, true),
    ];
    for (name, count, colour, dashed) in cases {
        let scene = scene(name);
        let x = scene.centre_m(300.0, 150.0, 0.0);
        let sampled = directions(&scene.view(x), count).expect("an audience");
        let wanted = facets(&scene, x, &sampled.list).expect("facets");
        // A tolerance that rounding hardly lets be met: the curve ends where it does.
        let solved = solve(&mut Workspace::default(), &wanted.gradients, &wanted.weights, 4.0, 1e-9);
        let history = solved.expect("a solution").history;
        let points: Vec<(f64, f64)> =
            history.iter().enumerate().map(|(step, error)| (step as f64, error.log10())).collect();
        println!(
            "{name}, {count} facets: {}",
            history.iter().map(|e| format!("{e:.1e}")).collect::<Vec<_>>().join(" ")
        );
        layers.push(Layer::Dots { name: String::new(), points: points.clone(), colour, radius: 3.0 });
        layers.push(Layer::Line { name: format!("{name}, {count} facets"), points, colour, dashed });
    }
    Figure {
        title: "Convergence of the areas".into(),
        subtitle: "cell (300, 150) of the flat screens, from the quadratic start; the paper stops at 0.01 after about 50 steps".into(),
        x: Axis::new("Newton step", 0.0, 9.0),
        y: Axis { logarithms: true, ..Axis::new("largest relative error of an area", -13.0, 2.0) },
        layers,
        legend: Legend::UpperRight,
        bar: None,
    }
}

/// Facets by how far stitching takes them from their areas, in the middle and in a corner of the screen.
fn stitched() -> Vec<Figure> {
    let heights: Vec<_> =
        SCENES.iter().map(|(name, _)| screen::elevation(&scene(name)).expect("an elevation")).collect();
    [("the middle", 245, 120), ("a corner", 480, 230)]
        .map(|(place, c0, r0)| {
            let mut layers = Vec::new();
            for ((name, colour), heights) in SCENES.into_iter().zip(&heights) {
                let cases = [(Profile::Bump, 0), (Profile::Bump, SWEEPS), (Profile::Dish, 0), (Profile::Dish, SWEEPS)];
                for (profile, sweeps) in cases {
                    let mut scene = scene(name);
                    let cells = &mut scene.microgeometry;
                    (cells.profile, cells.seam, cells.area_sweeps) = (profile, Seam::Stitched, sweeps);
                    let core = CellRange { c0, r0, c1: c0 + SIDE, r1: r0 + SIDE };
                    let design =
                        screen::design(&scene, Some(core), Some(heights), &|_, _| ()).expect("cells");
                    let mut errors: Vec<f64> = design.area_errors().into_iter().map(f64::abs).collect();
                    errors.sort_by(f64::total_cmp);
                    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
                    let worst = errors.last().copied().unwrap_or(0.0);
                    let shape = if profile == Profile::Bump { "bump" } else { "dish" };
                    println!(
                        "{place}: {name}, {shape}, {sweeps} sweeps: {:.1} % rms, {:.0} % at most",
                        1e2 * rms,
                        1e2 * worst
                    );
                    // Bumps lie beside their dishes.
                    if profile == Profile::Bump {
                        continue;
                    }
                    let points = (0..=200)
                        .map(|k| {
                            let at = k * (errors.len() - 1) / 200;
                            (0.5 * k as f64, (1e2 * errors[at]).max(1e-3).log10())
                        })
                        .collect();
                    let (repaired, dashed) = if sweeps > 0 { (", repaired", true) } else { ("", false) };
                    layers.push(Layer::Line { name: format!("{name}{repaired}"), points, colour, dashed });
                }
            }
            Figure {
                title: format!("Facet areas once stitched, in {place}"),
                subtitle: format!(
                    "dishes, {SIDE} x {SIDE} cells of 200 facets; dashed: after {SWEEPS} sweeps; at the foot areas are kept"
                ),
                x: Axis::new("facets that are off by less, %", 0.0, 100.0),
                y: Axis { logarithms: true, ..Axis::new("area off by, %", -2.0, 2.5) },
                layers,
                legend: Legend::UpperLeft,
                bar: None,
            }
        })
        .into()
}
