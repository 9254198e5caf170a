//! The design against an independent implementation of the paper (tests/cases).

#[path = "screen/morphology.rs"]
mod morphology;
#[path = "screen/plain.rs"]
mod plain;

use glam::DVec3;
use screenmill::screen::{self, CellRange, Elevation, Profile, Scene, Seam, Workspace};
use serde_json::Value;

fn case(name: &str) -> Value {
    let path = format!("{}/tests/cases/{name}.json", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).expect("a case file");
    serde_json::from_str(&text).expect("JSON")
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|v| v.as_f64().expect("a number")).collect()
}

fn points<const N: usize>(value: &Value) -> Vec<[f64; N]> {
    let list = value.as_array().expect("a list").iter();
    list.map(|v| numbers(v).try_into().expect("a point")).collect()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn scene(name: &str) -> Scene {
    let path = format!("{}/samples/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Scene::read(path.as_ref()).expect("a sample scene")
}

fn one_cell_matches(scene: &Scene, case: &Value) {
    let facets = case["n"].as_u64().expect("a number") as usize;
    let x = DVec3::from_array(points::<3>(&Value::Array(vec![case["screen_point_m"].clone()]))[0]);
    let found = screen::directions(&scene.view(x), facets).expect("an audience");
    assert_eq!(found.density, case["lattice_nu"].as_f64().expect("a number"));
    let directions = points::<3>(&case["directions"]);
    assert_eq!(found.list.len(), directions.len());
    for (o, expected) in found.list.iter().zip(&directions) {
        assert!(largest_difference(&o.to_array(), expected) < 1e-12, "{o} {expected:?}");
    }
    let wanted = screen::facets(scene, x, &found.list).expect("facets");
    let gradients = points::<2>(&case["gradients"]);
    for (g, expected) in wanted.gradients.iter().zip(&gradients) {
        assert!(largest_difference(g, expected) < 1e-12);
    }
    let solved = screen::solve(&mut Workspace::default(), &wanted.gradients, &wanted.weights, 4.0, 1e-6)
        .expect("a solution");
    assert!(largest_difference(&solved.areas_mm2, &numbers(&case["target_proj_mm2"])) < 1e-12);
    for (a, p) in solved.achieved_mm2.iter().zip(&solved.areas_mm2) {
        assert!((a / p - 1.0).abs() <= 1e-6);
    }
    assert!(largest_difference(&solved.offsets_mm, &numbers(&case["plane_offsets_mm"])) < 1e-6);
}

#[test]
fn a_theatre_cell_of_200_facets_is_the_references() {
    one_cell_matches(&scene("theatre"), &case("theatre-centre-200"));
}

#[test]
fn a_home_cell_of_50_facets_is_the_references() {
    one_cell_matches(&scene("home-theatre"), &case("home-50"));
}

#[test]
fn edge_cases_merge_and_solve_as_the_references() {
    for case in case("edge_cases").as_array().expect("a list") {
        let (g, p) = (points::<2>(&case["g"]), numbers(&case["p"]));
        let tag = case["tag"].as_str().expect("a tag");
        let solved = screen::solve(&mut Workspace::default(), &g, &p, 4.0, 1e-9).expect(tag);
        assert_eq!(solved.gradients, points::<2>(&case["merged_g"]), "{tag}");
        assert!(largest_difference(&solved.areas_mm2, &numbers(&case["merged_p"])) < 1e-12, "{tag}");
        let map: Vec<Option<usize>> = case["map"]
            .as_array()
            .expect("a list")
            .iter()
            .map(|v| usize::try_from(v.as_i64().expect("a number")).ok())
            .collect();
        assert_eq!(solved.merged_into, map, "{tag}");
        assert!(largest_difference(&solved.offsets_mm, &numbers(&case["c"])) < 1e-6, "{tag}");
        assert!(largest_difference(&solved.achieved_mm2, &numbers(&case["A"])) < 1e-7, "{tag}");
    }
}

#[test]
fn the_quick_solver_finds_what_the_plain_one_does() {
    for (name, facets, place) in
        [("theatre", 200, [0.93, -0.41]), ("home-theatre", 120, [-0.5, 0.3]), ("conference", 37, [0.0, 0.49])]
    {
        let scene = scene(name);
        let x = DVec3::new(place[0], place[1], 0.03);
        let found = screen::directions(&scene.view(x), facets).expect("an audience");
        let wanted = screen::facets(&scene, x, &found.list).expect("facets");
        let solved = screen::solve(&mut Workspace::default(), &wanted.gradients, &wanted.weights, 4.0, 1e-6)
            .expect("a solution");
        let (plain, _) = plain::solve(&solved.gradients, &solved.areas_mm2, 4.0);
        // Offsets are free by a constant.
        let shift = solved.offsets_mm[0] - plain[0];
        for (c, d) in solved.offsets_mm.iter().zip(&plain) {
            assert!((c - d - shift).abs() < 1e-7, "{name}: {c} {}", d + shift);
        }
        let areas: Vec<f64> = plain::diagram(&solved.gradients, &solved.offsets_mm, 2.0)
            .iter()
            .map(|polygon| plain::area(polygon))
            .collect();
        assert!(largest_difference(&areas, &solved.achieved_mm2) < 1e-13, "{name}");
    }
}

/// The middle one of 3 x 3 cells under a ball of 1 mm radius, at 25 um.
fn left(
    scene: &Scene,
    elevation: &Elevation,
    [column, row]: [i32; 2],
    profile: Profile,
    seam: Seam,
) -> morphology::Left {
    let mut scene = scene.clone();
    (scene.microgeometry.profile, scene.microgeometry.seam) = (profile, seam);
    let cells = CellRange { c0: column - 1, r0: row - 1, c1: column + 2, r1: row + 2 };
    let design = screen::design(&scene, Some(cells), Some(elevation), &|_, _| ()).expect("a design");
    morphology::under_a_ball(&scene, &design, 40, 0.025)
}

#[test]
fn a_ball_can_follow_stitched_dishes_and_no_others() {
    let scene = scene("theatre");
    let elevation = screen::elevation(&scene).expect("an elevation");
    for (cell, steps_leak) in [([250, 125], 0.015), ([475, 225], 0.04)] {
        let left = |profile, seam| left(&scene, &elevation, cell, profile, seam);
        // The paper's bumps lose their grooves; dishes with steps the fillets under these, which send light astray.
        let bump = left(Profile::Bump, Seam::Step);
        assert!(bump.turned > 0.12 && bump.raised > 0.05 && bump.leak < 0.005, "{cell:?} {bump:?}");
        let steps = left(Profile::Dish, Seam::Step);
        assert!(steps.turned > 0.015 && steps.leak > steps_leak, "{cell:?} {steps:?}");
        let stitched = left(Profile::Dish, Seam::Stitched);
        assert!(stitched.turned < 0.003 && stitched.leak < 3e-4, "{cell:?} {stitched:?}");
        assert_eq!(stitched.raised, 0.0);
    }
}
