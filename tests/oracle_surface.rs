//! Surfaces against their definitions: minima over planes, triangles one by one, rotations undone.

use std::sync::Arc;

use screenmill::grid::{Heights, Window};
use screenmill::screen::{Cell, CellRange, Design, Facet, Profile, Seam};
use screenmill::surface::{Designed, Die, Kind, Options, Surface, Tile, Transposed, Unit, Up, Walled, open};

/// Numbers in 0 .. 1 that are the same on every run.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Cells with facets that touch a paraboloid at random places, some of them twice, some hidden.
fn design(profile: Profile, seam: Seam, facets: usize) -> Design {
    let mut numbers = Numbers(7);
    let core = CellRange { c0: 10, r0: 20, c1: 13, r1: 22 };
    let cell_mm = 4.0;
    let sign = if profile == Profile::Bump { 1.0 } else { -1.0 };
    let ring = i32::from(seam == Seam::Stitched);
    let mut cells = Vec::new();
    for row in core.r0 - ring..core.r1 + ring {
        for column in core.c0 - ring..core.c1 + ring {
            let mut list: Vec<Facet> = (0..facets)
                .map(|k| {
                    let p = [4.4 * numbers.next() - 2.2, 4.4 * numbers.next() - 2.2];
                    let hidden = if k % 9 == 8 { 0.05 } else { 0.0 };
                    let curve = 0.12;
                    Facet {
                        gradient: [-2.0 * curve * p[0] + 0.03, -2.0 * curve * p[1] - 0.05],
                        offset_mm: sign * (curve * (p[0] * p[0] + p[1] * p[1]) + hidden),
                        area_mm2: 16.0 / facets as f64,
                    }
                })
                .collect();
            list.push(list[0]);
            let elevation_mm = 40.0 + 0.1 * f64::from(column) - 0.2 * f64::from(row) + 0.1 * numbers.next();
            cells.push(Cell { column, row, elevation_mm, facets: list });
        }
    }
    Design { core, cell_mm, profile, seam, cells }
}

/// One cell's function, continued over the plane, in the arithmetic of the kernel.
fn function(design: &Design, cell: &Cell, p: [f64; 2]) -> f64 {
    let centre = [
        (f64::from(cell.column - design.core.c0) + 0.5) * design.cell_mm,
        (f64::from(cell.row - design.core.r0) + 0.5) * design.cell_mm,
    ];
    let (x, y) = (p[0] - centre[0], p[1] - centre[1]);
    let sign = if design.profile == Profile::Bump { 1.0 } else { -1.0 };
    let planes = cell
        .facets
        .iter()
        .map(|f| sign * f.gradient[0] * x + (sign * f.gradient[1] * y + sign * f.offset_mm));
    sign * (planes.fold(f64::INFINITY, f64::min) + sign * cell.elevation_mm)
}

/// The surface by its definition at a point from the core's lower left corner; None off the cells
/// of `material`.
fn naive(design: &Design, material: CellRange, p: [f64; 2]) -> Option<f64> {
    let core = design.core;
    let index = |position: f64, first: i32, end: i32| {
        let place = position / design.cell_mm + f64::from(first);
        let cell = (place + 1e-9).floor() as i32;
        if cell == end && place - f64::from(end) <= 1e-9 { end - 1 } else { cell }
    };
    let (column, row) = (index(p[0], core.c0, material.c1), index(p[1], core.r0, material.r1));
    if !material.contains(column, row) {
        return None;
    }
    let reach = i32::from(design.seam == Seam::Stitched);
    let near = design
        .cells
        .iter()
        .filter(|cell| (cell.column - column).abs() <= reach && (cell.row - row).abs() <= reach);
    let heights = near.map(|cell| function(design, cell, p));
    Some(match design.profile {
        Profile::Bump => heights.fold(f64::NEG_INFINITY, f64::max),
        Profile::Dish => heights.fold(f64::INFINITY, f64::min),
    })
}

const CASES: [(Profile, Seam); 4] = [
    (Profile::Bump, Seam::Step),
    (Profile::Dish, Seam::Step),
    (Profile::Bump, Seam::Stitched),
    (Profile::Dish, Seam::Stitched),
];

fn same_bits(a: &Heights, b: &Heights) -> bool {
    a.window == b.window
        && a.z_mm.iter().zip(&b.z_mm).all(|(a, b)| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()))
}

/// Heights to one unit in the last place of a float at this size, and the same holes.
fn agree(found: f32, wanted: Option<f64>, datum: f64) -> bool {
    match wanted {
        None => found.is_nan(),
        Some(z) => {
            let rounded = (z - datum) as f32;
            rounded.to_bits() == found.to_bits()
                || (z - datum - f64::from(found)).abs() < 1e-12 + 6e-8 * (z - datum).abs()
        }
    }
}

#[test]
fn designed_samples_are_the_minima_over_all_planes() {
    for (profile, seam) in CASES {
        for (step, facets) in [(0.05, 60), (0.32, 60), (0.07, 1), (0.11, 200)] {
            let design = Arc::new(design(profile, seam, facets));
            let surface = Designed::whole(design.clone(), step).unwrap();
            let lattice = surface.lattice();
            let window = lattice.window().grown(3);
            let heights = surface.heights(window, 38.0).unwrap();
            let mut differing = 0;
            for row in window.row..window.row_end() {
                for column in window.column..window.column_end() {
                    let p = [lattice.x_mm(column), lattice.y_mm(row)];
                    let wanted = naive(&design, design.core, p);
                    let found = heights.row(row)[(column - window.column) as usize];
                    assert!(
                        agree(found, wanted, 38.0),
                        "{profile:?} {seam:?} {step} at {column} {row}: {found} {wanted:?}"
                    );
                    differing += usize::from(wanted.is_some_and(|z| (z - 38.0) as f32 != found));
                }
            }
            assert!(differing * 10_000 <= window.samples(), "{differing} samples differ in their last bit");
        }
    }
}

#[test]
fn a_sample_has_the_same_bits_in_every_window_and_on_every_number_of_threads() {
    for (profile, seam) in CASES {
        let surface = Designed::whole(Arc::new(design(profile, seam, 80)), 0.031).unwrap();
        let whole = surface.heights(surface.lattice().window().grown(5), 40.0).unwrap();
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        for window in [
            Window { column: -5, row: 7, columns: 90, rows: 3 },
            Window { column: 128, row: 129, columns: 1, rows: 40 },
            Window { column: 201, row: 5, columns: 100, rows: 33 },
        ] {
            let part = alone.install(|| surface.heights(window, 40.0)).unwrap();
            assert!(same_bits(&part, &whole.crop(window)));
        }
    }
}

#[test]
fn a_tile_sees_its_neighbours_only_where_they_are_material() {
    let design = Arc::new(design(Profile::Bump, Seam::Step, 50));
    let core = design.core;
    let tile = CellRange { c0: 11, c1: 12, ..core };
    let whole = Designed::whole(design.clone(), 0.05).unwrap();
    let (origin, size) = ([4.0, 0.0], [4.0, 8.0]);
    let sheet = Designed::new(design.clone(), core, origin, size, 0.05).unwrap();
    let blank = Designed::new(design.clone(), tile, origin, size, 0.05).unwrap();
    let window = sheet.lattice().window().grown(10);
    let shifted = Window { column: window.column + 80, ..window };
    let all = whole.heights(shifted, 40.0).unwrap();
    let one = sheet.heights(window, 40.0).unwrap();
    let own = blank.heights(window, 40.0).unwrap();
    for (index, &z) in all.z_mm.iter().enumerate() {
        let column = index as i64 % window.columns as i64 + window.column;
        let found = one.z_mm[index];
        assert!((z.is_nan() && found.is_nan()) || (z - found).abs() < 1e-7);
        let inside = (0..80).contains(&column);
        assert_eq!(own.z_mm[index].is_nan(), !inside || z.is_nan());
        assert!(!inside || own.z_mm[index].to_bits() == found.to_bits() || z.is_nan());
    }
    assert!(sheet.top_mm() <= whole.top_mm() && sheet.bottom_mm() >= whole.bottom_mm());
    assert_eq!(sheet.top_mm(), blank.top_mm());
    let cut = Tile::new(&whole, Window { column: 80, row: 0, columns: 80, rows: 160 }, true);
    let cut = cut.unwrap().expect("material");
    let again = cut.heights(window, 40.0).unwrap();
    assert!(again.z_mm.iter().zip(&all.z_mm).all(|(a, b)| a.to_bits() == b.to_bits() || b.is_nan()));
}

#[test]
fn top_and_bottom_are_those_of_the_vertices() {
    for (profile, seam) in CASES {
        let design = Arc::new(design(profile, seam, 40));
        let surface = Designed::whole(design.clone(), 0.01).unwrap();
        let heights = surface.heights(surface.lattice().window(), 40.0).unwrap();
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for z in heights.z_mm {
            low = low.min(f64::from(z) + 40.0);
            high = high.max(f64::from(z) + 40.0);
        }
        let [sx, sy] = surface.steepest();
        let slack = 0.5 * 0.01 * (sx + sy) + 1e-6;
        assert!((-1e-6..slack).contains(&(surface.top_mm() - high)), "{profile:?} {seam:?} top {high}");
        assert!((-1e-6..slack).contains(&(low - surface.bottom_mm())), "{profile:?} {seam:?} bottom {low}");
        let facets = design.cells.iter().flat_map(|cell| &cell.facets);
        assert!(facets.clone().all(|f| f.gradient[0].abs() <= sx + 1e-12 || f.gradient[0].abs() < 0.7));
        assert!(facets.clone().any(|f| f.gradient[0].abs() == sx));
    }
}

fn area(outline: &[[f64; 3]]) -> f64 {
    let next = |k: usize| outline[(k + 1) % outline.len()];
    (0..outline.len()).map(|k| 0.5 * (outline[k][0] * next(k)[1] - outline[k][1] * next(k)[0])).sum()
}

#[test]
fn faces_cover_a_cell_once_and_lie_in_the_surface() {
    for (profile, seam) in CASES {
        let design = Arc::new(design(profile, seam, 60));
        let surface = Designed::whole(design.clone(), 0.05).unwrap();
        for (column, row) in [(10, 20), (11, 20), (12, 21)] {
            let faces = surface.faces(column, row);
            let total: f64 = faces.iter().map(|face| area(&face.outline_mm)).sum();
            assert!((total - 16.0).abs() < 1e-9, "{profile:?} {seam:?}: {total}");
            for face in &faces {
                assert!(area(&face.outline_mm) > 0.0);
                let count = face.outline_mm.len() as f64;
                let middle: [f64; 3] =
                    std::array::from_fn(|k| face.outline_mm.iter().map(|c| c[k]).sum::<f64>() / count);
                let z = naive(&design, design.core, [middle[0], middle[1]]).expect("inside");
                assert!((z - middle[2]).abs() < 1e-9, "{profile:?} {seam:?}: {z} {middle:?}");
            }
        }
    }
}

fn theatre() -> std::path::PathBuf {
    concat!(env!("CARGO_MANIFEST_DIR"), "/tests/cases/theatre-3x3-bump.stl").into()
}

fn triangles(path: &std::path::Path) -> Vec<[[f64; 3]; 3]> {
    let mut file = std::fs::File::open(path).unwrap();
    let mesh = stl_io::read_stl(&mut file).unwrap();
    mesh.faces.iter().map(|face| face.vertices.map(|v| mesh.vertices[v].0.map(f64::from))).collect()
}

/// Highest z over a point, from every triangle that holds it, edges included.
fn brute(triangles: &[[[f64; 3]; 3]], p: [f64; 2]) -> Option<f64> {
    let mut highest: Option<f64> = None;
    for [a, b, c] in triangles {
        let cross =
            |u: &[f64; 3], v: &[f64; 3]| (u[0] - p[0]) * (v[1] - p[1]) - (u[1] - p[1]) * (v[0] - p[0]);
        let (wa, wb, wc) = (cross(b, c), cross(c, a), cross(a, b));
        let sum = wa + wb + wc;
        if sum == 0.0 || [wa, wb, wc].iter().any(|w| w / sum < -1e-12) {
            continue;
        }
        let z = (wa * a[2] + wb * b[2] + wc * c[2]) / sum;
        highest = Some(highest.map_or(z, |highest| highest.max(z)));
    }
    highest
}

#[test]
fn mesh_samples_are_the_highest_of_all_triangles() {
    let opened = open(&theatre(), &Options::at_step(0.13)).unwrap();
    assert_eq!((opened.kind, opened.notes.len()), (Kind::Mesh, 0));
    let surface = opened.surface;
    let all = triangles(&theatre());
    let low: [f64; 2] =
        std::array::from_fn(|k| all.iter().flatten().map(|corner| corner[k]).fold(f64::INFINITY, f64::min));
    let lattice = surface.lattice();
    let window = lattice.window().grown(2);
    let heights = surface.heights(window, 0.0).unwrap();
    for row in window.row..window.row_end() {
        for column in window.column..window.column_end() {
            let wanted = brute(&all, [lattice.x_mm(column) + low[0], lattice.y_mm(row) + low[1]]);
            let found = heights.row(row)[(column - window.column) as usize];
            match wanted {
                None => assert!(found.is_nan()),
                Some(z) => assert!((f64::from(found) - z).abs() < 1e-6, "{column} {row}: {found} {z}"),
            }
        }
    }
    let part = Window { column: 11, row: 5, columns: 40, rows: 50 };
    assert!(same_bits(&surface.heights(part, 0.0).unwrap(), &heights.crop(part)));
    // The solid's base lies below the surface and is not its bottom.
    let lowest = heights.z_mm.iter().copied().fold(f32::INFINITY, f32::min);
    let base = all.iter().flatten().map(|c| c[2]).fold(f64::INFINITY, f64::min);
    assert!(surface.bottom_mm() > base && surface.bottom_mm() <= f64::from(lowest) + 1e-6);
    assert!(f64::from(lowest) - surface.bottom_mm() < 0.1);
}

fn stl(name: &str, folder: &std::path::Path, triangles: &[[[f32; 3]; 3]]) -> std::path::PathBuf {
    let list: Vec<stl_io::Triangle> = triangles
        .iter()
        .map(|t| stl_io::Triangle {
            normal: stl_io::Normal::new([0.0; 3]),
            vertices: t.map(stl_io::Vertex::new),
        })
        .collect();
    let path = folder.join(name);
    stl_io::write_stl(&mut std::fs::File::create(&path).unwrap(), list.iter()).unwrap();
    path
}

/// A ramp z = x/4 + y/8 of squares that share their edges, on which samples fall.
fn ramp() -> Vec<[[f32; 3]; 3]> {
    let point = |i: u32, j: u32| {
        let (x, y) = (i as f32 * 0.75, j as f32 * 0.75);
        [x + 3.0, y - 2.0, x / 4.0 + y / 8.0]
    };
    let mut list = Vec::new();
    for (i, j) in (0..8).flat_map(|i| (0..8).map(move |j| (i, j))) {
        let [a, b, c, d] = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
        list.extend(if (i + j) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
    }
    list
}

#[test]
fn samples_on_shared_edges_are_filled_whatever_the_unit_and_the_axis() {
    let folder = tempfile::tempdir().unwrap();
    for (name, unit, factor) in
        [("mm.stl", Unit::Mm, 1.0), ("m.stl", Unit::Metre, 1e-3), ("in.stl", Unit::Inch, 1.0 / 25.4)]
    {
        for (up, order) in [(Up::Z, [0, 1, 2]), (Up::X, [1, 2, 0])] {
            let turned: Vec<_> = ramp()
                .iter()
                .map(|t| {
                    t.map(|c| {
                        // Put part axis k where the file keeps it.
                        let mut out = [0.0; 3];
                        for (part, file) in order.iter().enumerate() {
                            out[*file] = c[part] * factor;
                        }
                        out
                    })
                })
                .collect();
            let path = stl(name, folder.path(), &turned);
            let options = Options { unit, up, ..Options::at_step(0.1) };
            let surface = open(&path, &options).unwrap().surface;
            let lattice = surface.lattice();
            assert_eq!((lattice.columns, lattice.rows), (60, 60));
            let heights = surface.heights(lattice.window(), 0.0).unwrap();
            for (index, z) in heights.z_mm.iter().enumerate() {
                let (x, y) = (lattice.x_mm(index as i64 % 60), lattice.y_mm(index as i64 / 60));
                assert!((f64::from(*z) - (x / 4.0 + y / 8.0)).abs() < 2e-6, "{x} {y} {z}");
            }
            let [sx, sy] = surface.steepest();
            assert!((sx - 0.25).abs() < 1e-5 && (sy - 0.125).abs() < 1e-5);
        }
    }
    let turned: Vec<_> = ramp().iter().map(|t| t.map(|[x, y, z]| [x, z, -y])).collect();
    let path = stl("y.stl", folder.path(), &turned);
    let surface = open(&path, &Options { up: Up::Y, ..Options::at_step(0.1) }).unwrap().surface;
    assert!((surface.top_mm() - 2.25).abs() < 1e-6 && surface.lattice().columns == 60);
}

#[test]
fn a_die_is_the_part_from_behind_and_its_die_the_part() {
    let designed = |step| Designed::whole(Arc::new(design(Profile::Bump, Seam::Step, 30)), step).unwrap();
    // 12 mm are not whole steps of 0.0701 mm.
    for step in [0.05, 0.0701] {
        let part = designed(step);
        let die = Die::new(designed(step));
        let lattice = die.lattice();
        let window = lattice.window().grown(2);
        let heights = die.heights(window, -40.0).unwrap();
        let source = design(Profile::Bump, Seam::Step, 30);
        for row in window.row..window.row_end() {
            for column in window.column..window.column_end() {
                let p = [lattice.width_mm - lattice.x_mm(column), lattice.y_mm(row)];
                let found = heights.row(row)[(column - window.column) as usize];
                assert!(agree(found, naive(&source, source.core, p).map(|z| -z), -40.0));
            }
        }
        assert_eq!((die.top_mm(), die.bottom_mm()), (-part.bottom_mm(), -part.top_mm()));
        let twice = Die::new(Die::new(designed(step)));
        assert!(same_bits(&twice.heights(window, 40.0).unwrap(), &part.heights(window, 40.0).unwrap()));
    }
}

#[test]
fn columns_and_rows_exchanged_twice_are_the_part() {
    let part = Designed::whole(Arc::new(design(Profile::Dish, Seam::Step, 30)), 0.05).unwrap();
    let window = Window { column: -3, row: 11, columns: 70, rows: 41 };
    let straight = part.heights(window, 40.0).unwrap();
    let turned = Transposed::new(Arc::new(part));
    assert_eq!((turned.lattice().columns, turned.lattice().rows), (160, 240));
    let across = Window { column: 11, row: -3, columns: 41, rows: 70 };
    let found = turned.heights(across, 40.0).unwrap();
    for (index, z) in straight.z_mm.iter().enumerate() {
        let other = found.z_mm[(index % 70) * 41 + index / 70];
        assert!(z.to_bits() == other.to_bits() || (z.is_nan() && other.is_nan()));
    }
    let back = Transposed::new(turned);
    assert!(same_bits(&back.heights(window, 40.0).unwrap(), &straight));
}

#[test]
fn a_wall_stands_outside_the_part_only() {
    let part = Arc::new(Designed::whole(Arc::new(design(Profile::Bump, Seam::Step, 30)), 0.07).unwrap());
    let walled = Walled::new(part.clone(), 50.0);
    let lattice = part.lattice();
    let window = lattice.window().grown(4);
    let (bare, found) = (part.heights(window, 40.0).unwrap(), walled.heights(window, 40.0).unwrap());
    for (index, z) in found.z_mm.iter().enumerate() {
        let x = lattice.x_mm(index as i64 % window.columns as i64 + window.column);
        let y = lattice.y_mm(index as i64 / window.columns as i64 + window.row);
        let inside = x > 0.0 && y > 0.0 && x <= 12.0 && y <= 8.0;
        assert_eq!(z.to_bits(), if inside { bare.z_mm[index].to_bits() } else { 10.0f32.to_bits() });
    }
    assert_eq!(walled.top_mm(), part.top_mm());
}

/// The same cells on a slope of 3 and -2 degrees, as on a corner of an elevated screen.
fn sloped(seam: Seam) -> Design {
    let mut design = design(Profile::Bump, seam, 30);
    for cell in &mut design.cells {
        let high = f64::from((cell.column + cell.row) % 2);
        cell.elevation_mm = 40.0 + 0.21 * f64::from(cell.column) - 0.14 * f64::from(cell.row) + 0.2 * high;
        for facet in &mut cell.facets {
            facet.gradient[0] += 3f64.to_radians().tan();
            facet.gradient[1] -= 2f64.to_radians().tan();
        }
    }
    design
}

#[test]
fn a_levelled_design_turned_back_is_the_design() {
    for seam in [Seam::Step, Seam::Stitched] {
        let design = Arc::new(sloped(seam));
        let part = Designed::whole(design.clone(), 0.05).unwrap();
        let level = part.levelled().unwrap();
        assert!(level.about_x_deg.abs() > 1.0 && level.about_y_deg.abs() > 1.0);
        let r = level.rotation;
        let turn =
            |p: [f64; 3]| -> [f64; 3] { std::array::from_fn(|k| (0..3).map(|c| r[k][c] * p[c]).sum()) };
        for facet in &design.cells[0].facets {
            let normal = [-facet.gradient[0], -facet.gradient[1], 1.0];
            let back = level.back(turn(normal));
            assert!((0..3).all(|k| (back[k] - normal[k]).abs() < 1e-14));
        }
        // The triangles' own normals, turned back, are the facets'.
        for index in (0..level.surface.triangles()).step_by(37) {
            let [a, b, c] = level.surface.triangle(index);
            let (u, v): ([f64; 3], [f64; 3]) =
                (std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            let n = level.back(n);
            let size = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
            if size < 1e-4 || n[2].abs() < 1e-3 * size {
                continue;
            }
            let near = design
                .cells
                .iter()
                .flat_map(|cell| &cell.facets)
                .map(|f| (f.gradient[0] + n[0] / n[2]).abs().max((f.gradient[1] + n[1] / n[2]).abs()));
            assert!(near.fold(f64::INFINITY, f64::min) < 1e-9);
        }
        // Every sample lies on the design, turned; the few on a slanted step wall lie between cells.
        let lattice = level.surface.lattice();
        let heights = level.surface.heights(lattice.window(), 0.0).unwrap();
        let (mut on, mut off, mut none) = (0, 0, 0);
        let mut points = Vec::new();
        for (index, &z) in heights.z_mm.iter().enumerate() {
            if z.is_nan() {
                none += 1;
                continue;
            }
            let (x, y) = (
                lattice.x_mm((index % lattice.columns) as i64),
                lattice.y_mm((index / lattice.columns) as i64),
            );
            points.push([x, y, f64::from(z)]);
            let turned = [x - level.shift_mm[0], y - level.shift_mm[1], f64::from(z) - level.shift_mm[2]];
            let p = level.back(turned);
            match naive(&design, design.core, [p[0], p[1]]) {
                Some(wanted) if (wanted - p[2]).abs() < 1e-5 => on += 1,
                _ => off += 1,
            }
        }
        assert!(on > 50 * off && off > 0 || seam == Seam::Stitched && off < 20, "{seam:?}: {on} {off}");
        assert!(none > 0 && none * 20 < on, "{none} of {on}");
        let count = points.len() as f64;
        let mean = [0, 1, 2].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / count);
        for axis in 0..2 {
            let moment =
                |k: usize| points.iter().map(|p| (p[axis] - mean[axis]) * (p[k] - mean[k])).sum::<f64>();
            assert!((moment(2) / moment(axis)).abs() < 1e-3, "{}", moment(2) / moment(axis));
        }
        if seam == Seam::Step {
            assert!(level.undercuts > 0 && level.undercut_area_mm2 > 0.0 && level.undercut_area_mm2 < 1.0);
        } else {
            assert_eq!(level.undercuts, 0);
        }
    }
}

#[test]
fn a_levelled_mesh_is_level() {
    let folder = tempfile::tempdir().unwrap();
    let path = stl("ramp.stl", folder.path(), &ramp());
    let surface = open(&path, &Options::at_step(0.1)).unwrap().surface;
    let level = surface.levelled().unwrap();
    assert!((level.surface.top_mm() - level.surface.bottom_mm()).abs() < 1e-6);
    // A plane with slopes 1/4 and 1/8: turned about Y by atan(1/4), then about X by the rest.
    assert!((level.about_y_deg - 0.25f64.atan().to_degrees()).abs() < 1e-5);
    let about_x = (0.125 / (1.0 + 0.0625f64).sqrt()).atan().to_degrees();
    assert!((level.about_x_deg + about_x).abs() < 1e-5);
    assert_eq!(level.undercuts, 0);
}
