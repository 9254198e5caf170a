//! `screen-map.svg`: which tile goes where, seen from the audience.

use std::path::Path;

use serde::Serialize;

use super::Error;
use super::template::{self, Template};

/// A part in tiles, and where on a screen it is.
#[derive(Clone, Debug, Default)]
pub struct ScreenMap {
    pub title: String,
    /// Width and height of the part.
    pub part_mm: [f64; 2],
    /// Tiles of a die lie mirrored: what is its left stands on the right of the sheet that it presses.
    pub die: bool,
    pub tiles: Vec<MapTile>,
    /// Width and height of the whole screen, and the part's lower left corner on it.
    pub screen_mm: Option<([f64; 2], [f64; 2])>,
}

/// A tile in the frame of its programs.
#[derive(Clone, Debug, Default)]
pub struct MapTile {
    pub name: String,
    pub corner_mm: [f64; 2],
    pub size_mm: [f64; 2],
    /// Row and column, for the shading.
    pub place: [usize; 2],
}

/// Largest drawing of the part, in the picture's units.
const DRAWN: [f64; 2] = [640.0, 480.0];
const LEFT: f64 = 24.0;
const TOP: f64 = 76.0;
const INSET: f64 = 180.0;

#[derive(Debug, Serialize)]
struct Drawn {
    title: String,
    subtitle: String,
    width: f64,
    height: f64,
    font: f64,
    tiles: Vec<DrawnTile>,
    screen: Option<[f64; 4]>,
    part_on_screen: [f64; 4],
    legend: Vec<String>,
    legend_y: f64,
}

#[derive(Debug, Serialize)]
struct DrawnTile {
    name: String,
    size: String,
    /// x, y of the upper left corner, width, height; y down.
    #[serde(rename = "box")]
    area: [f64; 4],
    label: [f64; 2],
    size_y: f64,
    /// x, lower y, upper y.
    arrow: [f64; 3],
    zero: [f64; 2],
    dark: bool,
}

fn draw(map: &ScreenMap) -> Drawn {
    let scale = (DRAWN[0] / map.part_mm[0].max(1e-9)).min(DRAWN[1] / map.part_mm[1].max(1e-9));
    let drawn = map.part_mm.map(|mm| mm * scale);
    let smallest = map.tiles.iter().flat_map(|t| t.size_mm).fold(f64::INFINITY, f64::min) * scale;
    let font = (smallest / 5.0).clamp(5.0, 18.0);
    let tiles = map.tiles.iter().map(|tile| {
        let [width, height] = tile.size_mm;
        let seen_mm = if map.die { map.part_mm[0] - tile.corner_mm[0] - width } else { tile.corner_mm[0] };
        let area = [
            LEFT + seen_mm * scale,
            TOP + drawn[1] - (tile.corner_mm[1] + height) * scale,
            width * scale,
            height * scale,
        ];
        let middle = [area[0] + 0.5 * area[2], area[1] + 0.5 * area[3]];
        DrawnTile {
            name: tile.name.clone(),
            size: format!("{width:.1} × {height:.1} mm"),
            area,
            label: [middle[0], middle[1] + 0.6 * font],
            size_y: middle[1] + 1.5 * font,
            arrow: [middle[0], middle[1] - 0.5 * font, area[1] + 0.12 * area[3]],
            zero: [if map.die { area[0] + area[2] } else { area[0] }, area[1] + area[3]],
            dark: (tile.place[0] + tile.place[1]) % 2 == 1,
        }
    });
    let inset_x = LEFT + drawn[0] + 30.0;
    let fit = |whole: [f64; 2]| (INSET / whole[0].max(1e-9)).min(INSET / whole[1].max(1e-9));
    let screen =
        map.screen_mm.map(|(whole, _)| [inset_x, TOP + 20.0, whole[0] * fit(whole), whole[1] * fit(whole)]);
    let part_on_screen = match (map.screen_mm, screen) {
        (Some((whole, corner)), Some(outer)) => {
            let s = fit(whole);
            // A speck of a part is still to be seen, and on the screen.
            let [w, h] = map.part_mm.map(|mm| (mm * s).max(3.0));
            let x = (outer[0] + corner[0] * s).min(outer[0] + outer[2] - w).max(outer[0]);
            let y = (outer[1] + outer[3] - corner[1] * s - h).max(outer[1]);
            [x, y, w, h]
        }
        _ => [0.0; 4],
    };
    let mut legend = vec![
        "Arrows point up on the screen; mark each blank's back with its name and an arrow before it is cut."
            .to_string(),
    ];
    if map.die {
        legend.push("Red: X0 Y0 of the die's programs.".to_string());
        legend.push(
            "The die is the screen seen from behind: on its table left and right are exchanged.".to_string(),
        );
    } else {
        legend.push("Red: X0 Y0 of the tile's programs; +X runs to the right, +Y up.".to_string());
    }
    let legend_y = TOP + drawn[1].max(screen.map_or(0.0, |s| s[3] + 20.0)) + 30.0;
    Drawn {
        title: map.title.clone(),
        subtitle: format!(
            "{:.1} × {:.1} mm in {} tiles, seen from the audience{}",
            map.part_mm[0],
            map.part_mm[1],
            map.tiles.len(),
            if map.die { "; each sheet is pressed by the die tile of this name" } else { "" }
        ),
        width: (LEFT + drawn[0] + if screen.is_some() { 30.0 + INSET } else { 0.0 } + LEFT).max(720.0),
        height: legend_y + 18.0 * legend.len() as f64 + 6.0,
        font,
        tiles: tiles.collect(),
        screen,
        part_on_screen,
        legend,
        legend_y,
    }
}

/// Writes the picture, whole or not at all.
pub fn write_screen_map(path: &Path, map: &ScreenMap) -> Result<(), Error> {
    #[derive(Serialize)]
    struct Filled {
        m: Drawn,
    }
    template::write(path, Template::ScreenMap, &Filled { m: draw(map) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(die: bool) -> ScreenMap {
        let tile = |name: &str, x: f64| MapTile {
            name: name.into(),
            corner_mm: [x, 0.0],
            size_mm: [40.0, 30.0],
            place: [0, (x / 40.0) as usize],
        };
        ScreenMap {
            title: "a part".into(),
            part_mm: [80.0, 30.0],
            die,
            tiles: vec![tile("r0c0", 0.0), tile("r0c1", 40.0)],
            screen_mm: Some(([2000.0, 1000.0], [0.0, 970.0])),
        }
    }

    #[test]
    fn a_die_s_left_tile_is_the_sheet_s_right_one() {
        let (part, die) = (draw(&map(false)), draw(&map(true)));
        assert!(part.tiles[0].area[0] < part.tiles[1].area[0]);
        assert!(die.tiles[0].area[0] > die.tiles[1].area[0]);
        assert_eq!(part.tiles[0].area[0], die.tiles[1].area[0]);
        // The zero is the lower left corner, seen from behind the lower right one.
        assert_eq!(part.tiles[0].zero[0], part.tiles[0].area[0]);
        assert_eq!(die.tiles[0].zero[0], die.tiles[0].area[0] + die.tiles[0].area[2]);
    }

    #[test]
    fn the_part_is_where_it_is_on_the_screen() {
        let drawn = draw(&map(false));
        let (screen, part) = (drawn.screen.expect("one"), drawn.part_on_screen);
        assert_eq!(part[0], screen[0]);
        assert!((part[1] - screen[1]).abs() < 1e-9, "in the upper left corner");
    }
}
