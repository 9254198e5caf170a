//! The evaluation's figures as tables.

use std::path::Path;

use super::evaluation::{BINS, WIDEST, binned};
use super::{Error, write_whole};
use crate::evaluation::Evaluation;

type Table = (&'static str, Vec<String>, Vec<Vec<String>>);

/// The figures as tables.
fn tables(found: &Evaluation) -> Vec<Table> {
    let text = |value: f64| format!("{value:.6}");
    let mut gain_header = vec!["angle_deg".to_string()];
    gain_header.extend(found.curves.iter().map(|curve| curve.name.replace([' ', ','], "_")));
    let angles = found.curves.first().map_or(&[][..], |curve| &curve.angle_deg);
    let gain = angles.iter().enumerate().map(|(at, &angle)| {
        std::iter::once(format!("{angle}"))
            .chain(found.curves.iter().map(|curve| text(curve.gain[at])))
            .collect()
    });
    let map = &found.map;
    let rows = map.gain.len() / map.columns;
    let places = (0..map.gain.len()).map(|at| {
        let part = |k: usize, count: usize, axis: usize| {
            map.low[axis] + (map.high[axis] - map.low[axis]) * (k as f64 + 0.5) / count as f64
        };
        vec![
            text(part(at % map.columns, map.columns, 0)),
            text(part(at / map.columns, rows, 1)),
            text(map.gain[at]),
            u8::from(map.inside[at]).to_string(),
        ]
    });
    let histograms: Vec<[Vec<f64>; 2]> =
        found.views.iter().map(|view| [binned(&view.gain), binned(&view.high_gain)]).collect();
    let mut header = vec!["from_percent".to_string(), "to_percent".to_string()];
    for view in &found.views {
        header.extend([format!("{}_directional", view.seat.name), format!("{}_high_gain", view.seat.name)]);
    }
    let edge = |k: usize| 100.0 * WIDEST * (2.0 * k as f64 / BINS as f64 - 1.0);
    let bins = (0..BINS).map(|k| {
        let mut row = vec![text(edge(k)), text(edge(k + 1))];
        row.extend(histograms.iter().flatten().map(|bins| text(bins[k])));
        row
    });
    let off = found.tolerance.iter().flat_map(|t| {
        t.off
            .iter()
            .zip(&t.on_audience)
            .map(|(off, on)| vec![t.what.clone(), t.unit.into(), format!("{off}"), text(*on)])
    });
    let named = |names: &[&str]| names.iter().map(|name| name.to_string()).collect::<Vec<_>>();
    vec![
        ("gain.csv", gain_header, gain.collect()),
        ("audience.csv", named(&["x_m", "z_m", "gain", "inside"]), places.collect()),
        ("histograms.csv", header, bins.collect()),
        ("misalignment.csv", named(&["what", "unit", "off", "on_audience"]), off.collect()),
    ]
}

/// Writes the tables into a folder and gives their names.
pub(super) fn write(folder: &Path, found: &Evaluation) -> Result<Vec<&'static str>, Error> {
    let mut names = Vec::new();
    for (name, header, rows) in tables(found) {
        write_csv(&folder.join(name), &header, rows)?;
        names.push(name);
    }
    Ok(names)
}

fn write_csv(path: &Path, header: &[String], rows: Vec<Vec<String>>) -> Result<(), Error> {
    let failed = |error: csv::Error| Error::Io { path: path.display().to_string(), source: error.into() };
    write_whole(path, |writer| {
        let mut table = csv::Writer::from_writer(writer);
        table.write_record(header).map_err(failed)?;
        for row in &rows {
            table.write_record(row).map_err(failed)?;
        }
        table.flush().map_err(|source| Error::Io { path: path.display().to_string(), source })
    })
}
