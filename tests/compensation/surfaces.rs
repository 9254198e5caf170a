//! Surfaces that a compensation must not stumble over, as samples of 10 um; `facets` stands for
//! what the program is for, the others for everything else.

use screenmill::grid::{Heights, Window};

/// A small generator of its own, so that every run sees the same surfaces.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

pub const STEP_MM: f64 = 0.01;

pub fn from(columns: usize, rows: usize, mut z: impl FnMut(usize, usize) -> f64) -> Heights {
    let mut z_mm = Vec::with_capacity(columns * rows);
    for row in 0..rows {
        for column in 0..columns {
            z_mm.push((z(column, row) * STEP_MM) as f32);
        }
    }
    Heights { window: Window { column: 0, row: 0, columns, rows }, z_mm }
}

/// Square domes of `cell` samples: lower envelopes of planes that touch a paraboloid at jittered
/// points, steepest at 20 degrees, with steps where they meet. Heights in samples.
pub fn facets(columns: usize, rows: usize, cell: usize, across: usize) -> impl FnMut(usize, usize) -> f64 {
    let mut random = Random(42);
    let mut domes = Vec::new();
    for _ in 0..columns.div_ceil(cell) * rows.div_ceil(cell) {
        let (ax, ay) = (0.07 * (random.next() - 0.5), 0.07 * (random.next() - 0.5));
        let curvature = 0.72 / cell as f64;
        let mut planes = Vec::new();
        for i in 0..across * across {
            let place = |k: usize, jitter: f64| ((k as f64 + jitter) / across as f64 - 0.5) * cell as f64;
            let (px, py) = (place(i % across, random.next()), place(i / across, random.next()));
            let (gx, gy) = (ax - curvature * px, ay - curvature * py);
            planes.push([gx, gy, 0.5 * curvature * (px * px + py * py)]);
        }
        domes.push(planes);
    }
    let wide = columns.div_ceil(cell);
    move |column, row| {
        let dome = &domes[row / cell * wide + column / cell];
        let x = (column % cell) as f64 + 0.5 - 0.5 * cell as f64;
        let y = (row % cell) as f64 + 0.5 - 0.5 * cell as f64;
        dome.iter().map(|[gx, gy, c]| gx * x + gy * y + c).fold(f64::INFINITY, f64::min)
    }
}

fn round_dome(column: usize, row: usize, cell: usize, radius: f64) -> f64 {
    let x = (column % cell) as f64 + 0.5 - 0.5 * cell as f64;
    let y = (row % cell) as f64 + 0.5 - 0.5 * cell as f64;
    (radius * radius - x * x - y * y).max(0.0).sqrt() - radius
}

/// Every class, `n` samples a side.
pub fn all(n: usize) -> Vec<(&'static str, Heights)> {
    let mut random = Random(7);
    let mut surfaces: Vec<(&'static str, Heights)> = vec![
        ("coarse facets", from(n, n, facets(n, n, 100, 3))),
        ("facets", from(n, n, facets(n, n, 100, 6))),
        ("fine facets", from(n, n, facets(n, n, 60, 12))),
        ("smooth domes", from(n, n, |c, r| round_dome(c, r, 80, 200.0))),
        ("bowls of the cutter's radius", from(n, n, |c, r| -round_dome(c, r, 100, 50.0))),
        ("constant plane", from(n, n, |_, _| -3.0)),
        ("tilted plane", from(n, n, |c, r| 0.3 * c as f64 - 0.2 * r as f64)),
        ("stairs", from(n, n, |c, r| (c / 9) as f64 * 4.0 - (r / 14) as f64 * 2.5)),
        ("white noise", from(n, n, |_, _| 70.0 * random.next())),
        ("one step up", from(n, n, |c, r| if 3 * c + r > 2 * n { 60.0 } else { 0.0 })),
        ("lattice spikes", from(n, n, |c, r| if c % 11 == 0 && r % 11 == 3 { 40.0 } else { 0.0 })),
    ];
    surfaces.push((
        "spikes",
        from(n, n, |_, _| if random.next() < 1.0 / 256.0 { 40.0 + 30.0 * random.next() } else { 0.0 }),
    ));
    surfaces.push((
        "random steps and walls",
        from(n, n, {
            let mut walls: Vec<f64> = Vec::new();
            for _ in 0..(n / 7 + 1) * (n / 5 + 1) {
                walls.push((random.next() * 96.0).floor() * 3.0);
            }
            move |c, r| walls[r / 5 * (n / 7 + 1) + c / 7]
        }),
    ));
    let mut base = facets(n, n, 100, 6);
    surfaces.push(("0.1 um noise", from(n, n, |c, r| base(c, r) + 0.01 * random.next())));
    let mut base = facets(n, n, 100, 6);
    surfaces.push(("1 um noise", from(n, n, |c, r| base(c, r) + 0.1 * random.next())));
    let mut base = facets(n, n, 100, 6);
    surfaces.push(("16 bit steps", from(n, n, |c, r| (base(c, r) * 936.0).round() / 936.0)));
    let mut base = facets(n, n, 100, 6);
    surfaces.push(("at 40 mm", from(n, n, |c, r| base(c, r) + 4000.0)));
    let mut base = facets(n, n, 100, 6);
    let holes: Vec<(f64, f64, f64)> = (0..12)
        .map(|_| (random.next() * n as f64, random.next() * n as f64, 2.0 + 16.0 * random.next()))
        .collect();
    surfaces.push((
        "holes",
        from(n, n, |c, r| {
            let gone = |(x, y, size): &(f64, f64, f64)| (c as f64 - x).hypot(r as f64 - y) < *size;
            if holes.iter().any(gone) || random.next() < 0.003 { f64::NAN } else { base(c, r) }
        }),
    ));
    surfaces.push(("no data", from(n, n, |_, _| f64::NAN)));
    surfaces
}
