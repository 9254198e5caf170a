//! Rows, columns and the frame. Nothing else in the crate knows how samples are laid out.
//!
//! ```text
//!   row 2 |  .   .   .   .          Y: away from the operator, up on the screen
//!   row 1 |  .   .   .   .          X: right
//!   row 0 |  .   .   .   .          Z: out of the stock, towards the spindle and the audience
//!         +----------------> X
//!        (0,0): lower left corner of the part's bounding box
//! ```
//!
//! Sample (column i, row j) stands at x = (i + 1/2) step, y = (j + 1/2) step. In memory row 0 is
//! the lowest y; image files are flipped where they are read and written. No data is NaN.

/// Where the samples of a part stand, and the part's true size in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    pub width_mm: f64,
    pub height_mm: f64,
    pub step_mm: f64,
    pub columns: usize,
    pub rows: usize,
}

impl Lattice {
    /// The samples that cover a part of this size: columns = ceil(width/step - 1e-6).
    pub fn covering(width_mm: f64, height_mm: f64, step_mm: f64) -> Lattice {
        let count = |length_mm: f64| (length_mm / step_mm - 1e-6).ceil().max(1.0) as usize;
        Lattice { width_mm, height_mm, step_mm, columns: count(width_mm), rows: count(height_mm) }
    }

    /// x of a column's samples in mm; columns outside the part have one too.
    pub fn x_mm(&self, column: i64) -> f64 {
        (column as f64 + 0.5) * self.step_mm
    }

    /// y of a row's samples in mm.
    pub fn y_mm(&self, row: i64) -> f64 {
        (row as f64 + 0.5) * self.step_mm
    }

    /// The whole part as a window.
    pub fn window(&self) -> Window {
        Window { column: 0, row: 0, columns: self.columns, rows: self.rows }
    }
}

/// A rectangle of columns and rows, possibly reaching past the part: a band, a tile, a block
/// with its halo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    pub column: i64,
    pub row: i64,
    pub columns: usize,
    pub rows: usize,
}

impl Window {
    /// Number of samples; 64 bits, since one machine bed is 2.5 gigasamples.
    pub fn samples(&self) -> usize {
        self.columns * self.rows
    }

    /// This window with `halo` more samples on every side.
    pub fn grown(&self, halo: usize) -> Window {
        Window {
            column: self.column - halo as i64,
            row: self.row - halo as i64,
            columns: self.columns + 2 * halo,
            rows: self.rows + 2 * halo,
        }
    }

    /// One past the last column.
    pub fn column_end(&self) -> i64 {
        self.column + self.columns as i64
    }

    /// One past the last row.
    pub fn row_end(&self) -> i64 {
        self.row + self.rows as i64
    }

    /// The smallest window that holds both.
    pub fn hull(&self, other: &Window) -> Window {
        let (column, row) = (self.column.min(other.column), self.row.min(other.row));
        let (column_end, row_end) =
            (self.column_end().max(other.column_end()), self.row_end().max(other.row_end()));
        Window { column, row, columns: (column_end - column) as usize, rows: (row_end - row) as usize }
    }

    /// What both windows cover, or None.
    pub fn intersection(&self, other: &Window) -> Option<Window> {
        let column = self.column.max(other.column);
        let row = self.row.max(other.row);
        let columns = self.column_end().min(other.column_end()) - column;
        let rows = self.row_end().min(other.row_end()) - row;
        (columns > 0 && rows > 0).then_some(Window {
            column,
            row,
            columns: columns as usize,
            rows: rows as usize,
        })
    }
}

/// Heights of the samples of one window in mm, row-major, NaN where there are none.
#[derive(Clone, Debug)]
pub struct Heights {
    pub window: Window,
    pub z_mm: Vec<f32>,
}

impl Heights {
    /// A window of no data.
    pub fn empty(window: Window) -> Heights {
        Heights { window, z_mm: vec![f32::NAN; window.samples()] }
    }

    /// The samples of one row, counted in part rows.
    pub fn row(&self, row: i64) -> &[f32] {
        let start = (row - self.window.row) as usize * self.window.columns;
        &self.z_mm[start..start + self.window.columns]
    }

    /// Copies the part of this window that `window` covers; the rest is no data.
    pub fn crop(&self, window: Window) -> Heights {
        if self.window.intersection(&window) == Some(window) {
            let first = (window.column - self.window.column) as usize;
            let mut z_mm = Vec::with_capacity(window.samples());
            for row in window.row..window.row_end() {
                z_mm.extend_from_slice(&self.row(row)[first..][..window.columns]);
            }
            return Heights { window, z_mm };
        }
        let mut out = Heights::empty(window);
        if let Some(shared) = self.window.intersection(&window) {
            for row in shared.row..shared.row_end() {
                let from = &self.row(row)[(shared.column - self.window.column) as usize..][..shared.columns];
                let start =
                    (row - window.row) as usize * window.columns + (shared.column - window.column) as usize;
                out.z_mm[start..start + shared.columns].copy_from_slice(from);
            }
        }
        out
    }
}

/// z = max(z, from - by_mm); no data raises nothing.
pub fn raise_row(z_mm: &mut [f32], from_mm: &[f32], by_mm: f32) {
    each_pair(z_mm, from_mm, by_mm, |z, from, by| {
        let raised = from - by;
        if raised > z { raised } else { z }
    });
}

/// z = min(z, from + by_mm); no data lowers nothing.
pub fn lower_row(z_mm: &mut [f32], from_mm: &[f32], by_mm: f32) {
    each_pair(z_mm, from_mm, by_mm, |z, from, by| {
        let lowered = from + by;
        if lowered < z { lowered } else { z }
    });
}

/// A loop over two rows, compiled for the widest vectors that the processor has.
fn each_pair(z_mm: &mut [f32], from_mm: &[f32], by_mm: f32, of: impl Fn(f32, f32, f32) -> f32) {
    // Moved: behind a reference it could be one of the heights that are written, and the loop went one by one.
    pulp::Arch::new().dispatch(move || {
        for (z, from) in z_mm.iter_mut().zip(from_mm) {
            *z = of(*z, *from, by_mm);
        }
    });
}
