//! `tools`: the cutters of a library.

use screenmill::machine::{Library, Tool};

use super::{Common, Outcome, Refusal};

/// List the tools of a library, or show one
#[derive(clap::Args)]
pub struct Arguments {
    /// A tool's name
    #[arg(value_name = "NAME")]
    name: Option<String>,
    /// The library: a name, or the path of a file to check
    #[arg(long, value_name = "FILE", default_value = "tools")]
    library: String,
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let library = Library::find(&arguments.library, None)?;
    if let Some(name) = &arguments.name {
        let tool = library.tool(name)?;
        if common.json {
            println!("{}", facts(tool));
        } else {
            print_whole(tool);
        }
        return Ok(Outcome::Within);
    }
    if common.json {
        let tools: Vec<serde_json::Value> = library.tools.iter().map(facts).collect();
        let whole = serde_json::json!({
            "title": library.title, "source": library.source, "unconfirmed": library.unconfirmed, "tools": tools,
        });
        println!("{whole}");
        return Ok(Outcome::Within);
    }
    println!("{}", library.title);
    if library.unconfirmed {
        println!("unconfirmed: {}", library.source);
    }
    println!(
        "tool       no  cutter        feed, plunge mm/min  rpm     depth mm  neck mm     shank  stick-out  life m"
    );
    for tool in &library.tools {
        let neck =
            tool.body.map_or(String::new(), |b| format!("{} x {}", b.neck_diameter_mm, b.neck_length_mm));
        println!(
            "{:<10} {:<3} {:<13} {:<20} {:<7} {:<9} {neck:<11} {:<6} {:<10} {}",
            tool.name,
            text(tool.number),
            tool.shape.to_string(),
            format!("{}, {}", tool.feed_mm_min, tool.plunge_mm_min),
            tool.spindle_rpm,
            text(tool.max_depth_mm),
            text(tool.body.map(|b| b.shank_diameter_mm)),
            text(tool.body.map(|b| b.stick_out_mm)),
            text(tool.tool_life_m)
        );
    }
    Ok(Outcome::Within)
}

fn text(value: Option<impl ToString>) -> String {
    value.map_or("-".into(), |value| value.to_string())
}

fn facts(tool: &Tool) -> serde_json::Value {
    serde_json::json!({
        "name": tool.name,
        "number": tool.number,
        "cutter": tool.shape.to_string(),
        "flutes": tool.flutes,
        "neck_diameter_mm": tool.body.map(|b| b.neck_diameter_mm),
        "neck_length_mm": tool.body.map(|b| b.neck_length_mm),
        "shank_diameter_mm": tool.body.map(|b| b.shank_diameter_mm),
        "stick_out_mm": tool.body.map(|b| b.stick_out_mm),
        "feed_mm_min": tool.feed_mm_min,
        "plunge_mm_min": tool.plunge_mm_min,
        "spindle_rpm": tool.spindle_rpm,
        "max_depth_mm": tool.max_depth_mm,
        "tool_life_m": tool.tool_life_m,
    })
}

fn print_whole(tool: &Tool) {
    if let serde_json::Value::Object(facts) = facts(tool) {
        for (key, value) in facts {
            println!("{key} = {value}");
        }
    }
}
