use glam::DVec3;

use super::Grid;
use crate::screen::Figures;

/// Gain of the silver screen that the paper measured against, straight before it.
pub const HIGH_GAIN_PEAK: f64 = 2.9;
/// Angle at which it has half of that. The paper's text gives only the peak and that it falls: assumed.
const HIGH_GAIN_HALF_DEG: f64 = 25.0;

/// Gain over viewing angles, in degrees and times a matte screen.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Curve {
    pub name: String,
    pub angle_deg: Vec<f64>,
    pub gain: Vec<f64>,
}

/// Model of a high-gain silver screen: its peak, halved for every square of 25 degrees off the mirror direction.
pub fn high_gain(angle_deg: f64) -> f64 {
    HIGH_GAIN_PEAK * (-(angle_deg / HIGH_GAIN_HALF_DEG).powi(2)).exp2()
}

/// The same at a point of a flat screen z = 0 towards a place: the angle is that to the projector's mirror image.
pub fn high_gain_towards(point_m: DVec3, projector_m: DVec3, place_m: DVec3) -> f64 {
    let i = (projector_m - point_m).normalize();
    let mirrored = DVec3::new(-i.x, -i.y, i.z);
    high_gain(mirrored.angle_between(place_m - point_m).to_degrees())
}

/// Gain of a white patch against the viewing angle in the plane along x through the patch and the middle of the
/// audience: with the mask as a filter (`mask` at the patch), by redirection, and without either the model of a
/// high-gain screen and a matte one.
pub fn gain_curves(patch: &Grid, middle_m: DVec3, mask: f64, figures: &Figures) -> Vec<Curve> {
    let count = patch.cells.len().max(1) as f64;
    let centre = patch.cells.iter().map(|cell| cell.point_m).sum::<DVec3>() / count;
    let lift = (middle_m - centre).y.atan2((middle_m - centre).z);
    let angles: Vec<f64> = (-240..=240).map(|k| 0.25 * f64::from(k)).collect();
    let bare: Vec<f64> = angles
        .iter()
        .map(|angle| {
            let (sin, cos) = angle.to_radians().sin_cos();
            let o = DVec3::new(sin, cos * lift.sin(), cos * lift.cos());
            patch.cells.iter().map(|cell| cell.gain(o)).sum::<f64>() / count
        })
        .collect();
    let curve = |name: &str, gain: Vec<f64>| Curve { name: name.into(), angle_deg: angles.clone(), gain };
    let scaled = |factor: f64| bare.iter().map(|gain| factor * gain).collect::<Vec<f64>>();
    vec![
        curve("directional, attenuation", scaled(mask)),
        curve("directional, redirection", scaled(mask / figures.mask_mean)),
        curve("high gain 2.9, model", angles.iter().map(|angle| high_gain(*angle)).collect()),
        curve("matte", vec![1.0; angles.len()]),
    ]
}
