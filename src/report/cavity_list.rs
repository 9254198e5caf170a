//! `cavities.csv` and `cavities.geojson`.

use std::path::Path;

use geo::{Coord, LineString, Polygon};
use serde_json::{Value, json};

use super::{Error, write_whole};
use crate::fidelity::{CAVITY_THRESHOLD_MM, Cavity, Found};

/// The cavities of one tile, and the cutters whose residuals they carry, largest first.
#[derive(Clone, Copy, Debug)]
pub struct TileCavities<'a> {
    pub tile: &'a str,
    pub found: &'a Found,
    pub candidates: &'a [String],
}

impl TileCavities<'_> {
    /// The largest candidate that would reach a cavity; empty when none does or none was tried.
    pub fn reached_by(&self, cavity: &Cavity) -> &str {
        let index = cavity.reached_by(CAVITY_THRESHOLD_MM);
        index.and_then(|index| self.candidates.get(index)).map_or("", String::as_str)
    }
}

/// Writes one line per listed cavity, largest by volume first within its tile; lengths in mm of the part frame.
pub fn write_csv(path: &Path, tiles: &[TileCavities]) -> Result<(), Error> {
    write_whole(path, |writer| {
        let failed = |error: csv::Error| Error::Io { path: path.display().to_string(), source: error.into() };
        let mut csv = csv::Writer::from_writer(writer);
        csv.write_record([
            "tile",
            "x_mm",
            "y_mm",
            "area_mm2",
            "depth_mm",
            "volume_mm3",
            "deepest_x_mm",
            "deepest_y_mm",
            "x_min_mm",
            "y_min_mm",
            "x_max_mm",
            "y_max_mm",
            "reached_by",
        ])
        .map_err(failed)?;
        for tile in tiles {
            for cavity in &tile.found.cavities {
                let [low, high] = cavity.outline.bounds_mm().unwrap_or([cavity.centre_mm; 2]);
                let fields = [
                    tile.tile.to_string(),
                    fixed(cavity.centre_mm[0]),
                    fixed(cavity.centre_mm[1]),
                    fixed(cavity.area_mm2),
                    fixed(cavity.depth_mm),
                    format!("{:.9}", cavity.volume_mm3),
                    fixed(cavity.deepest_mm[0]),
                    fixed(cavity.deepest_mm[1]),
                    fixed(low[0]),
                    fixed(low[1]),
                    fixed(high[0]),
                    fixed(high[1]),
                    tile.reached_by(cavity).to_string(),
                ];
                csv.write_record(fields).map_err(failed)?;
            }
        }
        csv.flush().map_err(|error| failed(error.into()))
    })
}

/// Writes one feature per listed cavity. Coordinates are millimetres of the part frame, not degrees.
pub fn write_geojson(path: &Path, tiles: &[TileCavities]) -> Result<(), Error> {
    write_whole(path, |writer| {
        let failed = |source| Error::Io { path: path.display().to_string(), source };
        let count: u64 = tiles.iter().map(|tile| tile.found.count).sum();
        let unlisted: u64 = tiles.iter().map(|tile| tile.found.unlisted()).sum();
        writeln!(
            writer,
            "{{\"type\": \"FeatureCollection\", \"coordinates_unit\": \"mm\", \"coordinates_frame\": \"part\", \
             \"cavities\": {count}, \"unlisted\": {unlisted}, \"features\": ["
        )
        .map_err(failed)?;
        let mut between = "";
        for tile in tiles {
            for cavity in &tile.found.cavities {
                // One feature a line: a list of 10,000 stays readable and is never held as a whole.
                write!(writer, "{between}{}", feature(tile, cavity)).map_err(failed)?;
                between = ",\n";
            }
        }
        writeln!(writer, "\n]}}").map_err(failed)
    })
}

fn feature(tile: &TileCavities, cavity: &Cavity) -> Value {
    let rings = |polygon: &Polygon| -> Vec<Vec<[f64; 2]>> {
        std::iter::once(polygon.exterior()).chain(polygon.interiors()).map(ring).collect()
    };
    let polygons = &cavity.outline.polygons.0;
    let geometry = match polygons.as_slice() {
        [one] => json!({ "type": "Polygon", "coordinates": rings(one) }),
        many => {
            json!({ "type": "MultiPolygon", "coordinates": many.iter().map(rings).collect::<Vec<_>>() })
        }
    };
    json!({
        "type": "Feature",
        "geometry": geometry,
        "properties": {
            "tile": tile.tile,
            "centre_mm": cavity.centre_mm.map(six),
            "deepest_mm": cavity.deepest_mm.map(six),
            "area_mm2": six(cavity.area_mm2),
            "depth_mm": six(cavity.depth_mm),
            "volume_mm3": (cavity.volume_mm3 * 1e9).round() / 1e9,
            "outline": if cavity.outline.traced { "traced" } else { "convex hull" },
            "reached_by": Some(tile.reached_by(cavity)).filter(|name| !name.is_empty()),
        },
    })
}

fn ring(line: &LineString) -> Vec<[f64; 2]> {
    line.0.iter().map(|&Coord { x, y }| [six(x), six(y)]).collect()
}

/// Nanometres are enough, and keep the file short.
fn six(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

fn fixed(value: f64) -> String {
    format!("{value:.6}")
}
