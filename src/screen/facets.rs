use glam::{DVec2, DVec3};

use crate::optics::half_vector;

use super::{AreaRule, Scene};

/// The mean gradient of a cell whose base normal enters its own areas settles to this.
const SETTLED: f64 = 1e-14;
const SETTLING: usize = 200;

/// Wanted facets of a cell: gradient of each surface, and projected area up to a common factor.
#[derive(Clone, Debug, PartialEq)]
pub struct Wanted {
    pub gradients: Vec<[f64; 2]>,
    pub weights: Vec<f64>,
}

/// The mirror that sends the projector's light from `point_m` in direction `o`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mirror {
    /// Half vector, the mirror's normal.
    pub normal: DVec3,
    /// Its area in Eq. 3 over the cosine: 1/F, or 1/(F (i.h)) for exact areas.
    pub factor: f64,
}

pub(super) fn mirror(scene: &Scene, point_m: DVec3, o: DVec3) -> Mirror {
    let i = (scene.projector_m - point_m).normalize();
    let normal = half_vector(i, o);
    let cosine = i.dot(normal);
    let reflectance = scene.reflector.reflectance.at(cosine);
    let factor = match scene.microgeometry.area {
        AreaRule::Paper => 1.0 / reflectance,
        AreaRule::Exact => 1.0 / (reflectance * cosine),
    };
    Mirror { normal, factor }
}

/// Sums of factor * o_z h, factor * o_x h and factor * o_y h over directions: all that the mean
/// gradient of a cell depends on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments([DVec3; 3]);

impl Moments {
    pub(super) fn add(&mut self, mirror: &Mirror, o: DVec3, weight: f64) {
        let h = mirror.normal * (mirror.factor * weight);
        self.0[0] += h * o.z;
        self.0[1] += h * o.x;
        self.0[2] += h * o.y;
    }

    /// Mean gradient m of the cell: the gradient of its base in the paper's construction, whose
    /// area-weighted normal is the sum of the facets'. Exact areas depend on it, by the cosine
    /// o_z - m . o_xy to the base, and so it is iterated; None if that does not settle.
    pub(super) fn mean_gradient(&self, area: AreaRule) -> Option<DVec2> {
        let gradient = |sum: DVec3| (sum.z > 0.0).then(|| DVec2::new(-sum.x / sum.z, -sum.y / sum.z));
        let mut m = gradient(self.0[0])?;
        if area == AreaRule::Paper {
            return Some(m);
        }
        m = DVec2::ZERO;
        for _ in 0..SETTLING {
            let next = gradient(self.0[0] - self.0[1] * m.x - self.0[2] * m.y)?;
            let change = (next - m).length();
            m = next;
            if change <= SETTLED {
                return Some(m);
            }
        }
        None
    }
}

/// The tilt of a cell's base at which a direction to the audience no longer stands above it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grazing {
    pub mean_gradient: [f64; 2],
}

/// Gradients and areas of the mirrors that light these directions evenly (Eq. 3 of the paper, or
/// with the 1/(i.h) and base normal that it leaves out). A gradient is -(h_x, h_y)/h_z; the
/// weight is a h_z, the area that the mirror covers of the screen.
pub fn facets(scene: &Scene, point_m: DVec3, directions: &[DVec3]) -> Result<Wanted, Grazing> {
    let mirrors: Vec<Mirror> = directions.iter().map(|&o| mirror(scene, point_m, o)).collect();
    let mut m = DVec2::ZERO;
    if scene.microgeometry.area == AreaRule::Exact {
        let mut moments = Moments::default();
        for (mirror, &o) in mirrors.iter().zip(directions) {
            moments.add(mirror, o, 1.0);
        }
        m = moments.mean_gradient(AreaRule::Exact).ok_or(Grazing { mean_gradient: [0.0, 0.0] })?;
    }
    let mut wanted = Wanted { gradients: Vec::new(), weights: Vec::new() };
    for (mirror, &o) in mirrors.iter().zip(directions) {
        let cosine = o.z - m.dot(o.truncate());
        if cosine <= 0.0 {
            return Err(Grazing { mean_gradient: m.to_array() });
        }
        let h = mirror.normal;
        wanted.gradients.push([-h.x / h.z, -h.y / h.z]);
        wanted.weights.push(mirror.factor * cosine * h.z);
    }
    Ok(wanted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::screen::directions;

    #[test]
    fn exact_areas_send_every_direction_the_same_light() {
        let text = include_str!("../../samples/theatre.toml").replace("area = \"paper\"", "area = \"exact\"");
        let scene = Scene::parse(&text, "theatre.toml").expect("a scene");
        let x = DVec3::new(0.9, 0.4, 0.12);
        let i = (scene.projector_m - x).normalize();
        let list = directions(&scene.view(x), 200).expect("an audience").list;
        let wanted = facets(&scene, x, &list).expect("facets");
        let total: f64 = wanted.weights.iter().sum();
        let mean = |axis: usize| -> f64 {
            wanted.gradients.iter().zip(&wanted.weights).map(|(g, p)| g[axis] * p).sum::<f64>() / total
        };
        let m = DVec2::new(mean(0), mean(1));
        assert!(m.length() > 0.3, "a corner of the screen is steep: {m}");
        for ((&o, g), p) in list.iter().zip(&wanted.gradients).zip(&wanted.weights) {
            let normal = DVec3::new(-g[0], -g[1], 1.0).normalize();
            // Light that the mirror catches and sends on, over the base's projected area towards o.
            let caught = p / normal.z * i.dot(normal) * scene.reflector.reflectance.at(i.dot(normal));
            let seen = o.z - m.dot(o.truncate());
            assert!((caught / seen - 1.0).abs() < 1e-12, "{caught} {seen}");
        }
    }
}
