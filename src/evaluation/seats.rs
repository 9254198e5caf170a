use glam::DVec3;

use crate::screen::{Polyhedron, Scene};

/// Part of a row's length that its outer seats stand off its ends.
const INSET: f64 = 0.1;

/// A place to look from.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Seat {
    pub name: String,
    pub place_m: [f64; 3],
    /// Whether it is in the audience.
    pub inside: bool,
}

/// Left, middle and right of the middle row of one audience, and of all of them together: there the middle may lie
/// between two audiences.
pub fn seats(scene: &Scene) -> [[Seat; 3]; 2] {
    let rows: Vec<[DVec3; 2]> = scene.audience.iter().map(row).collect();
    let leftmost = rows.iter().copied().reduce(|a, b| if b[0].x < a[0].x { b } else { a });
    let rightmost = rows.iter().copied().reduce(|a, b| if b[1].x > a[1].x { b } else { a });
    let nowhere = [DVec3::ZERO; 2];
    let (left, right) = (leftmost.unwrap_or(nowhere), rightmost.unwrap_or(nowhere));
    let of = |low: DVec3, high: DVec3| {
        [("left", low), ("middle", low.midpoint(high)), ("right", high)].map(|(name, place_m)| Seat {
            name: name.into(),
            place_m: place_m.to_array(),
            inside: scene.audience.iter().any(|p| p.contains(place_m)),
        })
    };
    [of(left[0], left[1]), of(left[0], right[1])]
}

/// The ends, a bit inwards, of the line along x through the middle of an audience.
fn row(polyhedron: &Polyhedron) -> [DVec3; 2] {
    let corners = polyhedron.vertices_m();
    let middle = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for face in polyhedron.half_spaces() {
        let room = (face.offset_m - face.normal.dot(middle)) / face.normal.x;
        if face.normal.x > 0.0 {
            high = high.min(room);
        } else if face.normal.x < 0.0 {
            low = low.max(room);
        }
    }
    [middle + DVec3::X * low * (1.0 - 2.0 * INSET), middle + DVec3::X * high * (1.0 - 2.0 * INSET)]
}

/// Where a plane (normal . p = offset) cuts an audience: the corners of a convex polygon, in order round it;
/// empty if it does not.
pub fn section(polyhedron: &Polyhedron, normal: DVec3, offset_m: f64) -> Vec<DVec3> {
    let corners = polyhedron.vertices_m();
    let over = |p: DVec3| normal.dot(p) - offset_m;
    let mut found: Vec<DVec3> = Vec::new();
    for (k, &a) in corners.iter().enumerate() {
        for &b in &corners[k + 1..] {
            if over(a) * over(b) < 0.0 {
                found.push(a.lerp(b, over(a) / (over(a) - over(b))));
            }
        }
    }
    let (u, v) = normal.any_orthonormal_pair();
    let flat = found.iter().map(|p| [p.dot(u), p.dot(v)]);
    hull(flat).into_iter().map(|[s, t]| u * s + v * t + normal * offset_m).collect()
}

/// The outline that an audience throws from a point onto the plane at `z_m`.
pub fn thrown(polyhedron: &Polyhedron, from_m: DVec3, z_m: f64) -> Vec<DVec3> {
    let ways = polyhedron.vertices_m().iter().map(|&v| v - from_m).filter(|way| way.z > 0.0);
    let flat = ways.map(|way| (from_m + way * ((z_m - from_m.z) / way.z)).truncate().to_array());
    hull(flat).into_iter().map(|[x, y]| DVec3::new(x, y, z_m)).collect()
}

/// The corners of the convex hull, in order, the first once more at the end.
fn hull(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let points: geo::MultiPoint<f64> = points.map(|[x, y]| geo::Point::new(x, y)).collect();
    let hull = geo::ConvexHull::convex_hull(&points);
    hull.exterior().coords().map(|c| [c.x, c.y]).collect()
}
