use std::path::Path;

use glam::DVec3;
use serde::Deserialize;

use crate::optics::{ComplexIndex, Reflectance};
use crate::settings::{Numbers, Source};

use super::audience::{Polyhedron, View};
use super::{Error, Profile, Seam, sight};

/// The schema of scene files that is read.
pub const SCHEMA: u32 = 1;
/// Most corners of one audience polyhedron.
pub const MOST_CORNERS: usize = 200;
/// Most cells of a screen: a cinema's 16 x 7 m has 7 million of 4 mm.
pub const MOST_CELLS: f64 = 4e7;

/// Least reflectance at normal incidence: areas of facets go by its reciprocal, and air (n = 1, k = 0) has none.
const LEAST_REFLECTANCE: f64 = 1e-3;

/// Fewest facets whose areas are repaired where cells are stitched: seams that take away most of a
/// facet are beyond steps by derivatives, and make it worse (measured: 12 do, 50 do not).
const FEWEST_REPAIRED: f64 = 50.0;

/// Screen, projector, audience and how the screen is to be made. Metres; the screen is the plane
/// z = 0, centred at the origin, and faces +Z.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    pub width_m: f64,
    pub height_m: f64,
    pub projector_m: DVec3,
    pub audience: Vec<Polyhedron>,
    pub microgeometry: Microgeometry,
    pub elevation: ElevationMethod,
    pub reflector: Reflector,
}

/// What each cell is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Microgeometry {
    /// Side of a cell.
    pub width_mm: f64,
    /// Facets a cell.
    pub facets: usize,
    pub profile: Profile,
    pub seam: Seam,
    pub area: AreaRule,
    /// Largest relative error of a facet's area.
    pub area_tolerance: f64,
    /// Sweeps that bring the facets of stitched cells back to their areas; with 0 they keep the planes
    /// that they have by themselves.
    pub area_sweeps: usize,
}

/// How a facet's area follows from its direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AreaRule {
    /// Eq. 3 of the paper.
    Paper,
    /// With 1/(i.h), since directions are sampled by solid angle, and the cell's own base normal.
    Exact,
}

/// How high the cells stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ElevationMethod {
    /// Bases aligned to a smooth surface (paper, section 3.2).
    Poisson,
    /// All at z = 0.
    Flat,
}

/// What the mirrors are made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflector {
    pub reflectance: Reflectance,
    /// Width of the microfacet lobe (GGX alpha); None is a mirror.
    pub roughness: Option<f64>,
    /// Part of the reflected light that leaves as from a matte surface.
    pub diffuse: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    schema: u32,
    screen: ScreenTable,
    projector: ProjectorTable,
    audience: Vec<AudienceTable>,
    microgeometry: MicrogeometryTable,
    elevation: ElevationTable,
    reflector: ReflectorTable,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScreenTable {
    width_m: f64,
    height_m: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProjectorTable {
    position_m: Numbers<3>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AudienceTable {
    name: Option<String>,
    vertices_m: Vec<Numbers<3>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MicrogeometryTable {
    width_mm: f64,
    facets: u32,
    profile: Profile,
    seam: Seam,
    area: AreaRule,
    area_tolerance: f64,
    area_sweeps: Option<u32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ElevationTable {
    method: ElevationMethod,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ReflectorTable {
    material: Option<String>,
    n: Option<f64>,
    k: Option<f64>,
    reflectance: Option<f64>,
    roughness: Option<f64>,
    diffuse: Option<f64>,
}

impl Scene {
    /// Reads and checks a scene file (schema 1).
    pub fn read(path: &Path) -> Result<Scene, Error> {
        Scene::from_source(&Source::read(path)?)
    }

    /// Reads and checks a scene from its text; `path` names it in errors.
    pub fn parse(text: &str, path: &str) -> Result<Scene, Error> {
        Scene::from_source(&Source::new(text, path))
    }

    fn from_source(source: &Source) -> Result<Scene, Error> {
        let file: File = source.parse()?;
        source.schema(file.schema, SCHEMA)?;
        let width_m = source.within("screen.width_m", file.screen.width_m, 1e-3, 1e3)?;
        let height_m = source.within("screen.height_m", file.screen.height_m, 1e-3, 1e3)?;
        let microgeometry = microgeometry(source, &file.microgeometry)?;
        if microgeometry.area_sweeps > 0 && file.elevation.method == ElevationMethod::Flat {
            let line = source.line_of("microgeometry.area_sweeps");
            return Err(Error::SweepsOfFlat { path: source.path().to_string(), line });
        }
        let width_mm = microgeometry.width_mm;
        let line = source.line_of("microgeometry.width_mm");
        let path = source.path().to_string();
        let (columns, rows) = (count(width_m, width_mm), count(height_m, width_mm));
        if columns < 1.0 || rows < 1.0 {
            let (screen_width_mm, screen_height_mm) = (1e3 * width_m, 1e3 * height_m);
            return Err(Error::CellTooWide { path, line, width_mm, screen_width_mm, screen_height_mm });
        }
        if columns * rows > MOST_CELLS {
            return Err(Error::TooManyCells { path, line, columns, rows, most: MOST_CELLS });
        }
        let projector_m = point(source, "projector.position_m", file.projector.position_m)?;
        if projector_m.z <= 0.0 {
            let line = source.line_of("projector.position_m");
            return Err(Error::ProjectorBehind { path, line, z_m: projector_m.z });
        }
        Ok(Scene {
            width_m,
            height_m,
            projector_m,
            audience: audience(source, &file.audience, [width_m, height_m])?,
            microgeometry,
            elevation: file.elevation.method,
            reflector: reflector(source, &file.reflector)?,
        })
    }

    /// Whole cells in a row of the screen; what is left over at the right stays bare.
    pub fn columns(&self) -> usize {
        count(self.width_m, self.microgeometry.width_mm) as usize
    }

    /// Whole cells in a column of the screen; what is left over at the top stays bare.
    pub fn rows(&self) -> usize {
        count(self.height_m, self.microgeometry.width_mm) as usize
    }

    /// The centre of a cell at an elevation, in m: column 0 is at the left, row 0 at the bottom.
    pub fn centre_m(&self, column: f64, row: f64, elevation_m: f64) -> DVec3 {
        let width_m = 1e-3 * self.microgeometry.width_mm;
        DVec3::new(
            (column + 0.5) * width_m - 0.5 * self.width_m,
            (row + 0.5) * width_m - 0.5 * self.height_m,
            elevation_m,
        )
    }

    /// Whether the ray from `origin_m` along `direction` (of any length) meets an audience.
    pub fn audience_hit(&self, origin_m: DVec3, direction: DVec3) -> bool {
        self.audience.iter().any(|polyhedron| polyhedron.hit(origin_m, direction))
    }

    /// Refuses a point of the screen from which nothing can be reflected to an audience.
    pub(super) fn check_point(&self, (column, row): (i32, i32), point_m: DVec3) -> Result<(), Error> {
        let DVec3 { x: x_m, y: y_m, z: z_m } = point_m;
        if self.projector_m.z <= z_m {
            return Err(Error::BehindProjector { column, row, z_m, projector_m: self.projector_m.z });
        }
        if let Some(polyhedron) = self.audience.iter().find(|p| p.contains(point_m)) {
            return Err(Error::Inside { column, row, x_m, y_m, z_m, name: polyhedron.name.clone() });
        }
        if !sight::sees(&self.audience, point_m) {
            return Err(Error::SeesNoAudience { column, row, x_m, y_m, z_m });
        }
        Ok(())
    }

    /// The audience as one point sees it, for many rays from there.
    pub fn view(&self, origin_m: DVec3) -> View {
        View::new(&self.audience, origin_m)
    }
}

fn count(length_m: f64, width_mm: f64) -> f64 {
    (1e3 * length_m / width_mm + 1e-6).floor()
}

fn point(source: &Source, key: &str, numbers: Numbers<3>) -> Result<DVec3, Error> {
    for value in numbers.0 {
        source.within(key, value, -1e4, 1e4)?;
    }
    Ok(DVec3::from_array(numbers.0))
}

fn microgeometry(source: &Source, table: &MicrogeometryTable) -> Result<Microgeometry, Error> {
    let facets = source.within("microgeometry.facets", f64::from(table.facets), 1.0, 4000.0)?;
    let sweeps = f64::from(table.area_sweeps.unwrap_or(0));
    let sweeps = source.within("microgeometry.area_sweeps", sweeps, 0.0, 16.0)?;
    if sweeps > 0.0 && table.seam == Seam::Step {
        let line = source.line_of("microgeometry.area_sweeps");
        return Err(Error::SweepsOfSteps { path: source.path().into(), line });
    }
    if sweeps > 0.0 && facets < FEWEST_REPAIRED {
        let line = source.line_of("microgeometry.area_sweeps");
        let (path, fewest) = (source.path().into(), FEWEST_REPAIRED);
        return Err(Error::SweepsOfFew { path, line, facets, fewest });
    }
    Ok(Microgeometry {
        width_mm: source.within("microgeometry.width_mm", table.width_mm, 0.01, 1e3)?,
        facets: facets as usize,
        profile: table.profile,
        seam: table.seam,
        area: table.area,
        area_tolerance: source.within("microgeometry.area_tolerance", table.area_tolerance, 1e-9, 0.1)?,
        area_sweeps: sweeps as usize,
    })
}

fn reflector(source: &Source, table: &ReflectorTable) -> Result<Reflector, Error> {
    let refuse = |given| {
        Err(Error::Reflector { path: source.path().into(), line: source.line_of("reflector"), given })
    };
    let reflectance = match (&table.material, table.n, table.k, table.reflectance) {
        (Some(name), None, None, None) => Reflectance::Metal(
            ComplexIndex::named(name)
                .ok_or_else(|| source.unknown_value("reflector.material", name, &ComplexIndex::names()))?,
        ),
        (None, None, None, Some(value)) => {
            Reflectance::Constant(source.within("reflector.reflectance", value, LEAST_REFLECTANCE, 1.0)?)
        }
        (None, Some(n), Some(k), None) => {
            let n = source.within("reflector.n", n, 0.01, 100.0)?;
            let k = source.within("reflector.k", k, 0.0, 100.0)?;
            let index = ComplexIndex { n, k };
            let reflectance = index.reflectance(1.0);
            if reflectance < LEAST_REFLECTANCE {
                let (path, line) = (source.path().into(), source.line_of("reflector.n"));
                return Err(Error::NoMirror { path, line, n, k, percent: 100.0 * reflectance });
            }
            Reflectance::Metal(index)
        }
        (Some(_), _, _, _) | (_, _, _, Some(_)) => {
            return refuse("given twice, by two of its material, n and k, and reflectance");
        }
        (None, None, None, None) => return refuse("not given"),
        (None, _, _, None) => return refuse("given by only one of n and k"),
    };
    let roughness = match table.roughness {
        Some(value) => Some(source.within("reflector.roughness", value, 0.0, 1.0)?),
        None => None,
    };
    let diffuse = source.within("reflector.diffuse", table.diffuse.unwrap_or(0.0), 0.0, 1.0)?;
    Ok(Reflector { reflectance, roughness, diffuse })
}

fn audience(source: &Source, tables: &[AudienceTable], size_m: [f64; 2]) -> Result<Vec<Polyhedron>, Error> {
    let path = || source.path().to_string();
    if tables.is_empty() {
        return Err(Error::NoAudience { path: path(), line: source.line_of("audience") });
    }
    let mut audience = Vec::with_capacity(tables.len());
    for (index, table) in tables.iter().enumerate() {
        let name = table.name.clone().unwrap_or_else(|| format!("{}", index + 1));
        let key = format!("audience[{index}].vertices_m");
        let line = source.line_of(&key);
        let corners = table.vertices_m.len();
        if !(4..=MOST_CORNERS).contains(&corners) {
            return Err(Error::Corners { path: path(), line, name, found: corners, most: MOST_CORNERS });
        }
        let mut vertices = Vec::with_capacity(corners);
        for (corner, &numbers) in table.vertices_m.iter().enumerate() {
            vertices.push(point(source, &format!("{key}[{corner}]"), numbers)?);
        }
        let Some(polyhedron) = Polyhedron::hull(&name, &vertices) else {
            return Err(Error::Flat { path: path(), line, name, corners });
        };
        if let Some(point) = screen_point_inside(&polyhedron, size_m) {
            return Err(Error::ContainsScreen { path: path(), line, name, x_m: point.x, y_m: point.y });
        }
        if let Some(corner) = (0..corners).find(|&corner| vertices[corner].z <= 0.0) {
            let line = source.line_of(&format!("{key}[{corner}]"));
            return Err(Error::Behind { path: path(), line, name, z_m: vertices[corner].z });
        }
        audience.push(polyhedron);
    }
    Ok(audience)
}

/// A point of the flat screen inside the polyhedron: of its corners, its centre and the points
/// where the polyhedron's edges could pass through it. It only chooses between two refusals.
fn screen_point_inside(polyhedron: &Polyhedron, size_m: [f64; 2]) -> Option<DVec3> {
    let half = DVec3::new(0.5 * size_m[0], 0.5 * size_m[1], 0.0);
    let vertices = polyhedron.vertices_m();
    let corners = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [0.0, 0.0]];
    let on_screen = corners.iter().map(|c| half * DVec3::new(c[0], c[1], 0.0));
    let crossings = vertices.iter().enumerate().flat_map(|(i, &a)| {
        vertices[i + 1..]
            .iter()
            .filter(move |b| a.z * b.z < 0.0)
            .map(move |&b| a + (b - a) * (a.z / (a.z - b.z)))
    });
    let on_screen = on_screen.chain(crossings.map(|p| DVec3::new(p.x, p.y, 0.0).clamp(-half, half)));
    on_screen.into_iter().find(|&p| polyhedron.contains(p))
}
