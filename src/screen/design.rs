use serde::Deserialize;

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
