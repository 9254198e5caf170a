//! `machines`: the machines that programs can be written for.

use std::path::Path;

use screenmill::catalogue::{self, Kind};
use screenmill::machine::{Machine, SpindleLaw};
use screenmill::post::Dialect;

use super::{Common, Outcome, Refusal};

/// List the machines, or explain and check one
#[derive(clap::Args)]
pub struct Arguments {
    /// A machine's name, or the path of a profile to check
    #[arg(value_name = "NAME|FILE")]
    name: Option<String>,
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    if let Some(name) = &arguments.name {
        let machine = Machine::find(name, None)?;
        // As a job beside the file finds them.
        let folder = Path::new(name).parent();
        for dialect in &machine.dialects {
            Dialect::find(dialect, folder)?;
        }
        if common.json {
            println!("{}", serde_json::to_string(&machine)?);
        } else {
            for line in explained(&machine) {
                println!("{}", format!("# {line}").trim_end());
            }
            print!("\n{}", toml::to_string_pretty(&machine)?);
        }
        return Ok(Outcome::Within);
    }
    let machines = catalogue::names(Kind::Machine)
        .map(|name| Machine::find(name, None))
        .collect::<Result<Vec<_>, _>>()?;
    if common.json {
        println!("{}", serde_json::json!({ "machines": machines }));
        return Ok(Outcome::Within);
    }
    println!(
        "machine         travel mm             feed mm/min    spindle rpm            posts; * verify against your machine"
    );
    for machine in &machines {
        let star = |unconfirmed| if unconfirmed { "*" } else { "" };
        let travel = format!(
            "{} x {} x {}{}",
            machine.travel.x_mm,
            machine.travel.y_mm,
            machine.travel.z_mm,
            star(machine.travel.unconfirmed)
        );
        let feed = format!(
            "{} .. {}{}",
            machine.rate.feed_min_mm_min,
            machine.rate.feed_xy_max_mm_min,
            star(machine.rate.unconfirmed)
        );
        let hand = if machine.spindle.set == SpindleLaw::ByHand { " by hand" } else { "" };
        let rpm = format!(
            "{} .. {}{}{hand}",
            machine.spindle.rpm_min,
            machine.spindle.rpm_max,
            star(machine.spindle.unconfirmed)
        );
        println!("{:<15} {travel:<21} {feed:<14} {rpm:<22} {}", machine.name, machine.dialects.join(", "));
    }
    println!("\nscreenmill machines NAME explains one.");
    Ok(Outcome::Within)
}

/// A machine in words; the file itself follows.
fn explained(machine: &Machine) -> Vec<String> {
    let Machine { travel, rate, spindle, .. } = machine;
    let seconds = |mm_min: f64| format!("{mm_min} mm/min ({:.1} mm/s)", mm_min / 60.0);
    let law = match spindle.set {
        SpindleLaw::Rpm => "the program names rpm".into(),
        SpindleLaw::ByHand => "set by hand".into(),
        SpindleLaw::CodeFrom0 => {
            let step = (spindle.rpm_max - spindle.rpm_min) / 15.0;
            format!("!RC codes 0 to 15, {step:.1} rpm apart")
        }
        SpindleLaw::CodeFrom1 => {
            let step = (spindle.rpm_max - spindle.rpm_min) / 14.0;
            format!("!RC codes 1 to 15, {step:.1} rpm apart")
        }
    };
    let mut lines = vec![
        format!("{}: {}", machine.name, machine.title),
        String::new(),
        format!("travel     {} x {} x {} mm", travel.x_mm, travel.y_mm, travel.z_mm),
        format!(
            "feeds      from {}; X and Y to {}, Z to {}",
            rate.feed_min_mm_min,
            seconds(rate.feed_xy_max_mm_min),
            seconds(rate.feed_z_max_mm_min)
        ),
        format!("spindle    {} to {} rpm, {law}", spindle.rpm_min, spindle.rpm_max),
        format!("posts      {}; the first unless a job asks for another", machine.dialects.join(", ")),
    ];
    lines.extend(machine.notes.iter().map(|note| format!("note       {note}")));
    let figures = machine.unconfirmed_figures();
    if !figures.is_empty() {
        lines.push(String::new());
        lines.push("No source confirms these: verify against your machine.".into());
        lines.extend(figures.iter().map(|figure| format!("  {figure}")));
    }
    lines
}
