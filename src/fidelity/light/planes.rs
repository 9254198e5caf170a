//! The light of a design by its planes: no samples, no shadows, every point of a facet with the facet's own normal.

use glam::DVec3;

use super::{Pose, Room, Shares, Stage};

/// A planar piece of a surface in the tile's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    pub gradient: [f64; 2],
    /// Convex, counter-clockwise.
    pub outline_mm: Vec<[f64; 3]>,
}

/// Points and weights of a rule of degree 2 over a triangle.
const POINTS: [[f64; 3]; 3] =
    [[2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0], [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0], [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0]];

/// Largest triangle that one rule covers, in mm2.
const LARGEST_MM2: f64 = 0.004;

/// Sums of incident light, of that on the audience, beside it, and absorbed, over planar pieces that lie within a
/// cell's reach of each other. The metal is taken as a perfect mirror.
pub fn planes(pieces: &[Plane], pose: &Pose, room: &Room) -> [f64; 4] {
    let mut sums = [0.0; 4];
    let corners = || pieces.iter().flat_map(|piece| &piece.outline_mm).map(|&p| DVec3::from_array(p));
    let (Some(low), Some(high)) = (corners().reduce(DVec3::min), corners().reduce(DVec3::max)) else {
        return sums;
    };
    let room = Room { metal: room.metal.polished(), ..*room };
    let stage = Stage::new(&room, pose, 0.5 * (low + high), (high - low).length());
    for piece in pieces {
        let corner = |k: usize| DVec3::from_array(piece.outline_mm[k]);
        let normal = DVec3::new(-piece.gradient[0], -piece.gradient[1], 1.0);
        for k in 2..piece.outline_mm.len() {
            triangle(&stage, normal, [corner(0), corner(k - 1), corner(k)], &mut sums);
        }
    }
    sums
}

fn triangle(stage: &Stage, normal: DVec3, [a, b, c]: [DVec3; 3], sums: &mut [f64; 4]) {
    let area_mm2 = 0.5 * (b - a).cross(c - a).z.abs();
    if area_mm2 > LARGEST_MM2 {
        let (ab, bc, ca) = (0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a));
        for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
            triangle(stage, normal, part, sums);
        }
        return;
    }
    let unit = normal.normalize();
    for [u, v, w] in POINTS {
        let place_m = stage.place_m(u * a + v * b + w * c);
        let i = (stage.projector_m - place_m).normalize();
        let taken = i.dot(normal) * area_mm2 / 3.0;
        if taken <= 0.0 {
            continue;
        }
        let way = stage.metal.scatter(i, unit, i.dot(unit), || [0.0; 3]);
        sums[0] += taken;
        sums[3] += taken * way.absorbed;
        sums[if stage.silhouette.met(place_m, way.out) { 1 } else { 2 }] += taken * way.goes_on;
    }
}

impl Shares {
    /// Shares from sums of [`planes`]; None where no light fell.
    pub fn of_planes([incident, on_audience, leak, absorbed]: [f64; 4]) -> Option<Shares> {
        (incident > 0.0).then(|| Shares {
            on_audience: on_audience / incident,
            leak: leak / incident,
            absorbed: absorbed / incident,
            unresolved: 0.0,
        })
    }
}
