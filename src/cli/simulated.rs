//! One program of a simulation: what it does to stock and part by itself, and what is told of it.

use screenmill::cutter::Shape;
use screenmill::machine::Machine;
use screenmill::report::{Finding, Severity, finding};
use screenmill::verify::{Blank, Extent, Feeds, PathMode, ProgramCut, Reading, Timing};
use serde_json::{Value, json};

use super::program::{bounds, past_travel};

pub(super) struct Program {
    pub file: String,
    pub cutter: Shape,
    pub reading: Reading,
    pub extent: Extent,
    pub timing: Option<Timing>,
    /// Lowest and highest x and y of the feed motions in the part's frame.
    pub worked_mm: Option<[[f64; 2]; 2]>,
    pub cut: ProgramCut,
}

impl Program {
    /// What this program does to stock and part by itself.
    pub fn findings(&self, blank: &Blank, zero_mm: [f64; 3], findings: &mut Vec<Finding>) {
        let file = &self.file;
        if let Some(hit) = self.cut.rapid {
            let message = format!(
                "{file} line {}: a rapid cuts {:.4} mm into the stock at x {:.3}, y {:.3}",
                hit.line, hit.depth_mm, hit.at_mm[0], hit.at_mm[1]
            );
            findings.push(finding(Severity::Error, "rapid-through-stock", message).at(&hit.at_mm));
        }
        let last_mm = self.reading.motions.last().map_or(f64::NAN, |motion| motion.to_mm[2] + zero_mm[2]);
        if last_mm < blank.top_mm - 1e-6 {
            let message = format!(
                "{file} ends with the cutter {:.4} mm below the stock's top; hint: is the file complete?",
                blank.top_mm - last_mm
            );
            findings.push(finding(Severity::Warning, "ends-low", message));
        }
        if let Some(bite) = self.cut.plunge.filter(|bite| bite.depth_mm > self.cutter.radius_mm()) {
            let message = format!(
                "{file} line {}: plunges {:.4} mm straight down into solid, more than the radius of {}; hint: a ramp, or an operation before it",
                bite.line, bite.depth_mm, self.cutter
            );
            findings.push(finding(Severity::Warning, "plunge", message).at(&bite.at_mm));
        }
        let part = [0, 1].map(|axis| [blank.low_mm[axis], blank.high_mm[axis]]);
        // A program without a feed motion works nowhere.
        let [low, high] = self.worked_mm.unwrap_or([[f64::NAN; 2]; 2]);
        let place = [0, 1].map(|axis| [low[axis], high[axis]]);
        let reach = self.cutter.radius_mm();
        let beside = (0..2)
            .any(|axis| place[axis][1] + reach < part[axis][0] || place[axis][0] - reach > part[axis][1]);
        if beside {
            let message = format!(
                "{file} cuts x {:.3} .. {:.3}, y {:.3} .. {:.3} in the part's frame, the part is {:.3} x {:.3} mm; \
                 hint: another part, or another --zero",
                place[0][0], place[0][1], place[1][0], place[1][1], part[0][1], part[1][1]
            );
            findings.push(finding(Severity::Error, "elsewhere", message));
        } else if !self.cut.touched() {
            let message = format!(
                "{file} cuts nothing: its lowest point is z {:.3} in the part's frame, the stock's top {:.3}; \
                 hint: another --zero or --stock-top-mm, or it ran before",
                self.extent.low_mm[2] + zero_mm[2],
                blank.top_mm
            );
            findings.push(finding(Severity::Warning, "cuts-nothing", message));
        }
        let centre = |span: [f64; 2]| 0.5 * (span[0] + span[1]);
        let off = [0, 1].map(|axis| centre(place[axis]) - centre(part[axis]));
        let size = [0, 1].map(|axis| part[axis][1] - part[axis][0]);
        if !beside && (0..2).any(|axis| off[axis].abs() > 0.25 * size[axis] + reach) {
            let message = format!(
                "{file} is centred {:.3} mm in x and {:.3} mm in y off the part's middle; hint: another part or --zero?",
                off[0], off[1]
            );
            findings.push(finding(Severity::Warning, "off-centre", message));
        }
        let unbounded =
            |mode: &&(usize, PathMode)| matches!(mode.1, PathMode::Blend { tolerance_mm: None, .. });
        if self.reading.path_modes.iter().find(unbounded).is_some() {
            let message = format!(
                "{file}: G64 without P lets the controller cut corners without bound; hint: G64 P0.001"
            );
            findings.push(finding(Severity::Warning, "path-tolerance", message));
        }
        for note in &self.reading.summary.notes {
            findings.push(finding(Severity::Note, "program", format!("{file} {note}")));
        }
    }

    pub fn travel(&self, machine: &Machine, findings: &mut Vec<Finding>) {
        for past in past_travel(&self.extent, self.reading.summary.language, machine) {
            let severity = if past.harmless { Severity::Note } else { Severity::Error };
            findings.push(finding(severity, "travel", format!("{} {}", self.file, past.message)));
        }
    }

    /// Feeds that the machine does not reach.
    pub fn too_fast(&self, machine: &Machine, feeds: &Feeds, findings: &mut Vec<Finding>) {
        let rate = &machine.rate;
        for (fastest, most, way) in [
            (feeds.lateral, rate.feed_xy_max_mm_min, "in X and Y"),
            (feeds.plunge, rate.feed_z_max_mm_min, "straight down"),
        ] {
            if let Some(fastest) = fastest.filter(|fastest| fastest.feed_mm_min > most * (1.0 + 1e-6)) {
                let message = format!(
                    "{} line {}: a feed of {} mm/min {way}, {} goes up to {most}",
                    self.file, fastest.line, fastest.feed_mm_min, machine.name
                );
                findings.push(finding(Severity::Warning, "feed", message));
            }
        }
    }

    pub fn path_tolerance_mm(&self) -> f64 {
        self.reading.path_modes.iter().fold(0.0, |most, (_, mode)| match mode {
            PathMode::Blend { tolerance_mm, merge_mm } => {
                most.max(tolerance_mm.unwrap_or(0.0) + merge_mm.unwrap_or(0.0))
            }
            _ => most,
        })
    }

    pub fn written(&self) -> Value {
        json!({
            "file": self.file, "language": self.reading.summary.language.to_string(),
            "cutter": self.cutter.to_string(), "blocks": self.reading.summary.blocks,
            "bytes": self.reading.summary.bytes, "cutting_mm": self.extent.cutting_mm,
            "rapid_mm": self.extent.rapid_mm, "time_s": self.timing.map(|t| t.total_s),
            "deepest_bite_mm": self.cut.deepest_bite_mm(), "bounds_mm": bounds(&self.extent),
        })
    }
}
