//! Which screens shadow themselves (paper, section 4): Eqs. 10 and 11 at every cell.

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::audience::Polyhedron;
use super::opening::{Opening, Sight};
use super::{Elevation, Error, Scene, sight};
use crate::optics::half_vector;

/// Directions lower than this over the screen plane count as under it.
const LOWEST_Z: f64 = 1e-6;
/// Most cells that are looked at; of a larger screen every second, third, ... row and column, and the last.
const MOST_CELLS: usize = 600_000;
/// Azimuths over half a turn at which a cell is tried.
const AZIMUTHS: usize = 90;
/// The worst azimuth of the worst cell is refined to this, in radians.
const AZIMUTH_TOLERANCE: f64 = 1e-7;
/// More than a margin falls between two of these azimuths.
const BETWEEN_AZIMUTHS_DEG: f64 = 0.05;
/// Pieces that an edge of the audience's outline is cut into, to find the steepest facet.
const EDGE_PIECES: usize = 8;

/// Margins of a surface: how far it is from shadowing itself.
#[derive(Clone, Debug, Serialize)]
pub struct Margins {
    /// Cells looked at.
    pub points: usize,
    /// 1: all of the screen's; k: every k-th row and column, and the last ones.
    pub every: usize,
    /// In planes along the screen's rows: the paper's two-dimensional case.
    pub horizontal: Plane,
    /// In planes along its columns.
    pub vertical: Plane,
    /// Over all planes through the normal: the paper's worst case in three dimensions.
    pub any_direction: Plane,
    /// Smallest angle in degrees between a reflected ray and any facet's plane at the same point; while it is
    /// positive no continuous surface made of these facets meets its own light, whatever its shape.
    pub facet_pair_deg: f64,
    /// Cells whose margin of Eq. 10 is negative in some plane.
    pub points_broken: usize,
    #[serde(skip)]
    pub field: Field,
}

/// Margins over planes of one kind.
#[derive(Clone, Debug, Serialize)]
pub struct Plane {
    pub alpha_deg: [f64; 2],
    pub beta_deg: [f64; 2],
    pub gamma_deg: [f64; 2],
    /// Smallest margin of Eq. 10 with each cell's own light.
    pub eq10_margin_deg: f64,
    /// The same with the extreme directions of light over the screen, as the paper's Fig. 8 draws it.
    pub eq10_extreme_margin_deg: f64,
    /// Smallest margin of Eq. 11.
    pub eq11_margin_deg: f64,
    /// Where the smallest margin of Eq. 10 is.
    pub worst: Worst,
}

/// The first to break.
#[derive(Clone, Debug, Serialize)]
pub struct Worst {
    pub column: usize,
    pub row: usize,
    pub point_m: [f64; 3],
    /// Direction of the plane along the screen, from +x towards +y.
    pub azimuth_deg: f64,
    #[serde(flatten)]
    pub opening: Opening,
    /// Audience and corner at the edge that is shadowed first.
    pub audience: String,
    pub corner_m: [f64; 3],
}

/// Openings at the cells looked at, row-major, lowest row first.
#[derive(Clone, Debug, Default)]
pub struct Field {
    pub columns: usize,
    pub rows: usize,
    /// Openings along the rows, for the plot of the design space.
    pub horizontal: Vec<Opening>,
    pub vertical: Vec<Opening>,
    /// Openings in the plane with the smallest margin.
    pub worst: Vec<Opening>,
}

/// How wide a cell is to the eye: the paper wants it under what an eye resolves.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Acuity {
    pub cell_mm: f64,
    /// From the place in the audience nearest to the screen, and to its nearest point.
    pub nearest_m: f64,
    pub nearest_arcmin: f64,
    /// From the middle of the audience to the screen's centre.
    pub middle_m: f64,
    pub middle_arcmin: f64,
    /// From the farthest corner to the screen's centre.
    pub farthest_m: f64,
    pub farthest_arcmin: f64,
    /// Distance from which a cell is one arc minute, the smallest gap of 20/20 vision.
    pub one_arcmin_m: f64,
}

/// The margins at the screen's cells, at these elevations or on the flat screen.
///
/// Errors: a cell that sees no audience, lies in it, or stands behind the projector.
pub fn limits(scene: &Scene, elevation: Option<&Elevation>) -> Result<Margins, Error> {
    let every = ((scene.columns() as f64 * scene.rows() as f64 / MOST_CELLS as f64).sqrt().ceil()) as usize;
    let (places_x, places_y) = (places(scene.columns(), every), places(scene.rows(), every));
    let (columns, rows) = (places_x.len(), places_y.len());
    let azimuths: Vec<[f64; 2]> = (0..AZIMUTHS)
        .map(|k| {
            let (sin, cos) = (std::f64::consts::PI * k as f64 / AZIMUTHS as f64).sin_cos();
            [cos, sin]
        })
        .collect();
    let place = |at: usize| [places_x[at % columns], places_y[at / columns]];
    let point = |at: usize| {
        let [column, row] = place(at);
        let z_m = elevation.map_or(0.0, |elevation| 1e-3 * elevation.at(column, row));
        scene.centre_m(column as f64, row as f64, z_m)
    };
    let cells: Vec<Result<Cell, Error>> = (0..columns * rows)
        .into_par_iter()
        .map(|at| {
            let x = point(at);
            let [column, row] = place(at).map(|index| index as i32);
            scene.check_point((column, row), x)?;
            let sight = sight_of(scene, x);
            let worst = sight.worst(&azimuths);
            Ok(Cell {
                horizontal: sight.opening([1.0, 0.0]),
                vertical: sight.opening([0.0, 1.0]),
                worst: sight.opening(azimuths[worst.azimuth]),
                margin_deg: worst.eq10_deg,
                eq11_deg: worst.eq11_deg,
                azimuth: std::f64::consts::PI * worst.azimuth as f64 / AZIMUTHS as f64,
                facet_pair: facet_pair(scene, x),
            })
        })
        .collect();
    let cells = cells.into_iter().collect::<Result<Vec<Cell>, Error>>()?;
    let field = Field {
        columns,
        rows,
        horizontal: cells.iter().map(|cell| cell.horizontal).collect(),
        vertical: cells.iter().map(|cell| cell.vertical).collect(),
        worst: cells.iter().map(|cell| cell.worst).collect(),
    };
    let found = |openings: &[Opening], azimuth: &dyn Fn(usize) -> f64| {
        let at = least(openings.iter().map(Opening::eq10_deg));
        let worst = worst(scene, place(at), point(at), azimuth(at));
        plane(openings, worst)
    };
    let coarsest = cells.iter().map(|cell| cell.margin_deg).fold(f64::INFINITY, f64::min);
    let tightest: Vec<(usize, f64)> = (0..cells.len())
        .into_par_iter()
        .filter(|&at| cells[at].margin_deg <= coarsest + BETWEEN_AZIMUTHS_DEG)
        .map(|at| (at, refine(&sight_of(scene, point(at)), cells[at].azimuth)))
        .collect();
    let of = |&(at, azimuth): &(usize, f64)| {
        sight_of(scene, point(at)).opening([azimuth.cos(), azimuth.sin()]).eq10_deg()
    };
    let (tightest, refined) = tightest[least(tightest.iter().map(of))];
    let mut any_direction = plane(&field.worst, worst(scene, place(tightest), point(tightest), refined));
    any_direction.eq11_margin_deg = cells.iter().map(|cell| cell.eq11_deg).fold(f64::INFINITY, f64::min);
    Ok(Margins {
        points: cells.len(),
        every,
        horizontal: found(&field.horizontal, &|_| 0.0),
        vertical: found(&field.vertical, &|_| 0.5 * std::f64::consts::PI),
        any_direction,
        facet_pair_deg: cells.iter().map(|cell| cell.facet_pair).fold(1.0, f64::min).asin().to_degrees(),
        points_broken: cells.iter().filter(|cell| cell.margin_deg < 0.0).count(),
        field,
    })
}

/// Every k-th index, and the last.
fn places(count: usize, every: usize) -> Vec<usize> {
    let last = count - 1;
    (0..last).step_by(every).chain([last]).collect()
}

struct Cell {
    horizontal: Opening,
    vertical: Opening,
    worst: Opening,
    margin_deg: f64,
    eq11_deg: f64,
    azimuth: f64,
    facet_pair: f64,
}

/// Place of the smallest value, the first of equals.
fn least(values: impl Iterator<Item = f64>) -> usize {
    values.enumerate().fold((0, f64::INFINITY), |best, (at, v)| if v < best.1 { (at, v) } else { best }).0
}

fn sight_of(scene: &Scene, x: DVec3) -> Sight {
    let towards = scene.projector_m - x;
    let mut sight = Sight { corners: Vec::new(), projector: [towards.x / towards.z, towards.y / towards.z] };
    for polyhedron in &scene.audience {
        sight.add(&sight::outline(polyhedron, x, LOWEST_Z));
    }
    sight
}

/// The azimuth of the smallest margin between the two tried beside this one, by golden section.
fn refine(sight: &Sight, azimuth: f64) -> f64 {
    let margin = |azimuth: f64| sight.opening([azimuth.cos(), azimuth.sin()]).eq10_deg();
    let step = std::f64::consts::PI / AZIMUTHS as f64;
    let (mut low, mut high) = (azimuth - step, azimuth + step);
    let part = 0.5 * (5.0_f64.sqrt() - 1.0);
    while high - low > AZIMUTH_TOLERANCE {
        let (a, b) = (high - part * (high - low), low + part * (high - low));
        if margin(a) <= margin(b) {
            high = b;
        } else {
            low = a;
        }
    }
    let refined = 0.5 * (low + high);
    if margin(refined) < margin(azimuth) { refined } else { azimuth }
}

fn plane(openings: &[Opening], worst: Worst) -> Plane {
    let range = |of: fn(&Opening) -> f64| {
        openings
            .iter()
            .map(of)
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
    };
    let smallest = |of: &dyn Fn(&Opening) -> f64| openings.iter().map(of).fold(f64::INFINITY, f64::min);
    let gamma_deg = range(|o| o.gamma_deg);
    Plane {
        alpha_deg: range(|o| o.alpha_deg),
        beta_deg: range(|o| o.beta_deg),
        gamma_deg,
        eq10_margin_deg: smallest(&Opening::eq10_deg).min(worst.opening.eq10_deg()),
        eq10_extreme_margin_deg: smallest(&|o: &Opening| {
            o.with_gamma(gamma_deg[0]).min(o.with_gamma(gamma_deg[1]))
        }),
        eq11_margin_deg: smallest(&Opening::eq11_deg),
        worst,
    }
}

/// The opening at a point and azimuth, with the audience's corner at the edge that breaks first.
fn worst(scene: &Scene, [column, row]: [usize; 2], x: DVec3, azimuth: f64) -> Worst {
    let e = [azimuth.cos(), azimuth.sin()];
    let opening = sight_of(scene, x).opening(e);
    let sign = if opening.breaks_at_alpha() { -1.0 } else { 1.0 };
    let corners = scene.audience.iter().flat_map(|p| p.vertices_m().iter().map(move |&v| (&p.name, v)));
    // The angle to the normal, which also orders corners under the horizon.
    let lean = |v: DVec3| (sign * (e[0] * (v.x - x.x) + e[1] * (v.y - x.y))).atan2(v.z - x.z);
    let (mut audience, mut corner, mut most) = (String::new(), DVec3::ZERO, f64::NEG_INFINITY);
    for (name, v) in corners {
        if lean(v) > most {
            (audience, corner, most) = (name.clone(), v, lean(v));
        }
    }
    Worst {
        column,
        row,
        point_m: x.to_array(),
        azimuth_deg: azimuth.to_degrees(),
        opening,
        audience,
        corner_m: corner.to_array(),
    }
}

/// Smallest o . h over reflected directions o and facet normals h of one point. The normal's distance to o has
/// no maximum inside the view, and o's none but at a corner: corners for o, and the outline for h, will do.
fn facet_pair(scene: &Scene, x: DVec3) -> f64 {
    let i = (scene.projector_m - x).normalize();
    let outlines: Vec<Vec<DVec3>> = scene
        .audience
        .iter()
        .map(|p| {
            let outline = sight::outline(p, x, LOWEST_Z);
            outline.iter().map(|([u, v], _)| DVec3::new(*u, *v, 1.0).normalize()).collect()
        })
        .collect();
    let mut smallest = 1.0_f64;
    for outline in &outlines {
        for (k, a) in outline.iter().enumerate() {
            let b = outline[(k + 1) % outline.len()];
            for piece in 0..EDGE_PIECES {
                let h = half_vector(i, a.lerp(b, piece as f64 / EDGE_PIECES as f64).normalize());
                for o in outlines.iter().flatten() {
                    smallest = smallest.min(o.dot(h));
                }
            }
        }
    }
    smallest
}

/// How wide the scene's cells are to the eyes of its audience.
pub fn acuity(scene: &Scene) -> Acuity {
    let half = DVec3::new(0.5 * scene.width_m, 0.5 * scene.height_m, 0.0);
    let corners = || scene.audience.iter().flat_map(|p| p.vertices_m().iter().copied());
    let middle = corners().sum::<DVec3>() / corners().count().max(1) as f64;
    let nearest_m = scene.audience.iter().map(|p| nearest_m(p, half)).fold(f64::INFINITY, f64::min);
    let farthest_m = corners().map(|v| v.length()).fold(0.0, f64::max);
    let cell_m = 1e-3 * scene.microgeometry.width_mm;
    let arcmin = |distance_m: f64| 60.0 * (2.0 * (0.5 * cell_m / distance_m).atan()).to_degrees();
    Acuity {
        cell_mm: scene.microgeometry.width_mm,
        nearest_m,
        nearest_arcmin: arcmin(nearest_m),
        middle_m: middle.length(),
        middle_arcmin: arcmin(middle.length()),
        farthest_m,
        farthest_arcmin: arcmin(farthest_m),
        one_arcmin_m: 0.5 * cell_m / (0.5 / 60.0_f64).to_radians().tan(),
    }
}

/// Distance between a polyhedron and the screen's rectangle, which is that of two edges, of a corner and a face, or
/// of a corner of the screen and a face. Along each line between two corners the distance is convex, and narrowing
/// finds its least.
fn nearest_m(polyhedron: &Polyhedron, half: DVec3) -> f64 {
    let distance = |p: DVec3| p.distance(p.clamp(-half, half));
    let corners = polyhedron.vertices_m();
    let mut nearest = f64::INFINITY;
    for (k, &a) in corners.iter().enumerate() {
        nearest = nearest.min(distance(a));
        for &b in &corners[k + 1..] {
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..40 {
                let (s, t) = ((2.0 * low + high) / 3.0, (low + 2.0 * high) / 3.0);
                if distance(a.lerp(b, s)) <= distance(a.lerp(b, t)) {
                    high = t;
                } else {
                    low = s;
                }
            }
            nearest = nearest.min(distance(a.lerp(b, low)));
        }
    }
    let faces = polyhedron.half_spaces();
    for corner in
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| half * DVec3::new(x, y, 0.0))
    {
        for face in faces {
            let away = face.normal.dot(corner) - face.offset_m;
            let foot = corner - face.normal * away;
            if away > 0.0 && faces.iter().all(|other| other.normal.dot(foot) <= other.offset_m + 1e-9) {
                nearest = nearest.min(away);
            }
        }
    }
    nearest
}
