//! Compensation against the definitions, to the bit.

#[path = "compensation/drops.rs"]
mod drops;
#[path = "compensation/naive.rs"]
mod naive;
#[path = "compensation/surfaces.rs"]
mod surfaces;

use naive::Cutter;
use rayon::prelude::*;
use screenmill::compensation::{self as fast, Closings, Profile, RowPass, RowTarget, Tables};
use screenmill::grid::{Heights, Window};
use surfaces::STEP_MM;

fn cutter(text: &str, allowance_mm: f64) -> (Profile, Cutter) {
    let shape = text.parse().expect("a cutter");
    let profile = Profile::new(shape, STEP_MM, allowance_mm).expect("a profile");
    (profile, Cutter { shape, step_mm: STEP_MM, allowance_mm })
}

#[track_caller]
fn same(what: &str, got: &[f32], want: &[f32]) {
    assert_eq!(got.len(), want.len(), "{what}");
    let bits = |z: f32| if z.is_nan() { None } else { Some(z.to_bits()) };
    let wrong = got.iter().zip(want).filter(|(g, w)| bits(**g) != bits(**w)).count();
    if let Some(i) = got.iter().zip(want).position(|(g, w)| bits(*g) != bits(*w)) {
        panic!(
            "{what}: {wrong} of {} differ, the first at {i}: {} instead of {}",
            got.len(),
            got[i],
            want[i]
        );
    }
}

/// A window that is off the surface's own on every side but one.
fn reaching_past(h: &Heights) -> Window {
    Window { column: -13, row: -9, columns: h.window.columns + 21, rows: h.window.rows + 9 }
}

fn cutter_locations(cutters: &[&str], n: usize) {
    surfaces::all(n).par_iter().for_each(|(name, h)| {
        for text in cutters {
            let (profile, twin) = cutter(text, 0.0);
            let out = reaching_past(h);
            let got = fast::cutter_location(h, &profile, out);
            let want = naive::cutter_location(h, &twin, out, 1);
            assert_eq!(got.window, out);
            same(&format!("{text} on {name}"), &got.z_mm, &want.z_mm);
        }
    });
}

#[test]
fn balls_on_every_surface() {
    cutter_locations(&["ball:0.15", "ball:0.2", "ball:0.5", "ball:0.02"], 100);
}

#[test]
fn a_large_ball_on_every_surface() {
    cutter_locations(&["ball:1"], 104);
}

#[test]
fn flats_on_every_surface() {
    cutter_locations(&["flat:0.02", "flat:0.2", "flat:0.5", "flat:0.73", "flat:0.7"], 80);
}

#[test]
fn bulls_vees_and_tapers_on_every_surface() {
    cutter_locations(
        &["bull:0.6:0.1", "bull:0.4:0.2", "bull:0.4:0", "vee:60:0.1:0.5", "vee:90:0:0.4", "taper:0.2:10:0.5"],
        72,
    );
}

#[test]
fn every_kth_row_is_those_rows() {
    surfaces::all(80).par_iter().for_each(|(name, h)| {
        for (text, every) in [("ball:0.5", 5), ("ball:0.15", 3), ("flat:0.3", 4), ("bull:0.4:0.1", 7)] {
            let (profile, twin) = cutter(text, 0.0);
            let out = reaching_past(h);
            let got = fast::cutter_location_rows(h, &profile, out, every);
            let want = naive::cutter_location(h, &twin, out, every as i64);
            assert_eq!(got.window, want.window);
            same(&format!("{text} every {every} rows on {name}"), &got.z_mm, &want.z_mm);
        }
    });
}

#[test]
fn closing_is_the_erosion_of_positions_past_the_edges() {
    surfaces::all(60).par_iter().for_each(|(name, h)| {
        for text in ["ball:0.3", "flat:0.3", "bull:0.4:0.1"] {
            let (profile, twin) = cutter(text, 0.0);
            let cl = naive::cutter_location(h, &twin, h.window.grown(profile.reach()), 1);
            let want = naive::erode(&cl, &twin, h.window);
            let got = fast::closing(h, &profile, h.window);
            same(&format!("{text} closing {name}"), &got.z_mm, &want.z_mm);
            let residual = fast::residual(&got, h);
            for (residual, h) in residual.z_mm.iter().zip(&h.z_mm) {
                assert!(*residual >= 0.0 || h.is_nan());
            }
        }
    });
}

#[test]
fn closings_in_memory_of_others_are_the_same() {
    let mut closings = Closings::new();
    let surfaces = surfaces::all(60);
    // Larger and smaller windows in turn, with holes and without, off the surface and on it.
    for (k, (name, h)) in surfaces.iter().enumerate() {
        for text in ["ball:0.3", "flat:0.3", "bull:0.4:0.1"] {
            let (profile, _) = cutter(text, 0.0);
            let out = if k % 2 == 0 { h.window } else { Window { row: 41, rows: 13, ..reaching_past(h) } };
            let got = closings.of(h, &Tables::new(profile), out);
            assert_eq!(got.window, out);
            same(&format!("{text} closing {name}"), &got.z_mm, &fast::closing(h, &profile, out).z_mm);
        }
    }
}

#[test]
fn rows_stand_where_the_controller_can() {
    surfaces::all(72).par_iter().for_each(|(name, h)| {
        for (text, allowance_mm) in
            [("ball:0.5", 0.0), ("flat:0.4", 0.0), ("ball:0.3", 0.0047), ("flat:0.3", 0.007)]
        {
            let (profile, twin) = cutter(text, allowance_mm);
            let targets: Vec<RowTarget> = (0..14)
                .map(|i| RowTarget {
                    x0_mm: -0.05 + 0.0025 * (i % 3) as f64,
                    y_mm: -0.1 + 0.0875 * i as f64,
                    count: 90 + 3 * i,
                })
                .collect();
            let got = fast::rows(h, &profile, &targets);
            for (got, target) in got.iter().zip(&targets) {
                let want = naive::row(h, &twin, *target);
                same(&format!("{text} + {allowance_mm} along {target:?} of {name}"), got, &want);
            }
        }
    });
}

#[test]
fn passes_leave_what_they_leave() {
    surfaces::all(72).par_iter().for_each(|(name, h)| {
        for text in ["ball:0.5", "flat:0.3", "bull:0.4:0.1", "vee:60:0.1:0.4"] {
            let (profile, twin) = cutter(text, 0.0);
            let targets: Vec<RowTarget> = (0..22)
                .map(|i| RowTarget {
                    x0_mm: -0.052 + 0.0025 * (i % 4) as f64,
                    y_mm: -0.03 + 0.05125 * i as f64,
                    count: 105,
                })
                .collect();
            let z = fast::rows(h, &profile, &targets);
            let passes: Vec<RowPass> = targets
                .iter()
                .zip(&z)
                .map(|(t, z_mm)| RowPass { x0_mm: t.x0_mm, y_mm: t.y_mm, z_mm })
                .collect();
            let got = fast::machined_by_rows(&passes, &profile, h.window);
            let want = naive::machined_by_rows(&passes, &twin, h.window);
            same(&format!("{text} over {name}"), &got.z_mm, &want.z_mm);
        }
    });
}

#[test]
fn points_are_rows_of_one() {
    let h = &surfaces::all(60)[1].1;
    let (profile, _) = cutter("ball:0.3", 0.0);
    let at: Vec<[f64; 2]> = (0..40).map(|i| [0.013 * i as f64, 0.6 - 0.0111 * i as f64]).collect();
    for (z, [x_mm, y_mm]) in fast::points(h, &profile, &at).iter().zip(&at) {
        let row = fast::row(h, &profile, *x_mm, *y_mm, 1)[0] as f64;
        assert!((z - row).abs() < 1e-7, "{z} {row}");
    }
}

/// Two slopes that meet in a ridge between samples, and a step up to a level: as faces.
fn roof(ridge_mm: f64) -> Vec<Vec<[f64; 3]>> {
    let z = |x_mm: f64| 0.3 - 0.4 * (x_mm - ridge_mm).abs();
    let strip = |x0_mm: f64, x1_mm: f64, z: &dyn Fn(f64) -> f64| {
        let corner = |x_mm: f64, y_mm: f64| [x_mm, y_mm, z(x_mm)];
        vec![corner(x0_mm, 0.0), corner(x1_mm, 0.0), corner(x1_mm, 1.0), corner(x0_mm, 1.0)]
    };
    vec![strip(0.0, ridge_mm, &z), strip(ridge_mm, 1.2, &z), strip(1.2, 1.6, &|_| 0.45)]
}

fn roof_height(faces: &[Vec<[f64; 3]>], x_mm: f64, y_mm: f64) -> f64 {
    if !(0.0..=1.0).contains(&y_mm) {
        return f64::NEG_INFINITY;
    }
    let mut best = f64::NEG_INFINITY;
    for face in faces {
        let (a, b) = (face[0], face[1]);
        if x_mm >= a[0] && x_mm <= b[0] {
            best = best.max(a[2] + (b[2] - a[2]) * (x_mm - a[0]) / (b[0] - a[0]));
        }
    }
    best
}

#[test]
fn lifted_locations_are_the_true_drop() {
    let faces = roof(0.4437);
    let h = surfaces::from(160, 100, |c, r| {
        roof_height(&faces, (c as f64 + 0.5) * STEP_MM, (r as f64 + 0.5) * STEP_MM) / STEP_MM
    });
    for text in ["ball:0.3", "flat:0.3", "bull:0.4:0.1", "vee:60:0.1:0.4", "taper:0.2:10:0.4"] {
        let (profile, _) = cutter(text, 0.0);
        let out = Window { column: -6, row: 46, columns: 172, rows: 3 };
        let sampled = fast::cutter_location_rows(&h, &profile, out, 2);
        let mut lifted = sampled.clone();
        fast::lift(lifted.window, &mut lifted.z_mm, 2, &profile, &faces);
        let mut raised_mm: f64 = 0.0;
        for (i, (lifted, sampled)) in lifted.z_mm.iter().zip(&sampled.z_mm).enumerate() {
            assert!(lifted >= sampled);
            let x_mm = ((out.column + (i % 172) as i64) as f64 + 0.5) * STEP_MM;
            let y_mm = (out.row as f64 + 0.5 + 2.0 * (i / 172) as f64) * STEP_MM;
            // The definition over points 30 times denser than the samples, and the ridge and the
            // top of the step among them.
            let mut drop_mm = f64::NEG_INFINITY;
            let reach = (profile.radius_mm() * 3000.0) as i64;
            for k in -reach..=reach {
                for at_mm in [x_mm + k as f64 / 3000.0, 0.4437, 1.2, x_mm - profile.radius_mm()] {
                    if let Some(s_mm) = profile.s_mm((at_mm - x_mm).abs()) {
                        drop_mm = drop_mm.max(roof_height(&faces, at_mm, y_mm) + s_mm);
                    }
                }
            }
            let off_mm = f64::from(*lifted) - drop_mm;
            assert!(off_mm > -5e-8 && off_mm < 2e-4, "{text} at {x_mm}: {lifted} instead of {drop_mm}");
            raised_mm = raised_mm.max(f64::from(lifted - sampled));
        }
        // Positions between the samples' reach and the step's own stood a slope's worth too low.
        assert!(raised_mm > 5e-4, "{text}: {raised_mm}");
    }
}

#[test]
fn faces_lift_to_the_drop_by_its_definition() {
    let cutters = [
        ("ball:0.5", 0.0),
        ("ball:2", 0.0),
        ("ball:1", 0.004),
        ("flat:1", 0.0),
        ("bull:1:0.2", 0.0),
        ("vee:60:0.1:1", 0.0),
        ("vee:90:0:0.4", 0.004),
        ("taper:0.4:30:1", 0.0),
    ];
    for seed in [5, 11] {
        let faces = drops::relief(8, seed);
        let facets = fast::Facets::new(&faces);
        cutters.par_iter().for_each(|&(text, allowance_mm)| {
            let (profile, _) = cutter(text, allowance_mm);
            let lifting = fast::Faces::new(&facets, &profile);
            for k in 0..4 {
                let target = RowTarget { x0_mm: -0.3, y_mm: -0.113 + 0.7871 * f64::from(k), count: 87 };
                let mut z_mm = vec![f32::NAN; target.count];
                lifting.lift_row(&target, 0.0373, &mut z_mm);
                for (i, z_mm) in z_mm.iter().enumerate() {
                    let place = [target.x0_mm + 0.0373 * i as f64, target.y_mm];
                    let want_mm = drops::drop_mm(&faces, &profile, place);
                    let off_mm = f64::from(*z_mm) - want_mm;
                    assert!(
                        off_mm.abs() < 1e-7 || z_mm.is_nan() && want_mm == f64::NEG_INFINITY,
                        "{text} + {allowance_mm} at {place:?}: {z_mm} instead of {want_mm}"
                    );
                    let single_mm = lifting.lift_point(place, f64::NAN);
                    assert!(single_mm.is_nan() && z_mm.is_nan() || (single_mm as f32 - z_mm).abs() < 1e-7);
                }
            }
        });
    }
}
