//! `cargo bench --bench design [-- CELLS]`: cells of the three sample scenes on one thread, what
//! sampling and solving take, and the plain solver of the tests on the same cells in the same run.
//! `cargo bench --bench design -- figures DIR`: the figures of the design that stand in docs/.

#[path = "figures/design.rs"]
mod figures;

#[allow(dead_code)]
#[path = "../tests/screen/plain.rs"]
mod plain;

use std::hint::black_box;
use std::time::Instant;

use screenmill::screen::{self, Scene, Workspace, directions, facets, solve};

fn main() {
    let words: Vec<String> = std::env::args().collect();
    if let Some(at) = words.iter().position(|word| word == "figures") {
        figures::write(words.get(at + 1).map_or("docs", String::as_str).as_ref());
        return;
    }
    let cells: usize = std::env::args().find_map(|word| word.parse().ok()).unwrap_or(200);
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("the first pool of the program");
    println!("one thread; milliseconds a cell");
    println!("scene         facets  sampling  solving  cells/s  steps  plain/this  125,000 cells on 2 cores");
    for (name, count) in [
        ("theatre", 50),
        ("theatre", 200),
        ("conference", 200),
        ("home-theatre", 200),
        ("theatre", 1000),
        ("home-theatre", 1000),
        ("theatre", 2000),
    ] {
        let path = format!("{}/samples/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let mut scene = Scene::read(path.as_ref()).expect("a sample scene");
        scene.microgeometry.facets = count;
        let heights = screen::elevation(&scene).expect("an elevation");
        let width_mm = scene.microgeometry.width_mm;
        let tolerance = scene.microgeometry.area_tolerance;
        let mut workspace = Workspace::default();
        let (mut sampling, mut solving, mut plain_time) = (0.0, 0.0, 0.0);
        let (mut steps, mut plain_cells) = (0, 0);
        let cells = (cells * 200 / count).clamp(4, cells);
        for k in 0..cells {
            // Spread over the screen without a pattern.
            let (column, row) = (k * 7919 % scene.columns(), k * 104_729 % scene.rows());
            let x = scene.centre_m(column as f64, row as f64, 1e-3 * heights.at(column, row));
            let start = Instant::now();
            let sampled = directions(&scene.view(x), count).expect("an audience");
            let wanted = facets(&scene, x, &sampled.list).expect("facets");
            sampling += start.elapsed().as_secs_f64();
            let start = Instant::now();
            let solved = solve(&mut workspace, &wanted.gradients, &wanted.weights, width_mm, tolerance);
            solving += start.elapsed().as_secs_f64();
            let solved = solved.expect("a solution");
            steps += solved.iterations;
            // The plain one takes its time: every tenth cell.
            if k % 10 == 0 {
                let start = Instant::now();
                black_box(plain::solve(&solved.gradients, &solved.areas_mm2, width_mm));
                plain_time += start.elapsed().as_secs_f64();
                plain_cells += 1;
            }
        }
        let each = 1e3 / cells as f64;
        let (sampling, solving) = (sampling * each, solving * each);
        println!(
            "{name:13} {count:6}  {sampling:8.3}  {solving:7.3}  {:7.0}  {:5.2}  {:10.1}  {:8.0} s",
            1e3 / (sampling + solving),
            steps as f64 / cells as f64,
            1e3 * plain_time / f64::from(plain_cells) / solving,
            125_000.0 * (sampling + solving) / 2e3,
        );
    }
}
