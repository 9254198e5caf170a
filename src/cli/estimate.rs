//! `screenmill estimate`: how long a job or some programs run, and what limits them.

use std::path::{Path, PathBuf};

use screenmill::job::Job;
use screenmill::machine::Machine;
use screenmill::pipeline;
use screenmill::verify::{
    Clock, Command, Event, Extent, Kinematics, Language, Options, Summary, Timing, Travel, TravelSearch,
};
use serde_json::{Map, Value, json};

use super::console::Console;
use super::program::{
    Refused, bounds, clock, language, length, past_travel, reading_options, stream, unread,
};
use super::{Common, Outcome, Refusal};

/// Milling time of a job or of programs, with what limits it
#[derive(clap::Args, Clone, Debug)]
pub struct Arguments {
    /// A job file (.toml), or programs in G-code or RML-1
    #[arg(required = true, value_name = "JOB.toml or PROGRAM")]
    programs: Vec<PathBuf>,
    /// Machine profile for programs: a name or a file; a job names its own
    #[arg(long, value_name = "NAME")]
    machine: Option<String>,
}

/// The arguments do not go together.
#[derive(Debug, thiserror::Error)]
enum Misused {
    #[error("programs do not say which machine runs them; hint: --machine NAME, see screenmill machines")]
    NoMachine,
    #[error(
        "{job} is a job, and {others} other files stand beside it; hint: one job at a time, or programs only"
    )]
    Mixed { job: String, others: usize },
    #[error(
        "--machine {machine} stands beside a job, which names its own machine; hint: leave --machine out"
    )]
    MachineOfJob { machine: String },
}

struct Estimated {
    summary: Summary,
    extent: Extent,
    timing: Timing,
    /// What its operator should know.
    notes: Vec<String>,
    /// Why its machine cannot run it.
    errors: Vec<String>,
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let is_job = |path: &&PathBuf| path.extension().is_some_and(|extension| extension == "toml");
    if let Some(path) = arguments.programs.iter().find(is_job) {
        let others = arguments.programs.len() - 1;
        if others > 0 {
            return Err(Misused::Mixed { job: path.display().to_string(), others }.into());
        }
        if let Some(machine) = &arguments.machine {
            return Err(Misused::MachineOfJob { machine: machine.clone() }.into());
        }
        return job(path, common);
    }
    let name = arguments.machine.as_deref().ok_or(Misused::NoMachine)?;
    let machine = Machine::find(name, None)?;
    let kinematics = Kinematics::from(&machine);
    let options = Options { from_zero: true, ..reading_options(&machine)? };
    let mut total_s = 0.0;
    let mut limits: Vec<(&'static str, f64)> = Vec::new();
    let mut programs = Vec::new();
    let mut runs = true;
    for path in &arguments.programs {
        let mut one = estimate(path, &options, &kinematics)?;
        for past in past_travel(&one.extent, one.summary.language, &machine) {
            if past.harmless { one.notes.push(past.message) } else { one.errors.push(past.message) }
        }
        one.notes.extend(unread(one.summary.language, &machine)?);
        runs &= one.errors.is_empty();
        total_s += one.timing.total_s;
        for (name, seconds) in one.timing.limits() {
            match limits.iter_mut().find(|l| l.0 == name) {
                Some(known) => known.1 += seconds,
                None => limits.push((name, seconds)),
            }
        }
        if common.json {
            programs.push(program(path, &one));
        } else {
            print(path, &one);
        }
    }
    limits.sort_by(|a, b| b.1.total_cmp(&a.1));
    let unconfirmed = machine.unconfirmed();
    if common.json {
        let report = json!({
            "time_s": total_s, "machine": machine.name, "limited_by": limits.first().map(|l| l.0),
            "parts": parts(&limits), "programs": programs, "unconfirmed": unconfirmed,
        });
        println!("{report}");
    } else {
        println!("{} on {}: {}", clock(total_s), machine.name, shares(&limits, total_s));
        if !unconfirmed.is_empty() {
            println!(
                "verify against your machine: {} of its profile are unconfirmed",
                unconfirmed.join(", ")
            );
        }
    }
    Ok(if runs { Outcome::Within } else { Outcome::Found })
}

fn job(path: &Path, common: &Common) -> Result<Outcome, Refusal> {
    let job = Job::read(path)?;
    let scratch = tempfile::tempdir()?;
    let console = Console::new(common.quiet || common.json, common.verbose);
    let folder = path.parent().unwrap_or(Path::new(""));
    let estimated = pipeline::estimate(&job, folder, scratch.path(), &console)?;
    console.times();
    let hours = estimated.total_s / 3600.0;
    let over = estimated.hours_max.is_some_and(|most| hours > most);
    if common.json {
        let report = json!({
            "time_s": estimated.total_s, "machine": estimated.machine, "post": estimated.post,
            "limited_by": estimated.limits.first().map(|l| l.0), "parts": parts(&estimated.limits),
            "by_operation": estimated.by_operation, "by_tool": estimated.by_tool,
            "by_tile": estimated.by_tile, "cutting_mm": estimated.cutting_mm,
            "rapid_mm": estimated.rapid_mm, "blocks": estimated.blocks, "tiles": estimated.tiles,
            "hours_max": estimated.hours_max, "unconfirmed": estimated.unconfirmed,
        });
        println!("{report}");
    } else {
        for (name, seconds) in &estimated.by_operation.0 {
            println!("{name}: {}", clock(*seconds));
        }
        println!(
            "{} on {} in {} tile(s), {} of cut, {} of rapids: {}",
            clock(estimated.total_s),
            estimated.machine,
            estimated.tiles,
            length(estimated.cutting_mm),
            length(estimated.rapid_mm),
            shares(&estimated.limits, estimated.total_s)
        );
        if !estimated.unconfirmed.is_empty() {
            println!(
                "verify against your machine: {} of its profile are unconfirmed",
                estimated.unconfirmed.join(", ")
            );
        }
        if let Some(most) = estimated.hours_max.filter(|_| over) {
            println!("{hours:.2} machine hours, {most} are allowed");
        }
    }
    Ok(if over { Outcome::Found } else { Outcome::Within })
}

fn estimate(path: &Path, options: &Options, kinematics: &Kinematics) -> Result<Estimated, Refused> {
    let travel = travel(path, options)?;
    let Clock { mut interpreter, mut planner } = Clock::new(kinematics, travel);
    let mut extent = Extent::with_travel(travel);
    // All that needs no planning is done beside the reading.
    let mut interpret = |event: &Event, commands: &mut Vec<Command>| {
        if let Event::Move(motion) = event {
            extent.add(motion);
        }
        interpreter.event(event, &mut |command| commands.push(command));
    };
    let summary = stream(path, options, &mut interpret, &mut |commands: &[Command]| {
        commands.iter().for_each(|command| planner.take(command));
    })?;
    let timing = Clock { interpreter, planner }.finish(summary.bytes);
    let notes = summary.notes.iter().map(ToString::to_string).collect();
    Ok(Estimated { summary, extent, timing, notes, errors: Vec::new() })
}

/// RML-1 has no rapids, so its travels have to be found before the text is timed.
fn travel(path: &Path, options: &Options) -> Result<Travel, Refused> {
    if language(path)? != Language::Rml1 {
        return Ok(Travel::default());
    }
    let mut search = TravelSearch::default();
    let mut look = |event: &Event, _: &mut Vec<()>| {
        if let Event::Move(motion) = event {
            search.add(motion);
        }
    };
    stream(path, options, &mut look, &mut |_| ())?;
    Ok(search.found())
}

fn parts(limits: &[(&'static str, f64)]) -> Value {
    let parts: Map<String, Value> =
        limits.iter().map(|(name, s)| (name.replace(' ', "_"), json!(s))).collect();
    Value::Object(parts)
}

fn shares(limits: &[(&'static str, f64)], total_s: f64) -> String {
    let share = |(name, seconds): &(&'static str, f64)| format!("{name} {:.0} %", 100.0 * seconds / total_s);
    limits.iter().map(share).collect::<Vec<_>>().join(", ")
}

fn program(path: &Path, one: &Estimated) -> Value {
    let Estimated { summary, extent, timing, notes, errors } = one;
    let limits = timing.limits();
    json!({
        "file": path.display().to_string(), "language": summary.language.to_string(),
        "blocks": summary.blocks, "bytes": summary.bytes,
        "cutting_mm": extent.cutting_mm, "rapid_mm": extent.rapid_mm, "bounds_mm": bounds(extent),
        "time_s": timing.total_s, "cutting_s": timing.cutting_s, "rapid_s": timing.rapid_s,
        "dwell_s": timing.dwell_s, "pauses": timing.pauses,
        "limited_by": limits.first().map(|l| l.0), "parts": parts(&limits),
        "notes": notes, "errors": errors,
    })
}

fn print(path: &Path, one: &Estimated) {
    let Estimated { summary, extent, timing, notes, errors } = one;
    println!("{}: {}, {} blocks", path.display(), summary.language, summary.blocks);
    println!(
        "  {} ({} cutting {}, {} rapids {}, {} dwell)",
        clock(timing.total_s),
        clock(timing.cutting_s),
        length(extent.cutting_mm),
        clock(timing.rapid_s),
        length(extent.rapid_mm),
        clock(timing.dwell_s)
    );
    println!("  {}", shares(&timing.limits(), timing.total_s));
    if timing.pauses > 0 {
        println!("  {} stops for the operator, whose time is not counted", timing.pauses);
    }
    for error in errors {
        println!("  error: {error}");
    }
    for note in notes {
        println!("  note: {note}");
    }
}
