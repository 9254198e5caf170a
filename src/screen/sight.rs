//! The solid angle in which a point sees its audience, as a limit rather than by samples.

use geo::{ConvexHull, MultiPoint, Point};
use glam::DVec3;

use super::audience::Polyhedron;
use super::power::{Vertex, area_and_moments, clip};

/// Directions closer to the screen plane than this are not used, as in the sampled lattice.
const LOWEST_Z: f64 = 1e-3;
/// Longest side of a spherical triangle that one quadrature covers.
const LONGEST: f64 = 0.8;
/// Smaller pieces (in tangent of the angle, squared) are rounding.
const SMALLEST: f64 = 1e-14;

/// Gauss-Legendre nodes and weights on 0..1.
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_23),
    (0.5, 0.284_444_444_444_444_44),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_23),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];

/// Whether any direction above the horizon leads to the audience.
pub(super) fn sees(audience: &[Polyhedron], point_m: DVec3) -> bool {
    audience.iter().flat_map(|p| p.vertices_m()).any(|&v| (v - point_m).normalize_or_zero().z > LOWEST_Z)
}

/// Calls `visit` with directions and their weights in sr, which together integrate a smooth
/// function over all directions that meet the audience. Where polyhedra overlap in view, what
/// both cover counts once. A part under the horizon is cut off at a height of 0.001 of its
/// distance.
pub(super) fn integrate(audience: &[Polyhedron], point_m: DVec3, mut visit: impl FnMut(DVec3, f64)) {
    for piece in pieces(audience, point_m, LOWEST_Z) {
        for k in 2..piece.len() {
            let corner = |at: usize| {
                let [x, y] = piece[at].0;
                DVec3::new(x, y, 1.0).normalize()
            };
            triangle(corner(0), corner(k - 1), corner(k), &mut visit);
        }
    }
}

/// The view of the audience as convex polygons on the plane z = 1 before the point, counter-clockwise
/// and without overlap: what two polyhedra cover is in one polygon only. A part under the horizon is
/// cut off at a height of `lowest` of its distance.
pub(super) fn pieces(audience: &[Polyhedron], point_m: DVec3, lowest: f64) -> Vec<Vec<Vertex>> {
    let mut earlier: Vec<Vec<Vertex>> = Vec::with_capacity(audience.len());
    let mut all = Vec::new();
    for polyhedron in audience {
        let outline = outline(polyhedron, point_m, lowest);
        if outline.len() < 3 {
            continue;
        }
        let mut pieces = vec![outline.clone()];
        for other in &earlier {
            pieces = pieces.into_iter().flat_map(|piece| without(piece, other)).collect();
        }
        all.append(&mut pieces);
        earlier.push(outline);
    }
    all
}

/// The outline of a polyhedron on the plane z = 1 before the point, counter-clockwise.
pub(super) fn outline(polyhedron: &Polyhedron, point_m: DVec3, lowest: f64) -> Vec<Vertex> {
    let corners: Vec<DVec3> = polyhedron.vertices_m().iter().map(|&v| v - point_m).collect();
    let reach = corners.iter().map(|v| v.length()).fold(0.0, f64::max);
    let floor = lowest * reach;
    let mut above: Vec<DVec3> = corners.iter().copied().filter(|v| v.z > floor).collect();
    if above.len() < corners.len() {
        for a in corners.iter().filter(|v| v.z > floor) {
            for b in corners.iter().filter(|v| v.z <= floor) {
                above.push(*a + (*b - *a) * ((a.z - floor) / (a.z - b.z)));
            }
        }
    }
    let flat: MultiPoint<f64> = above.iter().map(|v| Point::new(v.x / v.z, v.y / v.z)).collect();
    let hull = flat.convex_hull();
    // The ring repeats its first corner at its end.
    hull.exterior().coords().skip(1).map(|c| ([c.x, c.y], 0)).collect()
}

/// A convex polygon less another, as convex pieces.
fn without(mut rest: Vec<Vertex>, other: &[Vertex]) -> Vec<Vec<Vertex>> {
    let mut pieces = Vec::new();
    let mut spare = Vec::new();
    for k in 0..other.len() {
        let (a, b) = (other[k].0, other[(k + 1) % other.len()].0);
        // Outward normal of a counter-clockwise edge.
        let normal = [b[1] - a[1], a[0] - b[0]];
        let offset = normal[0] * a[0] + normal[1] * a[1];
        let mut outside = rest.clone();
        clip(&mut outside, &mut spare, normal.map(|v| -v), -offset, 0);
        if area_and_moments(&outside).0 > SMALLEST {
            pieces.push(outside);
        }
        clip(&mut rest, &mut spare, normal, offset, 0);
        if rest.is_empty() {
            break;
        }
    }
    pieces
}

/// Quadrature over a spherical triangle: halved along its longest side until small, then a
/// product rule on the flat triangle, seen from the centre.
fn triangle(a: DVec3, b: DVec3, c: DVec3, visit: &mut impl FnMut(DVec3, f64)) {
    let (ab, bc, ca) = ((b - a).length(), (c - b).length(), (a - c).length());
    let longest = ab.max(bc).max(ca);
    if longest > LONGEST {
        let (a, b, c) = if ab == longest {
            (a, b, c)
        } else if bc == longest {
            (b, c, a)
        } else {
            (c, a, b)
        };
        let middle = (a + b).normalize();
        triangle(a, middle, c, visit);
        triangle(middle, b, c, visit);
        return;
    }
    let volume = a.dot(b.cross(c)).abs();
    for (s, ws) in GAUSS {
        for (t, wt) in GAUSS {
            let p = a * (1.0 - s) + (b * (1.0 - t) + c * t) * s;
            let length = p.length();
            visit(p / length, ws * wt * s * volume / (length * length * length));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slab(x: [f64; 2], y: [f64; 2], z: [f64; 2]) -> Polyhedron {
        let mut corners = Vec::new();
        for x in x {
            for y in y {
                for z in z {
                    corners.push(DVec3::new(x, y, z));
                }
            }
        }
        Polyhedron::hull("box", &corners).expect("a solid")
    }

    fn solid_angle(audience: &[Polyhedron], point: DVec3) -> f64 {
        let mut sum = 0.0;
        integrate(audience, point, |_, weight| sum += weight);
        sum
    }

    #[test]
    fn a_centred_square_has_its_closed_form() {
        let audience = [slab([-1.0, 1.0], [-1.0, 1.0], [2.0, 3.0])];
        let exact = 4.0 * (1.0_f64 / (4.0 + 1.0)).asin();
        assert!((solid_angle(&audience, DVec3::ZERO) - exact).abs() < 1e-7);
        let wide = [slab([-9.0, 9.0], [-9.0, 9.0], [2.0, 3.0])];
        let exact = 4.0 * (81.0_f64 / (4.0 + 81.0)).asin();
        assert!((solid_angle(&wide, DVec3::ZERO) - exact).abs() < 3e-6);
    }

    #[test]
    fn what_two_audiences_share_counts_once() {
        let near = slab([-1.0, 0.2], [-1.0, 1.0], [2.0, 3.0]);
        let far = slab([-0.3, 1.5], [-1.5, 1.5], [3.0, 4.5]);
        let whole = [near.clone(), far.clone()];
        let turned = [far.clone(), near.clone()];
        let point = DVec3::new(0.1, 0.05, 0.0);
        let both = solid_angle(&whole, point);
        assert!((both - solid_angle(&turned, point)).abs() < 1e-7);
        assert!(both < solid_angle(std::slice::from_ref(&near), point) + solid_angle(&[far], point) - 1e-3);
        assert!(
            (solid_angle(&[near.clone(), near.clone()], point) - solid_angle(&[near], point)).abs() < 1e-12
        );
        // Against the sampled lattice, whose density is points over the hemisphere.
        let view = crate::screen::View::new(&whole, point);
        let found = crate::screen::directions(&view, 4000).expect("an audience");
        let sampled = 4000.0 / found.density * 2.0 * std::f64::consts::PI;
        assert!((sampled / both - 1.0).abs() < 2e-3, "{sampled} {both}");
    }
}
