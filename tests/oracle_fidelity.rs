//! Tallies and cavities against naive whole-array twins, and against themselves however a tile is cut into blocks.

use geo::Area;
use screenmill::fidelity::cavities::{self, label};
use screenmill::fidelity::{Cavities, Figures, Found, Layers, Params, Tally};
use screenmill::grid::{Heights, Window};

const STEP_MM: f64 = 0.01;
const TILE: Window = Window { column: 100, row: -7, columns: 83, rows: 61 };

/// xorshift: the same noise everywhere.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

struct Tile {
    design: Heights,
    machined: Heights,
    cavity: Heights,
    passes: Heights,
}

/// A rough dome with holes, cut with scallops, cavities and a few gouges; heights stand at 40 mm.
fn tile(seed: u64) -> Tile {
    let mut noise = Noise(seed);
    let mut tile = Tile {
        design: Heights::empty(TILE),
        machined: Heights::empty(TILE),
        cavity: Heights::empty(TILE),
        passes: Heights::empty(TILE),
    };
    for index in 0..TILE.samples() {
        let (column, row) = ((index % TILE.columns) as f64, (index / TILE.columns) as f64);
        let design = 40.0 + 0.05 * (column * 0.2).sin() * (row * 0.13).cos() + 0.002 * noise.next();
        let cavity = if noise.next() < 0.42 { 0.03 * noise.next() } else { 0.0 };
        let passes = design + cavity + 0.0006 * noise.next();
        let machined = passes + 0.0004 * (noise.next() - 0.5) - if noise.next() < 0.01 { 0.01 } else { 0.0 };
        let hole = noise.next();
        tile.design.z_mm[index] = if hole < 0.02 { f32::NAN } else { design as f32 };
        tile.cavity.z_mm[index] = if hole < 0.02 { f32::NAN } else { cavity as f32 };
        tile.passes.z_mm[index] = passes as f32;
        tile.machined.z_mm[index] = if hole > 0.99 { f32::NAN } else { machined as f32 };
    }
    tile
}

fn blocks(width: usize, height: usize) -> Vec<Window> {
    let mut blocks = Vec::new();
    for row in (0..TILE.rows).step_by(height) {
        for column in (0..TILE.columns).step_by(width) {
            blocks.push(Window {
                column: TILE.column + column as i64,
                row: TILE.row + row as i64,
                columns: width.min(TILE.columns - column),
                rows: height.min(TILE.rows - row),
            });
        }
    }
    blocks
}

const PARAMS: Params = Params { step_mm: STEP_MM, limit_mm: Some(0.008) };

fn tally(tile: &Tile, blocks: &[Window]) -> Tally {
    let mut whole = Tally::new(PARAMS);
    for &block in blocks {
        // As a stage hands them over: cut to the block and its halo.
        let (design, machined) = (tile.design.crop(block.grown(1)), tile.machined.crop(block.grown(1)));
        let (cavity, passes) = (tile.cavity.crop(block), tile.passes.crop(block));
        let layers =
            Layers { design: &design, machined: &machined, cavity: Some(&cavity), passes: Some(&passes) };
        let mut part = Tally::new(PARAMS);
        part.add(block, layers).expect("the layers cover the block");
        whole.merge(&part);
    }
    whole
}

fn near(value: Option<f64>, wanted: f64, within: f64) {
    let value = value.expect("measured");
    assert!((value - wanted).abs() <= within, "{value} is not {wanted}");
}

#[test]
fn figures_equal_those_of_whole_arrays() {
    let tile = tile(7);
    let figures = tally(&tile, &blocks(TILE.columns, TILE.rows)).figures();
    let mut deviations = Vec::new();
    let (mut sums, mut causes) = ([0.0; 3], 0.0);
    let (mut deep, mut with_cavity, mut unjudged) = (0, 0, 0);
    for index in 0..TILE.samples() {
        let [design, machined, cavity, passes] = [&tile.design, &tile.machined, &tile.cavity, &tile.passes]
            .map(|layer| f64::from(layer.z_mm[index]));
        with_cavity += usize::from(!cavity.is_nan());
        deep += usize::from(cavity > 0.001);
        unjudged += u64::from(!design.is_nan() && machined.is_nan());
        if design.is_nan() || machined.is_nan() {
            continue;
        }
        deviations.push(machined - design);
        for (sum, cause) in sums.iter_mut().zip([cavity, passes - design - cavity, machined - passes]) {
            *sum += cause;
        }
        causes += 1.0;
    }
    assert_eq!(figures.samples as usize, deviations.len());
    assert_eq!(figures.unjudged, unjudged);
    assert!(unjudged > 0);
    let lowest = deviations.iter().copied().fold(f64::MAX, f64::min);
    let highest = deviations.iter().copied().fold(f64::MIN, f64::max);
    assert_eq!(figures.gouge_max_mm, -lowest);
    assert_eq!(figures.excess_max_mm, highest);
    let mean = deviations.iter().sum::<f64>() / deviations.len() as f64;
    near(figures.deviation_mean_mm, mean, 1e-12);
    let mut sizes: Vec<f64> = deviations.iter().map(|deviation| deviation.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let rank = |fraction: f64| sizes[(fraction * sizes.len() as f64).ceil() as usize - 1];
    near(figures.deviation_p50_mm, rank(0.50), 0.51e-6);
    near(figures.deviation_p99_mm, rank(0.99), 0.51e-6);
    let within = sizes.iter().filter(|&&size| size <= 0.008).count() as f64 / sizes.len() as f64;
    assert_eq!(figures.within_limit_fraction, Some(within));
    assert_eq!(figures.cavity_area_fraction, Some(deep as f64 / with_cavity as f64));
    let by_cause = figures.by_cause.expect("all layers were given");
    near(by_cause.unreachable_mm, sums[0] / causes, 1e-12);
    near(Some(by_cause.scallop_mm), sums[1] / causes, 1e-12);
    near(by_cause.rounding_mm, sums[2] / causes, 1e-12);
    let sum = by_cause.unreachable_mm.unwrap() + by_cause.scallop_mm + by_cause.rounding_mm.unwrap();
    near(figures.deviation_mean_mm, sum, 1e-15);
}

#[test]
fn gouge_and_excess_are_found_where_they_are() {
    let mut tile = tile(3);
    tile.design.z_mm.fill(1.0);
    tile.machined.z_mm.fill(1.0);
    let at =
        |column: i64, row: i64| (row - TILE.row) as usize * TILE.columns + (column - TILE.column) as usize;
    for (column, row) in [(150, 20), (120, 20), (160, 3)] {
        tile.machined.z_mm[at(column, row)] = 0.75;
    }
    tile.machined.z_mm[at(182, 53)] = 1.5;
    for size in [(83, 61), (10, 9)] {
        let figures = tally(&tile, &blocks(size.0, size.1)).figures();
        assert_eq!((figures.gouge_max_mm, figures.excess_max_mm), (0.25, 0.5));
        // The lowest row wins a tie.
        near(figures.gouge_where_mm.map(|place| place[0]), 1.605, 1e-12);
        near(figures.gouge_where_mm.map(|place| place[1]), 0.035, 1e-12);
        near(figures.excess_where_mm.map(|place| place[0]), 1.825, 1e-12);
    }
}

#[test]
fn blocks_leave_no_trace_in_a_tally() {
    let tile = tile(11);
    let whole = tally(&tile, &blocks(TILE.columns, TILE.rows));
    for (width, height) in [(1, 1), (17, 5), (83, 4), (9, 61), (40, 30)] {
        let mut parts = blocks(width, height);
        assert_eq!(tally(&tile, &parts), whole, "{width} x {height}");
        parts.reverse();
        assert_eq!(tally(&tile, &parts).figures(), whole.figures(), "{width} x {height} backwards");
    }
}

fn tilted(design: [f64; 2], machined: [f64; 2]) -> Figures {
    let plane = |[gx, gy]: [f64; 2]| {
        let mut heights = Heights::empty(TILE);
        for (index, z) in heights.z_mm.iter_mut().enumerate() {
            let (x, y) = ((index % TILE.columns) as f64 * STEP_MM, (index / TILE.columns) as f64 * STEP_MM);
            *z = (gx * x + gy * y) as f32;
        }
        heights
    };
    let (design, machined) = (plane(design), plane(machined));
    let mut tally = Tally::new(Params { limit_mm: None, ..PARAMS });
    let layers = Layers { design: &design, machined: &machined, cavity: None, passes: None };
    tally.add(TILE, layers).expect("the layers cover the tile");
    tally.figures()
}

#[test]
fn normals_of_tilted_planes_differ_by_the_angle_between_them() {
    for degrees in [0.01f64, 0.5, 3.0, 44.9, 45.1, 80.0] {
        let figures = tilted([0.0, 0.0], [0.0, degrees.to_radians().tan()]);
        // Single floats at 0.6 mm over two steps of 0.01 mm carry slopes of 3e-6.
        near(figures.normal_p50_deg, degrees, 5e-4);
        near(figures.normal_p95_deg, degrees, 5e-4);
    }
    let tilt = 60f64.to_radians().tan();
    near(tilted([-tilt, 0.0], [tilt, 0.0]).normal_p50_deg, 120.0, 1e-3);
    let figures = tilted([0.3, 0.2], [0.3, 0.2]);
    assert_eq!((figures.normal_p95_deg, figures.within_limit_fraction), (Some(0.0), None));
    let by_cause = figures.by_cause.expect("deviations were measured");
    assert_eq!((by_cause.unreachable_mm, by_cause.scallop_mm, by_cause.rounding_mm), (None, 0.0, None));
}

const THRESHOLD_MM: f64 = 0.001;

fn cavity_params() -> cavities::Params {
    cavities::Params { threshold_mm: THRESHOLD_MM, ..cavities::Params::at_step(STEP_MM) }
}

fn found(cavity: &Heights, candidate: &Heights, params: cavities::Params, blocks: &[Window]) -> Found {
    let mut cavities = Cavities::new(params, TILE);
    for &block in blocks {
        let (cavity, candidate) = (cavity.crop(block), candidate.crop(block));
        let labelled = label(block, &cavity, &[&candidate], &params).expect("the cavity covers the block");
        cavities.add(labelled).expect("blocks come in order");
    }
    cavities.finish()
}

/// Flood fill: samples, depth, volume and candidate's residual of each region.
fn flooded(cavity: &Heights, candidate: &Heights) -> Vec<(f64, f64, f64, f64)> {
    let (columns, rows) = (TILE.columns as i64, TILE.rows as i64);
    let deep = |column: i64, row: i64| {
        (0..columns).contains(&column)
            && (0..rows).contains(&row)
            && f64::from(cavity.z_mm[(row * columns + column) as usize]) > THRESHOLD_MM
    };
    let mut seen = vec![false; TILE.samples()];
    let mut regions = Vec::new();
    for start in 0..TILE.samples() as i64 {
        let mut todo = vec![(start % columns, start / columns)];
        let (mut samples, mut depth, mut volume, mut residual) = (0.0, 0.0f64, 0.0, 0.0f64);
        while let Some((column, row)) = todo.pop() {
            let index = (row * columns + column) as usize;
            if !deep(column, row) || std::mem::replace(&mut seen[index], true) {
                continue;
            }
            samples += STEP_MM * STEP_MM;
            depth = depth.max(f64::from(cavity.z_mm[index]));
            volume += f64::from(cavity.z_mm[index]) * STEP_MM * STEP_MM;
            residual = residual.max(f64::from(candidate.z_mm[index]));
            let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (column + dx, row + dy)));
            todo.extend(around.filter(|&(column, row)| deep(column, row)));
        }
        if samples > 0.0 {
            regions.push((samples, depth, volume, residual));
        }
    }
    regions.sort_by(|a, b| b.2.total_cmp(&a.2));
    regions
}

/// Noise at several densities: few large regions, many small ones, one that fills the tile.
fn noise(seed: u64, density: f64) -> (Heights, Heights) {
    let mut noise = Noise(seed);
    let (mut cavity, mut candidate) = (Heights::empty(TILE), Heights::empty(TILE));
    for (cavity, candidate) in cavity.z_mm.iter_mut().zip(&mut candidate.z_mm) {
        let depth = if noise.next() < density { 0.002 + noise.next() as f32 as f64 } else { 0.0005 };
        *cavity = if noise.next() < 0.01 { f32::NAN } else { depth as f32 };
        *candidate = (depth * noise.next()) as f32;
    }
    (cavity, candidate)
}

#[test]
fn cavities_equal_a_flood_fill_however_the_tile_is_cut() {
    for (seed, density) in [(5, 0.02), (6, 0.2), (7, 0.35), (8, 0.6), (9, 1.0)] {
        let (cavity, candidate) = noise(seed, density);
        let wanted = flooded(&cavity, &candidate);
        let whole = found(&cavity, &candidate, cavity_params(), &blocks(TILE.columns, TILE.rows));
        assert_eq!(whole.count as usize, wanted.len(), "density {density}");
        for (cavity, &(area_mm2, depth_mm, volume_mm3, residual_mm)) in whole.cavities.iter().zip(&wanted) {
            near(Some(cavity.area_mm2), area_mm2, 1e-9);
            assert_eq!(cavity.depth_mm, depth_mm);
            near(Some(cavity.volume_mm3), volume_mm3, 1e-9);
            assert_eq!(cavity.residuals_mm, [residual_mm]);
        }
        near(Some(whole.volume_mm3), wanted.iter().map(|region| region.2).sum(), 1e-9);
        for (width, height) in [(1, 1), (7, 5), (83, 3), (5, 61), (32, 16)] {
            assert_eq!(found(&cavity, &candidate, cavity_params(), &blocks(width, height)), whole);
        }
    }
}

#[test]
fn only_the_largest_cavities_are_kept_and_the_rest_counted() {
    let (cavity, candidate) = noise(21, 0.1);
    let all = found(&cavity, &candidate, cavity_params(), &blocks(20, 20));
    let params = cavities::Params { keep: 7, ..cavity_params() };
    let few = found(&cavity, &candidate, params, &blocks(9, 4));
    assert_eq!(few.cavities, all.cavities[..7]);
    assert_eq!((few.count, few.unlisted()), (all.count, all.count - 7));
    assert_eq!((few.area_mm2, few.volume_mm3), (all.area_mm2, all.volume_mm3));
}

#[test]
fn an_outline_holds_the_area_and_a_large_region_gets_its_hull() {
    let mut cavity = Heights::empty(TILE);
    // An L of 20 x 20 less 10 x 10 samples, across the blocks' sides.
    for (dy, dx) in (0..20).flat_map(|dy| (0..20).map(move |dx| (dy, dx))) {
        if dy < 10 || dx < 10 {
            cavity.z_mm[(10 + dy) * TILE.columns + 25 + dx] = 0.5;
        }
    }
    let found_in = |outline_samples: u64| {
        let params = cavities::Params { outline_samples, ..cavity_params() };
        let found = found(&cavity, &cavity, params, &blocks(8, 8));
        assert_eq!(found.cavities.len(), 1);
        found.cavities[0].clone()
    };
    let traced = found_in(300);
    assert!(traced.outline.traced);
    assert!((traced.outline.polygons.unsigned_area() - 0.03).abs() < 1e-12);
    assert_eq!(traced.outline.polygons.0[0].exterior().0.len(), 7, "six corners, closed");
    let hull = found_in(299);
    assert!(!hull.outline.traced);
    assert!((hull.outline.polygons.unsigned_area() - 0.035).abs() < 1e-12);
    let [low, high] = hull.outline.bounds_mm().expect("a hull has bounds");
    near(Some(low[0]), 1.25, 1e-12);
    near(Some(low[1]), 0.03, 1e-12);
    near(Some(high[0] - low[0]), 0.2, 1e-12);
    near(Some(high[1] - low[1]), 0.2, 1e-12);
    assert_eq!((traced.reached_by(0.5), traced.reached_by(0.4)), (Some(0), None));
}
