//! Surfaces made from others: a die, a wall around the part, a tile of it, rows and columns
//! exchanged.

use super::{Error, Level, Surface};
use crate::grid::{Heights, Lattice, Window};

/// The die that presses a part: z'(x, y) = -z(width - x, y). A die's die is the part again.
pub struct Die<S> {
    inner: S,
}

impl<S: Surface> Die<S> {
    pub fn new(inner: S) -> Die<S> {
        Die { inner }
    }
}

fn negated(mut heights: Heights) -> Heights {
    for z in &mut heights.z_mm {
        *z = -*z;
    }
    heights
}

impl<S: Surface> Surface for Die<S> {
    fn lattice(&self) -> Lattice {
        self.inner.lattice()
    }

    fn top_mm(&self) -> f64 {
        -self.inner.bottom_mm()
    }

    fn bottom_mm(&self) -> f64 {
        -self.inner.top_mm()
    }

    fn steepest(&self) -> [f64; 2] {
        self.inner.steepest()
    }

    fn heights(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        Ok(negated(self.inner.heights_mirrored(window, -datum_mm)?))
    }

    fn heights_mirrored(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        Ok(negated(self.inner.heights(window, -datum_mm)?))
    }
}

/// A part in a wall: every sample outside its rectangle stands at a given z. What has no data
/// inside the rectangle keeps none.
pub struct Walled<S> {
    inner: S,
    z_mm: f64,
}

impl<S: Surface> Walled<S> {
    /// `z_mm` is the wall's top in the source's z.
    pub fn new(inner: S, z_mm: f64) -> Walled<S> {
        Walled { inner, z_mm }
    }
}

impl<S: Surface> Surface for Walled<S> {
    fn lattice(&self) -> Lattice {
        self.inner.lattice()
    }

    /// Of the part; the wall is not part of it.
    fn top_mm(&self) -> f64 {
        self.inner.top_mm()
    }

    fn bottom_mm(&self) -> f64 {
        self.inner.bottom_mm()
    }

    fn steepest(&self) -> [f64; 2] {
        self.inner.steepest()
    }

    fn heights(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        let lattice = self.lattice();
        let wall = (self.z_mm - datum_mm) as f32;
        let mut out = Heights { window, z_mm: vec![wall; window.samples()] };
        let Some(shared) = lattice.window().intersection(&window) else { return Ok(out) };
        let part = self.inner.heights(shared, datum_mm)?;
        // The last column and row may stand past the part's true edge: they belong to the wall.
        let past = 1e-9 * lattice.step_mm;
        for row in shared.row..shared.row_end() {
            if lattice.y_mm(row) > lattice.height_mm + past {
                continue;
            }
            let start =
                (row - window.row) as usize * window.columns + (shared.column - window.column) as usize;
            let from = part.row(row);
            let inside = (shared.column..shared.column_end())
                .take_while(|&column| lattice.x_mm(column) <= lattice.width_mm + past)
                .count();
            out.z_mm[start..start + inside].copy_from_slice(&from[..inside]);
        }
        Ok(out)
    }

    /// Those of the part, and what of the wall's top is asked for: up to the part's edge, which samples only come near.
    fn outlines(&self, low_mm: [f64; 2], high_mm: [f64; 2]) -> Vec<Vec<[f64; 3]>> {
        let [low, high] = [low_mm, high_mm];
        let size = [self.lattice().width_mm, self.lattice().height_mm];
        let inside = [0, 1].map(|axis| [low[axis].max(0.0), high[axis].min(size[axis])]);
        let across = [low[1], high[1]];
        let sides = [
            ([low[0], high[0].min(0.0)], across),
            ([low[0].max(size[0]), high[0]], across),
            (inside[0], [low[1], high[1].min(0.0)]),
            (inside[0], [low[1].max(size[1]), high[1]]),
        ];
        let mut outlines = self.inner.outlines(low, high);
        for ([left, right], [front, back]) in sides {
            if left < right && front < back {
                let corners = [[left, front], [right, front], [right, back], [left, back]];
                outlines.push(corners.map(|[x, y]| [x, y, self.z_mm]).to_vec());
            }
        }
        outlines
    }
}

/// A rectangle of whole samples of another surface, its lower left sample at column 0, row 0.
pub struct Tile<S> {
    inner: S,
    window: Window,
    lattice: Lattice,
    neighbours: bool,
    range_mm: [f64; 2],
}

impl<S: Surface> Tile<S> {
    /// The samples of `window`. With `neighbours` windows past the tile see what lies there (one
    /// sheet), without they see nothing (separate blanks). None where the window holds no data.
    pub fn new(inner: S, window: Window, neighbours: bool) -> Result<Option<Tile<S>>, Error> {
        let Some(range_mm) = inner.range_mm(window)? else { return Ok(None) };
        let whole = inner.lattice();
        let step_mm = whole.step_mm;
        let length = |start: i64, count: usize, of_part: f64| {
            let end = (start + count as i64) as f64 * step_mm;
            end.min(of_part.max(start as f64 * step_mm)) - start as f64 * step_mm
        };
        let lattice = Lattice {
            width_mm: length(window.column, window.columns, whole.width_mm),
            height_mm: length(window.row, window.rows, whole.height_mm),
            step_mm,
            columns: window.columns,
            rows: window.rows,
        };
        Ok(Some(Tile { inner, window, lattice, neighbours, range_mm }))
    }
}

impl<S: Surface> Surface for Tile<S> {
    fn lattice(&self) -> Lattice {
        self.lattice
    }

    fn top_mm(&self) -> f64 {
        self.range_mm[1]
    }

    fn bottom_mm(&self) -> f64 {
        self.range_mm[0]
    }

    /// Of the whole part.
    fn steepest(&self) -> [f64; 2] {
        self.inner.steepest()
    }

    fn heights(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        let wanted = Window {
            column: window.column + self.window.column,
            row: window.row + self.window.row,
            ..window
        };
        let mut heights = if self.neighbours {
            self.inner.heights(wanted, datum_mm)?
        } else {
            match wanted.intersection(&self.window) {
                Some(shared) => self.inner.heights(shared, datum_mm)?.crop(wanted),
                None => Heights::empty(wanted),
            }
        };
        heights.window = window;
        Ok(heights)
    }

    /// Of a separate blank only what lies on the tile: past its edge there is nothing to protect.
    fn outlines(&self, low_mm: [f64; 2], high_mm: [f64; 2]) -> Vec<Vec<[f64; 3]>> {
        let step_mm = self.lattice.step_mm;
        let at = [self.window.column, self.window.row].map(|sample| sample as f64 * step_mm);
        let size = [self.lattice.width_mm, self.lattice.height_mm];
        let (mut low, mut high) = (low_mm, high_mm);
        if !self.neighbours {
            low = std::array::from_fn(|axis| low[axis].max(0.0));
            high = std::array::from_fn(|axis| high[axis].min(size[axis]));
            if (0..2).any(|axis| low[axis] > high[axis]) {
                return Vec::new();
            }
        }
        let shifted = |place: [f64; 2]| std::array::from_fn(|axis| place[axis] + at[axis]);
        let mut outlines = self.inner.outlines(shifted(low), shifted(high));
        for corner in outlines.iter_mut().flatten() {
            corner[0] -= at[0];
            corner[1] -= at[1];
        }
        if !self.neighbours {
            for outline in &mut outlines {
                for axis in 0..2 {
                    *outline = cut(outline, |corner| corner[axis]);
                    *outline = cut(outline, |corner| size[axis] - corner[axis]);
                }
            }
            outlines.retain(|outline| !outline.is_empty());
        }
        outlines
    }

    fn range_mm(&self, window: Window) -> Result<Option<[f64; 2]>, Error> {
        let wanted = Window {
            column: window.column + self.window.column,
            row: window.row + self.window.row,
            ..window
        };
        match wanted.intersection(&self.window) {
            _ if self.neighbours => self.inner.range_mm(wanted),
            Some(shared) => self.inner.range_mm(shared),
            None => Ok(None),
        }
    }
}

/// The part of a convex polygon in space where a linear function is not negative.
fn cut(outline: &[[f64; 3]], inside: impl Fn(&[f64; 3]) -> f64) -> Vec<[f64; 3]> {
    let mut kept = Vec::with_capacity(outline.len() + 1);
    for (index, from) in outline.iter().enumerate() {
        let to = &outline[(index + 1) % outline.len()];
        let (a, b) = (inside(from), inside(to));
        if a >= 0.0 {
            kept.push(*from);
        }
        if (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0) {
            let t = a / (a - b);
            kept.push(std::array::from_fn(|axis| from[axis] + t * (to[axis] - from[axis])));
        }
    }
    kept
}

/// Columns and rows exchanged, z(y, x): passes along Y become passes along X.
pub struct Transposed<S> {
    inner: S,
}

impl<S: Surface> Transposed<S> {
    pub fn new(inner: S) -> Transposed<S> {
        Transposed { inner }
    }
}

fn turned(window: Window) -> Window {
    Window { column: window.row, row: window.column, columns: window.rows, rows: window.columns }
}

impl<S: Surface> Surface for Transposed<S> {
    fn lattice(&self) -> Lattice {
        let Lattice { width_mm, height_mm, step_mm, columns, rows } = self.inner.lattice();
        Lattice { width_mm: height_mm, height_mm: width_mm, step_mm, columns: rows, rows: columns }
    }

    fn top_mm(&self) -> f64 {
        self.inner.top_mm()
    }

    fn bottom_mm(&self) -> f64 {
        self.inner.bottom_mm()
    }

    fn steepest(&self) -> [f64; 2] {
        let [x, y] = self.inner.steepest();
        [y, x]
    }

    fn heights(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        const BLOCK: usize = 32;
        let from = self.inner.heights(turned(window), datum_mm)?;
        let mut out = Heights::empty(window);
        for row_block in (0..window.rows).step_by(BLOCK) {
            for column_block in (0..window.columns).step_by(BLOCK) {
                for row in row_block..(row_block + BLOCK).min(window.rows) {
                    for column in column_block..(column_block + BLOCK).min(window.columns) {
                        out.z_mm[row * window.columns + column] = from.z_mm[column * window.rows + row];
                    }
                }
            }
        }
        Ok(out)
    }

    fn range_mm(&self, window: Window) -> Result<Option<[f64; 2]>, Error> {
        self.inner.range_mm(turned(window))
    }

    fn levelled(&self) -> Result<Level, Error> {
        Err(Error::NotLevelled)
    }
}

#[cfg(test)]
mod tests {
    use super::cut;

    #[test]
    fn a_square_across_the_edge_keeps_its_slope_up_to_it() {
        let square = [[-1.0, 0.0, 0.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [-1.0, 1.0, 0.0]];
        let want = [[0.0, 0.0, 1.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [0.0, 1.0, 1.0]];
        assert_eq!(cut(&square, |corner| corner[0]), want);
        assert!(cut(&square, |corner| corner[0] - 2.0).is_empty());
    }
}
