use super::super::pen::Pen;
use super::super::{Error, Site, Toolpath};
use crate::cutter::Shape;

/// Letters stand on a lattice of 4 x 6, and this far from each other.
const ADVANCE: f64 = 6.0;
const HEIGHT: f64 = 6.0;

/// Where a line of text is engraved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Room {
    /// The margin before the tile, at low Y.
    Front,
    /// The margin behind it.
    Back,
    /// The tile's own middle; for the underside.
    Tile,
}

/// A tile's name and an arrow that points to high Y.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark<'a> {
    pub shape: Shape,
    pub text: &'a str,
    pub rooms: Vec<Room>,
    pub height_mm: f64,
    /// Below the face.
    pub depth_mm: f64,
    /// Most that may be cut below the face.
    pub most_mm: f64,
}

/// Engraves the text once in each of the rooms, in its middle.
pub fn mark(site: &Site, params: &Mark) -> Result<Toolpath, Error> {
    site.validate(0.0)?;
    if params.depth_mm > params.most_mm + 1e-9 {
        return Err(Error::Deep { depth_mm: params.depth_mm, most_mm: params.most_mm });
    }
    let lattice = site.surface.lattice();
    let size_mm = [lattice.width_mm, lattice.height_mm];
    let scale = params.height_mm / HEIGHT;
    let strokes = strokes(params.text);
    let length_mm = scale * (ADVANCE * (params.text.len() + 1) as f64 - 2.0);
    let cutter_mm = 2.0 * params.shape.radius_mm();
    let z_mm = site.top_allowance_mm - params.depth_mm;
    let mut pen = Pen::new(site);
    for room in &params.rooms {
        let margin = site.margin_mm;
        let (middle_y, room_mm, place) = match room {
            Room::Front => (-0.5 * margin, [size_mm[0] + 2.0 * margin, margin], "in the margin"),
            Room::Back => (size_mm[1] + 0.5 * margin, [size_mm[0] + 2.0 * margin, margin], "in the margin"),
            Room::Tile => (0.5 * size_mm[1], size_mm, "under the tile"),
        };
        for (needed_mm, room_mm) in
            [length_mm, params.height_mm].map(|mm| mm + cutter_mm).into_iter().zip(room_mm)
        {
            if needed_mm > room_mm + 1e-9 {
                return Err(Error::Mark { text: params.text.into(), needed_mm, room_mm, place });
            }
        }
        let corner = [0.5 * (size_mm[0] - length_mm), middle_y - 0.5 * params.height_mm];
        for stroke in &strokes {
            let mut points = stroke
                .iter()
                .map(|p| site.nearest([corner[0] + scale * p[0], corner[1] + scale * p[1]], z_mm));
            if let Some(first) = points.next() {
                pen.begin(first, pen.top());
                points.for_each(|to| pen.cut(to));
            }
        }
    }
    Ok(pen.finish())
}

/// The strokes of a text and of an arrow after it, in lattice units from the lower left corner.
fn strokes(text: &str) -> Vec<Vec<[f64; 2]>> {
    text.chars()
        .map(glyph)
        .chain([ARROW])
        .enumerate()
        .flat_map(|(nth, lines)| {
            lines.split(' ').map(move |line| {
                let place = |pair: &[u8]| {
                    let [x, y] = [pair[0], pair[1]].map(|digit| f64::from(digit.saturating_sub(b'0')));
                    [x + ADVANCE * nth as f64, y]
                };
                line.as_bytes().chunks_exact(2).map(place).collect()
            })
        })
        .collect()
}

const ARROW: &str = "2026 042644";

/// Strokes of a letter of a tile's name: pairs of x (0 .. 4) and y (0 .. 6), a stroke a word.
fn glyph(letter: char) -> &'static str {
    match letter {
        '0' => "0040460600",
        '1' => "152620",
        '2' => "064643030040",
        '3' => "06464000 0343",
        '4' => "060343 4640",
        '5' => "460603434000",
        '6' => "460600404303",
        '7' => "064610",
        '8' => "034346060040 4340",
        '9' => "430306464000",
        'r' => "0400 031434",
        'c' => "34040030",
        _ => "0343",
    }
}
