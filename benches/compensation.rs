//! `cargo bench --bench compensation [-- SIDE]`: designed domes of SIDE x SIDE samples of 10 um,
//! one thread unless said, all ratios of one run: processor time where Linux tells it. OpenCV,
//! SciPy and OpenCAMLib are asked by benches/peers.py where python3 has them.

#[allow(dead_code)]
#[path = "../tests/compensation/surfaces.rs"]
mod surfaces;

use npyz::WriterBuilder;
use screenmill::compensation::{self, Band, Closings, Profile, RowTarget, Tables, Wanted, Way};
use screenmill::grid::{Heights, Lattice, Window};
use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use surfaces::STEP_MM;

const RADII: [usize; 5] = [10, 25, 50, 100, 150];

/// Rounds in which copies, locations and closings take turns, and how long each is repeated in one of them.
const ROUNDS: usize = 9;
const LEAST_NS: f64 = 6e7;

/// What this thread has run, in ns: other programs on the machine do not show as much as in wall
/// time.
fn spent_ns(since: Instant) -> f64 {
    #[cfg(target_os = "linux")]
    {
        let mut spent = libc::timespec { tv_sec: 0, tv_nsec: 0 };
        // SAFETY: the call writes the time it is given.
        if unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut spent) } == 0 {
            return spent.tv_sec as f64 * 1e9 + spent.tv_nsec as f64;
        }
    }
    since.elapsed().as_secs_f64() * 1e9
}

/// What each of some rounds took, in ns a sample, and in times the first of its round: the processor's speed and what
/// memory gives change from minute to minute, and less within a round.
struct Rounds(Vec<Vec<f64>>);

impl Rounds {
    fn of(samples: f64, runs: &mut [&mut dyn FnMut()]) -> Rounds {
        let origin = Instant::now();
        let mut rounds = Vec::new();
        for round in 0..=ROUNDS {
            let of_round = runs.iter_mut().map(|run| {
                let (start, mut times) = (spent_ns(origin), 0);
                while times == 0 || spent_ns(origin) - start < LEAST_NS {
                    run();
                    times += 1;
                }
                (spent_ns(origin) - start) / (f64::from(times) * samples)
            });
            let of_round = of_round.collect();
            // The first one takes the memory.
            if round > 0 {
                rounds.push(of_round);
            }
        }
        Rounds(rounds)
    }

    fn least(&self, run: usize) -> f64 {
        self.0.iter().map(|round| round[run]).fold(f64::INFINITY, f64::min)
    }

    /// The median over all rounds.
    fn ratio(&self, run: usize, to: usize) -> f64 {
        let mut ratios: Vec<f64> = self.0.iter().map(|round| round[run] / round[to]).collect();
        ratios.sort_by(f64::total_cmp);
        ratios[ratios.len() / 2]
    }
}

/// The least of some runs, in ns.
fn nanoseconds(runs: usize, mut run: impl FnMut()) -> f64 {
    let origin = Instant::now();
    (0..runs).fold(f64::INFINITY, |least, _| {
        let start = spent_ns(origin);
        run();
        least.min(spent_ns(origin) - start)
    })
}

fn ball(radius: usize) -> Profile {
    cutter(&format!("ball:{}", 2.0 * radius as f64 * STEP_MM))
}

fn cutter(text: &str) -> Profile {
    Profile::new(text.parse().expect("a cutter"), STEP_MM, 0.0).expect("a profile")
}

fn naive_ns_per_sample(h: &Heights, profile: &Profile) -> f64 {
    let reach = profile.reach() as i64;
    let mut taps = Vec::new();
    for dy in -reach..=reach {
        for dx in -reach..=reach {
            let d_mm = ((dx * dx + dy * dy) as f64).sqrt() * STEP_MM;
            if let Some(s_mm) = profile.s_mm(d_mm) {
                taps.push((dx, dy, s_mm as f32));
            }
        }
    }
    // Enough of them for the thread's clock, which moves in steps of milliseconds.
    let side = (2400 / reach.max(1)).clamp(24, 240).min(h.window.rows as i64 - 2 * reach);
    let ns = nanoseconds(1, || {
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
    });
    ns / (side * side) as f64
}

/// The numbers that benches/peers.py prints; None where a package is missing.
fn peers(arguments: &[&str]) -> Option<Vec<f64>> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers.py");
    let python = std::env::var("SCREENMILL_PYTHON").unwrap_or_else(|_| "python3".into());
    let output = Command::new(python).arg(script).args(arguments).output().ok()?;
    let said = String::from_utf8_lossy(&output.stdout);
    said.split_whitespace()
        .map(|word| word.parse().ok())
        .collect::<Option<Vec<f64>>>()
        .filter(|n| !n.is_empty())
}

fn write(h: &Heights, path: &Path) {
    let file = std::fs::File::create(path).expect("a scratch file");
    let shape = [h.window.rows as u64, h.window.columns as u64];
    let options = npyz::WriteOptions::new().default_dtype().shape(&shape);
    let mut writer = options.writer(std::io::BufWriter::new(file)).begin_nd().expect("a header");
    writer.extend(h.z_mm.iter().copied()).expect("heights");
    writer.finish().expect("a file");
}

fn line(name: &str, values: impl IntoIterator<Item = Option<f64>>, digits: usize) {
    print!("| {name} |");
    for value in values {
        match value {
            Some(value) => print!(" {value:.digits$} |"),
            None => print!(" - |"),
        }
    }
    println!();
}

fn main() {
    let side = std::env::args().find_map(|word| word.parse().ok()).unwrap_or(3000);
    // This thread is the pool, so that its clock tells all.
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .use_current_thread()
        .build_global()
        .expect("the first pool of the program");
    let h = surfaces::from(side, side, surfaces::facets(side, side, 400, 7));
    let mut random = surfaces::Random(3);
    let noise = surfaces::from(side, 400.min(side), |_, _| 70.0 * random.next());
    let samples = (side * side) as f64;
    let window = h.window;
    let (mut cl, mut copies, mut flat) = (Vec::new(), Vec::new(), Vec::new());
    let (mut to_copy, mut fifth, mut closing) = (Vec::new(), Vec::new(), Vec::new());
    let (mut naive, mut known) = (Vec::new(), Vec::new());
    let mut done = Heights { window, z_mm: Vec::new() };
    let mut rows = done.clone();
    let mut noisy = done.clone();
    let mut closings = Closings::new();
    // Memory of the same kind as locations are in.
    let mut to = compensation::cutter_location(&h, &ball(10), window);
    for radius in RADII {
        let profile = ball(radius);
        // All in memory that is there.
        let rounds = Rounds::of(
            samples,
            &mut [
                &mut || {
                    to.z_mm.copy_from_slice(black_box(&h.z_mm));
                    black_box(&to);
                },
                &mut || compensation::cutter_location_rows_into(&h, &profile, window, 1, &mut done),
                &mut || compensation::cutter_location_rows_into(&h, &profile, window, 5, &mut rows),
                &mut || _ = black_box(closings.of(&h, &Tables::new(profile), window)),
            ],
        );
        copies.push(rounds.least(0));
        cl.push(rounds.least(1));
        to_copy.push(rounds.ratio(1, 0));
        fifth.push(rounds.ratio(2, 1));
        closing.push(rounds.ratio(3, 1));
        naive.push(naive_ns_per_sample(&h, &profile));
        let disc = cutter(&format!("flat:{}", 2.0 * radius as f64 * STEP_MM));
        let often = (200 / radius).max(1);
        let of_disc = nanoseconds(4, || {
            (0..often).for_each(|_| drop(black_box(compensation::cutter_location(&h, &disc, window))));
        });
        flat.push(of_disc / (samples * often as f64));
        let noisy = std::cell::RefCell::new(&mut noisy);
        let by = |way| {
            compensation::cutter_location_by(&noise, &profile, noise.window, way, &mut noisy.borrow_mut());
            black_box(&noisy);
        };
        let contacts = nanoseconds(1, || by(Way::Contacts)) / noise.window.samples() as f64;
        let rounds = Rounds::of(
            noise.window.samples() as f64,
            &mut [&mut || by(Way::EveryTap), &mut || by(Way::Known)],
        );
        known.push(rounds.ratio(1, 0).max(rounds.least(1) / contacts));
    }
    let scratch = tempfile::tempdir().expect("a scratch folder");
    let heights = scratch.path().join("heights.npy");
    write(&h, &heights);
    let heights = heights.display().to_string();
    let radii = RADII.map(|radius| radius.to_string());
    let words: Vec<&str> = ["opencv", &heights].into_iter().chain(radii.iter().map(String::as_str)).collect();
    let opencv = peers(&words);
    let opencv = |i: usize| opencv.as_ref().and_then(|ns| ns.get(2 * i + 1)).copied();

    println!("{side} x {side} samples\n");
    println!("| R in samples | 10 | 25 | 50 | 100 | 150 |\n|---|---|---|---|---|---|");
    line("a copy, ns a sample", copies.into_iter().map(Some), 2);
    line("ball CL, ns a sample", cl.iter().map(|ns| Some(*ns)), 1);
    line("ball CL, times a copy", to_copy.into_iter().map(Some), 1);
    line("naive loop, times ball CL", naive.iter().zip(&cl).map(|(n, ns)| Some(n / ns)), 0);
    line("flat disc, ns a sample", flat.iter().map(|ns| Some(*ns)), 1);
    line("OpenCV's dilate, times flat disc", flat.iter().enumerate().map(|(i, ns)| Some(opencv(i)? / ns)), 1);
    line("every 5th row, part of ball CL", fifth.into_iter().map(Some), 2);
    line("closing, times ball CL", closing.into_iter().map(Some), 2);
    line("white noise, times the better way", known.into_iter().map(Some), 2);
    println!();
    if let Some(scipy) = peers(&["scipy", &heights, "25"]) {
        println!("SciPy's grey_dilation, R = 25: {:.0} times ball CL", scipy[1] / cl[1]);
    }
    drops(scratch.path());
    two_threads(&h);
    whole_part(&h);
    others(&h);
}

/// Against OpenCAMLib's path drop-cutter, on a designed tile of 20 x 20 mm as triangles.
fn drops(scratch: &Path) {
    let binary = env!("CARGO_BIN_EXE_screenmill");
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/theatre.toml");
    let (stl, npz) = (scratch.join("tile.stl"), scratch.join("tile.npz"));
    let mut design = Command::new(binary);
    design.arg("design").arg(scene).args(["--cells", "322", "148", "327", "153", "--quiet"]);
    design.arg("--out").arg(npz).arg("--stl").arg(&stl);
    let made = design.output().is_ok_and(|output| output.status.success());
    if let Some(rates) = made.then(|| peers(&["opencamlib", binary, &stl.display().to_string()])).flatten() {
        println!(
            "20 x 20 mm of triangles, exact, ball:0.5: {:.2} million cutter locations a processor second, OpenCAMLib {:.1} thousand: {:.0} times",
            rates[1] / 1e6,
            rates[0] / 1e3,
            rates[1] / rates[0]
        );
    }
}

/// By the clock, on four times the surface: one after the other several times, and the middle one of their ratios,
/// because the clock also counts what else the machine does.
fn two_threads(h: &Heights) {
    let profile = ball(100);
    let window = Window { rows: 4 * h.window.rows, ..h.window };
    let tall = Heights { window, z_mm: h.z_mm.repeat(4) };
    let mut done = Heights { window, z_mm: Vec::new() };
    let pools = [1, 2].map(|threads| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads")
    });
    let mut ratios: Vec<f64> = (0..11)
        .map(|_| {
            let [one, two] = pools.each_ref().map(|pool| {
                let start = Instant::now();
                pool.install(|| {
                    compensation::cutter_location_rows_into(&tall, &profile, window, 1, &mut done)
                });
                start.elapsed().as_secs_f64()
            });
            one / two
        })
        .collect();
    ratios.sort_by(f64::total_cmp);
    println!("two threads, ball CL, R = 100: {:.2} times one, wall time", ratios[ratios.len() / 2]);
}

/// 20 x 20 cm, the domes side by side, band by band on two threads; reading, a copy here, is left out, and nothing is written.
fn whole_part(h: &Heights) {
    let (profile, lattice) = (ball(100), Lattice::covering(200.0, 200.0, STEP_MM));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool of threads");
    let cl = Wanted { cl: true, ..Wanted::default() };
    let closing = Wanted { closing: true, ..Wanted::default() };
    let all = Wanted { cl: true, closing: true, residual: true, out_of_reach: true };
    for (wanted, what) in [(cl, "locations"), (closing, "closing"), (all, "locations, closing and residual")]
    {
        let took: Vec<String> = (0..5)
            .map(|_| {
                let (start, mut reading) = (Instant::now(), Duration::ZERO);
                let read = |window: Window, z_mm: &mut [f32]| -> Result<(), ()> {
                    let start = Instant::now();
                    for (row, z_mm) in (window.row..).zip(z_mm.chunks_exact_mut(window.columns)) {
                        let from = h.row(row % h.window.rows as i64);
                        z_mm.chunks_mut(from.len())
                            .for_each(|z_mm| z_mm.copy_from_slice(&from[..z_mm.len()]));
                    }
                    reading += start.elapsed();
                    Ok(())
                };
                let each = |band: &mut Band| {
                    black_box(band);
                    Ok(())
                };
                let done = pool.install(|| {
                    compensation::stream(&lattice, &profile, 1, wanted, read, |_, _| Ok(()), each)
                });
                done.expect("nothing that could fail");
                format!("{:.2}", (start.elapsed() - reading).as_secs_f64())
            })
            .collect();
        println!("20 x 20 cm, {what}, R = 100, two threads: {} s, wall time", took.join(", "));
    }
}

/// Cutters and calls that the table leaves out, in ns a sample or position.
fn others(h: &Heights) {
    let window = h.window;
    let part = Window { rows: window.rows.min(400), ..window };
    for text in ["bull:2:0.2", "vee:60:0.1:1", "taper:0.2:10:1"] {
        let profile = cutter(text);
        let ns = nanoseconds(1, || drop(black_box(compensation::cutter_location(h, &profile, part))));
        println!("{text}: CL {:.0} ns a sample", ns / part.samples() as f64);
    }
    let profile = ball(50);
    let width_mm = window.columns as f64 * STEP_MM;
    let targets: Vec<RowTarget> = (0..(width_mm / 0.0475) as usize)
        .map(|i| RowTarget { x0_mm: 0.005, y_mm: 0.0475 * i as f64, count: window.columns })
        .collect();
    let mut rows = Vec::new();
    let ns = nanoseconds(2, || rows = compensation::rows(h, &profile, &targets));
    println!(
        "ball:1, rows off the lattice: {:.1} ns a position",
        ns / (targets.len() * window.columns) as f64
    );
    let passes: Vec<compensation::RowPass> = targets
        .iter()
        .zip(&rows)
        .map(|(t, z_mm)| compensation::RowPass { x0_mm: t.x0_mm, y_mm: t.y_mm, z_mm })
        .collect();
    let ns = nanoseconds(2, || drop(black_box(compensation::machined_by_rows(&passes, &profile, window))));
    println!("ball:1, surface under these rows: {:.1} ns a sample", ns / window.samples() as f64);
}
