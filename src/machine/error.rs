use crate::{catalogue, cutter, settings};

/// Why a machine, fixture, tool or setup was refused.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(transparent)]
    Find(#[from] catalogue::Error),
    #[error(transparent)]
    File(#[from] settings::Error),
    #[error("{path}:{line}: {source}")]
    Cutter { path: String, line: usize, source: cutter::ParseError },
    #[error(
        "{path}:{line}: tool \"{tool}\" has the name or the number {number} of tool \"{other}\"; hint: every tool needs its own of both"
    )]
    SameTool { path: String, line: usize, tool: String, number: u32, other: String },
    #[error(
        "{path}:{line}: tool name \"{name}\" is not usable in file names; hint: letters, digits, \"-\", \".\" and \"_\""
    )]
    ToolName { path: String, line: usize, name: String },
    #[error("tool \"{name}\" is not in the library; hint: {hint}")]
    Tool { name: String, hint: String },
    #[error("tool \"{tool}\": {key} is {value}; hint: it must lie in {low} .. {high}")]
    Inline { tool: String, key: &'static str, value: f64, low: f64, high: f64 },
    #[error(
        "tool \"{tool}\" sticks out {stick_out_mm} mm and has to go {depth_mm:.3} mm below the stock's top; hint: a longer stick_out_mm, smaller tiles or level = \"plane\""
    )]
    Reach { tool: String, stick_out_mm: f64, depth_mm: f64 },
    #[error(
        "tool \"{tool}\" has a neck of {neck_length_mm} mm and has to go {depth_mm:.3} mm deep where it is {width_mm} mm wide, its shank is {shank_diameter_mm} mm; hint: a tool with a longer neck, or a thinner blank"
    )]
    Neck { tool: String, neck_length_mm: f64, shank_diameter_mm: f64, width_mm: f64, depth_mm: f64 },
    #[error(
        "tool \"{tool}\" runs at {rpm} rpm, {machine} turns {low} .. {high} rpm; hint: spindle_rpm in that range, or a library made for this machine"
    )]
    Rpm { tool: String, rpm: f64, machine: String, low: f64, high: f64 },
    #[error(
        "tool \"{tool}\": {key} is {feed_mm_min}, {machine} feeds at {low} .. {high} mm/min; hint: a feed in that range, or a library made for this machine"
    )]
    Feed { tool: String, key: &'static str, feed_mm_min: f64, machine: String, low: f64, high: f64 },
    #[error(
        "one {what} of {length_mm} mm does not fit {axis} of {machine}: {room_mm:.3} mm are left of {travel_mm} mm with a border of {border_mm}, a margin of {margin_mm} and an overrun of {overrun_mm:.3} mm on each side; hint: a smaller margin_mm, another fixture or a larger machine"
    )]
    Room {
        what: &'static str,
        length_mm: f64,
        axis: &'static str,
        room_mm: f64,
        machine: String,
        travel_mm: f64,
        border_mm: f64,
        margin_mm: f64,
        overrun_mm: f64,
    },
    #[error(
        "the blank of tile {tile} is {length_mm:.3} mm along {axis} as it lies, {fixture} on {machine} takes {room_mm:.3} mm; hint: a smaller margin_mm, another fixture or a larger machine"
    )]
    Blank { tile: String, length_mm: f64, axis: &'static str, room_mm: f64, machine: String, fixture: String },
    #[error(
        "tile {tile} needs {needed_mm:.1} mm of Z travel, {machine} has {travel_mm} mm; hint: level = \"plane\" or smaller tiles"
    )]
    Travel { tile: String, needed_mm: f64, machine: String, travel_mm: f64 },
    #[error(
        "tile {tile} leaves {floor_mm:.3} mm of its {thickness_mm} mm blank under the deepest cut, min_floor_mm is {min_floor_mm}; hint: level = \"plane\", a thicker blank or smaller tiles"
    )]
    Floor { tile: String, floor_mm: f64, thickness_mm: f64, min_floor_mm: f64 },
    #[error(
        "tile {tile} runs {axis} from {low_mm:.3} to {high_mm:.3} mm, {machine} travels 0 .. {travel_mm} mm; hint: smaller tiles or a smaller margin_mm"
    )]
    Stroke { tile: String, axis: &'static str, low_mm: f64, high_mm: f64, machine: String, travel_mm: f64 },
    #[error(
        "\"{name}\" stands in the way on tile {tile}: {place}, and the cutters go {reach_mm:.3} mm past its edges; hint: margin_mm = {} (it is {margin_mm}), or another fixture",
        .needed_um.ceil() / 1000.0
    )]
    InTheWay {
        tile: String,
        name: String,
        place: String,
        reach_mm: f64,
        margin_mm: f64,
        /// The margin in um that would do.
        needed_um: f64,
    },
    #[error(
        "tile {tile} is cut {below_mm:.3} mm below its blank, the fixture allows {sacrificial_mm} mm; hint: a thicker blank, or a fixture with a board to cut into (sacrificial_mm)"
    )]
    Under { tile: String, below_mm: f64, sacrificial_mm: f64 },
    #[error(
        "the sheet of {length_mm:.3} mm does not fit fixture \"{fixture}\", which takes {most_mm} mm along {axis}; hint: blanks = \"per-tile\", or another fixture"
    )]
    Sheet { length_mm: f64, fixture: String, most_mm: f64, axis: &'static str },
}
