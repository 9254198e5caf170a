//! What rays from places close to each other meet an audience, without dividing.

use glam::{DMat3, DVec3};

use super::audience::Polyhedron;

/// The audience as it is seen from places around a point, in a frame of their own.
///
/// A ray meets a convex body exactly if it passes on the inner side of every edge of its outline. The plane
/// through an edge and the place has the normal a x b - place x (b - a), which is linear in the place, and the
/// outline stays the same while the place crosses no face's plane.
pub struct Silhouette {
    bodies: Vec<Body>,
}

enum Body {
    /// For every edge of the outline a x b and b - a, from the point, turned to the inside.
    Outline(Vec<[DVec3; 2]>),
    /// A face's plane passes near the point: each ray is clipped by all of them.
    Faces(Vec<(DVec3, f64)>),
}

impl Silhouette {
    /// For places up to `within_m` from `point_m`. Places and directions will be given in a frame that `rotation`
    /// turns into the screen's, places from `point_m` on.
    pub fn new(audience: &[Polyhedron], point_m: DVec3, within_m: f64, rotation: DMat3) -> Silhouette {
        let back = rotation.transpose();
        let local = |v: DVec3| back * (v - point_m);
        let bodies = audience
            .iter()
            .map(|polyhedron| {
                let faces: Vec<(DVec3, f64)> = polyhedron
                    .half_spaces()
                    .iter()
                    .map(|h| (back * h.normal, h.offset_m - h.normal.dot(point_m)))
                    .collect();
                let far = faces.iter().all(|face| face.1.abs() > within_m);
                let outline = outline(polyhedron, &faces, local);
                if far && outline.len() > 2 { Body::Outline(outline) } else { Body::Faces(faces) }
            })
            .collect();
        Silhouette { bodies }
    }

    /// For every body the edges of its outline, a x b and b - a each, if all have one here: a ray meets a body if
    /// direction . (a x b - place x (b - a)) is 0 or more for all of them.
    pub fn outlines(&self) -> Option<Vec<&[[DVec3; 2]]>> {
        self.bodies
            .iter()
            .map(|body| match body {
                Body::Outline(edges) => Some(edges.as_slice()),
                Body::Faces(_) => None,
            })
            .collect()
    }

    /// Whether the ray from `place_m` along `direction`, of any length, meets the audience.
    #[inline]
    pub fn met(&self, place_m: DVec3, direction: DVec3) -> bool {
        self.bodies.iter().any(|body| match body {
            Body::Outline(edges) => {
                edges.iter().all(|[moment, edge]| direction.dot(*moment - place_m.cross(*edge)) >= 0.0)
            }
            Body::Faces(faces) => {
                let (mut from, mut to) = (0.0_f64, f64::INFINITY);
                faces.iter().all(|&(normal, room)| {
                    super::audience::narrow(
                        room - normal.dot(place_m),
                        normal.dot(direction),
                        &mut from,
                        &mut to,
                    )
                })
            }
        })
    }
}

/// Edges between a face that the origin sees and one that it does not, as [`Body::Outline`] holds them.
fn outline(
    polyhedron: &Polyhedron,
    faces: &[(DVec3, f64)],
    local: impl Fn(DVec3) -> DVec3,
) -> Vec<[DVec3; 2]> {
    let corners = polyhedron.vertices_m();
    let middle = local(corners.iter().sum::<DVec3>() / corners.len() as f64);
    let seen = |face: usize| faces[face].1 < 0.0;
    let edges = polyhedron.edges().into_iter().filter(|(_, [i, j])| seen(*i) != seen(*j));
    edges
        .map(|(ends, _)| {
            let [a, b] = ends.map(&local);
            let (moment, edge) = (a.cross(b), b - a);
            let sign = moment.dot(middle).signum();
            [sign * moment, sign * edge]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_outline_and_the_faces_agree() {
        let wedge = [[-1.0, -0.6], [1.0, -0.6], [-0.8, 0.1], [1.0, 0.3]];
        let corners: Vec<DVec3> =
            [2.0, 3.5].iter().flat_map(|&z| wedge.map(|[x, y]| DVec3::new(x * z * 0.4, y, z))).collect();
        let prism = Polyhedron::hull("prism", &corners).expect("a solid");
        let other: Vec<DVec3> = corners.iter().map(|v| *v + DVec3::new(2.5, 0.4, 0.3)).collect();
        let audience = [prism, Polyhedron::hull("other", &other).expect("a solid")];
        let rotation = DMat3::from_rotation_x(0.2) * DMat3::from_rotation_y(-0.1);
        for point in [DVec3::ZERO, DVec3::new(0.9, -0.4, 0.1), DVec3::new(0.9, -0.6, 0.0)] {
            let silhouette = Silhouette::new(&audience, point, 0.02, rotation);
            let (mut met, mut missed) = (0, 0);
            for k in 0..4000 {
                let turn = |by: f64| (f64::from(k) * by).fract() - 0.5;
                let place = 0.02 * DVec3::new(turn(0.618), turn(0.414), turn(0.236));
                let out = DVec3::new(3.0 * turn(0.7548), 2.0 * turn(0.5698), 0.2 + (turn(0.3247) + 0.5));
                let wanted = audience.iter().any(|body| body.hit(point + rotation * place, rotation * out));
                assert_eq!(silhouette.met(place, out), wanted, "{point} {place} {out}");
                if wanted { met += 1 } else { missed += 1 }
            }
            assert!(met > 200 && missed > 200, "{met} {missed}");
        }
    }
}
