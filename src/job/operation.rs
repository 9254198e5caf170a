use serde::Deserialize;

use super::Error;
use crate::settings::Source;

/// One operation, cut with one tool in one program a tile. Which keys go with which kind is checked
/// when the job is read.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Operation {
    pub kind: Kind,
    /// An entry of the tool library, or an inline cutter such as `ball:1`.
    pub tool: String,
    pub stepdown_mm: Option<f64>,
    pub stepover_mm: Option<f64>,
    pub scallop_mm: Option<f64>,
    /// What the cutters before may leave where a rest operation does not go.
    pub leftover_mm: Option<f64>,
    #[serde(default)]
    pub stock_to_leave_mm: f64,
    #[serde(default)]
    pub direction_deg: f64,
    #[serde(default)]
    pub pattern: Pattern,
    /// How steeply roughing goes down into solid metal; 90 is straight down.
    pub ramp_deg: Option<f64>,
    pub feed_mm_min: Option<f64>,
    pub plunge_mm_min: Option<f64>,
    pub spindle_rpm: Option<f64>,
    /// Which side of the blank holes and marks go into.
    #[serde(default)]
    pub face: Face,
    /// Of holes and marks, from that face.
    pub depth_mm: Option<f64>,
    /// Middles of holes in the tile's frame, as seen from its top.
    #[serde(default)]
    pub holes_mm: Vec<[f64; 2]>,
    /// Holes and marks in the middle of the margin.
    #[serde(default)]
    pub places: Vec<Place>,
    /// Of holes; the cutter's own if left out.
    pub diameter_mm: Option<f64>,
    /// Of the letters of a mark.
    pub height_mm: Option<f64>,
    /// Of an outline run, over the stock's top.
    pub above_mm: Option<f64>,
    /// How far a cut-out goes past the blank's underside; below 0 it leaves a skin.
    pub through_mm: Option<f64>,
    /// On each side of the tile.
    pub tabs: Option<u32>,
    pub tab_width_mm: Option<f64>,
    /// From the blank's underside.
    pub tab_height_mm: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    Rough,
    Finish,
    /// Passes of a finer cutter where those before it could not reach.
    Rest,
    /// A run round the tile and round all that is cut, in air, with the spindle off.
    Outline,
    /// Holes, for dowels say, in the margin or in the underside.
    Drill,
    /// The tile's name and an arrow that points up, engraved.
    Mark,
    /// A slot around the tile through the blank, with tabs.
    CutOut,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pattern {
    #[default]
    Zigzag,
    OneWay,
}

/// A side of the blank that is turned up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Face {
    #[default]
    Top,
    /// The blank is turned over left to right.
    Underside,
}

/// A place in the margin as seen from the tile's top; front is the low Y.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Place {
    Left,
    Right,
    Front,
    Back,
    FrontLeft,
    FrontRight,
    BackLeft,
    BackRight,
    /// The tile's own middle.
    Centre,
}

impl Kind {
    /// The word of the job file.
    pub fn word(self) -> &'static str {
        match self {
            Kind::Rough => "rough",
            Kind::Finish => "finish",
            Kind::Rest => "rest",
            Kind::Outline => "outline",
            Kind::Drill => "drill",
            Kind::Mark => "mark",
            Kind::CutOut => "cut-out",
        }
    }

    /// Whether it makes the part's surface.
    pub fn shapes(self) -> bool {
        matches!(self, Kind::Rough | Kind::Finish | Kind::Rest)
    }

    /// Whether it cuts the tile's own blank beside the surface.
    pub fn beside(self) -> bool {
        matches!(self, Kind::Drill | Kind::Mark | Kind::CutOut)
    }
}

impl Operation {
    pub(super) fn check(&self, source: &Source, index: usize) -> Result<(), Error> {
        let ranges = [
            ("stepdown_mm", self.stepdown_mm, 1e-3, 50.0),
            ("stepover_mm", self.stepover_mm, 1e-3, 100.0),
            ("scallop_mm", self.scallop_mm, 1e-6, 10.0),
            ("leftover_mm", self.leftover_mm, 1e-4, 10.0),
            ("stock_to_leave_mm", Some(self.stock_to_leave_mm), 0.0, 10.0),
            ("direction_deg", Some(self.direction_deg), -360.0, 360.0),
            ("ramp_deg", self.ramp_deg, 0.5, 90.0),
            ("feed_mm_min", self.feed_mm_min, 1.0, 60_000.0),
            ("plunge_mm_min", self.plunge_mm_min, 1.0, 60_000.0),
            ("spindle_rpm", self.spindle_rpm, 1.0, 200_000.0),
            ("depth_mm", self.depth_mm, 1e-3, 500.0),
            ("diameter_mm", self.diameter_mm, 0.01, 100.0),
            ("height_mm", self.height_mm, 0.1, 100.0),
            ("above_mm", self.above_mm, 0.1, 200.0),
            ("through_mm", self.through_mm, -10.0, 10.0),
            ("tabs", self.tabs.map(f64::from), 0.0, 100.0),
            ("tab_width_mm", self.tab_width_mm, 0.1, 100.0),
            ("tab_height_mm", self.tab_height_mm, 0.01, 500.0),
        ];
        for (key, value, low, high) in ranges {
            if let Some(value) = value {
                source.within(&format!("operation[{index}].{key}"), value, low, high)?;
            }
        }
        for value in self.holes_mm.iter().flatten() {
            source.within(&format!("operation[{index}].holes_mm"), *value, -1e4, 1e4)?;
        }
        match self.misplaced().or_else(|| self.missing()) {
            Some((problem, hint)) => Err(self.refusal(source, index, problem, hint)),
            None => Ok(()),
        }
    }

    pub(super) fn refusal(
        &self,
        source: &Source,
        index: usize,
        problem: &'static str,
        hint: &'static str,
    ) -> Error {
        Error::Operation {
            path: source.path().into(),
            line: source.line_of(&format!("operation[{index}].kind")),
            number: index + 1,
            kind: self.kind.word(),
            problem,
            hint,
        }
    }

    /// A key that does not go with the kind, and what to do about it.
    fn misplaced(&self) -> Option<(&'static str, &'static str)> {
        use Kind::*;
        let out = "leave it out";
        let finish_levels = "finishing is one pass over the surface; a rough operation has levels";
        let kind = self.kind;
        let hint = |rough: &'static str| if kind == Rough { rough } else { out };
        let levels = if kind == Finish { finish_levels } else { out };
        [
            ("has stepdown_mm", levels, self.stepdown_mm.is_some(), &[Rough, Drill, CutOut][..]),
            ("has stepover_mm", out, self.stepover_mm.is_some(), &[Rough, Finish, Rest]),
            (
                "has scallop_mm",
                hint("roughing takes stepover_mm"),
                self.scallop_mm.is_some(),
                &[Finish, Rest],
            ),
            ("has leftover_mm", out, self.leftover_mm.is_some(), &[Rest]),
            ("has stock_to_leave_mm", out, self.stock_to_leave_mm > 0.0, &[Rough, Finish]),
            ("has direction_deg", out, self.direction_deg != 0.0, &[Rough, Finish, Rest]),
            ("has ramp_deg", out, self.ramp_deg.is_some(), &[Rough]),
            ("has pattern = \"one-way\"", out, self.pattern == Pattern::OneWay, &[Rough, Finish, Rest]),
            ("has face = \"underside\"", out, self.face == Face::Underside, &[Drill, Mark]),
            ("has depth_mm", out, self.depth_mm.is_some(), &[Drill, Mark]),
            ("has holes_mm", out, !self.holes_mm.is_empty(), &[Drill]),
            ("has places", out, !self.places.is_empty(), &[Drill, Mark]),
            ("has diameter_mm", out, self.diameter_mm.is_some(), &[Drill]),
            ("has height_mm", out, self.height_mm.is_some(), &[Mark]),
            ("has above_mm", out, self.above_mm.is_some(), &[Outline]),
            ("has through_mm", out, self.through_mm.is_some(), &[CutOut]),
            ("has tabs", out, self.tabs.is_some(), &[CutOut]),
            ("has tab_width_mm", out, self.tab_width_mm.is_some(), &[CutOut]),
            ("has tab_height_mm", out, self.tab_height_mm.is_some(), &[CutOut]),
        ]
        .into_iter()
        .find(|(_, _, given, kinds)| *given && !kinds.contains(&kind))
        .map(|(problem, hint, ..)| (problem, hint))
    }

    /// A key that the kind cannot do without, or values that contradict each other.
    fn missing(&self) -> Option<(&'static str, &'static str)> {
        let stepover = self.stepover_mm.is_some();
        let mark_places: &[Place] = match self.face {
            Face::Top => &[Place::Front, Place::Back],
            Face::Underside => &[Place::Front, Place::Back, Place::Centre],
        };
        match self.kind {
            Kind::Rough if self.stepdown_mm.is_none() => {
                Some(("has no stepdown_mm", "0.05 to 0.15 of the cutter's diameter"))
            }
            Kind::CutOut if self.stepdown_mm.is_none() => {
                Some(("has no stepdown_mm", "0.05 to 0.15 of the cutter's diameter a turn"))
            }
            Kind::Finish | Kind::Rest if stepover && self.scallop_mm.is_some() => {
                Some(("has stepover_mm and scallop_mm", "name one of them"))
            }
            Kind::Finish | Kind::Rest if !stepover && self.scallop_mm.is_none() => {
                Some(("has no stepover_mm or scallop_mm", "name one of them"))
            }
            Kind::Drill | Kind::Mark if self.depth_mm.is_none() => {
                Some(("has no depth_mm", "how deep it goes into its face"))
            }
            Kind::Drill if self.holes_mm.is_empty() && self.places.is_empty() => Some((
                "has no holes",
                "places = [\"left\", \"right\"], or holes_mm = [[x, y], ...] in the tile's frame",
            )),
            Kind::Drill if self.face == Face::Top && self.places.contains(&Place::Centre) => {
                Some(("has a hole in the tile's middle", "face = \"underside\""))
            }
            Kind::Mark if !self.places.iter().all(|place| mark_places.contains(place)) => Some((
                "has a place that no line of text fits",
                "\"front\", \"back\", or on the underside \"centre\"",
            )),
            _ => None,
        }
    }

    /// What the cutters before may leave where a rest operation does not go, in mm.
    pub fn leftover_or_default_mm(&self) -> f64 {
        self.leftover_mm.unwrap_or(0.005)
    }

    /// How steeply roughing goes down into solid metal, in degrees.
    pub fn ramp_or_default_deg(&self) -> f64 {
        self.ramp_deg.unwrap_or(3.0)
    }

    /// Whether it leaves the part's surface as it is to be.
    pub fn finishes(&self) -> bool {
        matches!(self.kind, Kind::Finish | Kind::Rest) && self.stock_to_leave_mm == 0.0
    }

    /// The height of an outline run over the stock's top in mm.
    pub fn above_or_default_mm(&self) -> f64 {
        self.above_mm.unwrap_or(5.0)
    }
}
