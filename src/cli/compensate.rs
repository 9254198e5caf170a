//! `screenmill compensate`: where a cutter can stand over a part, and what it leaves.

use std::path::{Path, PathBuf};
use std::sync::mpsc::sync_channel;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use screenmill::compensation::{self, Band, Profile, Wanted};
use screenmill::cutter::Shape;
use screenmill::grid::{Lattice, Window};
use screenmill::pipeline;
use screenmill::surface::{self, HeightWriter, Kind, Opened, Surface, open};
use screenmill::whole::publish_all;
use serde_json::json;

use super::part::Part;
use super::{Common, Outcome, Refusal, console};

/// Writes the locations of a cutter over a part, and what it can and cannot reach
#[derive(clap::Args, Clone, Debug)]
pub struct Arguments {
    #[command(flatten)]
    part: Part,
    /// Cutter, as ball:0.5, flat:1, bull:2:0.2, vee:60:0.1:6 or taper:0.2:10:3
    #[arg(long, value_name = "CUTTER")]
    cutter: Shape,
    /// File of cutter locations: .tif, .npy or .png
    #[arg(long, value_name = "FILE")]
    cl: Option<PathBuf>,
    /// File of what the cutter leaves at best
    #[arg(long, value_name = "FILE")]
    closing: Option<PathBuf>,
    /// File of closing less part
    #[arg(long, value_name = "FILE")]
    residual: Option<PathBuf>,
    /// Cut rows 0, K, 2K, ... only
    #[arg(long, value_name = "K", default_value_t = 1)]
    every: usize,
    /// Keep to the samples of a design or mesh
    #[arg(long)]
    sampled: bool,
}

#[derive(Debug, thiserror::Error)]
#[error("{path} is named for two of the files; hint: a name for each of --cl, --closing and --residual")]
struct NamedTwice {
    path: String,
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let named: Vec<&PathBuf> =
        [&arguments.cl, &arguments.closing, &arguments.residual].into_iter().flatten().collect();
    if let Some(nth) = (1..named.len()).find(|nth| named[..*nth].contains(&named[*nth])) {
        return Err(NamedTwice { path: named[nth].display().to_string() }.into());
    }
    arguments.part.stays(&named)?;
    let every = arguments.every;
    if every == 0 {
        return Err(compensation::Error::Every { every }.into());
    }
    let Opened { surface, kind, notes } = open(&arguments.part.part, &arguments.part.options())?;
    let lattice = surface.lattice();
    let profile = Profile::new(arguments.cutter, lattice.step_mm, 0.0)?;
    let exact = kind != Kind::Heights && !arguments.sampled;
    let [cl, closing, residual] =
        [&arguments.cl, &arguments.closing, &arguments.residual].map(|path| path.is_some());
    let wanted = Wanted { cl, closing, residual, out_of_reach: !cl };
    if wanted.closes() {
        profile.covers_between(every)?;
    }
    let needed = compensation::stream_bytes(&lattice, &profile, every, wanted);
    if let Some(there) = free_bytes().filter(|there| needed > *there) {
        return Err(compensation::Error::Memory {
            columns: lattice.columns,
            cutter: arguments.cutter.to_string(),
            needed_gb: needed as f64 / 1e9,
            there_gb: there as f64 / 1e9,
        }
        .into());
    }
    let files = Files::create(arguments, surface.as_ref(), &lattice)?;
    let progress = if common.quiet { ProgressBar::hidden() } else { ProgressBar::new(lattice.rows as u64) };
    if let Ok(style) = ProgressStyle::with_template("compensate {wide_bar} {pos}/{len} rows {eta}") {
        progress.set_style(style);
    }
    let work = Work { surface: surface.as_ref(), lattice, profile, every, wanted, exact };
    let (files, found, times) = work.stream(files, &progress)?;
    if common.verbose {
        times.tell();
    }
    progress.finish_and_clear();
    if found.samples == 0 {
        return Err(compensation::Error::NoData { samples: lattice.window().samples() }.into());
    }
    let names = files.finish()?;
    let Lattice { columns, rows, step_mm, .. } = lattice;
    let cutter = arguments.cutter.to_string();
    let residual = wanted.closes().then(|| {
        let area_mm2 = found.cavity_samples as f64 * step_mm * step_mm;
        let fraction = found.cavity_samples as f64 / found.samples as f64;
        (f64::from(found.residual_max_mm), area_mm2, fraction)
    });
    if common.json {
        let report = json!({
            "files": names, "cutter": cutter, "columns": columns, "rows": rows, "step_mm": step_mm,
            "every": every, "exact": exact, "no_data": lattice.window().samples() as u64 - found.samples,
            "residual": residual.map(|(max_mm, area_mm2, fraction)| json!({
                "max_mm": max_mm, "cavity_area_mm2": area_mm2, "cavity_area_fraction": fraction,
            })),
            "notes": notes,
        });
        println!("{report}");
    } else {
        let on = if exact { "its faces" } else { "its samples" };
        println!("{columns} x {rows} samples at {step_mm} mm under {cutter} on {on}, every {every} rows");
        for name in &names {
            println!("{name}");
        }
        if let Some((max_mm, area_mm2, fraction)) = residual {
            let percent = 100.0 * fraction;
            println!("out of reach: {max_mm:.6} mm at most, {area_mm2:.4} mm2 ({percent:.2} %)");
        }
        for note in &notes {
            println!("note: {note}");
        }
    }
    Ok(Outcome::Within)
}

/// Memory that a program may still take, where the system tells.
fn free_bytes() -> Option<u64> {
    let told = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = told.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| 1024 * kilobytes)
}

/// What is to be done with a part, band by band.
struct Work<'a> {
    surface: &'a dyn Surface,
    lattice: Lattice,
    profile: Profile,
    every: usize,
    wanted: Wanted,
    /// Whether locations are lifted to the exact drop on the part's faces.
    exact: bool,
}

impl Work<'_> {
    /// Writes a band while the next one is worked out.
    fn stream(&self, mut files: Files, progress: &ProgressBar) -> Result<(Files, Found, Times), Refusal> {
        let started = Instant::now();
        let mut times = Times::default();
        let (bands, to_write) = sync_channel::<Band>(0);
        // Two bands take turns.
        let (used, to_use) = sync_channel::<Band>(2);
        let columns = self.lattice.columns;
        let (streamed, written) = std::thread::scope(|scope| {
            let writer = scope.spawn(move || -> Result<(Files, Found, Duration), Refusal> {
                let (mut found, mut writing) = (Found::default(), Duration::ZERO);
                for band in to_write {
                    let started = Instant::now();
                    found.see(&band);
                    files.write(&band, columns)?;
                    progress.inc(band.rows as u64);
                    writing += started.elapsed();
                    // Nobody takes the last ones.
                    let _ = used.send(band);
                }
                Ok((files, found, writing))
            });
            let streamed = compensation::stream(
                &self.lattice,
                &self.profile,
                self.every,
                self.wanted,
                |window, z_mm| {
                    if console::interrupted() {
                        return Err(Stop::Refused(pipeline::Error::Interrupted.into()));
                    }
                    let read = timed(&mut times.reading, || self.surface.heights_onto(window, 0.0, z_mm));
                    read.map_err(|error| Stop::Refused(error.into()))
                },
                |window, z_mm| {
                    timed(&mut times.lifting, || self.lift(window, z_mm));
                    Ok(())
                },
                |band| {
                    let full = std::mem::take(band);
                    timed(&mut times.waiting, || bands.send(full)).map_err(|_| Stop::Writer)?;
                    *band = to_use.try_recv().unwrap_or_default();
                    Ok(())
                },
            );
            drop(bands);
            (streamed, writer.join())
        });
        let (files, found, writing) = written.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        if let Err(Stop::Refused(refusal)) = streamed {
            return Err(refusal);
        }
        (times.writing, times.all) = (writing, started.elapsed());
        Ok((files, found, times))
    }

    fn lift(&self, window: Window, z_mm: &mut [f32]) {
        if !self.exact || window.rows == 0 {
            return;
        }
        let (lattice, reach_mm) = (&self.lattice, self.profile.radius_mm());
        let last = window.row + ((window.rows - 1) * self.every) as i64;
        let low_mm = [lattice.x_mm(window.column) - reach_mm, lattice.y_mm(window.row) - reach_mm];
        let high_mm = [lattice.x_mm(window.column_end()) + reach_mm, lattice.y_mm(last) + reach_mm];
        let outlines = self.surface.outlines(low_mm, high_mm);
        compensation::lift(window, z_mm, self.every, &self.profile, &outlines);
    }
}

/// How long each stage took.
#[derive(Default)]
struct Times {
    all: Duration,
    reading: Duration,
    lifting: Duration,
    /// Beside the others, but for what they waited for it.
    writing: Duration,
    waiting: Duration,
}

impl Times {
    fn tell(&self) {
        let compensating = self.all.saturating_sub(self.reading + self.lifting + self.waiting);
        let stages = [("reading", self.reading), ("compensating", compensating), ("lifting", self.lifting)];
        for (stage, time) in stages {
            eprintln!("{stage}: {:.2} s", time.as_secs_f64());
        }
        let [writing, waited] = [self.writing, self.waiting].map(|time| time.as_secs_f64());
        eprintln!("writing: {writing:.2} s, of which {waited:.2} s were waited for");
    }
}

fn timed<T>(sum: &mut Duration, work: impl FnOnce() -> T) -> T {
    let started = Instant::now();
    let done = work();
    *sum += started.elapsed();
    done
}

/// Why bands are no longer made.
enum Stop {
    Refused(Refusal),
    /// What takes them is gone, and says why itself.
    Writer,
}

/// What was found on the way.
#[derive(Default)]
struct Found {
    samples: u64,
    residual_max_mm: f32,
    cavity_samples: u64,
}

impl Found {
    fn see(&mut self, band: &Band) {
        self.samples += band.samples;
        self.residual_max_mm = self.residual_max_mm.max(band.out_of_reach.most_mm);
        self.cavity_samples += band.out_of_reach.samples;
    }
}

/// The files asked for; none has its name before all are whole.
struct Files {
    cl: Option<(String, HeightWriter)>,
    closing: Option<(String, HeightWriter)>,
    residual: Option<(String, HeightWriter)>,
}

impl Files {
    fn create(arguments: &Arguments, surface: &dyn Surface, lattice: &Lattice) -> Result<Files, Refusal> {
        let range_mm = [surface.bottom_mm(), surface.top_mm()];
        let create = |path: &Option<PathBuf>, rows: usize, range_mm: [f64; 2]| {
            let create = |path: &PathBuf| -> Result<(String, HeightWriter), Refusal> {
                let writer = HeightWriter::create(path, lattice.columns, rows, lattice.step_mm, range_mm)?;
                console::unfinished(writer.hidden());
                Ok((name(path), writer))
            };
            path.as_ref().map(create).transpose()
        };
        Ok(Files {
            cl: create(&arguments.cl, lattice.rows.div_ceil(arguments.every), range_mm)?,
            closing: create(&arguments.closing, lattice.rows, range_mm)?,
            residual: create(&arguments.residual, lattice.rows, [0.0, range_mm[1] - range_mm[0]])?,
        })
    }

    fn write(&mut self, band: &Band, columns: usize) -> Result<(), Refusal> {
        let write = |to: &mut Option<(String, HeightWriter)>, z_mm: &[f32]| {
            if let Some((_, writer)) = to {
                writer.write_rows(columns, z_mm)?;
            }
            Ok::<(), Refusal>(())
        };
        write(&mut self.cl, &band.cl)?;
        write(&mut self.closing, &band.closing)?;
        write(&mut self.residual, &band.residual)
    }

    fn finish(self) -> Result<Vec<String>, Refusal> {
        let (mut names, mut files) = (Vec::new(), Vec::new());
        for (name, writer) in [self.cl, self.closing, self.residual].into_iter().flatten() {
            files.push(writer.whole()?);
            names.push(name);
        }
        publish_all(files)
            .map_err(|(path, source)| surface::Error::Unwritable { path: name(&path), source })?;
        Ok(names)
    }
}

fn name(path: &Path) -> String {
    path.display().to_string()
}
