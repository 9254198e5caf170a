//! `screenmill estimate PROGRAM...`: how long programs run, and what limits them.

use std::path::{Path, PathBuf};

use screenmill::machine::Machine;
use screenmill::verify::{Clock, Event, Extent, Kinematics, Language, Summary, Timing};
use serde_json::{Map, Value, json};

use super::program::{Refused, bounds, clock, stream};
use super::{Common, Outcome, Refusal};

/// Milling time of programs, with what limits it
#[derive(clap::Args, Clone, Debug)]
pub struct Arguments {
    /// Programs in G-code or RML-1
    #[arg(required = true, value_name = "PROGRAM")]
    programs: Vec<PathBuf>,
    /// Machine profile: a name or a file
    #[arg(long, value_name = "NAME")]
    machine: String,
}

struct Estimated {
    summary: Summary,
    extent: Extent,
    timing: Timing,
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let machine = Machine::find(&arguments.machine, None)?;
    let kinematics = Kinematics::from(&machine);
    let mut total_s = 0.0;
    let mut limits: Vec<(&'static str, f64)> = Vec::new();
    let mut programs = Vec::new();
    for path in &arguments.programs {
        let one = estimate(path, &kinematics)?;
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
    Ok(Outcome::Within)
}

fn estimate(path: &Path, kinematics: &Kinematics) -> Result<Estimated, Refused> {
    let travel = travel_mm_min(path)?;
    let mut timer = Clock::new(kinematics, travel);
    let mut extent = Extent::with_travel(travel);
    let summary = stream(path, &mut |event| {
        timer.event(event);
        if let Event::Move(motion) = event {
            extent.add(motion);
        }
    })?;
    let timing = timer.finish(summary.bytes);
    Ok(Estimated { summary, extent, timing })
}

/// RML-1 has no rapids, so its travel speed has to be found before the text is timed.
fn travel_mm_min(path: &Path) -> Result<Option<f32>, Refused> {
    let mut travel = screenmill::verify::Travel::default();
    let summary = stream(path, &mut |event| {
        if let Event::Move(motion) = event {
            travel.add(motion);
        }
    })?;
    Ok(travel.mm_min().filter(|_| summary.language == Language::Rml1))
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
    let Estimated { summary, extent, timing } = one;
    let limits = timing.limits();
    json!({
        "file": path.display().to_string(), "language": summary.language.to_string(),
        "blocks": summary.blocks, "bytes": summary.bytes,
        "cutting_mm": extent.cutting_mm, "rapid_mm": extent.rapid_mm, "bounds_mm": bounds(extent),
        "time_s": timing.total_s, "cutting_s": timing.cutting_s, "rapid_s": timing.rapid_s,
        "dwell_s": timing.dwell_s, "pauses": timing.pauses,
        "limited_by": limits.first().map(|l| l.0), "parts": parts(&limits),
        "notes": summary.notes.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

fn print(path: &Path, one: &Estimated) {
    let Estimated { summary, extent, timing } = one;
    println!("{}: {}, {} blocks", path.display(), summary.language, summary.blocks);
    println!(
        "  {} ({} cutting {:.1} m, {} rapids {:.1} m, {} dwell)",
        clock(timing.total_s),
        clock(timing.cutting_s),
        1e-3 * extent.cutting_mm,
        clock(timing.rapid_s),
        1e-3 * extent.rapid_mm,
        clock(timing.dwell_s)
    );
    println!("  {}", shares(&timing.limits(), timing.total_s));
    if timing.pauses > 0 {
        println!("  {} stops for the operator, whose time is not counted", timing.pauses);
    }
    for note in &summary.notes {
        println!("  note: {note}");
    }
}
