//! The paper's Fig. 8: which openings a screen can serve, and where those of a scene lie. And the margins as a map.

use std::path::Path;

use crate::screen::{Field, Margins, Opening};

use super::Error;
use super::figure::{self, Axis, BLACK, BLUE, Bar, Figure, GREEN, GREY, Layer, Legend, ORANGE, RED, VIOLET};
use super::palette::Palette;

/// Points of the screen along its longer side that the plot shows.
const SHOWN: usize = 60;
/// Cells along the longer side of the map.
const MAPPED: usize = 400;
/// Largest opening angle on the axes.
const MOST_DEG: f64 = 120.0;

/// Writes `stem`.svg and `stem`.png: alpha against beta at points all over the screen, along its rows and columns
/// and in each point's worst plane, over the region that Eqs. 10 and 11 leave.
pub fn write(stem: &Path, title: &str, margins: &Margins) -> Result<Vec<String>, Error> {
    let field = &margins.field;
    let [low, high] = margins.horizontal.gamma_deg;
    let stride = field.columns.max(field.rows).div_ceil(SHOWN).max(1);
    let dots = |openings: &[Opening], name: &str, colour| Layer::Dots {
        name: name.into(),
        points: (0..field.rows)
            .step_by(stride)
            .flat_map(|row| {
                (0..field.columns).step_by(stride).map(move |column| row * field.columns + column)
            })
            .map(|at| (openings[at].alpha_deg.min(MOST_DEG), openings[at].beta_deg.min(MOST_DEG)))
            .collect(),
        colour,
        radius: 2.0,
    };
    let layers = vec![
        Layer::Region { points: valid(low, high), colour: GREY, opacity: 0.22 },
        Layer::Text {
            at: (0.56 * MOST_DEG, 0.95 * MOST_DEG),
            text: "grey: no cell shadows its own light".into(),
            colour: BLACK,
        },
        Layer::Line {
            name: "limit for any projector, α + β = 60° (Eq. 11)".into(),
            points: vec![(0.0, 60.0), (60.0, 0.0)],
            colour: RED,
            dashed: false,
        },
        Layer::Line {
            name: format!("limits of this screen and projector, γ {low:.1}° to {high:.1}° (Eq. 10)"),
            points: within((0.0, 0.5 * (180.0 - low)), (180.0 - low, 0.0)),
            colour: ORANGE,
            dashed: false,
        },
        Layer::Line {
            name: String::new(),
            points: within((0.5 * high, 0.0), (0.0, high)),
            colour: ORANGE,
            dashed: false,
        },
        dots(&field.vertical, "scene, planes along the columns", GREEN),
        dots(&field.worst, "scene, each point's worst plane", VIOLET),
        dots(&field.horizontal, "scene, planes along the rows", BLUE),
    ];
    let subtitle = format!(
        "{} cells; smallest margin of Eq. 10 along rows {:.1}°, in any plane {:.1}°",
        margins.points, margins.horizontal.eq10_margin_deg, margins.any_direction.eq10_margin_deg
    );
    let figure = Figure {
        title: format!("Design space: {title}"),
        subtitle,
        x: Axis::new("α, degrees: one edge of the audience, measured from the screen's plane", 0.0, MOST_DEG),
        y: Axis::new("β, degrees: its other edge, from the other side", 0.0, MOST_DEG),
        layers,
        legend: Legend::LowerLeft,
        bar: None,
    };
    figure::write(stem, &[figure], 1, [760, 760])
}

/// The corners of what Eqs. 10 and 11 leave of the square of openings, with light from `low` to `high`.
fn valid(low: f64, high: f64) -> Vec<(f64, f64)> {
    // Eq. 10: alpha + 2 beta >= 180 - low and 2 alpha + beta >= high. Eq. 11 follows from both.
    let lines = [[1.0, 2.0, 180.0 - low], [2.0, 1.0, high], [1.0, 1.0, 60.0]];
    let mut region = vec![(0.0, 0.0), (MOST_DEG, 0.0), (MOST_DEG, MOST_DEG), (0.0, MOST_DEG)];
    for [a, b, least] in lines {
        let over = |p: (f64, f64)| a * p.0 + b * p.1 - least;
        let mut kept = Vec::new();
        for (k, &p) in region.iter().enumerate() {
            let q = region[(k + 1) % region.len()];
            if over(p) >= 0.0 {
                kept.push(p);
            }
            if over(p) * over(q) < 0.0 {
                let t = over(p) / (over(p) - over(q));
                kept.push((p.0 + t * (q.0 - p.0), p.1 + t * (q.1 - p.1)));
            }
        }
        region = kept;
    }
    region
}

/// The part of a line that is on the axes.
fn within(a: (f64, f64), b: (f64, f64)) -> Vec<(f64, f64)> {
    let cut = |a: (f64, f64), b: (f64, f64)| {
        let over = (a.0.max(a.1) - MOST_DEG).max(0.0);
        let span = if a.0 > a.1 { a.0 - b.0 } else { a.1 - b.1 };
        let t = if over > 0.0 { over / span } else { 0.0 };
        (a.0 + t * (b.0 - a.0), a.1 + t * (b.1 - a.1))
    };
    vec![cut(a, b), cut(b, a)]
}

/// Writes `stem`.png: the smallest margin of Eq. 10 of each cell, over the screen.
pub fn write_map(
    stem: &Path,
    title: &str,
    margins: &Margins,
    size_m: [f64; 2],
) -> Result<Vec<String>, Error> {
    let field = &margins.field;
    let (columns, values) = reduced(field);
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
    let spread = (high - low).max(0.1);
    let bar = Bar {
        label: "degrees".into(),
        low: low - 0.02 * spread,
        high: high + 0.02 * spread,
        palette: Palette::heights(),
    };
    let half = size_m.map(|side| 0.5 * side);
    let worst = margins.any_direction.worst.point_m;
    let figure = Figure {
        title: format!("Margin of Eq. 10 in each cell's worst plane: {title}"),
        subtitle: "the dot is the cell with the smallest".into(),
        x: Axis::new("x, m", -half[0], half[0]),
        y: Axis::new("y, m", -half[1], half[1]),
        layers: vec![
            bar.cells([-half[0], -half[1]], half, columns, &values),
            Layer::Dots { name: String::new(), points: vec![(worst[0], worst[1])], colour: RED, radius: 5.0 },
        ],
        legend: Legend::None,
        bar: Some(bar),
    };
    figure::write(stem, &[figure], 1, [960, figure::height_to_scale(960, true, size_m)])
}

/// The smallest margin in blocks of cells, at most [`MAPPED`] along a side.
fn reduced(field: &Field) -> (usize, Vec<f64>) {
    let factor = field.columns.max(field.rows).div_ceil(MAPPED).max(1);
    let (columns, rows) = (field.columns.div_ceil(factor), field.rows.div_ceil(factor));
    let mut values = vec![f64::INFINITY; columns * rows];
    for (at, opening) in field.worst.iter().enumerate() {
        let block = at % field.columns / factor + at / field.columns / factor * columns;
        values[block] = values[block].min(opening.eq10_deg());
    }
    (columns, values)
}
