use serde::Deserialize;

use super::power::Diagram;

/// Cells C0 <= column < C1, R0 <= row < R1 of the screen's grid; cell (0, 0) is lower left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellRange {
    pub c0: i32,
    pub r0: i32,
    pub c1: i32,
    pub r1: i32,
}

impl CellRange {
    /// Number of columns of cells.
    pub fn columns(&self) -> usize {
        (self.c1 - self.c0).max(0) as usize
    }

    /// Number of rows of cells.
    pub fn rows(&self) -> usize {
        (self.r1 - self.r0).max(0) as usize
    }

    /// With so many more cells on every side.
    pub fn grown(&self, by: i32) -> CellRange {
        CellRange { c0: self.c0 - by, r0: self.r0 - by, c1: self.c1 + by, r1: self.r1 + by }
    }

    /// Those that a screen of so many cells has.
    pub fn within(&self, columns: usize, rows: usize) -> CellRange {
        CellRange {
            c0: self.c0.max(0),
            r0: self.r0.max(0),
            c1: self.c1.min(columns as i32),
            r1: self.r1.min(rows as i32),
        }
    }

    /// Whether the cell is one of these.
    pub fn contains(&self, column: i32, row: i32) -> bool {
        (self.c0..self.c1).contains(&column) && (self.r0..self.r1).contains(&row)
    }
}

/// Convex bump (paper) or concave dish.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Profile {
    Bump,
    Dish,
}

impl Profile {
    /// 1 for bumps; -1 for dishes, which are bumps upside down.
    pub fn sign(self) -> f64 {
        match self {
            Profile::Bump => 1.0,
            Profile::Dish => -1.0,
        }
    }
}

/// Vertical steps between cells (paper), or cells extended until they meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Seam {
    Step,
    Stitched,
}

/// One mirror: the plane z = gradient . p + offset, p in mm from its cell's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet {
    pub gradient: [f64; 2],
    pub offset_mm: f64,
    /// Wanted projected area.
    pub area_mm2: f64,
}

/// One microgeometry. Bump: z = elevation + min over facets of gradient . p + offset; dish: max.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    pub column: i32,
    pub row: i32,
    pub elevation_mm: f64,
    pub facets: Vec<Facet>,
}

/// Designed cells of a screen. A stitched design also carries the ring of neighbours around `core`
/// that its surface needs, where the screen has them. Cells are sorted by row, then column.
/// The part's origin is the lower left corner of `core`.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    pub core: CellRange,
    pub cell_mm: f64,
    pub profile: Profile,
    pub seam: Seam,
    pub cells: Vec<Cell>,
}

/// What a design covers and how its cells are made, without the cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The cells asked for.
    pub core: CellRange,
    /// The cells that are there: the core, and its ring if stitched.
    pub extent: CellRange,
    pub cell_mm: f64,
    pub profile: Profile,
    pub seam: Seam,
}

/// The part of a facet's plane that is on the surface: a convex polygon, counter-clockwise.
#[derive(Clone, Debug, PartialEq)]
pub struct FacetPolygon {
    /// Index into the cell's facets.
    pub facet: usize,
    /// Corners in mm from the cell's centre.
    pub vertices_mm: Vec<[f64; 2]>,
}

impl Facet {
    /// The plane's height at `p` mm from its cell's centre, without the cell's elevation.
    pub fn height_mm(&self, p: [f64; 2]) -> f64 {
        self.gradient[0] * p[0] + self.gradient[1] * p[1] + self.offset_mm
    }
}

impl Cell {
    /// The surface's height at `p` mm from the cell's centre, elevation included. Past the cell's
    /// border it is that of the extended planes.
    pub fn height_mm(&self, p: [f64; 2], profile: Profile) -> f64 {
        let heights = self.facets.iter().map(|facet| facet.height_mm(p));
        self.elevation_mm
            + match profile {
                Profile::Bump => heights.fold(f64::INFINITY, f64::min),
                Profile::Dish => heights.fold(f64::NEG_INFINITY, f64::max),
            }
    }

    /// The facets' polygons within the cell's own square: what a `step` seam leaves of them. They
    /// cover the square without overlap; a facet that is nowhere on the surface has none.
    pub fn polygons(&self, cell_mm: f64, profile: Profile) -> Vec<FacetPolygon> {
        self.polygons_within([-0.5 * cell_mm; 2], [0.5 * cell_mm; 2], profile)
    }

    /// The same over another rectangle, in mm from the cell's centre, with the planes extended.
    pub fn polygons_within(&self, low: [f64; 2], high: [f64; 2], profile: Profile) -> Vec<FacetPolygon> {
        // The highest plane is the lowest of the planes turned upside down.
        let sign = profile.sign();
        let list = |of: fn(&Facet) -> f64| -> Vec<f64> { self.facets.iter().map(|f| sign * of(f)).collect() };
        let (gx, gy, c) = (list(|f| f.gradient[0]), list(|f| f.gradient[1]), list(|f| f.offset_mm));
        let mut diagram = Diagram::default();
        diagram.compute(&gx, &gy, &c, low, high);
        (0..diagram.len())
            .map(|facet| FacetPolygon {
                facet,
                vertices_mm: diagram.polygon(facet).iter().map(|vertex| vertex.0).collect(),
            })
            .filter(|polygon| polygon.vertices_mm.len() > 2)
            .collect()
    }

    /// Lowest and highest point of the surface within the cell's own square in mm, elevation
    /// included: at corners of the facets' polygons, exact.
    pub fn extremes_mm(&self, cell_mm: f64, profile: Profile) -> [f64; 2] {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for polygon in self.polygons(cell_mm, profile) {
            for &vertex in &polygon.vertices_mm {
                let z = self.facets[polygon.facet].height_mm(vertex);
                (low, high) = (low.min(z), high.max(z));
            }
        }
        [self.elevation_mm + low, self.elevation_mm + high]
    }
}

impl Design {
    /// All but the cells.
    pub fn frame(&self) -> Frame {
        let Design { core, cell_mm, profile, seam, .. } = *self;
        Frame { core, extent: self.extent(), cell_mm, profile, seam }
    }

    /// The columns and rows of cells that are there: the core, and its ring if stitched.
    pub fn extent(&self) -> CellRange {
        match (self.cells.first(), self.cells.last()) {
            (Some(first), Some(last)) => {
                CellRange { c0: first.column, r0: first.row, c1: last.column + 1, r1: last.row + 1 }
            }
            _ => CellRange { c0: 0, r0: 0, c1: 0, r1: 0 },
        }
    }

    /// A cell by its column and row on the screen, found by counting: cells fill a rectangle.
    pub fn cell(&self, column: i32, row: i32) -> Option<&Cell> {
        let extent = self.extent();
        let at = extent
            .contains(column, row)
            .then(|| (row - extent.r0) as usize * extent.columns() + (column - extent.c0) as usize)?;
        self.cells.get(at)
    }

    /// The cells of the core, by row, then column.
    pub fn core_cells(&self) -> impl Iterator<Item = &Cell> + Clone {
        let core = self.core;
        self.cells.iter().filter(move |cell| core.contains(cell.column, cell.row))
    }

    /// A cell's centre in the part's frame in mm: the origin is the lower left corner of the core.
    pub fn centre_mm(&self, cell: &Cell) -> [f64; 2] {
        [
            (f64::from(cell.column - self.core.c0) + 0.5) * self.cell_mm,
            (f64::from(cell.row - self.core.r0) + 0.5) * self.cell_mm,
        ]
    }

    /// Width and height of the core in mm.
    pub fn size_mm(&self) -> [f64; 2] {
        [self.core.columns() as f64 * self.cell_mm, self.core.rows() as f64 * self.cell_mm]
    }

    /// The plane z = [0] + [1] x + [2] y of the part's frame that fits the core's elevations best by
    /// least squares: what levelling turns flat. The slope across a single column or row is 0.
    pub fn best_plane(&self) -> [f64; 3] {
        let cells: Vec<&Cell> = self.core_cells().collect();
        let count = cells.len().max(1) as f64;
        let mean = |of: &dyn Fn(&Cell) -> f64| cells.iter().map(|cell| of(cell)).sum::<f64>() / count;
        let [width, height] = self.size_mm();
        let (x0, y0) = (0.5 * width, 0.5 * height);
        let z0 = mean(&|cell| cell.elevation_mm);
        // On a full rectangle of cells x and y are uncorrelated about its centre.
        let slope = |axis: usize, middle: f64| {
            let spread = mean(&|cell| (self.centre_mm(cell)[axis] - middle).powi(2));
            let lift = mean(&|cell| (self.centre_mm(cell)[axis] - middle) * (cell.elevation_mm - z0));
            if spread > 0.0 { lift / spread } else { 0.0 }
        };
        let (sx, sy) = (slope(0, x0), slope(1, y0));
        [z0 - sx * x0 - sy * y0, sx, sy]
    }
}
