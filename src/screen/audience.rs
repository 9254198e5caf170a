use glam::DVec3;

/// A convex region where viewers are: the hull of points, kept as half-spaces. Metres, screen frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Polyhedron {
    pub name: String,
    vertices_m: Vec<DVec3>,
    half_spaces: Vec<HalfSpace>,
}

/// The points y with normal . y <= offset; the normal is a unit vector pointing outward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    pub normal: DVec3,
    pub offset_m: f64,
}

impl Polyhedron {
    /// The hull of these points; None if they are all in one plane. Every triple of points is
    /// tried, which is quick for the few corners an audience has.
    pub fn hull(name: &str, vertices_m: &[DVec3]) -> Option<Polyhedron> {
        let low = vertices_m.iter().copied().reduce(DVec3::min)?;
        let high = vertices_m.iter().copied().reduce(DVec3::max)?;
        let tolerance = 1e-9 * (high - low).length();
        let mut half_spaces: Vec<HalfSpace> = Vec::new();
        for (i, &a) in vertices_m.iter().enumerate() {
            for (j, &b) in vertices_m.iter().enumerate().skip(i + 1) {
                for &c in &vertices_m[j + 1..] {
                    let normal = (b - a).cross(c - a);
                    if normal.length() <= tolerance * (b - a).length().max((c - a).length()) {
                        continue;
                    }
                    let normal = normal.normalize();
                    let (mut inner, mut outer) = (false, false);
                    for &v in vertices_m {
                        let distance = normal.dot(v - a);
                        inner |= distance < -tolerance;
                        outer |= distance > tolerance;
                        if inner && outer {
                            break;
                        }
                    }
                    if inner == outer {
                        continue;
                    }
                    let normal = if inner { normal } else { -normal };
                    let plane = HalfSpace { normal, offset_m: normal.dot(a) };
                    let known = half_spaces.iter().any(|h| {
                        h.normal.dot(normal) > 0.0
                            && h.normal.cross(normal).length() < 1e-7
                            && (h.offset_m - plane.offset_m).abs() <= 1e3 * tolerance
                    });
                    if !known {
                        half_spaces.push(plane);
                    }
                }
            }
        }
        // A solid has at least four faces; points in one plane have none that leaves a side empty.
        (half_spaces.len() >= 4).then(|| Polyhedron {
            name: name.into(),
            vertices_m: vertices_m.to_vec(),
            half_spaces,
        })
    }

    /// The points it is the hull of.
    pub fn vertices_m(&self) -> &[DVec3] {
        &self.vertices_m
    }

    /// Its faces.
    pub fn half_spaces(&self) -> &[HalfSpace] {
        &self.half_spaces
    }

    /// Its edges: two ends, and the places in [`Polyhedron::half_spaces`] of the two faces that meet there.
    pub fn edges(&self) -> Vec<([DVec3; 2], [usize; 2])> {
        let size = self.vertices_m.iter().map(|&v| (v - self.vertices_m[0]).length()).fold(0.0, f64::max);
        let on = |h: &HalfSpace, v: DVec3| (h.normal.dot(v) - h.offset_m).abs() <= 1e-7 * size;
        let mut edges = Vec::new();
        for (i, first) in self.half_spaces.iter().enumerate() {
            for (j, second) in self.half_spaces.iter().enumerate().skip(i + 1) {
                let along = first.normal.cross(second.normal);
                let shared = || self.vertices_m.iter().copied().filter(|&v| on(first, v) && on(second, v));
                let by_place = |p: &DVec3, q: &DVec3| along.dot(*p).total_cmp(&along.dot(*q));
                if let (Some(a), Some(b)) = (shared().min_by(by_place), shared().max_by(by_place))
                    && (b - a).length() > 1e-7 * size
                {
                    edges.push(([a, b], [i, j]));
                }
            }
        }
        edges
    }

    /// Whether the point is inside or on the border.
    pub fn contains(&self, point_m: DVec3) -> bool {
        self.half_spaces.iter().all(|h| h.normal.dot(point_m) <= h.offset_m)
    }

    /// Whether the ray from `origin_m` along `direction` meets it.
    pub fn hit(&self, origin_m: DVec3, direction: DVec3) -> bool {
        let (mut from, mut to) = (0.0_f64, f64::INFINITY);
        for h in &self.half_spaces {
            if !narrow(h.offset_m - h.normal.dot(origin_m), h.normal.dot(direction), &mut from, &mut to) {
                return false;
            }
        }
        from <= to
    }
}

/// Keeps of the ray's stretch `from ..= to` what lies within one half-space; false if nothing does.
#[inline]
pub(super) fn narrow(room_m: f64, speed: f64, from: &mut f64, to: &mut f64) -> bool {
    if speed > 0.0 {
        *to = to.min(room_m / speed);
    } else if speed < 0.0 {
        *from = from.max(room_m / speed);
    } else {
        return room_m >= 0.0;
    }
    *from <= *to
}

/// The audience as one point of the screen sees it: the same answer as [`Polyhedron::hit`], with
/// what depends on the point alone worked out once.
pub struct View {
    seen: Vec<Seen>,
    lowest_z: f64,
}

struct Seen {
    /// Normal and room in m of each half-space.
    faces: Vec<(DVec3, f64)>,
    /// A cone around all of it: axis, and cosine of the half angle with some slack.
    axis: DVec3,
    cosine: f64,
}

impl View {
    /// Prepares the view from a point.
    pub fn new(audience: &[Polyhedron], origin_m: DVec3) -> View {
        let mut lowest_z = 1.0_f64;
        let mut seen = Vec::with_capacity(audience.len());
        for polyhedron in audience {
            let faces: Vec<(DVec3, f64)> = polyhedron
                .half_spaces
                .iter()
                .map(|h| (h.normal, h.offset_m - h.normal.dot(origin_m)))
                .collect();
            let directions = polyhedron.vertices_m.iter().map(|&v| (v - origin_m).normalize_or_zero());
            let axis = directions.clone().sum::<DVec3>().normalize_or_zero();
            let cosine = directions.clone().map(|d| d.dot(axis)).fold(1.0, f64::min) - 1e-9;
            // A cone of 90 degrees or more bounds nothing, nor does one seen from the inside.
            let outside = faces.iter().any(|face| face.1 < 0.0);
            let cosine = if outside && cosine > 0.0 { cosine } else { -2.0 };
            let lowest = directions.map(|d| d.z).fold(1.0, f64::min);
            lowest_z = lowest_z.min(if outside { lowest } else { -1.0 });
            seen.push(Seen { faces, axis, cosine });
        }
        View { seen, lowest_z: lowest_z - 1e-9 }
    }

    /// No direction with a smaller z meets the audience, if this is positive.
    pub fn lowest_z(&self) -> f64 {
        self.lowest_z
    }

    /// Whether the ray in this direction (a unit vector) meets the audience.
    #[inline]
    pub fn hit(&self, direction: DVec3) -> bool {
        self.seen.iter().any(|seen| {
            if direction.dot(seen.axis) < seen.cosine {
                return false;
            }
            let (mut from, mut to) = (0.0_f64, f64::INFINITY);
            seen.faces.iter().all(|&(normal, room)| narrow(room, normal.dot(direction), &mut from, &mut to))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> Vec<DVec3> {
        let mut corners = Vec::new();
        for x in [-1.0, 1.0] {
            for y in [-1.0, 1.0] {
                for z in [2.0, 4.0] {
                    corners.push(DVec3::new(x, y, z));
                }
            }
        }
        corners
    }

    #[test]
    fn a_box_has_six_faces_whatever_else_is_inside() {
        let mut corners = cube();
        corners.push(DVec3::new(0.1, 0.2, 3.0));
        corners.push(DVec3::new(1.0, 0.3, 3.0));
        let hull = Polyhedron::hull("box", &corners).expect("a solid");
        assert_eq!(hull.half_spaces().len(), 6);
        assert_eq!(hull.edges().len(), 12);
        assert!(hull.contains(DVec3::new(0.9, -0.9, 2.1)));
        assert!(!hull.contains(DVec3::new(1.01, 0.0, 3.0)));
    }

    #[test]
    fn points_in_a_plane_are_no_solid() {
        let flat: Vec<DVec3> = cube().into_iter().map(|v| DVec3::new(v.x, v.y, 0.3 * v.x + 2.0)).collect();
        assert!(Polyhedron::hull("flat", &flat).is_none());
        let line: Vec<DVec3> = (0..5).map(|i| DVec3::splat(f64::from(i))).collect();
        assert!(Polyhedron::hull("line", &line).is_none());
        assert!(Polyhedron::hull("point", &[DVec3::ONE; 4]).is_none());
        assert!(Polyhedron::hull("none", &[]).is_none());
    }

    #[test]
    fn a_ray_meets_the_box_by_its_slopes() {
        let hull = Polyhedron::hull("box", &cube()).expect("a solid");
        for i in -20..=20 {
            for j in -20..=20 {
                let direction = DVec3::new(f64::from(i) / 15.0, f64::from(j) / 15.0, 1.0);
                // Seen from the origin the near face covers all.
                let expected = direction.x.abs() <= 0.5 && direction.y.abs() <= 0.5;
                assert_eq!(hull.hit(DVec3::ZERO, direction), expected, "{direction}");
                let view = View::new(std::slice::from_ref(&hull), DVec3::ZERO);
                assert_eq!(view.hit(direction.normalize()), expected, "{direction}");
                assert!(!hull.hit(DVec3::ZERO, -direction));
            }
        }
        assert!(hull.hit(DVec3::new(0.0, 0.0, 3.0), DVec3::X));
    }
}
