//! `posts`: the dialects that programs can be written in.

use screenmill::catalogue::{self, Kind};
use screenmill::machine::Machine;
use screenmill::post::{Dialect, Feed, FeedUnit, LengthUnit, LineCounts, Motion, Number, Place, Point, When};

use super::{Common, Outcome, Refusal};

/// List the dialects, or explain and check one
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
            for line in explained(&dialect) {
                println!("{}", format!("# {line}").trim_end());
            }
            print!("\n{}", toml::to_string_pretty(&dialect)?);
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
    println!("post       files   grid mm  path tolerance mm  line  read by; * parts of it are not confirmed");
    for dialect in &dialects {
        let readers: Vec<&str> =
            machines.iter().filter(|m| m.reads(&dialect.name)).map(|m| m.name.as_str()).collect();
        let star = if dialect.unconfirmed.is_empty() { "" } else { "*" };
        println!(
            "{:<10} .{:<6} {:<8} {:<18} {:<5} {}",
            format!("{}{star}", dialect.name),
            dialect.extension,
            dialect.unit_mm,
            dialect.path_tolerance_mm,
            dialect.limits.line_max,
            if readers.is_empty() { "machines of your own".into() } else { readers.join(", ") }
        );
    }
    println!("\nscreenmill posts NAME explains one: words, limits, blocks.");
    Ok(Outcome::Within)
}

/// A dialect in words; the file itself follows.
fn explained(dialect: &Dialect) -> Vec<String> {
    let (word, limits) = (&dialect.word, &dialect.limits);
    let mut lines = vec![
        format!("{}: {}", dialect.name, dialect.title),
        String::new(),
        format!("{:<9} {:<7} {:<14} {:<19} {:<13} example", "word", "letter", "counts", "numbers", "written"),
        motion("rapid", &word.rapid),
        motion("cut", &word.cut),
    ];
    for (name, number) in [("x", &word.x), ("y", &word.y), ("z", &word.z)] {
        lines.push(coordinate(name, number, dialect.unit_mm));
    }
    lines.push(feed(&word.feed));
    lines.push(String::new());
    let mm = limits.value_max as f64 * dialect.unit_mm;
    lines.push(format!("grid       {} mm; toolpaths are laid on it", dialect.unit_mm));
    let counted = match limits.line_counts {
        LineCounts::Bytes => "",
        LineCounts::Words => " (read: without blanks and comments)",
    };
    lines.push(format!(
        "lines      at most {} bytes{counted}, ended by {:?}",
        limits.line_max, dialect.line_ending
    ));
    lines.push(format!("range      coordinates within +-{mm} mm; dwells up to {} s", limits.dwell_max_s));
    if !limits.missing.is_empty() {
        lines.push(format!("not known  {}", limits.missing.join(" ")));
    }
    if !limits.forbidden.is_empty() {
        lines.push(format!("never sent {}", limits.forbidden));
    }
    lines.push(match &dialect.comment {
        None => "comments   none: what is not a command would be run".into(),
        Some(comment) if comment.upper_case => {
            format!("comments   {}TEXT{}, capital letters", comment.open, comment.close)
        }
        Some(comment) => format!("comments   {}text{}", comment.open, comment.close),
    });
    lines.push(match dialect.path_tolerance_mm + dialect.merge_tolerance_mm {
        0.0 => "path       kept by the controller, as far as anybody states".into(),
        mm => format!("path       left by at most {mm} mm, which the gouge budget counts"),
    });
    if dialect.wcs.is_empty() {
        lines.push("offsets    none in the text: the origin is set on the machine".into());
    } else {
        lines.push(format!("offsets    {}", dialect.wcs.join(" ")));
    }
    for note in &dialect.notes {
        lines.push(format!("note       {note}"));
    }
    if !dialect.unconfirmed.is_empty() {
        let keys = dialect.unconfirmed.join(", ");
        lines.push(format!("           no source confirms {keys}: verify against your machine"));
    }
    lines
}

fn when(when: When) -> &'static str {
    match when {
        When::Always => "always",
        When::Changed => "when changed",
    }
}

fn motion(name: &str, motion: &Motion) -> String {
    row(name, &motion.letter, "", "", when(motion.when), &motion.letter)
}

fn coordinate(name: &str, number: &Number, unit_mm: f64) -> String {
    let (counts, example) = match number.unit {
        LengthUnit::Mm => ("mm".to_string(), spelled(1.5, number.decimals, number.point)),
        LengthUnit::Grid => (format!("{unit_mm} mm"), format!("{}", (1.5 / unit_mm).round())),
    };
    let numbers = numbers(number.decimals, number.point);
    let example = format!("{}{example}", number.letter);
    row(name, &number.letter, &counts, &numbers, when(number.when), &format!("{example} is 1.5 mm"))
}

fn feed(feed: &Feed) -> String {
    let (counts, value) = match feed.unit {
        FeedUnit::MmMin => ("mm/min", 300.0),
        FeedUnit::MmS => ("mm/s", 5.0),
    };
    let place = match feed.place {
        Place::Line => "",
        Place::OwnLine => ", own line",
    };
    let example = format!("{}{} is 300 mm/min", feed.letter, spelled(value, feed.decimals, feed.point));
    let written = format!("{}{place}", when(feed.when));
    row("feed", &feed.letter, counts, &numbers(feed.decimals, feed.point), &written, &example)
}

fn row(name: &str, letter: &str, counts: &str, numbers: &str, written: &str, example: &str) -> String {
    let letter = if letter.is_empty() { "-" } else { letter };
    format!("{name:<9} {letter:<7} {counts:<14} {numbers:<19} {written:<13} {example}")
}

fn numbers(decimals: u32, point: Point) -> String {
    match (decimals, point) {
        (0, Point::Fraction) => "whole".into(),
        (_, Point::Always) => format!("{decimals} decimals, point"),
        (_, Point::Fraction) => format!("{decimals} decimals"),
    }
}

fn spelled(value: f64, decimals: u32, point: Point) -> String {
    let text = format!("{value:.*}", decimals.min(9) as usize);
    let short = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    match point {
        Point::Always if !short.contains('.') && decimals > 0 => format!("{short}.0"),
        Point::Always if !short.contains('.') => format!("{short}."),
        _ => short.into(),
    }
}
