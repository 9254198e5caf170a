use super::dialect::{Comment, Dialect};
use super::{Program, ZZero};
use crate::machine::{Bounds, Machine};

/// Room for a time of up to some thousand hours.
const TIME_WIDTH: usize = 20;

/// What the operator reads above a program, and where its time can be filled in later: only the text
/// read back says how long it runs.
#[derive(Default)]
pub(super) struct Header {
    pub lines: Vec<String>,
    /// Line, and byte in it, of [`TIME_WIDTH`] bytes.
    pub time_at: Option<(usize, usize)>,
}

/// The text of a time, as wide as the room for it.
pub(super) fn time(comment: &Comment, dialect: &Dialect, seconds: Option<f64>) -> String {
    let text = match seconds {
        None => "not estimated".into(),
        Some(seconds) => {
            let whole = seconds.max(0.0).round() as u64;
            format!("{} h {:02} min {:02} s", whole / 3600, whole / 60 % 60, whole % 60)
        }
    };
    comment.clean(&format!("{text:>TIME_WIDTH$}"), &dialect.limits)
}

/// The header, without line endings; nothing for a dialect without comments.
pub(super) fn header(
    program: &Program,
    dialect: &Dialect,
    machine: &Machine,
    bounds: &Bounds,
    sha256: &str,
) -> Header {
    let Some(comment) = &dialect.comment else { return Header::default() };
    let mut lines = Vec::new();
    let mut time_at = None;
    for (label, text) in facts(program, dialect, machine, bounds, sha256) {
        if label == TIME {
            time_at = Some((lines.len(), comment.open.len() + label.len() + comment.label.len()));
            let text = time(comment, dialect, None);
            lines.push(comment.line(&format!("{label}{}{text}", comment.label), &dialect.limits));
            continue;
        }
        wrap(&mut lines, comment, dialect, &format!("{label}{}{text}", comment.label));
    }
    Header { lines, time_at }
}

const TIME: &str = "estimated time";

fn facts(
    program: &Program,
    dialect: &Dialect,
    machine: &Machine,
    bounds: &Bounds,
    sha256: &str,
) -> Vec<(String, String)> {
    let Program { tool, stock, .. } = program;
    let mut facts: Vec<(&str, String)> = vec![
        (
            "screenmill",
            format!("{}, post {}, machine {}", env!("CARGO_PKG_VERSION"), dialect.name, machine.name),
        ),
        ("part", program.part.into()),
        ("tile", program.tile.into()),
        ("operation", program.operation.into()),
    ];
    if let Some(section) = program.section {
        let cutter = if section.index == 1 {
            ""
        } else if section.fresh_cutter {
            ", fit a fresh cutter and set Z0 again"
        } else {
            ", goes on with the same cutter"
        };
        facts.push(("section", format!("{} of {}{cutter}", section.index, section.count)));
    }
    let number = tool.number.map_or(String::new(), |n| format!("T{n} "));
    let flutes = tool.flutes.map_or(String::new(), |n| format!(", {n} flutes"));
    facts.push(("tool", format!("{number}{}, {}{flutes}", tool.name, shape(&tool.shape))));
    if let Some(body) = tool.body {
        let text = format!(
            "{} mm, neck {} x {} mm, shank {} mm",
            body.stick_out_mm, body.neck_diameter_mm, body.neck_length_mm, body.shank_diameter_mm
        );
        facts.push(("stick-out", text));
    }
    facts.push((
        "stock",
        format!(
            "{} {} x {} x {} mm, {} mm above the part",
            stock.material,
            short(stock.width_mm),
            short(stock.height_mm),
            stock.thickness_mm,
            stock.top_allowance_mm
        ),
    ));
    let zero = match program.z_zero {
        ZZero::StockTop => "top of the stock",
        ZZero::PartTop => "highest point of the part",
    };
    facts.push(("zero", format!("X0 Y0 lower left corner of the tile, Z0 {zero}")));
    if !dialect.wcs.is_empty() {
        facts.push(("wcs", program.wcs.into()));
    }
    facts.push(("units", "mm, mm/min".into()));
    let range = |axis: usize| format!("{} to {}", short(bounds.low_mm[axis]), short(bounds.high_mm[axis]));
    facts.push(("bounds", format!("X {}, Y {}, Z {}", range(0), range(1), range(2))));
    let feeds = format!(
        "{} mm/min, plunge {} mm/min, {} rpm",
        tool.feed_mm_min, tool.plunge_mm_min, tool.spindle_rpm
    );
    facts.push(("feed", feeds));
    if let (Some(coolant), None) = (&machine.coolant, dialect.coolant(machine)) {
        facts.push(("coolant", format!("{} is not known to the controller, switch it by hand", coolant.on)));
    }
    facts.push((TIME, String::new()));
    let z_zero = if machine.tool_changer {
        "the tool's length offset has to be measured, X0 Y0 stay as they are"
    } else {
        "set Z0 again whenever a tool has been fitted, leave X0 Y0 as they are"
    };
    facts.push(("z", z_zero.into()));
    let unconfirmed = machine.unconfirmed();
    if !unconfirmed.is_empty() {
        facts.push(("verify against your machine", unconfirmed.join(", ")));
    }
    for (label, text) in program.notes {
        facts.push((label, text.clone()));
    }
    facts.push(("sha256 of all lines below", sha256.into()));
    facts.into_iter().map(|(label, text)| (label.to_string(), text)).collect()
}

fn shape(shape: &crate::cutter::Shape) -> String {
    use crate::cutter::Shape::*;
    match *shape {
        Ball { diameter_mm } => format!("ball D{diameter_mm} corner R{}", 0.5 * diameter_mm),
        Flat { diameter_mm } => format!("flat D{diameter_mm} corner R0"),
        Bull { diameter_mm, corner_radius_mm } => format!("bull D{diameter_mm} corner R{corner_radius_mm}"),
        Vee { included_angle_deg, tip_diameter_mm, diameter_mm } => {
            format!("vee {included_angle_deg} deg tip D{tip_diameter_mm} to D{diameter_mm}")
        }
        Taper { tip_diameter_mm, half_angle_deg, diameter_mm } => {
            format!("tapered ball D{tip_diameter_mm} {half_angle_deg} deg a side to D{diameter_mm}")
        }
    }
}

/// At most four decimals, without zeros at the end.
fn short(value_mm: f64) -> String {
    let text = format!("{value_mm:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

/// Text as comment lines that the controller can take, broken between words where there are any.
fn wrap(lines: &mut Vec<String>, comment: &Comment, dialect: &Dialect, text: &str) {
    let text = comment.clean(text, &dialect.limits);
    let room = dialect.limits.line_max - comment.open.len() - comment.close.len() - CONTINUED.len();
    let mut rest = text.trim_end();
    let mut prefix = "";
    while !rest.is_empty() {
        let end = if rest.len() <= room {
            rest.len()
        } else {
            rest[..=room].rfind(' ').filter(|&at| at > 0).unwrap_or(room)
        };
        lines.push(format!("{}{prefix}{}{}", comment.open, rest[..end].trim_end(), comment.close));
        rest = rest[end..].trim_start();
        prefix = CONTINUED;
    }
}

/// Before the rest of a text that is broken, since LinuxCNC runs a comment that begins with MSG,
/// LOG, PRINT or DEBUG.
const CONTINUED: &str = "- ";
