//! `posts`: the dialects that programs can be written in.

use screenmill::catalogue::{self, Kind};
use screenmill::machine::Machine;
use screenmill::post::Dialect;

use super::{Common, Outcome, Refusal};

/// List the dialects, or show and check one
#[derive(clap::Args)]
pub struct Arguments {
    /// A dialect's name, or the path of a dialect to check
    #[arg(value_name = "NAME|FILE")]
    name: Option<String>,
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    if let Some(name) = &arguments.name {
        let dialect = Dialect::find(name, None)?;
        if common.json {
            println!("{}", serde_json::to_string(&dialect)?);
        } else {
            print!("{}", toml::to_string_pretty(&dialect)?);
        }
        return Ok(Outcome::Within);
    }
    let dialects = catalogue::names(Kind::Dialect)
        .map(|name| Dialect::find(name, None))
        .collect::<Result<Vec<_>, _>>()?;
    if common.json {
        println!("{}", serde_json::json!({ "posts": dialects }));
        return Ok(Outcome::Within);
    }
    let machines = catalogue::names(Kind::Machine)
        .map(|name| Machine::find(name, None))
        .collect::<Result<Vec<_>, _>>()?;
    println!("post       files   grid mm  path tolerance mm  line  read by");
    for dialect in &dialects {
        let readers: Vec<&str> =
            machines.iter().filter(|m| m.reads(&dialect.name)).map(|m| m.name.as_str()).collect();
        println!(
            "{:<10} .{:<6} {:<8} {:<18} {:<5} {}",
            dialect.name,
            dialect.extension,
            dialect.unit_mm,
            dialect.path_tolerance_mm,
            dialect.limits.line_max,
            readers.join(", ")
        );
    }
    Ok(Outcome::Within)
}
