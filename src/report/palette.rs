//! Colours of the pictures. Heights and deviations use Fabio Crameri's scientific colour maps batlow and vik
//! (doi 10.5281/zenodo.1243862), cavities acton: even to the eye, and readable without colour vision.

use colorgrad::{BlendMode, CatmullRomGradient, Color, Gradient, GradientBuilder};
use image::Rgb;

/// From low to high.
const BATLOW: [u32; 9] =
    [0x0B1F58, 0x103F60, 0x1C5A62, 0x3C6D56, 0x687B3E, 0x9D892B, 0xD29343, 0xF8A17B, 0xFDB7BC];
/// From gouged over nothing to material left.
const VIK: [u32; 11] = [
    0x001261, 0x033E7D, 0x1E6F9D, 0x71A8C4, 0xC9DDE7, 0xF5F2F0, 0xEACEBD, 0xD39774, 0xBE6533, 0x8B2706,
    0x590008,
];
/// From none to deep.
const ACTON: [u32; 7] = [0xF4F1F7, 0xDCC9DF, 0xD3A4C4, 0xCB6F9F, 0x985F8F, 0x5C3F73, 0x260C3F];

/// No data.
pub const NO_DATA: Rgb<u8> = Rgb([222, 223, 226]);
pub const PAPER: Rgb<u8> = Rgb([255, 255, 255]);
pub const INK: Rgb<u8> = Rgb([28, 31, 38]);
pub const SOFT_INK: Rgb<u8> = Rgb([104, 110, 122]);
pub const LINE: Rgb<u8> = Rgb([168, 173, 183]);

/// 1024 colours between the ends of a scale.
#[derive(Clone, Debug)]
pub struct Palette(Vec<Rgb<u8>>);

impl Palette {
    pub fn heights() -> Palette {
        Palette::through(&BATLOW)
    }

    pub fn deviations() -> Palette {
        Palette::through(&VIK)
    }

    pub fn cavities() -> Palette {
        Palette::through(&ACTON)
    }

    fn through(stops: &[u32]) -> Palette {
        let channel = |rgb: u32, shift: u32| (rgb >> shift & 0xFF) as u8;
        let colors: Vec<Color> = stops
            .iter()
            .map(|&rgb| Color::from_rgba8(channel(rgb, 16), channel(rgb, 8), channel(rgb, 0), 255))
            .collect();
        let gradient = GradientBuilder::new()
            .colors(&colors)
            .mode(BlendMode::Oklab)
            .build::<CatmullRomGradient>()
            .expect("two or more colours without positions make a gradient");
        let color = |index: u16| {
            let [r, g, b, _] = gradient.at(f32::from(index) / 1023.0).to_rgba8();
            Rgb([r, g, b])
        };
        Palette((0..1024).map(color).collect())
    }

    /// The colour of a place between 0 (low end) and 1; the ends hold beyond. NaN has no colour.
    pub fn at(&self, place: f64) -> Rgb<u8> {
        if place.is_nan() { NO_DATA } else { self.0[(place.clamp(0.0, 1.0) * 1023.0).round() as usize] }
    }
}
