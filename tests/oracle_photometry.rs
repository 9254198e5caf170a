//! Limits and light of a screen against closed forms, hand-worked cases and naive twins.

use glam::{DVec2, DVec3};
use screenmill::evaluation::{self, CellLight};
use screenmill::optics::half_vector;
use screenmill::progress::Silent;
use screenmill::screen::{self, Scene};

fn sample(name: &str) -> Scene {
    let path = format!("{}/samples/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Scene::read(path.as_ref()).expect("a sample scene")
}

/// A screen of one cell at the origin with the projector straight before it, and boxes for audience.
fn one_cell(boxes: &[[[f64; 2]; 3]]) -> Scene {
    let text = include_str!("../samples/theatre.toml")
        .replace("width_m = 2.0", "width_m = 0.004")
        .replace("height_m = 1.0", "height_m = 0.004")
        .replace("\"poisson\"", "\"flat\"");
    let start = text.find("[[audience]]").expect("an audience");
    let end = text.find("[microgeometry]").expect("a microgeometry");
    let mut audience = String::new();
    for [x, y, z] in boxes {
        let mut corners = Vec::new();
        for x in x {
            for y in y {
                corners.extend(z.iter().map(|z| format!("[{x}, {y}, {z}]")));
            }
        }
        audience += &format!("[[audience]]\nvertices_m = [{}]\n", corners.join(", "));
    }
    Scene::parse(&format!("{}{audience}\n{}", &text[..start], &text[end..]), "one.toml").expect("a scene")
}

fn near(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() < tolerance, "{a} {b}");
}

#[test]
fn eqs_10_and_11_are_those_worked_by_hand_before_the_centre() {
    // A front face of 2 x 1 at distance 2: alpha = beta = atan 2 along x, atan 4 along y; gamma = 90.
    let margins = screen::limits(&one_cell(&[[[-1.0, 1.0], [-0.5, 0.5], [2.0, 3.0]]]), None).expect("limits");
    let (wide, high) = (2.0_f64.atan().to_degrees(), 4.0_f64.atan().to_degrees());
    near(margins.horizontal.alpha_deg[0], wide, 1e-9);
    near(margins.horizontal.eq10_margin_deg, 3.0 * wide - 90.0, 1e-9);
    near(margins.horizontal.eq11_margin_deg, 2.0 * wide - 60.0, 1e-9);
    near(margins.vertical.eq10_margin_deg, 3.0 * high - 90.0, 1e-9);
    // The widest plane runs through a corner, sqrt(1.25) from the axis.
    let corner = (2.0 / 1.25_f64.sqrt()).atan().to_degrees();
    near(margins.any_direction.eq10_margin_deg, 3.0 * corner - 90.0, 1e-9);
    near(margins.any_direction.worst.azimuth_deg, 0.5_f64.atan().to_degrees(), 1e-3);
    assert_eq!(margins.points_broken, 0);
}

#[test]
fn an_audience_of_more_than_120_degrees_breaks_both_equations() {
    // Edges 29 degrees over the horizon: 180 - 29 - 58 = 93 > 90.
    let half = 2.0 / 29.0_f64.to_radians().tan();
    let margins =
        screen::limits(&one_cell(&[[[-half, half], [-0.1, 0.1], [2.0, 3.0]]]), None).expect("limits");
    near(margins.horizontal.eq10_margin_deg, -3.0, 1e-9);
    near(margins.horizontal.eq11_margin_deg, -2.0, 1e-9);
    assert_eq!(margins.points_broken, 1);
    // In the plane of both edges the ray of one meets the facet of the other: -3 / 2 degrees, by symmetry.
    assert!(margins.facet_pair_deg < 0.0);
}

#[test]
fn no_pair_of_sampled_facets_comes_nearer_than_the_limit_says() {
    let mut scene = sample("home-theatre");
    scene.microgeometry.width_mm = 200.0;
    let margins = screen::limits(&scene, None).expect("limits");
    assert_eq!(margins.points, 50);
    let mut sampled = 1.0_f64;
    for at in 0..50 {
        let x = scene.centre_m(f64::from(at % 10), f64::from(at / 10), 0.0);
        let i = (scene.projector_m - x).normalize();
        let list = screen::directions(&scene.view(x), 400).expect("an audience").list;
        for o in &list {
            for h in list.iter().map(|&other| half_vector(i, other)) {
                sampled = sampled.min(o.dot(h));
            }
        }
    }
    let sampled = sampled.asin().to_degrees();
    assert!(margins.facet_pair_deg <= sampled, "{} {sampled}", margins.facet_pair_deg);
    assert!(margins.facet_pair_deg > sampled - 2.0, "{} {sampled}", margins.facet_pair_deg);
}

#[test]
fn the_samples_keep_the_margins_that_an_independent_implementation_found() {
    // Degrees: Eq. 10 along rows, with extreme light, Eq. 11 along rows, worst plane, facet pair.
    for (name, expected) in [
        ("theatre", [100.0, 68.8, 66.9, 94.9, 47.4]),
        ("conference", [67.7, 42.8, 45.2, 64.0, 32.0]),
        ("home-theatre", [79.9, 53.9, 53.3, 77.2, 38.6]),
    ] {
        let mut scene = sample(name);
        scene.microgeometry.width_mm = 20.0;
        let margins = screen::limits(&scene, None).expect("limits");
        let found = [
            margins.horizontal.eq10_margin_deg,
            margins.horizontal.eq10_extreme_margin_deg,
            margins.horizontal.eq11_margin_deg,
            margins.any_direction.eq10_margin_deg,
            margins.facet_pair_deg,
        ];
        for (found, expected) in found.iter().zip(expected) {
            // Cells of 20 mm end 8 mm further in than those of the table.
            assert!((found - expected).abs() < 0.7, "{name}: {found} {expected}");
        }
    }
}

#[test]
fn a_cell_of_4_mm_is_0_6_arcmin_from_23_m() {
    let scene = one_cell(&[[[-1.0, 1.0], [-1.0, 1.0], [22.0, 24.0]]]);
    let acuity = screen::acuity(&scene);
    near(acuity.middle_m, 23.0, 1e-9);
    near(acuity.middle_arcmin, 0.598, 1e-3);
    near(acuity.nearest_m, 22.0, 1e-9);
    near(acuity.one_arcmin_m, 13.751, 1e-3);
    assert!(acuity.farthest_m > DVec3::new(1.0, 1.0, 23.9).length());
}

#[test]
fn exact_areas_make_the_elevated_screen_even_where_the_papers_do_not() {
    let deviations = |rule: &str| -> Vec<f64> {
        let text = include_str!("../samples/theatre.toml")
            .replace("width_mm = 4.0", "width_mm = 50.0")
            .replace("area = \"paper\"", &format!("area = \"{rule}\""));
        let scene = Scene::parse(&text, "areas.toml").expect("a scene");
        let found = evaluation::evaluate(&scene, &Silent).expect("a screen").expect("not interrupted");
        found.views.iter().map(|view| view.deviation).collect()
    };
    let (paper, exact) = (deviations("paper"), deviations("exact"));
    for (paper, exact) in paper.iter().zip(&exact) {
        assert!(*exact < 0.02 && *paper > 2.0 * exact, "{paper} {exact}");
    }
}

#[test]
fn mirrors_that_reflect_the_same_at_every_angle_have_areas_without_fresnel() {
    let text =
        include_str!("../samples/theatre.toml").replace("material = \"aluminium\"", "reflectance = 0.7");
    let scene = Scene::parse(&text, "even.toml").expect("a scene");
    let x = scene.centre_m(450.0, 30.0, 0.0);
    let i = (scene.projector_m - x).normalize();
    let list = screen::directions(&scene.view(x), 50).expect("an audience").list;
    let wanted = screen::facets(&scene, x, &list).expect("facets");
    let area = |o: &DVec3| o.z * half_vector(i, *o).z;
    for (weight, o) in wanted.weights.iter().zip(&list) {
        near(weight / wanted.weights[0], area(o) / area(&list[0]), 1e-12);
    }
    let figures = screen::calibrate(&scene, None).expect("a mask").figures;
    near(figures.gain_attenuation, 0.7 * std::f64::consts::PI / figures.l_max_sr, 1e-12);
}

#[test]
fn the_nearest_place_may_be_inside_a_face() {
    // The one face towards the screen spans all of it, its corners and edges pass far beside.
    let corners = "[[-60.0, -40.0, 2.0], [60.0, -40.0, 2.0], [0.0, 80.0, 2.0], [0.0, 0.0, 50.0]]";
    let text = include_str!("../samples/theatre.toml");
    let (start, end) = (text.find("[[audience]]").expect("it"), text.find("[microgeometry]").expect("it"));
    let text = format!("{}[[audience]]\nvertices_m = {corners}\n{}", &text[..start], &text[end..]);
    let acuity = screen::acuity(&Scene::parse(&text, "face.toml").expect("a scene"));
    near(acuity.nearest_m, 2.0, 1e-9);
}

/// L of Eq. 9 by a grid of directions on the unit disc, where equal areas are equal cos(theta) d(omega).
fn counted_sr(scene: &Scene, x: DVec3) -> f64 {
    let across = 1600;
    let spacing = 2.0 / f64::from(across);
    let view = scene.view(x);
    let mut hits = 0u32;
    for j in 0..across {
        for i in 0..across {
            let (u, v) = ((f64::from(i) + 0.5) * spacing - 1.0, (f64::from(j) + 0.5) * spacing - 1.0);
            let z2 = 1.0 - u * u - v * v;
            hits += u32::from(z2 > 0.0 && view.hit(DVec3::new(u, v, z2.sqrt())));
        }
    }
    f64::from(hits) * spacing * spacing
}

#[test]
fn eq_9_is_what_counting_directions_gives_overlap_and_horizon_included() {
    let scenes = [
        sample("theatre"),
        sample("home-theatre"),
        // Two boxes one behind the other, partly; one that reaches far round the screen, with its foot behind it.
        one_cell(&[[[-0.6, 0.3], [-0.4, 0.6], [1.5, 2.0]], [[-0.1, 1.1], [-0.8, 0.2], [2.5, 3.1]]]),
        one_cell(&[[[0.5, 3.0], [-2.0, 2.0], [0.01, 1.2]]]),
    ];
    for (k, scene) in scenes.iter().enumerate() {
        for x in [DVec3::ZERO, DVec3::new(-0.4, 0.3, 0.02)] {
            let (exact, counted) =
                (screen::projected_sr(&scene.audience, x, DVec2::ZERO), counted_sr(scene, x));
            assert!((exact / counted - 1.0).abs() < 1.5e-3, "{k} {x}: {exact} {counted}");
        }
    }
}

#[test]
fn a_tilted_base_counts_what_stands_over_it() {
    let scene = one_cell(&[[[-0.7, 0.9], [-0.4, 0.6], [1.5, 2.0]]]);
    let l = |tilt| screen::projected_sr(&scene.audience, DVec3::ZERO, tilt);
    // Linear in the tilt while the whole audience stands above the base.
    let (flat, x, y) = (l(DVec2::ZERO), l(DVec2::new(0.1, 0.0)), l(DVec2::new(0.0, 0.1)));
    near(l(DVec2::new(0.3, -0.2)), flat + 3.0 * (x - flat) - 2.0 * (y - flat), 1e-12);
    // A base turned away sees nothing; turned half away it sees the half that leans to it.
    assert_eq!(l(DVec2::new(1e9, 0.0)).max(0.0), l(DVec2::new(1e9, 0.0)));
    assert!(l(DVec2::new(40.0, 0.0)) > 0.0);
}

#[test]
fn the_samples_need_the_light_that_an_independent_implementation_found() {
    // sr: least, centre, most; gain with the mask as a filter.
    for (name, expected) in [
        ("theatre", [0.200, 0.319, 0.350, 8.18]),
        ("conference", [0.351, 0.486, 0.487, 5.88]),
        ("home-theatre", [0.157, 0.186, 0.187, 15.3]),
    ] {
        let mut scene = sample(name);
        scene.microgeometry.width_mm = 8.0;
        let figures = screen::calibrate(&scene, None).expect("a calibration").figures;
        let found = [figures.l_min_sr, figures.l_centre_sr, figures.l_max_sr, figures.gain_attenuation];
        // By redirection the mean place is the measure; here summed over another grid.
        let mut sum = 0.0;
        for at in 0..5000 {
            let (x, y) = (f64::from(at % 100) * 0.02 - 0.99, f64::from(at / 100) * 0.02 - 0.49);
            sum += screen::projected_sr(&scene.audience, DVec3::new(x, y, 0.0), DVec2::ZERO);
        }
        let redirected = std::f64::consts::PI * figures.reflectance / (sum / 5000.0);
        assert!((figures.gain_redirection / redirected - 1.0).abs() < 1e-3, "{name}: {redirected}");
        for (found, expected) in found.iter().zip(expected) {
            // The table has three figures.
            assert!((found / expected - 1.0).abs() < 4.5e-3, "{name}: {found} {expected}");
        }
    }
}

#[test]
fn the_mask_is_eq_9_over_its_largest_value() {
    let mut scene = sample("theatre");
    scene.microgeometry.width_mm = 10.0;
    let calibration = screen::calibrate(&scene, None).expect("a calibration");
    for (x, y) in [(0.0, 0.0), (-0.913, 0.377), (0.9999, -0.4999), (0.31, -0.123)] {
        let exact = screen::projected_sr(&scene.audience, DVec3::new(x, y, 0.0), DVec2::ZERO);
        let mask = calibration.mask(DVec2::new(x, y));
        near(mask, exact / calibration.figures.l_max_sr, 1e-4);
    }
    // A height of 0 everywhere is the flat screen.
    let zero = screen::Elevation { columns: 200, rows: 100, z_mm: vec![0.0; 20_000] };
    let same = screen::calibrate(&scene, Some(&zero)).expect("a calibration");
    near(same.mask(DVec2::new(0.31, -0.123)), calibration.mask(DVec2::new(0.31, -0.123)), 1e-12);
    near(same.figures.gain_redirection, calibration.figures.gain_redirection, 1e-9);
}

#[test]
fn the_facets_of_a_cell_give_the_gain_of_the_solid_angle_formula() {
    for (name, cell) in
        [("theatre", (250_i32, 125_i32)), ("theatre", (40, 210)), ("home-theatre", (250, 125))]
    {
        let mut scene = sample(name);
        scene.microgeometry.area = screen::AreaRule::Exact;
        // The base of the cell: the mean gradient of its facets, which is steep in a corner of the screen.
        let x = scene.centre_m(f64::from(cell.0), f64::from(cell.1), 0.0);
        let list = screen::directions(&scene.view(x), 200).expect("an audience").list;
        let wanted = screen::facets(&scene, x, &list).expect("facets");
        let total: f64 = wanted.weights.iter().sum();
        let mean = |axis: usize| -> f64 {
            wanted.gradients.iter().zip(&wanted.weights).map(|(g, p)| g[axis] * p).sum::<f64>() / total
        };
        let tilt = DVec2::new(mean(0), mean(1));
        let (column, row) = (cell.0 as usize, cell.1 as usize);
        let light = CellLight::new(&scene, (column, row), 0.0, tilt).expect("a cell");
        let l = screen::projected_sr(&scene.audience, x, tilt);
        let i = (scene.projector_m - x).normalize();
        let caught = 1.0 - tilt.dot(i.truncate()) / i.z;
        let reflectance = scene.reflector.reflectance.at(1.0);
        let formula = std::f64::consts::PI * reflectance * caught / l;
        near(light.reflected() / (reflectance * caught), 1.0, 2e-3);
        // Energy: what goes in all directions is the reflected part.
        let (across, view) = (300, scene.view(light.point_m));
        let spacing = 2.0 / f64::from(across);
        let (mut all, mut inside, mut count) = (0.0, 0.0, 0.0);
        for at in 0..across * across {
            let place = |k: i32| (f64::from(k) + 0.5) * spacing - 1.0;
            let (u, v) = (place(at % across), place(at / across));
            let z2 = 1.0 - u * u - v * v;
            if z2 <= 0.0 {
                continue;
            }
            let o = DVec3::new(u, v, z2.sqrt());
            let gain = light.gain(o);
            all += light.intensity(o) / o.z * spacing * spacing / std::f64::consts::PI;
            // Two spreads inside the audience's edge no light is lost to it.
            let far = 3.0 * light.spread_rad();
            let deep = [
                [far, 0.0],
                [-far, 0.0],
                [0.0, far],
                [0.0, -far],
                [far, far],
                [-far, far],
                [far, -far],
                [-far, -far],
            ]
            .iter()
            .all(|[du, dv]| view.hit((o + DVec3::new(*du, *dv, 0.0)).normalize()));
            if deep {
                inside += gain;
                count += 1.0;
            }
        }
        near(all, light.reflected(), 2e-3);
        assert!(count > 20.0, "{name}");
        let mean = inside / count;
        assert!((mean / formula - 1.0).abs() < 0.02, "{name} {cell:?}: {mean} {formula}");
    }
}

#[test]
fn high_gain_falls_to_half_at_25_degrees_off_the_mirror_direction() {
    near(evaluation::high_gain(0.0), 2.9, 1e-12);
    near(evaluation::high_gain(25.0), 1.45, 1e-12);
    // A projector to the left is mirrored to the right.
    let right = DVec3::new(1.0, 0.0, 3.0);
    near(evaluation::high_gain_towards(DVec3::ZERO, DVec3::new(-1.0, 0.0, 3.0), right), 2.9, 1e-9);
}

#[test]
fn what_stands_where_it_should_loses_no_light_and_more_error_loses_more() {
    let mut scene = sample("theatre");
    scene.microgeometry.width_mm = 20.0;
    let grid = evaluation::Grid::over(&scene, None, 10).expect("cells");
    let tile = evaluation::patch(&scene, None, 200.0, 4).expect("cells");
    assert_eq!((grid.columns, grid.rows, tile.columns, tile.rows), (10, 5, 4, 4));
    for tolerance in evaluation::misalignment(&scene, &grid, &tile) {
        let on = &tolerance.on_audience;
        let middle = on.len() / 2;
        assert_eq!(tolerance.off[middle], 0.0);
        near(on[middle], 1.0, 1e-12);
        for k in 0..middle {
            assert!(on[k] <= on[k + 1] + 1e-12, "{}: {on:?}", tolerance.what);
            assert!(on[on.len() - 1 - k] <= on[on.len() - 2 - k] + 1e-12, "{}: {on:?}", tolerance.what);
        }
    }
}

#[test]
fn seats_are_in_their_audience_and_the_middle_of_two_is_in_none() {
    let [one, all] = evaluation::seats(&sample("home-theatre"));
    assert_eq!(one.each_ref().map(|seat| seat.inside), [true; 3]);
    assert_eq!(all.each_ref().map(|seat| seat.inside), [true, false, true]);
    near(one[0].place_m[0], -1.25 + 0.07, 1e-9);
    near(all[1].place_m[0], 0.0, 1e-12);
    let section = evaluation::section(&sample("theatre").audience[0], DVec3::Z, 2.0 + 1e-9);
    assert!(section.iter().any(|p| (p.x - 1.0).abs() < 1e-6 && (p.y + 0.65).abs() < 1e-6));
}
