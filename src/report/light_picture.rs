//! Pictures of light: where on a tile it is lost, and where in the room it goes.

use ab_glyph::FontRef;
use image::RgbImage;
use imageproc::drawing::{draw_filled_rect_mut, draw_line_segment_mut, draw_text_mut, text_size};
use imageproc::rect::Rect;

use super::palette::{INK, LINE, PAPER, Palette, SOFT_INK};
use super::picture::{Caption, Look, Raster, Sheet};
use super::scale::Scale;

/// Longest side of a loss map, in pixels.
pub const MOST_PIXELS: usize = 1200;

/// Pixels across a hemisphere.
const DISC: usize = 600;

/// Gains from here up to 10,000 times as much have a colour.
const DECADES: f64 = 4.0;

/// Angles from straight ahead that are drawn as circles, in degrees.
const CIRCLES: [f64; 4] = [15.0, 30.0, 45.0, 60.0];

/// What the cut's share on the audience lacks of the design's, by pixels.
pub fn lost(designed: &[f64], machined: &[f64]) -> Vec<f32> {
    designed.iter().zip(machined).map(|(before, after)| lacks(before - after)).collect()
}

/// Not below 0; NaN stays.
fn lacks(part: f64) -> f32 {
    if part < 0.0 { 0.0 } else { part as f32 }
}

/// A picture's pixels, row 0 the lowest.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    pub columns: usize,
    pub rows: usize,
    pub pitch_mm: f64,
}

/// [`lost`] light over a tile.
pub fn loss(frame: &Frame, lost: &[f32], caption: &Caption) -> RgbImage {
    let look = Look {
        title: "Light that the design sends to the audience and the cut does not",
        bar_title: "lost",
        ends: ["", "of what falls"],
        pixel: "loss",
        scale: Scale::parts(lost),
        palette: Palette::cavities(),
        shaded: false,
    };
    draw(frame, lost, &look, caption)
}

/// Mean errors of the normals in degrees over a tile.
pub fn normals(frame: &Frame, degrees: &[f32], caption: &Caption) -> RgbImage {
    let look = Look {
        title: "Error of the machined surface's normals",
        bar_title: "error",
        ends: ["", "off"],
        pixel: "mean error",
        scale: Scale::degrees(degrees),
        palette: Palette::cavities(),
        shaded: false,
    };
    draw(frame, degrees, &look, caption)
}

fn draw(frame: &Frame, values: &[f32], look: &Look, caption: &Caption) -> RgbImage {
    let Frame { columns, rows, pitch_mm } = *frame;
    let raster = Raster { columns, rows, pitch_mm, z_mm: values };
    Sheet::new(&raster, caption).draw(look, &raster, caption)
}

/// One hemisphere of outgoing light.
pub struct Hemisphere<'a> {
    pub title: &'a str,
    /// Gain by (o_x, o_y) from -1 to 1, `bins` squared, lowest y first.
    pub gain: &'a [f64],
    pub bins: usize,
}

/// Hemispheres side by side, as the screen looks into the room: the centre is straight ahead, a direction stands
/// at (o_x, o_y). `outlines` are the audience's edges as directions.
pub fn room(hemispheres: &[Hemisphere], outlines: &[[[f64; 3]; 2]], caption: &Caption) -> RgbImage {
    let (left, top, gap) = (40, 130, 50);
    let count = hemispheres.len().max(1);
    let width = left + (DISC + gap) * count + 130;
    let height = top + DISC + 60 + 25 * (caption.notes.len() + 2);
    let font = FontRef::try_from_slice(epaint_default_fonts::UBUNTU_LIGHT)
        .expect("the embedded font is a TrueType font");
    let mut page = Page { image: RgbImage::from_pixel(width as u32, height as u32, PAPER), font };
    page.text(INK, 30, 20, 31.0, "Where in the room the light goes");
    page.text(SOFT_INK, 31, 56, 21.0, &caption.part);
    let palette = Palette::heights();
    let most = hemispheres.iter().flat_map(|h| h.gain).copied().fold(0.0, f64::max).max(1e-9);
    let high = most.log10().ceil();
    for (index, hemisphere) in hemispheres.iter().enumerate() {
        let corner = [(left + index * (DISC + gap)) as i32, top as i32];
        page.text(INK, corner[0], corner[1] - 32, 21.0, hemisphere.title);
        page.hemisphere(hemisphere, corner, high, &palette);
        for angle in CIRCLES {
            page.circle(corner, angle);
        }
        for edge in outlines {
            page.edge(corner, edge);
        }
    }
    page.bar((left + count * (DISC + gap)) as i32, top as i32, high, &palette);
    let mut y = (top + DISC + 34) as i32;
    let made = format!(
        "gain 1 is a matte white screen; a direction stands at its x and y, so equal areas are equal projected solid \
         angles; circles at {} degrees",
        CIRCLES.map(|angle| format!("{angle}")).join(", ")
    );
    for note in
        caption.notes.iter().chain([&made, &"outlined: the audience, from the middle of the part".into()])
    {
        page.text(SOFT_INK, 30, y, 18.0, note);
        y += 25;
    }
    page.image
}

struct Page {
    image: RgbImage,
    font: FontRef<'static>,
}

impl Page {
    fn text(&mut self, color: image::Rgb<u8>, x: i32, y: i32, size: f32, text: &str) {
        draw_text_mut(&mut self.image, color, x, y, size, &self.font, text);
    }

    /// Pixels of a direction from a hemisphere's corner.
    fn place([left, top]: [i32; 2], x: f64, y: f64) -> (f32, f32) {
        let half = 0.5 * DISC as f64;
        ((f64::from(left) + half * (1.0 + x)) as f32, (f64::from(top) + half * (1.0 - y)) as f32)
    }

    fn hemisphere(&mut self, shown: &Hemisphere, [left, top]: [i32; 2], high: f64, palette: &Palette) {
        for row in 0..DISC {
            for column in 0..DISC {
                let part = |at: usize| (at as f64 + 0.5) / DISC as f64;
                let (x, y) = (2.0 * part(column) - 1.0, 1.0 - 2.0 * part(row));
                if x * x + y * y > 1.0 {
                    continue;
                }
                let bin = |part: f64| ((part * shown.bins as f64) as usize).min(shown.bins - 1);
                let gain = shown.gain[bin(part(column)) + shown.bins * bin(1.0 - part(row))];
                let place = (gain.max(1e-300).log10() - high) / DECADES + 1.0;
                self.image.put_pixel(
                    (left as usize + column) as u32,
                    (top as usize + row) as u32,
                    palette.at(place),
                );
            }
        }
    }

    fn circle(&mut self, corner: [i32; 2], angle_deg: f64) {
        let radius = angle_deg.to_radians().sin();
        let point = |k: u32| {
            let turn = f64::from(k) / 90.0 * std::f64::consts::TAU;
            Page::place(corner, radius * turn.cos(), radius * turn.sin())
        };
        for k in 0..90 {
            draw_line_segment_mut(&mut self.image, point(k), point(k + 1), LINE);
        }
        let (x, y) = Page::place(corner, 0.0, -radius);
        let label = format!("{angle_deg}°");
        let (width, _) = text_size(15.0, &self.font, &label);
        self.text(LINE, x as i32 - width as i32 / 2, y as i32 + 2, 15.0, &label);
    }

    /// A straight edge in the room, curved as directions go.
    fn edge(&mut self, corner: [i32; 2], [a, b]: &[[f64; 3]; 2]) {
        let point = |k: u32| {
            let t = f64::from(k) / 24.0;
            let v: [f64; 3] = std::array::from_fn(|axis| a[axis] + t * (b[axis] - a[axis]));
            let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
            Page::place(corner, v[0] / length, v[1] / length)
        };
        for k in 0..24 {
            draw_line_segment_mut(&mut self.image, point(k), point(k + 1), PAPER);
        }
    }

    fn bar(&mut self, left: i32, top: i32, high: f64, palette: &Palette) {
        let height = 400;
        self.text(INK, left, top - 32, 20.0, "gain");
        for y in 0..height {
            let place = 1.0 - (f64::from(y) + 0.5) / f64::from(height);
            let row = Rect::at(left, top + y).of_size(26, 1);
            draw_filled_rect_mut(&mut self.image, row, palette.at(place));
        }
        for decade in 0..=DECADES as i32 {
            let y = top + (f64::from(height) * f64::from(decade) / DECADES) as i32;
            let value = 10f64.powf(high - f64::from(decade));
            let label =
                if decade == DECADES as i32 { format!("{value} or less") } else { format!("{value}") };
            self.text(INK, left + 34, y - 10, 18.0, &label);
        }
    }
}
