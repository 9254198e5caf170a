//! A picture to show on a screen: an evening at sea, with a grey and a colour wedge, in linear light from 0 to 1.

/// Offsets and weights of a small Gaussian, in standard deviations.
const TAPS: [(f64, f64); 5] = [(-2.0, 0.0545), (-1.0, 0.2442), (0.0, 0.4026), (1.0, 0.2442), (2.0, 0.0545)];

/// The colour at a place: u from left to right, v from bottom to top, each 0 to 1; `tall` is height over width.
pub fn colour(u: f64, v: f64, tall: f64) -> [f64; 3] {
    if v < 0.12 {
        // Sixteen steps of grey over eight colours.
        let grey = ((u * 16.0).floor() / 15.0).clamp(0.0, 1.0);
        let patch = (u * 8.0).floor() as u8;
        let channel = |bit: u8| if patch >> bit & 1 == 1 { 0.9 } else { 0.02 };
        return if v < 0.06 { [channel(0), channel(1), channel(2)] } else { [grey * grey; 3] };
    }
    let mix = |a: [f64; 3], b: [f64; 3], t: f64| {
        let t = t.clamp(0.0, 1.0);
        [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t]
    };
    let (x, horizon) = ((u - 0.64) / tall.max(1e-6), 0.42);
    let sky = mix([0.95, 0.42, 0.12], [0.05, 0.12, 0.35], (v - horizon) / (1.0 - horizon) * 1.3);
    let sun = x.hypot(v - 0.52);
    if v > horizon {
        return mix([1.0, 0.93, 0.7], sky, (sun - 0.085) * 60.0);
    }
    let depth = (horizon - v) / (horizon - 0.12);
    let waves = 0.5 + 0.5 * ((9.0 / (depth + 0.08)).sin() + (40.0 * u + 25.0 * depth).sin() * 0.6);
    let glitter = (1.0 - x.abs() / (0.1 + 0.25 * depth)).max(0.0) * waves.clamp(0.0, 1.0);
    let sea = mix([0.30, 0.16, 0.10], [0.01, 0.03, 0.08], depth * 1.2);
    mix(sea, [1.0, 0.75, 0.35], glitter)
}

/// The same blurred by a Gaussian of this standard deviation, in parts of the width.
pub fn blurred(u: f64, v: f64, tall: f64, deviation: f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (across, weight_x) in TAPS {
        for (up, weight_y) in TAPS {
            let place = |at: f64, off: f64| (at + off).clamp(0.0, 1.0 - 1e-9);
            let sampled = colour(place(u, across * deviation), place(v, up * deviation / tall), tall);
            for (sum, value) in sum.iter_mut().zip(sampled) {
                *sum += weight_x * weight_y * value;
            }
        }
    }
    sum
}

/// A pixel's value for linear light (IEC 61966-2-1).
pub fn encoded(light: f64) -> u8 {
    let light = light.clamp(0.0, 1.0);
    let value = if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
    (255.0 * value).round() as u8
}
