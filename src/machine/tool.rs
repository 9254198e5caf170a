use std::path::Path;

use serde::Deserialize;

use super::Error;
use crate::catalogue::{self, Kind};
use crate::cutter::Shape;
use crate::settings::Source;

/// What stands above the cutting profile; all lengths in mm from the tool's tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    pub neck_diameter_mm: f64,
    /// The tool is no wider than neck and cutter up to here.
    pub neck_length_mm: f64,
    pub shank_diameter_mm: f64,
    /// From here up stands the spindle's nose.
    pub stick_out_mm: f64,
}

/// A part of a tool that may not touch anything: a cylinder around the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    pub what: &'static str,
    pub radius_mm: f64,
    /// Its lower end above the tool's tip.
    pub from_mm: f64,
}

/// A cutter in its holder, with the feeds it is run at.
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    pub name: String,
    /// Its number in the machine's table; None for a cutter that a job gives inline.
    pub number: Option<u32>,
    pub shape: Shape,
    pub flutes: Option<u32>,
    pub body: Option<Body>,
    pub feed_mm_min: f64,
    pub plunge_mm_min: f64,
    pub spindle_rpm: f64,
    /// Deepest bite it may take at once.
    pub max_depth_mm: Option<f64>,
    /// Length of cut after which it is to be changed.
    pub tool_life_m: Option<f64>,
}

impl Tool {
    /// A cutter that a job gives inline: `tool = "ball:1"` with its feeds beside it. Nothing is
    /// known of its neck, shank and life.
    pub fn inline(
        shape: Shape,
        feed_mm_min: f64,
        plunge_mm_min: f64,
        spindle_rpm: f64,
    ) -> Result<Tool, Error> {
        let name = shape.to_string();
        let figures = [
            ("feed_mm_min", feed_mm_min, FEED),
            ("plunge_mm_min", plunge_mm_min, FEED),
            ("spindle_rpm", spindle_rpm, RPM),
        ];
        for (key, value, [low, high]) in figures {
            if !(value >= low && value <= high) {
                return Err(Error::Inline { tool: name, key, value, low, high });
            }
        }
        Ok(Tool {
            name,
            number: None,
            shape,
            flutes: None,
            body: None,
            feed_mm_min,
            plunge_mm_min,
            spindle_rpm,
            max_depth_mm: None,
            tool_life_m: None,
        })
    }

    /// Neck, shank and nose as cylinders above the tip, where they are wider than the cutter or
    /// end what it can reach. Empty for an inline cutter.
    pub fn cylinders(&self, nose_diameter_mm: f64) -> Vec<Cylinder> {
        let Some(body) = self.body else { return Vec::new() };
        let shank =
            Cylinder { what: "shank", radius_mm: 0.5 * body.shank_diameter_mm, from_mm: body.neck_length_mm };
        let nose = Cylinder { what: "holder", radius_mm: 0.5 * nose_diameter_mm, from_mm: body.stick_out_mm };
        if shank.radius_mm > self.shape.radius_mm() { vec![shank, nose] } else { vec![nose] }
    }

    /// The whole tool as cylinders that reach up for ever: the cutter from its tip, then [`Tool::cylinders`].
    pub fn columns(&self, nose_diameter_mm: f64) -> Vec<Cylinder> {
        let cutter = Cylinder { what: "cutter", radius_mm: self.shape.radius_mm(), from_mm: 0.0 };
        std::iter::once(cutter).chain(self.cylinders(nose_diameter_mm)).collect()
    }

    /// Refuses a tool whose holder would go below the top of the stock at the deepest point.
    pub fn check_reach(&self, depth_below_stock_mm: f64) -> Result<(), Error> {
        match self.body {
            Some(body) if depth_below_stock_mm > body.stick_out_mm => Err(Error::Reach {
                tool: self.name.clone(),
                stick_out_mm: body.stick_out_mm,
                depth_mm: depth_below_stock_mm,
            }),
            _ => Ok(()),
        }
    }
}

impl Tool {
    /// Refuses a tool whose shank would not follow it into a slot or hole of this width.
    pub fn check_neck(&self, width_mm: f64, depth_mm: f64) -> Result<(), Error> {
        match self.body {
            Some(body) if depth_mm > body.neck_length_mm && body.shank_diameter_mm > width_mm => {
                Err(Error::Neck {
                    tool: self.name.clone(),
                    neck_length_mm: body.neck_length_mm,
                    shank_diameter_mm: body.shank_diameter_mm,
                    width_mm,
                    depth_mm,
                })
            }
            _ => Ok(()),
        }
    }
}

const FEED: [f64; 2] = [0.1, 100_000.0];
const RPM: [f64; 2] = [1.0, 1_000_000.0];

/// The tools of a shop, in the order of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Library {
    pub title: String,
    pub source: String,
    pub unconfirmed: bool,
    pub tools: Vec<Tool>,
}

impl Library {
    /// The library that `name` means to a job in `folder`; "tools" is the one that comes along.
    pub fn find(name: &str, folder: Option<&Path>) -> Result<Library, Error> {
        Library::parse(&catalogue::find(Kind::Library, name, folder)?)
    }

    /// Reads and checks a library.
    pub fn parse(source: &Source) -> Result<Library, Error> {
        let file: File = source.parse()?;
        source.schema(file.schema, 1)?;
        source.within("tool", file.tool.len() as f64, 1.0, 10_000.0)?;
        let mut tools: Vec<Tool> = Vec::with_capacity(file.tool.len());
        for (index, entry) in file.tool.into_iter().enumerate() {
            let key = |name: &str| format!("tool[{index}].{name}");
            let place = |name: &str| (source.path().to_string(), source.line_of(&key(name)));
            let shape: Shape = entry.cutter.parse().map_err(|error| {
                let (path, line) = place("cutter");
                Error::Cutter { path, line, source: error }
            })?;
            let diameter = 2.0 * shape.radius_mm();
            let figures = [
                ("number", entry.number.into(), 1.0, 32_767.0),
                ("flutes", entry.flutes.into(), 1.0, 20.0),
                ("neck_diameter_mm", entry.neck_diameter_mm, 0.01, diameter),
                ("neck_length_mm", entry.neck_length_mm, 0.01, 500.0),
                ("shank_diameter_mm", entry.shank_diameter_mm, 0.1, 100.0),
                ("stick_out_mm", entry.stick_out_mm, entry.neck_length_mm, 500.0),
                ("feed_mm_min", entry.feed_mm_min, FEED[0], FEED[1]),
                ("plunge_mm_min", entry.plunge_mm_min, FEED[0], FEED[1]),
                ("spindle_rpm", entry.spindle_rpm, RPM[0], RPM[1]),
                ("max_depth_mm", entry.max_depth_mm, 0.001, entry.stick_out_mm),
                ("tool_life_m", entry.tool_life_m, 0.001, 1e9),
            ];
            for (name, value, low, high) in figures {
                source.within(&key(name), value, low, high)?;
            }
            let taken = |t: &Tool| t.name == entry.name || t.number == Some(entry.number);
            if let Some(other) = tools.iter().find(|t| taken(t)) {
                let (path, line) = place("name");
                let (number, other) = (entry.number, other.name.clone());
                return Err(Error::SameTool { path, line, tool: entry.name, number, other });
            }
            if entry.name.is_empty()
                || !entry.name.chars().all(|c| c.is_ascii_alphanumeric() || "-._".contains(c))
            {
                let (path, line) = place("name");
                return Err(Error::ToolName { path, line, name: entry.name.escape_debug().to_string() });
            }
            tools.push(Tool {
                name: entry.name,
                number: Some(entry.number),
                shape,
                flutes: Some(entry.flutes),
                body: Some(Body {
                    neck_diameter_mm: entry.neck_diameter_mm,
                    neck_length_mm: entry.neck_length_mm,
                    shank_diameter_mm: entry.shank_diameter_mm,
                    stick_out_mm: entry.stick_out_mm,
                }),
                feed_mm_min: entry.feed_mm_min,
                plunge_mm_min: entry.plunge_mm_min,
                spindle_rpm: entry.spindle_rpm,
                max_depth_mm: Some(entry.max_depth_mm),
                tool_life_m: Some(entry.tool_life_m),
            });
        }
        Ok(Library { title: file.title, source: file.source, unconfirmed: file.unconfirmed, tools })
    }

    /// The tool of this name; refused with the nearest one.
    pub fn tool(&self, name: &str) -> Result<&Tool, Error> {
        self.tools.iter().find(|tool| tool.name == name).ok_or_else(|| {
            let known: Vec<&str> = self.tools.iter().map(|tool| tool.name.as_str()).collect();
            let shown = name.chars().take(60).flat_map(char::escape_debug).collect();
            Error::Tool { name: shown, hint: catalogue::nearest(name, &known) }
        })
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    schema: u32,
    title: String,
    source: String,
    #[serde(default)]
    unconfirmed: bool,
    tool: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    number: u32,
    cutter: String,
    flutes: u32,
    neck_diameter_mm: f64,
    neck_length_mm: f64,
    shank_diameter_mm: f64,
    stick_out_mm: f64,
    feed_mm_min: f64,
    plunge_mm_min: f64,
    spindle_rpm: f64,
    max_depth_mm: f64,
    tool_life_m: f64,
}
