//! Designs written and read back, and what they say of their own surface.

use screenmill::screen::{self, CellRange, Design, Profile, Scene, Seam};

/// The theatre at the elevation of all zeros: what is tested here is one cell at a time.
fn theatre() -> Scene {
    let path = format!("{}/samples/theatre.toml", env!("CARGO_MANIFEST_DIR"));
    let mut scene = Scene::read(path.as_ref()).expect("a sample scene");
    scene.elevation = screen::ElevationMethod::Flat;
    scene
}

fn designed(profile: Profile) -> Design {
    let mut scene = theatre();
    scene.microgeometry.profile = profile;
    let cells = CellRange { c0: 324, r0: 149, c1: 327, r1: 151 };
    screen::design(&scene, Some(cells), None, &|_, _| ()).expect("a design")
}

#[test]
fn the_polygons_of_a_cell_have_its_areas_and_cover_it_once() {
    for profile in [Profile::Bump, Profile::Dish] {
        let design = designed(profile);
        for cell in design.core_cells() {
            let mut covered = 0.0;
            for polygon in cell.polygons(design.cell_mm, profile) {
                let v = &polygon.vertices_mm;
                let area: f64 = (0..v.len())
                    .map(|k| {
                        let (a, b) = (v[k], v[(k + 1) % v.len()]);
                        0.5 * (a[0] * b[1] - a[1] * b[0])
                    })
                    .sum();
                let wanted = cell.facets[polygon.facet].area_mm2;
                assert!((area / wanted - 1.0).abs() < 1.1e-6, "{} {area} {wanted}", polygon.facet);
                covered += area;
            }
            assert!((covered - 16.0).abs() < 1e-12);
        }
    }
}

#[test]
fn a_container_reads_back_as_it_was_and_writes_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    for profile in [Profile::Bump, Profile::Dish] {
        let design = designed(profile);
        let paths = ["a.npz", "b.npz"].map(|name| folder.path().join(name));
        design.write(&paths[0]).expect("written");
        let read = Design::read(&paths[0]).expect("read");
        assert_eq!(read, design);
        read.write(&paths[1]).expect("written");
        let bytes = paths.map(|path| std::fs::read(path).expect("bytes"));
        assert_eq!(bytes[0], bytes[1]);
    }
}

#[test]
fn a_cell_does_not_depend_on_its_company() {
    let scene = theatre();
    let one = CellRange { c0: 325, r0: 150, c1: 326, r1: 151 };
    let alone = screen::design(&scene, Some(one), None, &|_, _| ()).expect("a design");
    let among = designed(Profile::Bump);
    assert_eq!(alone.cells[0], *among.cell(325, 150).expect("the cell"));
    let mut stitched = scene.clone();
    stitched.microgeometry.seam = screen::Seam::Stitched;
    let ringed = screen::design(&stitched, Some(one), None, &|_, _| ()).expect("a design");
    assert_eq!(ringed.cells.len(), 9);
    assert_eq!(ringed.core, one);
    assert_eq!(alone.cells[0], *ringed.cell(325, 150).expect("the cell"));
    assert_eq!(ringed.core_cells().count(), 1);
    let corner = CellRange { c0: 0, r0: 249, c1: 1, r1: 250 };
    let cornered = screen::design(&stitched, Some(corner), None, &|_, _| ()).expect("a design");
    assert_eq!(cornered.extent(), CellRange { c0: 0, r0: 248, c1: 2, r1: 250 });
}

#[test]
fn a_dish_is_the_bump_turned_and_upside_down() {
    let (bump, dish) = (designed(Profile::Bump), designed(Profile::Dish));
    for (b, d) in bump.cells.iter().zip(&dish.cells) {
        assert_eq!(b.elevation_mm, d.elevation_mm);
        for k in 0..400 {
            let p = [f64::from(k % 20) * 0.2 - 1.9, f64::from(k / 20) * 0.2 - 1.9];
            let up = b.height_mm([-p[0], -p[1]], Profile::Bump) - b.elevation_mm;
            let down = d.height_mm(p, Profile::Dish) - d.elevation_mm;
            assert!((up + down).abs() < 1e-12);
        }
    }
}

#[test]
fn extremes_are_those_of_the_surface_and_its_mean_is_the_elevation() {
    for profile in [Profile::Bump, Profile::Dish] {
        let design = designed(profile);
        for cell in &design.cells {
            let [low, high] = cell.extremes_mm(design.cell_mm, profile);
            let (mut least, mut most, mut sum) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
            for k in 0..40_000 {
                let p = [f64::from(k % 200) * 0.02 - 1.99, f64::from(k / 200) * 0.02 - 1.99];
                let z = cell.height_mm(p, profile);
                (least, most, sum) = (least.min(z), most.max(z), sum + z);
            }
            assert!(low <= least && least - low < 0.01, "{low} {least}");
            assert!(high >= most && high - most < 0.01, "{high} {most}");
            assert!((sum / 40_000.0 - cell.elevation_mm).abs() < 2e-5);
        }
    }
}

#[test]
fn the_best_plane_of_a_tilted_design_is_its_tilt() {
    let mut design = designed(Profile::Bump);
    let centres: Vec<[f64; 2]> = design.cells.iter().map(|cell| design.centre_mm(cell)).collect();
    assert_eq!(centres[0], [2.0, 2.0]);
    for (cell, [x, y]) in design.cells.iter_mut().zip(centres) {
        cell.elevation_mm = 3.0 + 0.2 * x - 0.05 * y;
    }
    for (found, expected) in design.best_plane().iter().zip([3.0, 0.2, -0.05]) {
        assert!((found - expected).abs() < 1e-12);
    }
}

/// Triangles of a binary STL.
fn triangles(path: &std::path::Path) -> Vec<[[f32; 3]; 3]> {
    let bytes = std::fs::read(path).expect("a file");
    let count = u32::from_le_bytes(bytes[80..84].try_into().expect("four bytes")) as usize;
    assert_eq!(bytes.len(), 84 + 50 * count);
    let number = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"));
    let corner = |at: usize| [number(at), number(at + 4), number(at + 8)];
    (0..count).map(|k| 84 + 50 * k).map(|at| [corner(at + 12), corner(at + 24), corner(at + 36)]).collect()
}

#[test]
fn solids_are_closed_and_hold_the_volume_under_the_surface() {
    let mut scene = theatre();
    scene.elevation = screen::ElevationMethod::Poisson;
    let heights = screen::elevation(&scene).expect("an elevation");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.stl");
    // In the middle of the screen and in its corner, where stitched cells have no neighbours.
    for (c0, r0) in [(324, 149), (497, 247)] {
        for (profile, seam) in [
            (Profile::Bump, Seam::Step),
            (Profile::Dish, Seam::Step),
            (Profile::Bump, Seam::Stitched),
            (Profile::Dish, Seam::Stitched),
        ] {
            (scene.microgeometry.profile, scene.microgeometry.seam) = (profile, seam);
            let core = CellRange { c0, r0, c1: c0 + 3, r1: r0 + 3 };
            let design = screen::design(&scene, Some(core), Some(&heights), &|_, _| ()).expect("a design");
            design.write_stl(&path).expect("written");
            let triangles = triangles(&path);
            let mut edges = std::collections::BTreeMap::new();
            let mut volume = 0.0;
            let base = triangles.iter().flatten().map(|v| v[2]).fold(f32::INFINITY, f32::min);
            let (mut worst, mut covered) = (0.0f64, 0.0);
            for triangle in &triangles {
                for k in 0..3 {
                    let key = |at: usize| triangle[at].map(f32::to_bits);
                    *edges.entry((key(k), key((k + 1) % 3))).or_insert(0) += 1;
                }
                let [a, b, c] = triangle.map(|v| v.map(f64::from));
                let up = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
                let middle = [0, 1, 2].map(|axis| (a[axis] + b[axis] + c[axis]) / 3.0);
                volume += up * (middle[2] - f64::from(base));
                if up > 0.0 {
                    covered += up;
                    worst = worst.max((surface(&design, [middle[0], middle[1]]) - middle[2]).abs());
                } else {
                    assert!(triangle.iter().any(|v| v[2] == base), "an upper side that looks down");
                }
            }
            let name = format!("{profile:?} {seam:?} at {c0} {r0}");
            let opposite = |(from, to): &(_, _)| edges.get(&(*to, *from)) == Some(&1);
            let open = edges.iter().filter(|(edge, count)| **count != 1 || !opposite(edge)).count();
            assert_eq!(open, 0, "{name}: edges that do not have two triangles, one each way");
            assert!((covered - 144.0).abs() < 1e-6, "{name}: {covered} mm2");
            // Heights of up to 0.2 m in single precision.
            let highest = triangles.iter().flatten().map(|v| v[2].abs()).fold(1.0, f32::max);
            assert!(worst <= f64::from(f32::EPSILON * highest), "{name}: {worst} mm off the design");
            // With steps the mean height of a cell is its elevation; stitching lifts or lowers it.
            let level = design.core_cells().map(|cell| 16.0 * (cell.elevation_mm - f64::from(base)));
            let level = level.sum::<f64>();
            let off = (volume - level) / 144.0;
            let sign = if profile == Profile::Bump { 1.0 } else { -1.0 };
            assert!(
                if seam == Seam::Step { off.abs() < 1e-5 } else { (0.0..0.02).contains(&(sign * off)) },
                "{name}: {off} mm"
            );
        }
    }
}

#[test]
fn areas_of_stitched_facets_are_those_of_the_surface() {
    let mut scene = theatre();
    scene.elevation = screen::ElevationMethod::Poisson;
    scene.microgeometry.facets = 12;
    let heights = screen::elevation(&scene).expect("an elevation");
    for profile in [Profile::Bump, Profile::Dish] {
        let core = CellRange { c0: 497, r0: 247, c1: 500, r1: 250 };
        (scene.microgeometry.profile, scene.microgeometry.seam) = (profile, Seam::Step);
        let steps = screen::design(&scene, Some(core), Some(&heights), &|_, _| ()).expect("a design");
        let worst = steps.area_errors().into_iter().fold(0.0, |worst: f64, error| worst.max(error.abs()));
        assert!(worst < 2e-6, "with steps areas are those asked for, not {worst} off");
        scene.microgeometry.seam = Seam::Stitched;
        let design = screen::design(&scene, Some(core), Some(&heights), &|_, _| ()).expect("a design");
        let errors = design.area_errors();
        let core_cells: Vec<_> = design.core_cells().collect();
        assert_eq!(errors.len(), core_cells.iter().map(|cell| cell.facets.len()).sum::<usize>());
        // The middle cell by counting 20 um samples of the surface: whose plane is at its height?
        let first: usize = core_cells[..4].iter().map(|cell| cell.facets.len()).sum();
        let cell = core_cells[4];
        let centre = design.centre_mm(cell);
        let mut counted = vec![0.0; cell.facets.len()];
        let step = 0.02;
        for (i, j) in (0..400).flat_map(|i| (0..400).map(move |j| (i, j))) {
            let p = [2.0 + (f64::from(i) + 0.5) * step, 2.0 + (f64::from(j) + 0.5) * step];
            let z = surface(&design, p);
            let own = [p[0] - centre[0], p[1] - centre[1]];
            let on = |facet: &screen::Facet| (cell.elevation_mm + facet.height_mm(own) - z).abs() < 1e-12;
            if let Some(k) = cell.facets.iter().position(on) {
                counted[k] += step * step;
            }
        }
        let mut moved = 0.0f64;
        for ((facet, error), counted) in cell.facets.iter().zip(&errors[first..]).zip(counted) {
            let area = facet.area_mm2 * (1.0 + error);
            assert!((area - counted).abs() < 0.02, "{profile:?}: {area} mm2, counted {counted}");
            moved = moved.max(error.abs());
        }
        assert!(moved > 0.02, "seams move borders, here by {moved}");
    }
}

#[test]
fn repaired_facets_are_nearer_to_their_areas_whatever_is_asked_for() {
    let mut scene = theatre();
    scene.elevation = screen::ElevationMethod::Poisson;
    scene.microgeometry.seam = Seam::Stitched;
    scene.microgeometry.facets = 50;
    let heights = screen::elevation(&scene).expect("an elevation");
    let rms = |errors: &[f64]| (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    // In the corner of the screen, where cells also end without a neighbour and a facet may be covered.
    let core = CellRange { c0: 496, r0: 246, c1: 500, r1: 250 };
    for profile in [Profile::Bump, Profile::Dish] {
        scene.microgeometry.profile = profile;
        let made = |scene: &Scene, cells| {
            screen::design(scene, Some(cells), Some(&heights), &|_, _| ()).expect("a design")
        };
        scene.microgeometry.area_sweeps = 0;
        let before = rms(&made(&scene, core).area_errors());
        scene.microgeometry.area_sweeps = 3;
        let repaired = made(&scene, core);
        let after = rms(&repaired.area_errors());
        assert!(after < 0.5 * before, "{profile:?}: {before} rms before, {after} after");
        // A cell is the same alone and with others: gradients, areas and offsets, to the bit.
        let alone = made(&scene, CellRange { c0: 498, r0: 247, c1: 499, r1: 248 });
        for cell in &alone.cells {
            assert_eq!(Some(cell), repaired.cell(cell.column, cell.row), "{profile:?}");
        }
    }
    // ... and wherever rows are parted to save memory.
    scene.microgeometry.area_sweeps = 1;
    let column = |r0, r1| {
        let cells = CellRange { c0: 240, r0, c1: 241, r1 };
        screen::design(&scene, Some(cells), Some(&heights), &|_, _| ()).expect("a design")
    };
    let (long, short) = (column(100, 136), column(128, 136));
    for cell in &short.cells {
        assert_eq!(Some(cell), long.cell(cell.column, cell.row));
    }
}

/// The surface by the container's definition.
fn surface(design: &Design, p: [f64; 2]) -> f64 {
    let core = design.core;
    let index = |axis: usize, first: i32| first + (p[axis] / design.cell_mm).floor() as i32;
    let (column, row) = (index(0, core.c0), index(1, core.r0));
    let reach = i32::from(design.seam == Seam::Stitched);
    let mut z: Option<f64> = None;
    for (r, c) in
        (row - reach..=row + reach).flat_map(|r| (column - reach..=column + reach).map(move |c| (r, c)))
    {
        if let Some(cell) = design.cell(c, r) {
            let centre = design.centre_mm(cell);
            let own = cell.height_mm([p[0] - centre[0], p[1] - centre[1]], design.profile);
            z = Some(
                z.map_or(own, |z| if design.profile == Profile::Bump { z.max(own) } else { z.min(own) }),
            );
        }
    }
    z.expect("a cell there")
}
