//! A map as a picture: title, axes and scale bar in mm, colour bar with unit, and what it was made from.

use std::path::Path;

use ab_glyph::FontRef;
use image::{ImageFormat, Rgb, RgbImage};
use imageproc::drawing::{
    draw_filled_rect_mut, draw_hollow_rect_mut, draw_line_segment_mut, draw_text_mut, text_size,
};
use imageproc::rect::Rect;

use super::maps::{MapRow, Reducer};
use super::palette::{INK, LINE, NO_DATA, PAPER, Palette, SOFT_INK};
use super::scale::{Scale, round_up, ticks};
use super::{Error, write_whole};

/// Longest side of a map in a picture, in pixels.
const MOST_PIXELS: usize = 1200;
const HEADER: i32 = 124;
const LEFT: i32 = 92;
const RIGHT: i32 = 190;
const LINE_HEIGHT: i32 = 25;

/// Which map, and with it how it is coloured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Design,
    Machined,
    Deviation,
    Cavity,
}

impl Kind {
    pub const ALL: [Kind; 4] = [Kind::Design, Kind::Machined, Kind::Deviation, Kind::Cavity];

    /// As in the map's file name.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Design => "design",
            Kind::Machined => "machined",
            Kind::Deviation => "deviation",
            Kind::Cavity => "cavity",
        }
    }

    fn look(self, values: &[f32]) -> Look {
        let relief = |title| Look {
            title,
            bar_title: "height",
            ends: ["", ""],
            pixel: "mean height",
            scale: Scale::robust(values),
            palette: Palette::heights(),
            shaded: true,
        };
        match self {
            Kind::Design => relief("Designed surface"),
            Kind::Machined => relief("Machined surface, read back from the programs"),
            Kind::Deviation => Look {
                title: "Deviation of the machined surface from the design",
                bar_title: "deviation",
                ends: ["gouged", "left standing"],
                pixel: "deviation of the largest size",
                scale: Scale::about_zero(values),
                palette: Palette::deviations(),
                shaded: false,
            },
            Kind::Cavity => Look {
                title: "Cavities that no cutter of the job reaches",
                bar_title: "depth",
                ends: ["", "unreached"],
                pixel: "greatest depth",
                scale: Scale::from_zero(values, crate::fidelity::CAVITY_THRESHOLD_MM as f32),
                palette: Palette::cavities(),
                shaded: false,
            },
        }
    }
}

/// How a map is titled and coloured.
pub(super) struct Look {
    pub title: &'static str,
    pub bar_title: &'static str,
    /// Words at the low and the high end of the colour bar.
    pub ends: [&'static str; 2],
    /// What a pixel shows.
    pub pixel: &'static str,
    pub scale: Scale,
    pub palette: Palette,
    /// As a relief, lit from the upper left.
    pub shaded: bool,
}

/// Layers small enough for a picture: design and machined are means over each pixel's samples, deviation the one
/// with the largest size, cavity the deepest. Memory does not grow with the tile.
#[derive(Debug)]
pub struct Preview {
    reducer: Reducer,
    pitch_mm: f64,
    means: [Mean; 2],
    layers: [Vec<f32>; 4],
}

#[derive(Clone, Debug, Default)]
struct Mean {
    sums: Vec<f64>,
    counts: Vec<u32>,
}

impl Mean {
    fn add(&mut self, row: &[f32], factor: usize) {
        for (pixel, samples) in row.chunks(factor).enumerate() {
            for &z in samples.iter().filter(|z| z.is_finite()) {
                self.sums[pixel] += f64::from(z);
                self.counts[pixel] += 1;
            }
        }
    }

    fn take_row(&mut self, into: &mut Vec<f32>) {
        let mean =
            |(sum, count): (&f64, &u32)| if *count > 0 { (sum / f64::from(*count)) as f32 } else { f32::NAN };
        into.extend(self.sums.iter().zip(&self.counts).map(mean));
        self.sums.fill(0.0);
        self.counts.fill(0);
    }
}

impl Preview {
    /// For maps of this many columns and rows, a sample every `pitch_mm`.
    pub fn new(columns: usize, rows: usize, pitch_mm: f64) -> Preview {
        let reducer = Reducer::by_factor(columns, rows, columns.max(rows).div_ceil(MOST_PIXELS));
        let mean = Mean { sums: vec![0.0; reducer.columns()], counts: vec![0; reducer.columns()] };
        Preview { pitch_mm, means: [mean.clone(), mean], layers: Default::default(), reducer }
    }

    /// Takes the next row of the maps, lowest y first.
    pub fn take(&mut self, row: &MapRow) -> Result<(), Error> {
        let factor = self.reducer.factor();
        self.means[0].add(&row.design, factor);
        self.means[1].add(&row.machined, factor);
        let Preview { reducer, means, layers, .. } = self;
        let strip = super::maps::Strip { design: &row.design, machined: &row.machined, cavity: &row.cavity };
        reducer.push(strip, |reduced| -> Result<(), Error> {
            means[0].take_row(&mut layers[0]);
            means[1].take_row(&mut layers[1]);
            layers[2].extend(&reduced.deviation);
            layers[3].extend(&reduced.cavity);
            Ok(())
        })
    }

    /// Samples of the maps along each side of a pixel.
    pub fn factor(&self) -> usize {
        self.reducer.factor()
    }

    /// Draws one of the maps; rows not taken yet are no data.
    pub fn draw(&self, kind: Kind, caption: &Caption) -> RgbImage {
        let raster = Raster {
            columns: self.reducer.columns(),
            rows: self.reducer.rows(),
            pitch_mm: self.pitch_mm * self.reducer.factor() as f64,
            z_mm: &self.layers[kind as usize],
        };
        Sheet::new(&raster, caption).draw(&kind.look(raster.z_mm), &raster, caption)
    }
}

/// The words of a picture.
#[derive(Clone, Debug, Default)]
pub struct Caption {
    /// Part or job.
    pub part: String,
    /// Tile, e.g. `r0c0`.
    pub tile: String,
    /// Lower left corner in the part frame, so that axes read part coordinates.
    pub origin_mm: [f64; 2],
    /// Lines at the foot: grid and step, error bound, figures.
    pub notes: Vec<String>,
}

/// Writes a picture as PNG, whole or not at all.
pub fn write_png(path: &Path, picture: &RgbImage) -> Result<(), Error> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let failed = |source| Error::Io { path: path.display().to_string(), source };
    picture.write_to(&mut bytes, ImageFormat::Png).map_err(|error| failed(std::io::Error::other(error)))?;
    write_whole(path, |writer| writer.write_all(bytes.get_ref()).map_err(failed))
}

pub(super) struct Raster<'a> {
    pub columns: usize,
    pub rows: usize,
    pub pitch_mm: f64,
    pub z_mm: &'a [f32],
}

impl Raster<'_> {
    fn at(&self, column: usize, row: usize) -> f64 {
        if column >= self.columns || row >= self.rows {
            return f64::NAN;
        }
        self.z_mm.get(row * self.columns + column).map_or(f64::NAN, |&z| f64::from(z))
    }

    /// Slopes by differences over the neighbours there are; 0 where there are none.
    fn slope(&self, column: usize, row: usize) -> [f64; 2] {
        let centre = self.at(column, row);
        let along = |low: f64, high: f64| match (low.is_finite(), high.is_finite()) {
            (true, true) => (high - low) / (2.0 * self.pitch_mm),
            (true, false) => (centre - low) / self.pitch_mm,
            (false, true) => (high - centre) / self.pitch_mm,
            (false, false) => 0.0,
        };
        [
            along(self.at(column.wrapping_sub(1), row), self.at(column + 1, row)),
            along(self.at(column, row.wrapping_sub(1)), self.at(column, row + 1)),
        ]
    }
}

/// Light from the upper left, 45 degrees high; slopes are stretched so that the usual ones are well seen.
struct Relief {
    stretch: f64,
    mean: [f64; 2],
}

impl Relief {
    fn of(raster: &Raster) -> Relief {
        let slopes: Vec<[f64; 2]> = (0..raster.rows)
            .flat_map(|row| (0..raster.columns).map(move |column| (column, row)))
            .filter(|&(column, row)| raster.at(column, row).is_finite())
            .map(|(column, row)| raster.slope(column, row))
            .collect();
        let count = slopes.len().max(1) as f64;
        let mean = [0, 1].map(|axis| slopes.iter().map(|slope| slope[axis]).sum::<f64>() / count);
        let mut sizes: Vec<f64> = slopes.iter().map(|s| (s[0] - mean[0]).hypot(s[1] - mean[1])).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        let usual = sizes.get(sizes.len() * 7 / 10).copied().unwrap_or(0.0);
        Relief { stretch: if usual > 1e-9 { (0.45 / usual).min(200.0) } else { 1.0 }, mean }
    }

    /// 1 for a surface of mean slope, less in shade, more towards the light.
    fn shade(&self, slope: [f64; 2]) -> f64 {
        let [x, y] = [0, 1].map(|axis| (slope[axis] - self.mean[axis]) * self.stretch);
        // Light direction (-1, 1, sqrt 2) / 2 against the normal (-x, -y, 1).
        let lambert = (x - y + std::f64::consts::SQRT_2) / (2.0 * (1.0 + x * x + y * y).sqrt());
        0.30 + 0.70 * (lambert.max(0.0) / std::f64::consts::FRAC_1_SQRT_2)
    }
}

fn lit(Rgb(color): Rgb<u8>, shade: f64) -> Rgb<u8> {
    // Past 1 the colour goes towards white instead of clipping channel by channel.
    let white = ((shade - 1.0) * 1.1).clamp(0.0, 0.45);
    Rgb(color.map(|channel| {
        let value = f64::from(channel) * shade.min(1.0);
        (value + (255.0 - value) * white).round() as u8
    }))
}

/// The paper, its font and where the map lies on it.
pub(super) struct Sheet {
    image: RgbImage,
    font: FontRef<'static>,
    left: i32,
    top: i32,
    width: i32,
    height: i32,
    pixels_per_mm: f64,
}

impl Sheet {
    pub fn new(raster: &Raster, caption: &Caption) -> Sheet {
        let longest = raster.columns.max(raster.rows).max(1);
        let zoom = (MOST_PIXELS / longest).max(1);
        let (width, height) = ((raster.columns * zoom) as i32, (raster.rows * zoom) as i32);
        let whole_width = (LEFT + width + RIGHT).max(860);
        let foot = 74 + LINE_HEIGHT * (caption.notes.len() as i32 + 1) + 14;
        let whole_height = HEADER + height.max(260) + foot;
        Sheet {
            image: RgbImage::from_pixel(whole_width as u32, whole_height as u32, PAPER),
            font: FontRef::try_from_slice(epaint_default_fonts::UBUNTU_LIGHT)
                .expect("the embedded font is a TrueType font"),
            left: LEFT + (whole_width - LEFT - width - RIGHT) / 2,
            top: HEADER,
            width,
            height,
            pixels_per_mm: zoom as f64 / raster.pitch_mm,
        }
    }

    pub fn draw(mut self, look: &Look, raster: &Raster, caption: &Caption) -> RgbImage {
        let tile = if caption.tile.is_empty() { String::new() } else { format!("tile {}", caption.tile) };
        self.text(INK, 30, 20, 31.0, look.title);
        let between = if caption.part.is_empty() || tile.is_empty() { "" } else { "  ·  " };
        self.text(SOFT_INK, 31, 56, 21.0, &format!("{}{between}{tile}", caption.part));

        let relief = look.shaded.then(|| Relief::of(raster));
        self.map(raster, &look.scale, &look.palette, relief.as_ref());
        self.axes(caption.origin_mm);
        self.bar(look, raster.z_mm);
        self.scale_bar();

        let mut y = self.top + self.height.max(260) + 74;
        let mut notes = caption.notes.clone();
        notes.push(Sheet::made_from(look, raster.pitch_mm));
        for note in notes {
            self.text(SOFT_INK, 30, y, 18.0, &note);
            y += LINE_HEIGHT;
        }
        self.image
    }

    fn made_from(look: &Look, pitch_mm: f64) -> String {
        let what = look.pixel;
        let colors = if look.shaded {
            "relief shaded from the upper left, stretched"
        } else {
            "colours go by the square root, so that small figures show"
        };
        format!("a pixel shows the {what} in {pitch_mm:.3} mm x {pitch_mm:.3} mm; {colors}; grey is no data")
    }

    fn map(&mut self, raster: &Raster, scale: &Scale, palette: &Palette, relief: Option<&Relief>) {
        let zoom = (self.width as usize / raster.columns.max(1)).max(1);
        for row in 0..raster.rows {
            for column in 0..raster.columns {
                let z_mm = raster.at(column, row);
                let flat = if z_mm.is_finite() { palette.at(scale.place(z_mm)) } else { NO_DATA };
                let color = match relief {
                    Some(relief) if z_mm.is_finite() => lit(flat, relief.shade(raster.slope(column, row))),
                    _ => flat,
                };
                // Row 0 has the lowest y, the picture's first row the highest.
                let x = self.left as usize + column * zoom;
                let y = self.top as usize + (raster.rows - 1 - row) * zoom;
                for (x, y) in (y..y + zoom).flat_map(|y| (x..x + zoom).map(move |x| (x, y))) {
                    self.image.put_pixel(x as u32, y as u32, color);
                }
            }
        }
        self.frame(self.left - 1, self.top - 1, self.width + 2, self.height + 2);
    }

    fn axes(&mut self, origin_mm: [f64; 2]) {
        let (width_mm, height_mm) =
            (f64::from(self.width) / self.pixels_per_mm, f64::from(self.height) / self.pixels_per_mm);
        let bottom = self.top + self.height;
        let count = |pixels: i32| (pixels / 110).clamp(2, 8) as usize;
        for (x_mm, label) in ticks(origin_mm[0], origin_mm[0] + width_mm, count(self.width)) {
            let x = self.left + ((x_mm - origin_mm[0]) * self.pixels_per_mm).round() as i32;
            self.line(x, bottom + 1, x, bottom + 7);
            self.centred(SOFT_INK, x, bottom + 9, 18.0, &label);
        }
        for (y_mm, label) in ticks(origin_mm[1], origin_mm[1] + height_mm, count(self.height)) {
            let y = bottom - ((y_mm - origin_mm[1]) * self.pixels_per_mm).round() as i32;
            self.line(self.left - 7, y, self.left - 1, y);
            let (width, _) = text_size(18.0, &self.font, &label);
            self.text(SOFT_INK, self.left - 11 - width as i32, y - 10, 18.0, &label);
        }
        self.text(SOFT_INK, self.left - 1, bottom + 32, 18.0, "x in mm");
        self.text(SOFT_INK, self.left - 60, self.top - 27, 18.0, "y in mm");
    }

    fn scale_bar(&mut self) {
        let width_mm = f64::from(self.width) / self.pixels_per_mm;
        let length_mm = round_up(width_mm / 9.0);
        let length = (length_mm * self.pixels_per_mm).round() as i32;
        let (right, y) = (self.left + self.width, self.top + self.height + 44);
        draw_filled_rect_mut(
            &mut self.image,
            Rect::at(right - length, y).of_size(length.max(1) as u32, 5),
            INK,
        );
        for x in [right - length, right - 2] {
            draw_filled_rect_mut(&mut self.image, Rect::at(x, y - 4).of_size(2, 13), INK);
        }
        let label = format!("{length_mm} mm");
        let (text_width, _) = text_size(19.0, &self.font, &label);
        self.text(INK, right - length - 12 - text_width as i32, y - 8, 19.0, &label);
    }

    fn bar(&mut self, look: &Look, values: &[f32]) {
        let Look { scale, palette, .. } = look;
        let (left, width) = (self.left + self.width + 34, 26);
        let (top, height) = (self.top + 46, (self.height - 92).clamp(120, 620));
        for y in 0..height {
            let place = 1.0 - (f64::from(y) + 0.5) / f64::from(height);
            let row = Rect::at(left, top + y).of_size(width as u32, 1);
            draw_filled_rect_mut(&mut self.image, row, palette.at(place));
        }
        self.frame(left - 1, top - 1, width + 2, height + 2);
        let (unit, per_mm) = scale.unit();
        self.text(INK, left, self.top - 4, 20.0, &format!("{} in {unit}", look.bar_title));
        let [low, high] = look.ends;
        self.text(SOFT_INK, left, self.top + 19, 17.0, high);
        self.text(SOFT_INK, left, top + height + 5, 17.0, low);
        for (value_mm, label) in scale.ticks((height / 75).max(2) as usize) {
            let y = top + height - (scale.place(value_mm) * f64::from(height)).round() as i32;
            self.line(left + width, y, left + width + 6, y);
            self.text(INK, left + width + 11, y - 10, 18.0, &label);
        }
        let finite = values.iter().filter(|value| value.is_finite());
        let (lowest, highest) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| {
            (low.min(f64::from(value)), high.max(f64::from(value)))
        });
        if lowest <= highest {
            let decimals = if per_mm == 1.0 { 3 } else { 1 };
            let range = format!("{:.decimals$} to {:.decimals$} {unit}", lowest * per_mm, highest * per_mm);
            let y = top + height + if low.is_empty() { 8 } else { 30 };
            self.text(SOFT_INK, left, y, 16.0, &range.replace('-', "\u{2212}"));
        }
    }

    fn text(&mut self, color: Rgb<u8>, x: i32, y: i32, size: f32, text: &str) {
        draw_text_mut(&mut self.image, color, x, y, size, &self.font, text);
    }

    fn centred(&mut self, color: Rgb<u8>, x: i32, y: i32, size: f32, text: &str) {
        let (width, _) = text_size(size, &self.font, text);
        self.text(color, x - width as i32 / 2, y, size, text);
    }

    fn line(&mut self, x0: i32, y0: i32, x1: i32, y1: i32) {
        let point = |x: i32, y: i32| (x as f32, y as f32);
        draw_line_segment_mut(&mut self.image, point(x0, y0), point(x1, y1), LINE);
    }

    fn frame(&mut self, x: i32, y: i32, width: i32, height: i32) {
        let size = |length: i32| length.max(1) as u32;
        draw_hollow_rect_mut(&mut self.image, Rect::at(x, y).of_size(size(width), size(height)), LINE);
    }
}
