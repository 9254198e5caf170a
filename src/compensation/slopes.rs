use super::field::{Field, PAD};
use super::lanes::{LEAST, NONE};

/// Samples of a row whose slopes are kept as one range.
pub(super) const CELL: usize = 8;

/// The rises of some samples to their four neighbours, as far as they bound contacts: the least
/// rise to the next sample and the greatest from the one before, in mm. A neighbour without data
/// bounds nothing, and a sample without data touches nothing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rises {
    pub x_next: f32,
    pub x_before: f32,
    pub y_next: f32,
    pub y_before: f32,
}

impl Rises {
    /// No samples.
    pub const NO_SAMPLE: Rises =
        Rises { x_next: f32::MAX, x_before: f32::MIN, y_next: f32::MAX, y_before: f32::MIN };

    /// One sample of a row, `i` counted with its padding.
    #[inline(always)]
    pub fn of(field: &Field, a: i64, i: usize, with_y: bool) -> Rises {
        let row = field.row(a);
        let z = row[i];
        if z < LEAST {
            return Rises::NO_SAMPLE;
        }
        let (above, below) = if with_y { (field.row(a + 1)[i], field.row(a - 1)[i]) } else { (NONE, NONE) };
        Rises { x_next: row[i + 1] - z, x_before: z - row[i - 1], y_next: above - z, y_before: z - below }
    }

    /// Of both.
    #[inline(always)]
    pub fn with(self, other: Rises) -> Rises {
        let least = |a: f32, b: f32| if a < b { a } else { b };
        let most = |a: f32, b: f32| if a > b { a } else { b };
        Rises {
            x_next: least(self.x_next, other.x_next),
            x_before: most(self.x_before, other.x_before),
            y_next: least(self.y_next, other.y_next),
            y_before: most(self.y_before, other.y_before),
        }
    }

    /// How far the rises differ: nothing on a plane, and less than nothing in a valley.
    #[inline(always)]
    pub fn spread(&self) -> f32 {
        let (x, y) = (self.x_before - self.x_next, self.y_before - self.y_next);
        if x > y { x } else { y }
    }

    /// Rises that may each be this much different.
    #[inline(always)]
    pub fn wider(&self, by_mm: f32) -> Rises {
        Rises {
            x_next: self.x_next - by_mm,
            x_before: self.x_before + by_mm,
            y_next: self.y_next - by_mm,
            y_before: self.y_before + by_mm,
        }
    }

    #[inline(always)]
    pub fn is_no_sample(&self) -> bool {
        self.x_next == f32::MAX
    }
}

/// The rises of a row, cell by cell.
pub(super) struct RowRises {
    cells: Vec<Rises>,
    scratch: [Vec<f32>; 4],
}

impl RowRises {
    pub fn new(field: &Field) -> RowRises {
        let cells = field.columns.div_ceil(CELL);
        let scratch = || vec![0.0; cells * CELL];
        RowRises {
            cells: vec![Rises::NO_SAMPLE; cells],
            scratch: [scratch(), scratch(), scratch(), scratch()],
        }
    }

    pub fn cells(&self) -> &[Rises] {
        &self.cells
    }

    #[inline(always)]
    pub fn measure(&mut self, field: &Field, a: i64, with_y: bool) {
        let n = self.cells.len() * CELL;
        let row = field.row(a);
        let z = &row[PAD..][..n];
        let next = &row[PAD + 1..][..n];
        let before = &row[PAD - 1..][..n];
        let above = &field.row(a + 1)[PAD..][..n];
        let below = &field.row(a - 1)[PAD..][..n];
        let [x_next, x_before, y_next, y_before] = &mut self.scratch;
        let (x_next, x_before) = (&mut x_next[..n], &mut x_before[..n]);
        let (y_next, y_before) = (&mut y_next[..n], &mut y_before[..n]);
        for i in 0..n {
            let data = z[i] >= LEAST;
            x_next[i] = if data { next[i] - z[i] } else { f32::MAX };
            x_before[i] = if data { z[i] - before[i] } else { f32::MIN };
        }
        if with_y {
            for i in 0..n {
                let data = z[i] >= LEAST;
                y_next[i] = if data { above[i] - z[i] } else { f32::MAX };
                y_before[i] = if data { z[i] - below[i] } else { f32::MIN };
            }
        }
        let least = |v: &[f32]| v.iter().fold(f32::MAX, |m, &x| if x < m { x } else { m });
        let most = |v: &[f32]| v.iter().fold(f32::MIN, |m, &x| if x > m { x } else { m });
        for (c, cell) in self.cells.iter_mut().enumerate() {
            let at = c * CELL..(c + 1) * CELL;
            cell.x_next = least(&x_next[at.clone()]);
            cell.x_before = most(&x_before[at.clone()]);
            if with_y {
                cell.y_next = least(&y_next[at.clone()]);
                cell.y_before = most(&y_before[at]);
            } else {
                cell.y_next = NONE;
                cell.y_before = -NONE;
            }
        }
    }
}
