use std::path::Path;

use serde::{Deserialize, Serialize};

use super::Error;
use crate::catalogue::{self, Kind};
use crate::settings::{self, Source};

/// Workholding as fixtures/*.toml describes it.
///
/// The table's frame has X0 Y0 at the lower left end of the travel and Z0 on the machine's table.
/// A blank lies in the middle of the usable area, its underside `height_mm` above the table.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Fixture {
    pub schema: u32,
    pub name: String,
    pub title: String,
    /// What of the travel is not usable, on each end of an axis.
    pub border_mm: Border,
    /// Largest blank it takes along X and Y, a vise's opening say; None: what the travel allows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blank_max_mm: Option<Border>,
    pub height_mm: f64,
    /// How far below the blank's underside a cutter may go: the board under it that is spent.
    #[serde(default)]
    pub sacrificial_mm: f64,
    /// How the operator finds the work coordinate system.
    pub wcs_found: String,
    #[serde(default)]
    pub note: String,
    /// Clamps that sit on the edges of whatever blank is held.
    #[serde(default)]
    pub clamp: Vec<Clamp>,
    /// What stands on the table whatever the blank, in the table's frame.
    #[serde(default)]
    pub keep_out: Vec<KeepOut>,
}

/// A length along each axis.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Border {
    pub x: f64,
    pub y: f64,
}

/// A side of a blank.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    Left,
    Right,
    Front,
    Back,
}

/// A clamp, jaw, stop or pin on a side of the blank.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Clamp {
    pub name: String,
    pub side: Side,
    /// How far it reaches over the blank.
    pub reach_mm: f64,
    /// How wide it is along the side.
    pub width_mm: f64,
    /// How far it stands out beyond the blank.
    pub out_mm: f64,
    /// Its height above the blank's top; below 0 for jaws and pins that stay under it.
    pub height_mm: f64,
    /// Where along the side: 0 begins at its left or front end, 1 ends at the other, 0.5 is the middle.
    #[serde(default = "middle")]
    pub along: f64,
}

fn middle() -> f64 {
    0.5
}

/// A box that nothing may enter, in the table's frame.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct KeepOut {
    pub name: String,
    pub min_mm: Corner,
    pub max_mm: Corner,
}

/// A corner of a box.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Corner {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

impl Fixture {
    /// The fixture that `name` means to a job in `folder`.
    pub fn find(name: &str, folder: Option<&Path>) -> Result<Fixture, Error> {
        Ok(Fixture::parse(&catalogue::find(Kind::Fixture, name, folder)?)?)
    }

    /// Reads and checks a fixture.
    pub fn parse(source: &Source) -> Result<Fixture, settings::Error> {
        let fixture: Fixture = source.parse()?;
        source.schema(fixture.schema, 1)?;
        source.within("border_mm.x", fixture.border_mm.x, 0.0, 10_000.0)?;
        source.within("border_mm.y", fixture.border_mm.y, 0.0, 10_000.0)?;
        if let Some(most) = fixture.blank_max_mm {
            source.within("blank_max_mm.x", most.x, 0.1, 1e5)?;
            source.within("blank_max_mm.y", most.y, 0.1, 1e5)?;
        }
        source.within("height_mm", fixture.height_mm, 0.0, 1000.0)?;
        source.within("sacrificial_mm", fixture.sacrificial_mm, 0.0, fixture.height_mm)?;
        for (i, clamp) in fixture.clamp.iter().enumerate() {
            source.within(&format!("clamp[{i}].reach_mm"), clamp.reach_mm, 0.0, 1000.0)?;
            source.within(&format!("clamp[{i}].width_mm"), clamp.width_mm, 0.1, 1000.0)?;
            source.within(&format!("clamp[{i}].out_mm"), clamp.out_mm, 0.0, 1000.0)?;
            // What reaches over the blank lies on its top.
            let lowest = if clamp.reach_mm > 0.0 { 0.0 } else { -1000.0 };
            source.within(&format!("clamp[{i}].height_mm"), clamp.height_mm, lowest, 1000.0)?;
            source.within(&format!("clamp[{i}].along"), clamp.along, 0.0, 1.0)?;
        }
        for (i, keep_out) in fixture.keep_out.iter().enumerate() {
            let (low, high) = (keep_out.min_mm, keep_out.max_mm);
            source.within(&format!("keep_out[{i}].min_mm.x"), low.x, -1e5, 1e5)?;
            source.within(&format!("keep_out[{i}].min_mm.y"), low.y, -1e5, 1e5)?;
            source.within(&format!("keep_out[{i}].min_mm.z"), low.z, -1e5, 1e5)?;
            source.within(&format!("keep_out[{i}].max_mm.x"), high.x, low.x, 1e5)?;
            source.within(&format!("keep_out[{i}].max_mm.y"), high.y, low.y, 1e5)?;
            source.within(&format!("keep_out[{i}].max_mm.z"), high.z, low.z, 1e5)?;
        }
        Ok(fixture)
    }
}
