//! What is found on one program: its motions, its wear, its side of the blank, its rounding.

use super::cut::{Motions, TileResult};
use super::plan::{self, Program};
use super::shop::Shop;
use crate::job::{Job, Kind};
use crate::machine::Guard;
use crate::report::{Finding, Severity, finding};
use crate::verify::{Judged, Language, Note, ProgramCut};

/// A bite that is deeper than allowed by less is float noise.
const BITE_MM: f64 = 1e-6;

/// A finding on a program before it is known where its file goes.
pub struct Remark {
    /// Of the program's text.
    line: Option<u32>,
    pub finding: Finding,
}

impl Remark {
    fn new(severity: Severity, code: &'static str, line: Option<u32>, message: String) -> Remark {
        Remark { line, finding: finding(severity, code, message) }
    }

    fn at(self, place_mm: &[f64]) -> Remark {
        Remark { finding: self.finding.at(place_mm), ..self }
    }

    pub fn on(mut self, program: &Program) -> Finding {
        let line = self.line.map_or(String::new(), |line| format!(":{line}"));
        self.finding.message = format!("{}{line}: {}", program.file.display(), self.finding.message);
        self.finding
    }
}

/// Errors of one program's motions.
pub fn of_motions(shop: &Shop, result: &TileResult, post: usize, index: usize) -> Vec<Remark> {
    let tile = &result.tile;
    let program = &result.posts[post].programs[index];
    let Motions { cut, lateral_rapid, body_hit, .. } = &result.motions[post][index];
    let mut found = Vec::new();
    let tool = &shop.tools[program.operation];
    let bounds = plan::bounds_over_stock(&program.extent, tile, program.face);
    let checked = tile.setup.check(&bounds, shop.fixture.sacrificial_mm, &shop.machine);
    if let Err(refusal) = checked {
        found.push(Remark::new(Severity::Error, "travel", None, refusal.to_string()));
    }
    let guard = Guard::new(&tile.setup.obstacles, tool.columns(shop.machine.spindle.nose_diameter_mm));
    let motions = &program.reading.motions;
    let place = |index: usize| plan::over_stock(motions[index].to_mm, tile, program.face);
    let met = guard.first_met(motions.len(), place);
    if let Some(met) = met {
        let message = format!(
            "the {} of {} runs into \"{}\", {:.3} mm below its top ({} mm above the stock); hint: a larger margin_mm, another fixture or a tool that sticks out further",
            met.what, tool.name, met.obstacle, met.below_mm, met.top_mm
        );
        let place = result.in_part([met.at_mm[0], met.at_mm[1]]);
        found.push(Remark::new(Severity::Error, "clamp", Some(motions[met.motion].line), message).at(&place));
    }
    if let Some(hit) = body_hit {
        let longer = if hit.what == "holder" { "that sticks out further" } else { "with a longer neck" };
        let message = format!(
            "the {} of {} is {:.3} mm too deep in the metal beside the cutter; hint: a tool {longer}, an operation that clears more before it, or level = \"plane\"",
            hit.what, tool.name, hit.depth_mm
        );
        let place = result.in_part([hit.at_mm[0], hit.at_mm[1]]);
        found.push(Remark::new(Severity::Error, "holder", Some(hit.line), message).at(&place));
    }
    if let Some(bite) = cut.rapid {
        let message = format!("a rapid goes {:.4} mm deep through the stock", bite.depth_mm);
        let place = result.in_part([bite.at_mm[0], bite.at_mm[1]]);
        found.push(Remark::new(Severity::Error, "rapid-through-stock", Some(bite.line), message).at(&place));
    }
    if let Some(rapid) = lateral_rapid {
        let message = format!("a rapid in X or Y runs {:.4} mm below the stock's top", rapid.below_mm);
        found.push(Remark::new(Severity::Error, "lateral-rapid", Some(rapid.line), message));
    }
    match (shop.kinds[program.operation], cut.touched()) {
        (Kind::Outline, true) => {
            let message = format!("the run in air cuts {:.4} mm deep", cut.deepest_bite_mm());
            found.push(Remark::new(Severity::Error, "outline", None, message));
        }
        (Kind::Outline, false) | (_, true) => {}
        (_, false) => {
            let message = "cuts nothing; hint: leave the operation out".to_string();
            found.push(Remark::new(Severity::Warning, "air", None, message));
        }
    }
    found
}

/// Errors of one program that only its side of the blank, or the slot that it cuts, can show.
pub fn of_face(job: &Job, shop: &Shop, result: &TileResult, post: usize, index: usize) -> Vec<Remark> {
    let program = &result.posts[post].programs[index];
    let mut found = Vec::new();
    let least_mm = job.stock.min_floor_mm;
    if let Some(thin) = result.motions[post][index].thin.filter(|thin| thin.left_mm < least_mm) {
        let message = format!(
            "leaves {:.3} mm of metal under the part's surface, min_floor_mm is {least_mm}; hint: a smaller depth_mm, or a place in the margin",
            thin.left_mm
        );
        found.push(Remark::new(Severity::Error, "floor", None, message).at(&result.in_part(thin.at_mm)));
    }
    // Once, with the last of its sections.
    let last = result.posts[post].programs.iter().rposition(|other| other.operation == program.operation);
    let slots = result.slots[post].iter().filter(|slot| slot.operation == program.operation);
    for slot in slots.filter(|slot| last == Some(index) && !slot.holds()) {
        let message = format!(
            "{} tabs stand in the slot, {} are asked for{}; the tool is {}",
            slot.standing,
            slot.wanted,
            match slot.standing {
                0 => String::new(),
                _ => format!(
                    " (the narrowest is {:.3} mm, the lowest {:.3} mm)",
                    slot.narrowest_mm, slot.lowest_mm
                ),
            },
            shop.tools[program.operation].name
        );
        found.push(Remark::new(Severity::Error, "tabs", None, message));
    }
    found
}

/// How far the controller's grid turns the mirrors, as planned: what an operator can know before the cut.
pub fn of_rounding(result: &TileResult, program: &Program) -> Option<Remark> {
    let tilt = program.tilt?;
    let (rms_deg, worst) = (tilt.rms_deg()?, tilt.worst?);
    let message = format!(
        "rounding and simplification turn mirrors along the passes by {rms_deg:.3} degrees rms, at most {:.3} degrees over {:.2} mm",
        worst.deg, worst.length_mm
    );
    let note = Remark::new(Severity::Note, "rounding-tilt", None, message);
    Some(note.at(&result.in_part(worst.at_mm)))
}

/// A length with as many decimals, three at most, as set it apart from the limit that it is over.
fn shown(length: f64, limit: f64) -> String {
    let exceeds = |text: &String| text.parse().is_ok_and(|value: f64| value > limit);
    let texts = (0..3).map(|decimals| format!("{length:.decimals$}"));
    texts.into_iter().find(exceeds).unwrap_or_else(|| format!("{length:.3}"))
}

/// What a program asks of its cutter, and what its reader noticed.
pub fn of_wear(shop: &Shop, program: &Program, cut: &ProgramCut) -> Vec<Remark> {
    let tool = &shop.tools[program.operation];
    let mut found = Vec::new();
    if let Some(most_mm) = tool.max_depth_mm
        && let Some(bite) = cut.deepest()
        && bite.depth_mm > most_mm + BITE_MM
    {
        let message = format!(
            "{} bites {} mm deep at once, its max_depth_mm is {most_mm}; hint: a semi-finish (stock_to_leave_mm) before it that leaves less",
            tool.name,
            shown(bite.depth_mm, most_mm)
        );
        found.push(Remark::new(Severity::Warning, "bite", Some(bite.line), message));
    }
    let length_m = program.extent.cutting_mm * 1e-3;
    if let Some(life_m) = tool.tool_life_m
        && length_m > life_m
    {
        let message = format!(
            "{} m of cut without a retract, {} lasts {life_m} m; hint: pattern = \"one-way\" can be cut in sections at every pass",
            shown(length_m, life_m),
            tool.name
        );
        found.push(Remark::new(Severity::Warning, "tool-life", None, message));
    }
    if let Some(section) = program.section.filter(|section| section.index == 1) {
        let message = format!(
            "the first of {} sections; the setup sheet says where a fresh {} begins",
            section.count, tool.name
        );
        found.push(Remark::new(Severity::Note, "sections", None, message));
    }
    let gcode = program.reading.summary.language == Language::GCode;
    let air = shop.kinds[program.operation] == Kind::Outline;
    let feeds = Judged::new(&program.reading, tool.shape, [0.0; 3]).feeds();
    for (fastest, most, key) in [
        (feeds.lateral, tool.feed_mm_min, "feed_mm_min"),
        (feeds.plunge, tool.plunge_mm_min, "plunge_mm_min"),
    ] {
        // Nothing is cut in air, and there RML-1 does not tell the way from one round to the next from the rounds.
        let over = fastest.filter(|fastest| fastest.feed_mm_min > most + 1e-3 && (gcode || !air));
        if let Some(fastest) = over {
            let message =
                format!("feeds {} mm/min, the {key} of {} is {most}", fastest.feed_mm_min, tool.name);
            found.push(Remark::new(Severity::Warning, "feed", Some(fastest.line), message));
        }
    }
    if let Some(bite) = cut.plunge.filter(|bite| bite.depth_mm > tool.shape.radius_mm()) {
        let message = format!(
            "plunges {:.3} mm straight down into solid, more than the radius of {}; hint: a smaller stepdown",
            bite.depth_mm, tool.name
        );
        found.push(Remark::new(Severity::Warning, "plunge", Some(bite.line), message));
    }
    let spindle_off = |note: &&Note| matches!(note, Note::SpindleOff { .. });
    let notes = &program.reading.summary.notes;
    // RML-1 says nothing of it: its moves are the same in air and in metal.
    if air && gcode && !notes.iter().any(|note| spindle_off(&note)) {
        let message =
            "the spindle turns in the run in air; hint: a dialect whose start block minds {% if spindle %}";
        found.push(Remark::new(Severity::Warning, "spindle", None, message.into()));
    }
    for note in notes.iter().filter(|note| !(air && spindle_off(note))) {
        found.push(Remark::new(Severity::Note, "program", None, note.to_string()));
    }
    found
}
