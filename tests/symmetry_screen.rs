//! Cells turned, scaled and shuffled; scenes mirrored.

use glam::DVec2;
use screenmill::screen::{self, Scene, Workspace, solve};

fn facets(count: usize) -> (Vec<[f64; 2]>, Vec<f64>) {
    let spread = |k: usize, step: f64| (k as f64 * step).fract() - 0.5;
    let gradients = (0..count).map(|k| [0.3 * spread(k, 0.754_877_666), 0.2 * spread(k, 0.569_840_296)]);
    (gradients.collect(), (0..count).map(|k| 1.0 + spread(k, 0.618_033_988)).collect())
}

fn offsets(gradients: &[[f64; 2]], weights: &[f64], width_mm: f64) -> Vec<f64> {
    let mut workspace = Workspace::default();
    solve(&mut workspace, gradients, weights, width_mm, 1e-9).expect("a solution").offsets_mm
}

fn equal(a: &[f64], b: &[f64]) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert!((a - b).abs() < 1e-8, "{a} {b}");
    }
}

#[test]
fn quarter_turns_and_mirrors_leave_the_offsets() {
    for count in [1, 2, 3, 20, 150] {
        let (g, p) = facets(count);
        let c = offsets(&g, &p, 4.0);
        let turned: Vec<[f64; 2]> = g.iter().map(|g| [-g[1], g[0]]).collect();
        let mirrored: Vec<[f64; 2]> = g.iter().map(|g| [-g[0], g[1]]).collect();
        equal(&c, &offsets(&turned, &p, 4.0));
        equal(&c, &offsets(&mirrored, &p, 4.0));
    }
}

#[test]
fn a_cell_twice_as_wide_is_twice_as_high() {
    let (g, p) = facets(60);
    let doubled: Vec<f64> = offsets(&g, &p, 4.0).iter().map(|c| 2.0 * c).collect();
    equal(&doubled, &offsets(&g, &p, 8.0));
}

#[test]
fn a_tilt_of_all_facets_tilts_the_cell() {
    let (g, p) = facets(60);
    let tilted: Vec<[f64; 2]> = g.iter().map(|g| [g[0] + 0.1, g[1] - 0.3]).collect();
    equal(&offsets(&g, &p, 4.0), &offsets(&tilted, &p, 4.0));
}

#[test]
fn the_order_of_facets_does_not_matter() {
    let (g, p) = facets(90);
    let mut reversed = offsets(
        &g.iter().rev().copied().collect::<Vec<_>>(),
        &p.iter().rev().copied().collect::<Vec<_>>(),
        4.0,
    );
    reversed.reverse();
    equal(&offsets(&g, &p, 4.0), &reversed);
}

#[test]
fn hard_facets_are_solved_too() {
    let near: Vec<[f64; 2]> = (0..60).map(|k| [0.1 * f64::from(k / 2), 1e-6 * f64::from(k % 2)]).collect();
    let clusters: Vec<[f64; 2]> = (0..80)
        .map(|k| [f64::from(k % 2) * 2.0 + 1e-3 * f64::from(k % 7), 1e-3 * f64::from(k / 7)])
        .collect();
    let wild: Vec<f64> = (0..80).map(|k| f64::from(k % 9).exp()).collect();
    let mut workspace = Workspace::default();
    for (g, p) in [(&near, &vec![1.0; 60]), (&clusters, &vec![1.0; 80]), (&clusters, &wild)] {
        let solved = solve(&mut workspace, g, p, 4.0, 1e-6).expect("a solution");
        for (a, p) in solved.achieved_mm2.iter().zip(&solved.areas_mm2) {
            assert!((a / p - 1.0).abs() <= 1e-6);
        }
    }
}

/// A screen of a few cells before a box that stands to one side, mirrored or not.
fn beside(mirror: f64) -> Scene {
    let mut corners = Vec::new();
    for x in [0.2, 1.7] {
        for y in [-0.4, 0.5] {
            for z in [1.1, 2.3] {
                corners.push(format!("[{}, {y}, {z}]", mirror * x));
            }
        }
    }
    let text = include_str!("../samples/theatre.toml")
        .replace("width_m = 2.0", "width_m = 0.6")
        .replace("height_m = 1.0", "height_m = 0.4")
        .replace("width_mm = 4.0", "width_mm = 20.0")
        .replace("[0.0, 0.0, 3.0]", &format!("[{}, 0.1, 2.5]", 0.3 * mirror));
    let start = text.find("vertices_m").expect("corners");
    let end = text.find("[microgeometry]").expect("a microgeometry");
    let text = format!("{}vertices_m = [{}]\n\n{}", &text[..start], corners.join(", "), &text[end..]);
    Scene::parse(&text, "beside.toml").expect("a scene")
}

#[test]
fn a_mirrored_scene_has_mirrored_limits() {
    let (one, other) = (beside(1.0), beside(-1.0));
    let of = |scene: &Scene| {
        let elevation = screen::elevation(scene).expect("an elevation");
        screen::limits(scene, Some(&elevation)).expect("limits")
    };
    let (a, b) = (of(&one), of(&other));
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} {b}");
    assert_eq!(a.points, 30 * 20);
    near(a.any_direction.eq10_margin_deg, b.any_direction.eq10_margin_deg);
    near(a.horizontal.eq11_margin_deg, b.horizontal.eq11_margin_deg);
    near(a.facet_pair_deg, b.facet_pair_deg);
    for (at, opening) in a.field.horizontal.iter().enumerate() {
        let mirrored = &b.field.horizontal[at / 30 * 30 + 29 - at % 30];
        near(opening.alpha_deg, mirrored.beta_deg);
        near(opening.beta_deg, mirrored.alpha_deg);
        near(opening.gamma_deg, 180.0 - mirrored.gamma_deg);
    }
    let (worst, mirrored) = (&a.any_direction.worst, &b.any_direction.worst);
    near(worst.point_m[0], -mirrored.point_m[0]);
    near(worst.corner_m[0], -mirrored.corner_m[0]);
}

#[test]
fn a_mirrored_scene_has_the_mirrored_mask() {
    let of = |scene: &Scene| {
        let elevation = screen::elevation(scene).expect("an elevation");
        [screen::calibrate(scene, None), screen::calibrate(scene, Some(&elevation))]
            .map(|c| c.expect("a mask"))
    };
    let (one, other) = (of(&beside(1.0)), of(&beside(-1.0)));
    for (a, b) in one.iter().zip(&other) {
        for at in 0..60 {
            let x = DVec2::new(f64::from(at % 10) / 16.0 - 0.3, f64::from(at / 10) / 14.0 - 0.2);
            let (a, b) = (a.mask(x), b.mask(DVec2::new(-x.x, x.y)));
            // Heights settle to 1e-7 m.
            assert!((a - b).abs() < 2e-6, "{x}: {a} {b}");
        }
    }
}
