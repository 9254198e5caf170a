//! `machines`: the machines that programs can be written for.

use screenmill::catalogue::{self, Kind};
use screenmill::machine::{Machine, SpindleLaw};

use super::{Common, Outcome, Refusal};

/// List the machines, or show and check one
#[derive(clap::Args)]
pub struct Arguments {
    /// A machine's name, or the path of a profile to check
    #[arg(value_name = "NAME|FILE")]
    name: Option<String>,
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    if let Some(name) = &arguments.name {
        let machine = Machine::find(name, None)?;
        if common.json {
            println!("{}", serde_json::to_string(&machine)?);
        } else {
            print!("{}", toml::to_string_pretty(&machine)?);
            print_unconfirmed(&machine);
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
        "machine          travel mm            feed mm/min      spindle rpm    posts; * verify against your machine"
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
        println!("{:<16} {travel:<20} {feed:<16} {rpm:<22} {}", machine.name, machine.dialects.join(", "));
    }
    Ok(Outcome::Within)
}

fn print_unconfirmed(machine: &Machine) {
    let sections = machine.unconfirmed();
    if !sections.is_empty() {
        println!("\n# No source confirms {}: verify against your machine.", sections.join(", "));
    }
}
