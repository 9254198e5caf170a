//! The room of a designed screen, as the judge of one tile needs it.

use glam::DVec3;
use image::RgbImage;

use crate::fidelity::Pixels;
use crate::fidelity::light::{Centres, LightTally, Metal, Pose, ROOM_BINS, Room, View};
use crate::grid::{Heights, Lattice, Window};
use crate::report::light_picture::{self, Hemisphere};
use crate::report::picture::Caption;
use crate::report::{Light, Polished};
use crate::screen::Scene;

/// Points across a tile from which the audience is looked at.
const POINTS: usize = 4;

/// Samples around a block that a ray is followed into, at 10 um.
const HALO_MM: f64 = 0.16;

/// A tile in its place in front of the audience.
pub struct Sight<'a> {
    pub scene: &'a Scene,
    pub pose: Pose,
    /// Steepest face of the part, as it hangs.
    pub steepest: f64,
    pub far_field: Option<&'a Centres>,
}

impl Sight<'_> {
    /// The room in front of the tile.
    pub fn room(&self) -> Room<'_> {
        let reflector = &self.scene.reflector;
        Room {
            projector_m: self.scene.projector_m,
            audience: &self.scene.audience,
            metal: Metal::new(reflector.reflectance, reflector.roughness, reflector.diffuse),
            steepest: self.steepest,
            far_field: self.far_field,
        }
    }

    /// Adds the light of a block of heights of the tile's frame, and if asked for to a map of the tile.
    pub fn add(
        &self,
        tally: &mut LightTally,
        heights: &Heights,
        window: Window,
        step_mm: f64,
        map: Option<&mut Pixels>,
    ) {
        tally.add(heights, window, step_mm, &self.pose, &self.room(), map);
    }
}

/// Samples that the heights of a block should reach further than it on every side.
pub fn halo(step_mm: f64) -> usize {
    (HALO_MM / step_mm).ceil().clamp(1.0, 64.0) as usize
}

/// Points of a tile from which the audience is looked at, in metres of the screen's frame.
pub fn points(pose: &Pose, lattice: &Lattice) -> Vec<DVec3> {
    let place = |i: usize, length_mm: f64| (i as f64 + 0.5) / POINTS as f64 * length_mm;
    (0..POINTS * POINTS)
        .map(|k| {
            let x_mm = place(k % POINTS, lattice.width_mm);
            let y_mm = place(k / POINTS, lattice.height_mm);
            pose.point_m(DVec3::new(x_mm, y_mm, 0.0))
        })
        .collect()
}

/// The mean view of the audience from these points.
pub fn view(scene: &Scene, points_m: &[DVec3]) -> View {
    View::from_points(points_m, &|point, out| scene.audience_hit(point, out))
}

/// Where in the room the light of a design and of its cut goes; `middle_m` is the place it is seen from.
pub fn room_picture(
    scene: &Scene,
    middle_m: DVec3,
    designed: &LightTally,
    machined: &LightTally,
    caption: &Caption,
) -> RgbImage {
    let [before, after] = [designed, machined].map(LightTally::room_gain);
    let hemispheres = [("design", &before), ("as cut", &after)].map(|(title, gain)| Hemisphere {
        title,
        gain,
        bins: ROOM_BINS,
    });
    let edges = scene.audience.iter().flat_map(|polyhedron| polyhedron.edges());
    let outlines: Vec<[[f64; 3]; 2]> =
        edges.map(|(ends, _)| ends.map(|end| (end - middle_m).to_array())).collect();
    light_picture::room(&hemispheres, &outlines, caption)
}

/// The figures of `report.json` for a design and its cut.
pub fn summary(designed: &LightTally, machined: &LightTally, view: &View) -> Option<Light> {
    let (before, after) = (designed.shares()?, machined.shares()?);
    Some(Light {
        on_audience_designed: before.on_audience,
        on_audience_machined: after.on_audience,
        leak_designed: before.leak,
        leak_machined: after.leak,
        absorbed_designed: before.absorbed,
        absorbed_machined: after.absorbed,
        unresolved_designed: before.unresolved,
        unresolved_machined: after.unresolved,
        gain_designed: designed.gain(view),
        gain_machined: machined.gain(view),
        uniformity_designed: designed.uniformity(view),
        uniformity_machined: machined.uniformity(view),
        screen_uniformity_designed: None,
        screen_uniformity_machined: None,
        shadowed_designed: designed.shadowed_fraction(),
        shadowed_machined: machined.shadowed_fraction(),
        standard_error: machined.standard_error(),
        polished: None,
    })
}

/// The part of its light that reaches the audience, for each of a tile's cells, from its map as samples of `step_mm`.
pub fn of_cells(scene: &Scene, map: &Pixels, step_mm: f64) -> Vec<f64> {
    map.means_of_squares((scene.microgeometry.width_mm / step_mm).round() as usize)
}

/// 1 - standard deviation / mean, over the screen's cells, of those parts.
pub fn over_screen(shares: impl Iterator<Item = f64>) -> Option<f64> {
    let shares: Vec<f64> = shares.collect();
    let count = shares.len() as f64;
    let mean = shares.iter().sum::<f64>() / count;
    let variance = shares.iter().map(|share| (share - mean).powi(2)).sum::<f64>() / count;
    (shares.len() > 1 && mean > 0.0).then(|| 1.0 - variance.sqrt() / mean)
}

/// The figures of a polished cut.
pub fn polished(light: &LightTally, removal_mm: f64, view: &View) -> Option<Polished> {
    let shares = light.shares()?;
    Some(Polished {
        removal_um: 1e3 * removal_mm,
        on_audience: shares.on_audience,
        leak: shares.leak,
        absorbed: shares.absorbed,
        unresolved: shares.unresolved,
        gain: light.gain(view),
        uniformity: light.uniformity(view),
    })
}
