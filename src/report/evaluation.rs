//! The evaluation as figures, tables and one page.

use std::path::Path;

use glam::DVec3;
use serde::Serialize;

use super::figure::{
    self, Axis, BLACK, BLUE, Bar, Figure, GREEN, Layer, Legend, RED, Rgb8, VIOLET, height_to_scale,
};
use super::palette::Palette;
use super::template::{self, Template};
use super::{Error, evaluation_tables, test_image};
use crate::evaluation::{AudienceMap, Curve, Evaluation, FRAGMENT_MM, SeatView, Tolerance};

/// Columns of the pictures of the screen.
const PICTURE: usize = 240;
/// Bins of a histogram, over -60 to 60 % of the mean.
pub(super) const BINS: usize = 60;
pub(super) const WIDEST: f64 = 0.6;
const MASK_COLUMNS: usize = 240;

/// A figure on the page.
#[derive(Debug, Serialize)]
struct Shown {
    file: String,
    number: &'static str,
    caption: String,
}

#[derive(Serialize)]
struct Filled<'a> {
    page: Page<'a>,
}

#[derive(Serialize)]
struct Page<'a> {
    title: &'a str,
    version: &'static str,
    claims: &'a [crate::evaluation::Claim],
    figures: Vec<Shown>,
    notes: Vec<String>,
}

/// Writes `folder`/figures, `folder`/data and `folder`/evaluation.html; gives the figures' and tables' names.
pub fn write(folder: &Path, title: &str, found: &Evaluation) -> Result<Vec<String>, Error> {
    let figures = folder.join("figures");
    let data = folder.join("data");
    for made in [&figures, &data] {
        std::fs::create_dir_all(made)
            .map_err(|source| Error::Io { path: made.display().to_string(), source })?;
    }
    let mut files = Vec::new();
    let mut shown = Vec::new();
    let mut add = |number, name: &str, caption: String, panels: &[Figure], across, size| {
        let names = figure::write(&figures.join(name), panels, across, size)?;
        shown.push(Shown { file: format!("figures/{name}.png"), number, caption });
        files.extend(names.iter().map(|name| format!("figures/{name}")));
        Ok::<(), Error>(())
    };
    add(
        "Fig. 13",
        "gain",
        "Gain of a white patch of 20 x 20 cm in the middle of the screen against the viewing angle, in the plane along \
         the rows and through the middle of the audience. The high-gain screen is a model."
            .into(),
        &[gain(&found.curves)],
        1,
        [900, 560],
    )?;
    add(
        "Fig. 18",
        "gain-30",
        "The same within 30 degrees, on an even scale, as the paper measured it.".into(),
        &[gain_30(&found.curves)],
        1,
        [900, 520],
    )?;
    add(
        "Fig. 10",
        "mask",
        "Mask of the projector, seen from the audience.".into(),
        &[mask(found)],
        1,
        [900, height_to_scale(900, true, found.size_m)],
    )?;
    add(
        "Fig. 11",
        "audience",
        format!(
            "Mean luminance of the screen, as a gain, over places at y = {:.2} m. White lines: the audience.",
            found.map.height_m
        ),
        &[audience(&found.map, &found.sections)],
        1,
        [900, height_to_scale(900, true, span(found.map.low, found.map.high))],
    )?;
    let panels: Vec<Figure> = found.views.iter().map(histogram).collect();
    add(
        "Fig. 12",
        "histograms",
        "Luminance over the screen from three seats of one audience, as deviation from its mean; cells beyond 60 % are in \
         the end bins.".into(),
        &panels,
        3,
        [1200, 420],
    )?;
    add(
        "Fig. 19",
        "pictures",
        "A test image on this screen (top) and on a matte one (bottom) from the left, middle and right of the middle \
         row over all audiences, at the same exposure, blurred by the angle of one cell from the middle."
            .into(),
        &pictures(found),
        3,
        [1260, 2 * height_to_scale(420, false, found.size_m)],
    )?;
    add(
        "Fig. 14",
        "fragment",
        "The middle 20 x 20 cm of the screen with the test image, seen from five angles along the rows."
            .into(),
        &fragment(found),
        5,
        [1300, height_to_scale(260, false, [1.0, 1.0])],
    )?;
    add(
        "Fig. 17",
        "wall",
        format!(
            "Light of the same piece on a matte wall at z = {:.2} m, the largest 1. White lines: the outline of the audience as \
             the middle of the screen throws it there.",
            found.wall.z_m
        ),
        &[wall(found)],
        1,
        [900, height_to_scale(900, true, span(found.wall.low, found.wall.high))],
    )?;
    add(
        "Section 6",
        "misalignment",
        "Part of the reflected light that stays on the audience when the projector or a tile of 20 x 20 cm is not where \
         it should be."
            .into(),
        &misalignment(&found.tolerance),
        3,
        [1260, 420],
    )?;
    let tables = evaluation_tables::write(&data, found)?;
    files.extend(tables.iter().map(|name| format!("data/{name}")));
    let page = Page {
        title,
        version: env!("CARGO_PKG_VERSION"),
        claims: &found.claims,
        figures: shown,
        notes: notes(found),
    };
    template::write(&folder.join("evaluation.html"), Template::Evaluation, &Filled { page })?;
    files.push("evaluation.html".into());
    Ok(files)
}

fn span(low: [f64; 2], high: [f64; 2]) -> [f64; 2] {
    [high[0] - low[0], high[1] - low[1]]
}

fn notes(found: &Evaluation) -> Vec<String> {
    vec![
        format!(
            "Facets as designed, each from its cell's centre; a beam is spread over the distance to the next one{}. No \
             cutter, polish, shadow or diffraction: see screenmill light and mill for what a cut does.",
            if found.elevated { ", cells stand at their elevations" } else { "" }
        ),
        "The high-gain screen is modelled: gain 2.9, halved for every square of 25 degrees off the mirror direction. The \
         paper's text gives the peak only."
            .into(),
        format!(
            "A cell is {:.2} arcmin wide from the middle of the audience; an eye resolves 0.6 to 1.",
            found.acuity.middle_arcmin
        ),
        "Views are worked out at one cell in several and interpolated; single cells show more grain than an eye at this \
         distance would resolve."
            .into(),
    ]
}

const COLOURS: [Rgb8; 4] = [RED, RED, BLACK, VIOLET];

fn lines(curves: &[Curve], value: impl Fn(f64) -> f64, most_deg: f64) -> Vec<Layer> {
    let line = |(at, curve): (usize, &Curve)| Layer::Line {
        name: curve.name.clone(),
        points: curve
            .angle_deg
            .iter()
            .zip(&curve.gain)
            .filter(|(angle, _)| angle.abs() <= most_deg)
            .map(|(&angle, &gain)| (angle, value(gain)))
            .collect(),
        colour: COLOURS[at % COLOURS.len()],
        dashed: at == 1,
    };
    curves.iter().enumerate().map(line).collect()
}

fn most_gain(curves: &[Curve]) -> f64 {
    curves.iter().flat_map(|curve| &curve.gain).copied().fold(1.0, f64::max)
}

fn gain(curves: &[Curve]) -> Figure {
    let top = (most_gain(curves) * 1.3).log10();
    Figure {
        title: "Gain against viewing angle".into(),
        subtitle: "relative to a matte screen of reflectance 1; logarithmic".into(),
        x: Axis::new("viewing angle, degrees", -60.0, 60.0),
        y: Axis { label: "gain".into(), low: -1.0, high: top, logarithms: true },
        layers: lines(curves, |gain| gain.max(0.1).log10(), 60.0),
        legend: Legend::UpperRight,
        bar: None,
    }
}

fn gain_30(curves: &[Curve]) -> Figure {
    Figure {
        title: "Luminance within 30 degrees".into(),
        subtitle: "relative to a matte screen of reflectance 1".into(),
        x: Axis::new("viewing angle, degrees", -30.0, 30.0),
        y: Axis::new("gain", 0.0, 1.35 * most_gain(curves)),
        layers: lines(curves, |gain| gain, 30.0),
        legend: Legend::UpperRight,
        bar: None,
    }
}

fn mask(found: &Evaluation) -> Figure {
    let half = found.size_m.map(|side| 0.5 * side);
    let rows = ((MASK_COLUMNS as f64 * half[1] / half[0]).round() as usize).max(1);
    let values: Vec<f64> = (0..MASK_COLUMNS * rows)
        .map(|at| {
            let (c, r) = ((at % MASK_COLUMNS) as f64 + 0.5, (at / MASK_COLUMNS) as f64 + 0.5);
            let x = (2.0 * c / MASK_COLUMNS as f64 - 1.0) * half[0];
            found.calibration.mask(glam::DVec2::new(x, (2.0 * r / rows as f64 - 1.0) * half[1]))
        })
        .collect();
    let least = values.iter().copied().fold(1.0, f64::min);
    let bar = Bar {
        label: "mask".into(),
        low: (10.0 * least).floor() / 10.0,
        high: 1.0,
        palette: Palette::heights(),
    };
    Figure {
        title: "Calibration mask".into(),
        subtitle: if found.elevated { "of the elevated screen".into() } else { "of the flat screen".into() },
        x: Axis::new("x, m", -half[0], half[0]),
        y: Axis::new("y, m", -half[1], half[1]),
        layers: vec![bar.cells([-half[0], -half[1]], half, MASK_COLUMNS, &values)],
        legend: Legend::None,
        bar: Some(bar),
    }
}

fn outline(section: &[DVec3], up: impl Fn(&DVec3) -> f64) -> Layer {
    let points = section.iter().map(|p| (p.x, up(p))).collect();
    Layer::Line { name: String::new(), points, colour: [255, 255, 255], dashed: false }
}

fn audience(map: &AudienceMap, sections: &[Vec<DVec3>]) -> Figure {
    let most = map.gain.iter().copied().fold(0.0, f64::max);
    let bar = Bar { label: "gain".into(), low: 0.0, high: most * 1.02, palette: Palette::heights() };
    let mut layers = vec![bar.cells(map.low, map.high, map.columns, &map.gain)];
    layers.extend(sections.iter().map(|section| outline(section, |p| p.z)));
    Figure {
        title: "Mean luminance over the audience".into(),
        subtitle: "from above; the screen is at z = 0".into(),
        x: Axis::new("x, m", map.low[0], map.high[0]),
        y: Axis::new("distance from the screen, m", map.low[1], map.high[1]),
        layers,
        legend: Legend::None,
        bar: Some(bar),
    }
}

/// Shares of cells in bins of the deviation from the mean; those beyond are in the last ones.
pub(super) fn binned(gain: &[f64]) -> Vec<f64> {
    let mean = gain.iter().sum::<f64>() / gain.len().max(1) as f64;
    let mut bins = vec![0.0; BINS];
    for value in gain {
        let place = ((value / mean - 1.0) / WIDEST + 1.0) * 0.5 * BINS as f64;
        bins[(place.max(0.0) as usize).min(BINS - 1)] += 100.0 / gain.len() as f64;
    }
    bins
}

fn steps(bins: &[f64]) -> Vec<(f64, f64)> {
    let edge = |k: usize| 100.0 * WIDEST * (2.0 * k as f64 / BINS as f64 - 1.0);
    bins.iter().enumerate().flat_map(|(k, &share)| [(edge(k), share), (edge(k + 1), share)]).collect()
}

fn histogram(view: &SeatView) -> Figure {
    let (own, other) = (binned(&view.gain), binned(&view.high_gain));
    let most = own.iter().chain(&other).copied().fold(1.0, f64::max);
    let mut region = steps(&own);
    region.insert(0, (-100.0 * WIDEST, 0.0));
    region.push((100.0 * WIDEST, 0.0));
    let [x, y, z] = view.seat.place_m;
    Figure {
        title: format!("{}: gain {:.2}", view.seat.name, view.mean_gain),
        subtitle: format!("({x:.2}, {y:.2}, {z:.2}) m; deviation {:.1} %", 100.0 * view.deviation),
        x: Axis::new("deviation from the mean, %", -100.0 * WIDEST, 100.0 * WIDEST),
        y: Axis::new("share of the screen, %", 0.0, 1.3 * most),
        layers: vec![
            Layer::Region { points: region, colour: RED, opacity: 0.25 },
            Layer::Line { name: "directional".into(), points: steps(&own), colour: RED, dashed: false },
            Layer::Line {
                name: "high gain, model".into(),
                points: steps(&other),
                colour: BLACK,
                dashed: false,
            },
        ],
        legend: Legend::UpperRight,
        bar: None,
    }
}

/// The test image under a field of gains, row-major with the lowest row first, at an exposure.
fn picture(gain: &dyn Fn(f64, f64) -> f64, size: [usize; 2], exposure: f64, blur: f64) -> Vec<Option<Rgb8>> {
    let [columns, rows] = size;
    (0..columns * rows)
        .map(|at| {
            let u = ((at % columns) as f64 + 0.5) / columns as f64;
            let v = ((at / columns) as f64 + 0.5) / rows as f64;
            let light = test_image::blurred(u, v, rows as f64 / columns as f64, blur);
            Some(light.map(|channel| test_image::encoded(channel * gain(u, v) * exposure)))
        })
        .collect()
}

/// Bilinear in a grid of cells over the unit square.
fn interpolated(values: &[f64], columns: usize, u: f64, v: f64) -> f64 {
    let rows = values.len() / columns;
    let place = |part: f64, count: usize| {
        let at = (part * count as f64 - 0.5).clamp(0.0, (count - 1) as f64);
        let low = at.floor() as usize;
        (low, (low + 1).min(count - 1), at - low as f64)
    };
    let ((c0, c1, s), (r0, r1, t)) = (place(u, columns), place(v, rows));
    let at = |c: usize, r: usize| values[r * columns + c];
    (at(c0, r0) * (1.0 - s) + at(c1, r0) * s) * (1.0 - t) + (at(c0, r1) * (1.0 - s) + at(c1, r1) * s) * t
}

fn pictures(found: &Evaluation) -> Vec<Figure> {
    let half = found.size_m.map(|side| 0.5 * side);
    let size = [PICTURE, ((PICTURE as f64 * half[1] / half[0]).round() as usize).max(1)];
    // White at the exposure is what the best seat sees on average.
    let best = found.pictures.iter().map(|view| view.mean_gain).fold(1.0, f64::max);
    let blur = 1e-3 * found.acuity.cell_mm / found.size_m[0];
    let panel = |title: String, gain: &dyn Fn(f64, f64) -> f64| Figure {
        title,
        subtitle: String::new(),
        x: Axis::new("x, m", -half[0], half[0]),
        y: Axis::new("y, m", -half[1], half[1]),
        layers: vec![Layer::Cells {
            low: [-half[0], -half[1]],
            high: half,
            columns: PICTURE,
            colours: picture(gain, size, 1.0 / best, blur),
        }],
        legend: Legend::None,
        bar: None,
    };
    let own = found.pictures.iter().map(|view| {
        let seat = if view.seat.inside { "" } else { ", in no audience" };
        let title = format!("{}{seat}: gain {:.2}", view.seat.name, view.mean_gain);
        panel(title, &|u, v| interpolated(&view.gain, found.columns, u, v))
    });
    let matte =
        found.pictures.iter().map(|view| panel(format!("{}, matte: gain 1", view.seat.name), &|_, _| 1.0));
    own.chain(matte).collect()
}

fn fragment(found: &Evaluation) -> Vec<Figure> {
    let across = found.fragment_columns;
    let best = found.fragment.iter().map(|(_, gain)| mean(gain)).fold(f64::MIN_POSITIVE, f64::max);
    let half = 0.5 * FRAGMENT_MM;
    let panel = |(angle, gain): &(f64, Vec<f64>)| {
        let size = [across, gain.len() / across];
        let colours = picture(
            &|u, v| {
                let (c, r) = ((u * size[0] as f64) as usize, (v * size[1] as f64) as usize);
                gain[r.min(size[1] - 1) * across + c.min(across - 1)]
            },
            size,
            1.0 / best,
            1.0 / across as f64,
        );
        Figure {
            title: format!("{angle:.0}°").replace('-', "\u{2212}"),
            subtitle: format!("mean gain {:.2}", mean(gain)),
            x: Axis::new("mm", -half, half),
            y: Axis::new("", -half, half),
            layers: vec![Layer::Cells { low: [-half; 2], high: [half; 2], columns: across, colours }],
            legend: Legend::None,
            bar: None,
        }
    };
    found.fragment.iter().map(panel).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn wall(found: &Evaluation) -> Figure {
    let wall = &found.wall;
    let bar = Bar { label: "light".into(), low: 0.0, high: 1.0, palette: Palette::heights() };
    let mut layers = vec![bar.cells(wall.low, wall.high, wall.columns, &wall.light)];
    layers.extend(found.wall_outlines.iter().map(|section| outline(section, |p| p.y)));
    Figure {
        title: "Reflection on a matte wall".into(),
        subtitle: "seen from behind the wall, facing the screen".into(),
        x: Axis::new("x, m", wall.low[0], wall.high[0]),
        y: Axis::new("y, m", wall.low[1], wall.high[1]),
        layers,
        legend: Legend::None,
        bar: Some(bar),
    }
}

fn misalignment(tolerance: &[Tolerance]) -> Vec<Figure> {
    let titles = ["Projector moved", "Tile shifted", "Tile turned"];
    let panel = |(at, three): (usize, &[Tolerance])| {
        let ends = three.iter().flat_map(|t| &t.off).copied();
        let most = ends.map(f64::abs).fold(0.0, f64::max);
        let least = three.iter().flat_map(|t| &t.on_audience).copied().fold(1.0, f64::min);
        let low = ((20.0 * least).floor() / 20.0 - 0.05).max(0.0);
        let layers = three.iter().zip([RED, BLUE, GREEN]).map(|(t, colour)| Layer::Line {
            name: t.what.rsplit(' ').next().unwrap_or_default().to_string(),
            points: t.off.iter().zip(&t.on_audience).map(|(&off, &on)| (off, 100.0 * on)).collect(),
            colour,
            dashed: false,
        });
        Figure {
            title: titles[at % titles.len()].into(),
            subtitle: if at == 2 { "about x, y, z".into() } else { "along x, y, z".into() },
            x: Axis::new(
                &format!("{}, {}", ["moved by", "shifted by", "turned by"][at % 3], three[0].unit),
                -most,
                most,
            ),
            y: Axis::new("light on the audience, %", 100.0 * low, 100.0),
            layers: layers.collect(),
            legend: Legend::LowerLeft,
            bar: None,
        }
    };
    tolerance.chunks(3).enumerate().map(panel).collect()
}
