//! Program files as arguments.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::sync::mpsc;

use screenmill::machine::Machine;
use screenmill::post::{Dialect, LineCounts};
use screenmill::verify::{self, Event, Extent, Language, LineLimit, Options, Reading, Summary};
use serde_json::{Value, json};

use super::Refusal;

/// Bytes read ahead: long enough for a header, so that the language is found.
const BUFFER: usize = 1 << 16;
/// What the reading thread hands over at once, and how many such batches may wait.
const BATCH: usize = 2048;
const BATCHES: usize = 4;

/// A program's text was refused.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    #[error("{path}: {source}")]
    Open { path: PathBuf, source: std::io::Error },
    #[error("{path}: {source}")]
    Text { path: PathBuf, source: verify::Error },
}

fn open(path: &Path) -> Result<BufReader<File>, Refused> {
    let file = File::open(path).map_err(|source| Refused::Open { path: path.into(), source })?;
    Ok(BufReader::with_capacity(BUFFER, file))
}

/// Says so where no dialect of a machine is in a program's language.
pub fn unread(language: Language, machine: &Machine) -> Result<Option<String>, Refusal> {
    let rml = language == Language::Rml1;
    for name in &machine.dialects {
        if (Dialect::find(name, None)?.extension == "rml") == rml {
            return Ok(None);
        }
    }
    Ok(Some(format!("is {language}, {} reads {}", machine.name, machine.dialects.join(", "))))
}

/// What a text does not say of this machine: the unit of its RML-1, and how long a line its controller takes.
pub fn reading_options(machine: &Machine) -> Result<Options, Refusal> {
    let dialects: Vec<Dialect> =
        machine.dialects.iter().map(|name| Dialect::find(name, None)).collect::<Result<_, _>>()?;
    let is_rml = |dialect: &&Dialect| dialect.extension == "rml";
    let rml = dialects.iter().find(is_rml);
    let gcode = dialects.iter().find(|dialect| !is_rml(dialect));
    let default = Options::default();
    Ok(Options {
        rml_unit_mm: rml.map_or(default.rml_unit_mm, |dialect| dialect.unit_mm),
        line: gcode.map(line_limit),
        from_zero: false,
    })
}

fn line_limit(dialect: &Dialect) -> LineLimit {
    LineLimit {
        bytes: dialect.limits.line_max,
        words_only: dialect.limits.line_counts == LineCounts::Words,
        confirmed: !dialect.unconfirmed.iter().any(|key| key == "limits.line_max"),
    }
}

/// The language of a program, from its beginning.
pub fn language(path: &Path) -> Result<Language, Refused> {
    let refused = |source| Refused::Open { path: path.into(), source };
    Ok(verify::language(open(path)?.fill_buf().map_err(refused)?))
}

/// Reads a program whole.
pub fn read(path: &Path, options: &Options) -> Result<Reading, Refused> {
    Reading::from(&mut open(path)?, options).map_err(|source| Refused::Text { path: path.into(), source })
}

/// Reads a program event by event; a text without a motion is refused. The text is taken apart on a
/// thread of its own, where `beside` gets every event and says what of it goes on, batch by batch.
pub fn stream<T: Send>(
    path: &Path,
    options: &Options,
    beside: &mut (dyn FnMut(&Event, &mut Vec<T>) + Send),
    onward: &mut dyn FnMut(&[T]),
) -> Result<Summary, Refused> {
    let refused = |source| Refused::Text { path: path.into(), source };
    let (mut file, options) = (open(path)?, *options);
    let (sender, batches) = mpsc::sync_channel::<Vec<T>>(BATCHES);
    let (back, empty) = mpsc::channel::<Vec<T>>();
    let (summary, moved) = std::thread::scope(|scope| {
        let reader = scope.spawn(move || {
            let mut moved = false;
            let mut batch = Vec::with_capacity(BATCH);
            let summary = verify::read(&mut file, &options, &mut |event| {
                moved |= matches!(event, Event::Move(_));
                beside(event, &mut batch);
                if batch.len() >= BATCH {
                    let next = empty.try_recv().unwrap_or_else(|_| Vec::with_capacity(BATCH));
                    // The other end takes everything until this one is done.
                    let _ = sender.send(std::mem::replace(&mut batch, next));
                }
                Ok(())
            });
            let _ = sender.send(batch);
            (summary, moved)
        });
        for mut batch in batches {
            onward(&batch);
            batch.clear();
            // Where the reader is done, none is needed.
            let _ = back.send(batch);
        }
        reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    });
    let summary = summary.map_err(refused)?;
    if moved { Ok(summary) } else { Err(refused(verify::Error::Empty)) }
}

/// Bounds as the reports have them; None where no motion was placed.
pub fn bounds(extent: &Extent) -> Value {
    let axis = |axis: usize| {
        let (low, high) = (extent.low_mm[axis], extent.high_mm[axis]);
        if low <= high { json!([low, high]) } else { Value::Null }
    };
    json!({ "x": axis(0), "y": axis(1), "z": axis(2) })
}

/// An axis on which a program goes farther than its machine can.
pub struct PastTravel {
    pub message: String,
    /// The machine stops at its highest point by itself, and goes on from there.
    pub harmless: bool,
}

/// The axes on which a program goes farther than its machine can. A lift in RML-1 may ask for more than there is: the tool
/// then goes as high as it can.
pub fn past_travel(extent: &Extent, language: Language, machine: &Machine) -> Vec<PastTravel> {
    let travel = [machine.travel.x_mm, machine.travel.y_mm, machine.travel.z_mm];
    let span = |axis: usize| extent.high_mm[axis] - extent.low_mm[axis];
    let past = (0..3).filter(|axis| span(*axis) > travel[*axis] + 1e-6);
    past.map(|axis| {
        let name = ["X", "Y", "Z"][axis];
        let [low, high] = [extent.low_line[axis], extent.high_line[axis]];
        let harmless = axis == 2 && language == Language::Rml1;
        let hint = if harmless { "; it then goes no higher than it can" } else { "" };
        let message = format!(
            "line {}: moves {:.3} mm in {name}, from {:.3} (line {low}) to {:.3} (line {high}), {} travels {} mm{hint}",
            low.max(high),
            span(axis),
            extent.low_mm[axis],
            extent.high_mm[axis],
            machine.name,
            travel[axis]
        );
        PastTravel { message, harmless }
    })
    .collect()
}

/// A length as an operator says it.
pub fn length(mm: f64) -> String {
    if mm < 1000.0 { format!("{mm:.1} mm") } else { format!("{:.1} m", 1e-3 * mm) }
}

/// A time as an operator says it.
pub fn clock(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, _) => format!("{seconds:.1} s"),
        (0, minutes, rest) => format!("{minutes} min {rest:02} s"),
        (hours, minutes, _) => format!("{hours} h {minutes:02} min"),
    }
}
