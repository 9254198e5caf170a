//! `cargo bench --bench compensation [-- SIDE]`: one thread, designed domes of SIDE x SIDE samples
//! of 10 um; times as multiples of a plain copy of the heights and of the naive loop, all of one
//! run.

#[allow(dead_code)]
#[path = "../tests/compensation/surfaces.rs"]
mod surfaces;

use screenmill::compensation::{self, Profile, RowTarget};
use screenmill::grid::{Heights, Window};
use std::hint::black_box;
use std::time::Instant;
use surfaces::STEP_MM;

/// Nanoseconds of the median of three runs.
fn nanoseconds(mut run: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..3)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e9
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[1]
}

fn naive_ns_per_sample(h: &Heights, profile: &Profile) -> f64 {
    let radius = profile.radius();
    let reach = profile.reach() as i64;
    let mut taps = Vec::new();
    for dy in -reach..=reach {
        for dx in -reach..=reach {
            let d = ((dx * dx + dy * dy) as f64).sqrt();
            if d <= radius {
                taps.push((dx, dy, profile.s_mm(d * STEP_MM).unwrap_or(0.0) as f32));
            }
        }
    }
    let side = 24i64;
    let start = Instant::now();
    let mut sum = 0.0;
    for row in reach..reach + side {
        for column in reach..reach + side {
            let mut best = f32::MIN;
            for &(dx, dy, s) in &taps {
                best = best.max(h.row(row + dy)[(column + dx) as usize] + s);
            }
            sum += best;
        }
    }
    black_box(sum);
    start.elapsed().as_secs_f64() * 1e9 / (side * side) as f64
}

fn main() {
    let side = std::env::args().find_map(|word| word.parse().ok()).unwrap_or(3000);
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("the first pool of the program");
    let facets = surfaces::from(side, side, surfaces::facets(side, side, 400, 7));
    let mut random = surfaces::Random(3);
    let noise = surfaces::from(side, side, |_, _| 70.0 * random.next());
    let samples = (side * side) as f64;
    let window = facets.window;
    let copy = nanoseconds(|| drop(black_box(facets.z_mm.clone()))) / samples;
    println!("{side} x {side} samples, one thread; a copy takes {copy:.2} ns a sample");
    println!("surface cutter        what          ns/sample   x copy   naive/this");
    let report = |surface: &str, cutter: &str, what: &str, ns: f64, naive: f64| {
        println!("{surface:7} {cutter:13} {what:13} {ns:9.2} {:8.1} {:12.0}", ns / copy, naive / ns);
    };
    for text in ["ball:0.2", "ball:0.5", "ball:1", "ball:2", "ball:3"] {
        let profile = Profile::new(text.parse().expect("a cutter"), STEP_MM, 0.0).expect("a profile");
        let naive = naive_ns_per_sample(&facets, &profile);
        let cl = compensation::cutter_location(&facets, &profile, window);
        let time = |what: &str, run: &mut dyn FnMut()| {
            report("facets", text, what, nanoseconds(run) / samples, naive);
        };
        time("CL", &mut || drop(black_box(compensation::cutter_location(&facets, &profile, window))));
        time("CL every 5", &mut || {
            drop(black_box(compensation::cutter_location_rows(&facets, &profile, window, 5)))
        });
        time("erosion", &mut || drop(black_box(compensation::erode(&cl, &profile, window))));
        let part = Window { rows: 400, ..window };
        let ns = nanoseconds(|| drop(black_box(compensation::cutter_location(&noise, &profile, part))));
        report("noise", text, "CL", ns / part.samples() as f64, naive);
    }
    for text in ["flat:0.5", "flat:1", "flat:3", "bull:2:0.2", "vee:60:0.1:1", "taper:0.2:10:1"] {
        let profile = Profile::new(text.parse().expect("a cutter"), STEP_MM, 0.0).expect("a profile");
        let naive = naive_ns_per_sample(&facets, &profile);
        let part = Window { rows: window.rows.min(800), ..window };
        let ns = nanoseconds(|| drop(black_box(compensation::cutter_location(&facets, &profile, part))));
        report("facets", text, "CL", ns / part.samples() as f64, naive);
    }
    let profile = Profile::new("ball:1".parse().expect("a cutter"), STEP_MM, 0.0).expect("a profile");
    let naive = naive_ns_per_sample(&facets, &profile);
    let width_mm = side as f64 * STEP_MM;
    let targets: Vec<RowTarget> = (0..(width_mm / 0.0475) as usize)
        .map(|i| RowTarget { x0_mm: 0.005, y_mm: 0.0475 * i as f64, count: side })
        .collect();
    let positions = (targets.len() * side) as f64;
    let mut rows = Vec::new();
    let ns = nanoseconds(|| rows = compensation::rows(&facets, &profile, &targets));
    report("facets", "ball:1", "rows off grid", ns / positions, naive);
    let passes: Vec<compensation::RowPass> = targets
        .iter()
        .zip(&rows)
        .map(|(t, z_mm)| compensation::RowPass { x0_mm: t.x0_mm, y_mm: t.y_mm, z_mm })
        .collect();
    let ns = nanoseconds(|| drop(black_box(compensation::machined_by_rows(&passes, &profile, window))));
    report("facets", "ball:1", "under passes", ns / samples, naive);
}
