//! `fixtures`: the workholding that setups can be planned for.

use screenmill::catalogue::{self, Kind};
use screenmill::machine::Fixture;

use super::{Common, Outcome, Refusal};

/// List the fixtures, or show and check one
#[derive(clap::Args)]
pub struct Arguments {
    /// A fixture's name, or the path of a fixture to check
    #[arg(value_name = "NAME|FILE")]
    name: Option<String>,
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    if let Some(name) = &arguments.name {
        let fixture = Fixture::find(name, None)?;
        if common.json {
            println!("{}", serde_json::to_string(&fixture)?);
        } else {
            print!("{}", toml::to_string_pretty(&fixture)?);
        }
        return Ok(Outcome::Within);
    }
    let fixtures = catalogue::names(Kind::Fixture)
        .map(|name| Fixture::find(name, None))
        .collect::<Result<Vec<_>, _>>()?;
    if common.json {
        println!("{}", serde_json::json!({ "fixtures": fixtures }));
        return Ok(Outcome::Within);
    }
    println!("fixture       border mm  height mm  clamps  boxes  what it is");
    for fixture in &fixtures {
        println!(
            "{:<13} {:<10} {:<10} {:<7} {:<6} {}",
            fixture.name,
            format!("{}, {}", fixture.border_mm.x, fixture.border_mm.y),
            fixture.height_mm,
            fixture.clamp.len(),
            fixture.keep_out.len(),
            fixture.title
        );
    }
    Ok(Outcome::Within)
}
