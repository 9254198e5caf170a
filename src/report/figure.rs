//! Figures: curves, points, regions and coloured grids over two axes, as SVG and as PNG, drawn by plotters. Text is
//! measured and, in a PNG, drawn with the font that comes along; an SVG names it and leaves a viewer that lacks it
//! its own sans-serif. The same figure gives the same bytes on every system.

use std::error::Error as AnyError;
use std::path::{Path, PathBuf};
use std::sync::Once;

use image::ImageFormat;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, register_font};

use super::palette::{INK, LINE, Palette, SOFT_INK};
use super::scale::ticks;
use super::{Error, write_whole};

const FONT: &str = "Ubuntu, sans-serif";
/// A PNG has this many pixels for one of the SVG.
const SHARPNESS: u32 = 2;
/// Grids of more cells are not drawn as SVG, which would be megabytes of rectangles.
const MOST_SVG_CELLS: usize = 20_000;
/// Axes of logarithms over more decades are labelled at powers of ten alone.
const MOST_DECADES: usize = 8;
const HEADER: u32 = 54;
const LEFT: u32 = 66;
const RIGHT: u32 = 20;
const BOTTOM: u32 = 50;
const BAR: u32 = 104;

pub type Rgb8 = [u8; 3];

pub const RED: Rgb8 = [190, 49, 38];
pub const ORANGE: Rgb8 = [222, 130, 29];
pub const GREEN: Rgb8 = [31, 122, 77];
pub const BLUE: Rgb8 = [30, 111, 157];
pub const VIOLET: Rgb8 = [112, 72, 150];
pub const BLACK: Rgb8 = [28, 31, 38];
pub const GREY: Rgb8 = [150, 155, 165];

/// One plot: axes and what is drawn over them, first things lowest.
#[derive(Clone, Debug)]
pub struct Figure {
    pub title: String,
    /// A line of smaller text under the title.
    pub subtitle: String,
    pub x: Axis,
    pub y: Axis,
    pub layers: Vec<Layer>,
    pub legend: Legend,
    pub bar: Option<Bar>,
}

#[derive(Clone, Debug)]
pub struct Axis {
    pub label: String,
    pub low: f64,
    pub high: f64,
    /// Values are logarithms to base 10, labelled by what they are the logarithms of.
    pub logarithms: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Legend {
    None,
    UpperLeft,
    UpperRight,
    LowerLeft,
    LowerRight,
}

#[derive(Clone, Debug)]
pub enum Layer {
    Region {
        points: Vec<(f64, f64)>,
        colour: Rgb8,
        opacity: f64,
    },
    Line {
        name: String,
        points: Vec<(f64, f64)>,
        colour: Rgb8,
        dashed: bool,
    },
    Dots {
        name: String,
        points: Vec<(f64, f64)>,
        colour: Rgb8,
        radius: f64,
    },
    /// A grid from `low` to `high`, row-major with the lowest row first; None is left blank.
    Cells {
        low: [f64; 2],
        high: [f64; 2],
        columns: usize,
        colours: Vec<Option<Rgb8>>,
    },
    Text {
        at: (f64, f64),
        text: String,
        colour: Rgb8,
    },
}

/// A colour scale beside the plot.
#[derive(Clone, Debug)]
pub struct Bar {
    pub label: String,
    pub low: f64,
    pub high: f64,
    pub palette: Palette,
}

impl Axis {
    pub fn new(label: &str, low: f64, high: f64) -> Axis {
        Axis { label: label.into(), low, high, logarithms: false }
    }

    /// Round values on the axis and their labels.
    fn ticks(&self, count: usize) -> Vec<(f64, String)> {
        if !self.logarithms {
            return ticks(self.low, self.high, count);
        }
        let label = |value: f64| format!("{}", (value * 1e6).round() / 1e6);
        let decades = (self.high - self.low).ceil() as usize;
        if decades > MOST_DECADES {
            let powers = (self.low.ceil() as i32..).take_while(|&power| f64::from(power) <= self.high);
            let stride = decades.div_ceil(MOST_DECADES) as i32;
            return powers
                .filter(|power| power % stride == 0)
                .map(|power| {
                    let near = (-3..=3).contains(&power);
                    (f64::from(power), if near { label(10f64.powi(power)) } else { format!("1e{power}") })
                })
                .collect();
        }
        let steps = [1.0, 2.0, 5.0];
        let powers = self.low.floor() as i32..=self.high.ceil() as i32;
        let values = powers.flat_map(|power| steps.map(|step| step * 10f64.powi(power)));
        values
            .filter(|value| (self.low - 1e-9..=self.high + 1e-9).contains(&value.log10()))
            .map(|value| (value.log10(), label(value)))
            .collect()
    }

    fn coordinate(&self, count: usize) -> Coordinate {
        Coordinate { low: self.low, high: self.high, ticks: self.ticks(count) }
    }
}

/// An axis as plotters wants it: where its values stand, and which are labelled how.
struct Coordinate {
    low: f64,
    high: f64,
    ticks: Vec<(f64, String)>,
}

impl Ranged for Coordinate {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let place = (value - self.low) / (self.high - self.low);
        from + (f64::from(to - from) * place).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        self.ticks.iter().map(|tick| tick.0).collect()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Coordinate {
    fn format_ext(&self, value: &f64) -> String {
        let tick = self.ticks.iter().find(|tick| tick.0 == *value);
        tick.map_or(String::new(), |tick| tick.1.clone())
    }
}

impl Bar {
    /// The colour of a value; NaN has none.
    pub fn colour(&self, value: f64) -> Option<Rgb8> {
        value.is_finite().then(|| self.palette.at((value - self.low) / (self.high - self.low)).0)
    }

    /// A grid in this scale's colours.
    pub fn cells(&self, low: [f64; 2], high: [f64; 2], columns: usize, values: &[f64]) -> Layer {
        Layer::Cells { low, high, columns, colours: values.iter().map(|&v| self.colour(v)).collect() }
    }
}

/// Height of a panel of this width whose axes have one scale, for spans along x and y.
pub fn height_to_scale(width: u32, bar: bool, [across, up]: [f64; 2]) -> u32 {
    let plot = f64::from(width) - f64::from(LEFT + RIGHT + if bar { BAR } else { 0 });
    (plot * up / across).clamp(80.0, 1400.0).round() as u32 + HEADER + BOTTOM
}

/// Draws panels in rows of `across` to `stem`.png and, unless a grid is too fine, `stem`.svg; `size` in pixels of
/// the SVG. Gives the names of the files, without their folder.
pub fn write(stem: &Path, panels: &[Figure], across: usize, size: [u32; 2]) -> Result<Vec<String>, Error> {
    static FONTS: Once = Once::new();
    FONTS.call_once(|| {
        // A font that cannot be read leaves figures without text, which their tests would see.
        let _ = register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT);
    });
    let failed = |source| Error::Figure { path: stem.display().to_string(), source };
    let mut names = Vec::new();
    let [width, height] = size.map(|side| side * SHARPNESS);
    let mut pixels = vec![0; 3 * (width * height) as usize];
    {
        let backend = BitMapBackend::with_buffer(&mut pixels, (width, height));
        sheet(&backend.into_drawing_area(), panels, across, SHARPNESS).map_err(failed)?;
    }
    let png = extended(stem, "png");
    write_whole(&png, |writer| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image::write_buffer_with_format(
            &mut bytes,
            &pixels,
            width,
            height,
            image::ExtendedColorType::Rgb8,
            ImageFormat::Png,
        )
        .map_err(|source| failed(source.into()))?;
        writer
            .write_all(bytes.get_ref())
            .map_err(|source| Error::Io { path: png.display().to_string(), source })
    })?;
    names.push(name(&png));
    let cells = panels.iter().flat_map(|panel| &panel.layers).map(|layer| match layer {
        Layer::Cells { colours, .. } => colours.len(),
        _ => 0,
    });
    if cells.sum::<usize>() <= MOST_SVG_CELLS {
        let mut text = String::new();
        let backend = SVGBackend::with_string(&mut text, (size[0], size[1]));
        sheet(&backend.into_drawing_area(), panels, across, 1).map_err(failed)?;
        let svg = extended(stem, "svg");
        write_whole(&svg, |writer| {
            writer
                .write_all(text.as_bytes())
                .map_err(|source| Error::Io { path: svg.display().to_string(), source })
        })?;
        names.push(name(&svg));
    }
    Ok(names)
}

fn extended(stem: &Path, extension: &str) -> PathBuf {
    let mut path = stem.as_os_str().to_owned();
    path.push(".");
    path.push(extension);
    path.into()
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

type Failed = Box<dyn AnyError + Send + Sync>;

fn sheet<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    panels: &[Figure],
    across: usize,
    unit: u32,
) -> Result<(), Failed>
where
    DB::ErrorType: 'static,
{
    area.fill(&WHITE)?;
    let across = across.clamp(1, panels.len().max(1));
    let parts = area.split_evenly((panels.len().div_ceil(across), across));
    for (part, panel) in parts.iter().zip(panels) {
        plot(part, panel, unit)?;
    }
    area.present()?;
    Ok(())
}

fn plot<DB: DrawingBackend>(area: &DrawingArea<DB, Shift>, figure: &Figure, unit: u32) -> Result<(), Failed>
where
    DB::ErrorType: 'static,
{
    let px = |size: u32| (size * unit) as i32;
    let text = |size: u32, colour: RGBColor| (FONT, size * unit).into_font().color(&colour);
    let (ink, soft) = (rgb(INK.0), rgb(SOFT_INK.0));
    area.draw_text(&figure.title, &text(19, ink), (px(16), px(10)))?;
    area.draw_text(&figure.subtitle, &text(14, soft), (px(16), px(33)))?;
    let (width, height) = area.dim_in_pixel();
    let bar_width = if figure.bar.is_some() { px(BAR) } else { 0 };
    let ticks_x = (width / (90 * unit)).clamp(2, 12) as usize;
    let ticks_y = (height / (60 * unit)).clamp(2, 10) as usize;
    let mut chart = ChartBuilder::on(area)
        .margin_top(px(HEADER))
        .margin_right(px(RIGHT) + bar_width)
        .margin_left(px(8))
        .margin_bottom(px(6))
        .x_label_area_size(px(BOTTOM - 6))
        .y_label_area_size(px(LEFT - 8))
        .build_cartesian_2d(figure.x.coordinate(ticks_x), figure.y.coordinate(ticks_y))?;
    for layer in &figure.layers {
        if let Layer::Cells { low, high, columns, colours } = layer {
            let rows = colours.len() / columns.max(&1);
            let edge = |axis: usize, k: usize, count: usize| {
                low[axis] + (high[axis] - low[axis]) * k as f64 / count as f64
            };
            chart.draw_series(colours.iter().enumerate().filter_map(|(at, colour)| {
                let (i, j) = (at % columns, at / columns);
                let a = (edge(0, i, *columns), edge(1, j + 1, rows));
                let b = (edge(0, i + 1, *columns), edge(1, j, rows));
                colour.map(|colour| Rectangle::new([a, b], rgb(colour).filled()))
            }))?;
        }
    }
    let covered = figure.layers.iter().any(|layer| matches!(layer, Layer::Cells { .. }));
    let mut mesh = chart.configure_mesh();
    mesh.light_line_style(TRANSPARENT)
        .bold_line_style(rgb(LINE.0).mix(if covered { 0.0 } else { 0.5 }))
        .axis_style(rgb(SOFT_INK.0).stroke_width(unit))
        .x_desc(&figure.x.label)
        .y_desc(&figure.y.label)
        .axis_desc_style(text(15, ink))
        .label_style(text(14, ink))
        .draw()?;
    for layer in &figure.layers {
        match layer {
            Layer::Cells { .. } => {}
            Layer::Region { points, colour, opacity } => {
                let region = Polygon::new(points.clone(), rgb(*colour).mix(*opacity));
                chart.draw_series(std::iter::once(region))?;
            }
            Layer::Line { name, points, colour, dashed } => {
                let style = rgb(*colour).stroke_width(2 * unit);
                let drawn = if *dashed {
                    let (dash, gap) = (px(7), px(5));
                    chart.draw_series(DashedLineSeries::new(points.iter().copied(), dash, gap, style))?
                } else {
                    chart.draw_series(LineSeries::new(points.iter().copied(), style))?
                };
                if !name.is_empty() {
                    let (long, part) = (px(22), if *dashed { px(9) } else { px(22) });
                    drawn.label(name).legend(move |(x, y)| {
                        let second = PathElement::new([(x + long - part, y), (x + long, y)], style);
                        EmptyElement::at((0, 0)) + PathElement::new([(x, y), (x + part, y)], style) + second
                    });
                }
            }
            Layer::Dots { name, points, colour, radius } => {
                let style = rgb(*colour).filled();
                let size = (radius * f64::from(unit)).round().max(1.0) as i32;
                let dots = points.iter().map(|&point| Circle::new(point, size, style));
                let drawn = chart.draw_series(dots)?;
                if !name.is_empty() {
                    let (middle, size) = (px(11), px(4));
                    drawn.label(name).legend(move |(x, y)| Circle::new((x + middle, y), size, style));
                }
            }
            Layer::Text { at, text: words, colour } => {
                let style = text(14, rgb(*colour)).pos(Pos::new(HPos::Left, VPos::Bottom));
                chart.draw_series(std::iter::once(Text::new(words.clone(), *at, style)))?;
            }
        }
    }
    let position = match figure.legend {
        Legend::None => None,
        Legend::UpperLeft => Some(SeriesLabelPosition::UpperLeft),
        Legend::UpperRight => Some(SeriesLabelPosition::UpperRight),
        Legend::LowerLeft => Some(SeriesLabelPosition::LowerLeft),
        Legend::LowerRight => Some(SeriesLabelPosition::LowerRight),
    };
    if let Some(position) = position {
        chart
            .configure_series_labels()
            .position(position)
            .margin(px(8))
            .legend_area_size(px(28))
            .background_style(WHITE.mix(0.85))
            .border_style(rgb(LINE.0))
            .label_font(text(14, ink))
            .draw()?;
    }
    if let Some(bar) = &figure.bar {
        let (left, right) = (width as i32 - px(100), width as i32 - px(80));
        let (top, bottom) = (px(HEADER + 24), height as i32 - px(BOTTOM));
        let tall = bottom - top;
        for y in 0..tall {
            let colour = bar.palette.at(1.0 - f64::from(y) / f64::from(tall - 1)).0;
            area.draw(&Rectangle::new([(left, top + y), (right, top + y + 1)], rgb(colour).filled()))?;
        }
        for (value, label) in ticks(bar.low, bar.high, ticks_y) {
            let y = bottom - ((value - bar.low) / (bar.high - bar.low) * f64::from(tall)).round() as i32;
            let style = text(14, ink).pos(Pos::new(HPos::Left, VPos::Center));
            area.draw_text(&label, &style, (right + px(6), y))?;
        }
        area.draw_text(&bar.label, &text(14, ink), (left, px(HEADER)))?;
    }
    Ok(())
}

fn rgb([r, g, b]: Rgb8) -> RGBColor {
    RGBColor(r, g, b)
}
