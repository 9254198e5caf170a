//! Bad scenes, cells, elevations and containers: each is refused with the first line of its file in
//! tests/refuse/screen. Set BLESS to write the messages anew, then read what has changed.

use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use screenmill::evaluation::evaluate;
use screenmill::progress::Silent;
use screenmill::screen::{self, CellRange, Design, Elevation, Scene};

fn theatre() -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/theatre.toml")).expect("a sample")
}

/// The theatre with one piece of text replaced, which must be there.
fn changed(from: &str, to: &str) -> String {
    let text = theatre();
    assert!(text.contains(from), "{from}");
    text.replacen(from, to, 1)
}

fn check(case: &str, made_by: &str, message: &str) {
    assert!(message.lines().count() <= 12, "{case}: {message}");
    assert!(!message.contains('\n'), "{case}: the first line is all of it: {message}");
    let path: PathBuf =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/refuse/screen").join(format!("{case}.txt"));
    if std::env::var_os("BLESS").is_some() {
        fs::write(&path, format!("{message}\n{made_by}\n")).expect("writable");
    }
    let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    assert_eq!(text.lines().next(), Some(message), "{case}");
}

fn vertices(points: &[[f64; 3]]) -> String {
    let list: Vec<String> = points.iter().map(|[x, y, z]| format!("[{x:?}, {y:?}, {z:?}]")).collect();
    format!("vertices_m = [{}]", list.join(", "))
}

fn slab(x: [f64; 2], y: [f64; 2], z: [f64; 2]) -> String {
    let mut points = Vec::new();
    for x in x {
        for y in y {
            for z in z {
                points.push([x, y, z]);
            }
        }
    }
    vertices(&points)
}

/// The theatre with another audience.
fn with_audience(audience: &str) -> String {
    let text = theatre();
    let start = text.find("[[audience]]").expect("an audience");
    let end = text.find("[microgeometry]").expect("a microgeometry");
    format!("{}{audience}\n\n{}", &text[..start], &text[end..])
}

#[test]
fn scenes_that_are_wrong_are_refused_with_their_line() {
    let most = "width_m = 2.0";
    let stitched = |sweeps: u32| {
        let key = format!("area_tolerance = 1e-6\narea_sweeps = {sweeps}");
        changed("area_tolerance = 1e-6", &key).replace("seam = \"step\"", "seam = \"stitched\"")
    };
    let cases: Vec<(&str, String)> = vec![
        ("unknown-key", changed("facets = 200", "facettes = 200")),
        ("key-without-unit", changed("width_mm = 4.0", "width = 4.0")),
        ("missing-key", changed("area_tolerance = 1e-6\n", "")),
        ("missing-table", changed("[elevation]\nmethod = \"poisson\"", "")),
        ("wrong-type", changed(most, "width_m = \"2 m\"")),
        ("unknown-profile", changed("profile = \"bump\"", "profile = \"convex\"")),
        ("schema", changed("schema = 1", "schema = 2")),
        ("nan", changed(most, "width_m = nan")),
        ("infinite", changed(most, "width_m = inf")),
        ("size-overflows", changed(most, "width_m = 1e300")),
        ("too-many-cells", changed("width_mm = 4.0", "width_mm = 0.1")),
        (
            "cell-wider-than-the-screen",
            changed("width_mm = 4.0", "width_mm = 1000.0").replace("height_m = 1.0", "height_m = 0.9"),
        ),
        ("no-facets", changed("facets = 200", "facets = 0")),
        ("negative-facets", changed("facets = 200", "facets = -5")),
        ("tolerance-zero", changed("area_tolerance = 1e-6", "area_tolerance = 0.0")),
        ("sweeps-of-steps", changed("area_tolerance = 1e-6", "area_tolerance = 1e-6\narea_sweeps = 5")),
        ("sweeps-too-many", stitched(17)),
        ("sweeps-of-few-facets", stitched(5).replace("facets = 200", "facets = 49")),
        ("sweeps-on-a-flat-screen", stitched(5).replace("\"poisson\"", "\"flat\"")),
        ("projector-behind", changed("[0.0, 0.0, 3.0]", "[0.0, 0.0, -3.0]")),
        ("projector-on-the-screen", changed("[0.0, 0.0, 3.0]", "[0.2, 0.1, 0.0]")),
        ("projector-of-two-numbers", changed("[0.0, 0.0, 3.0]", "[0.0, 3.0]")),
        ("projector-nan", changed("[0.0, 0.0, 3.0]", "[0.0, nan, 3.0]")),
        ("unknown-metal", changed("\"aluminium\"", "\"aluminum\"")),
        ("reflector-twice", changed("material = \"aluminium\"", "material = \"aluminium\"\nn = 1.0")),
        ("reflector-half", changed("material = \"aluminium\"", "n = 1.0")),
        ("reflector-none", changed("material = \"aluminium\"", "roughness = 0.1")),
        (
            "reflectance-beside-a-metal",
            changed("material = \"aluminium\"", "material = \"aluminium\"\nreflectance = 0.9"),
        ),
        ("reflectance-over-1", changed("material = \"aluminium\"", "reflectance = 1.5")),
        ("reflector-of-air", changed("material = \"aluminium\"", "n = 1.0\nk = 0.0")),
        ("reflector-zero", changed("material = \"aluminium\"", "n = 0.0\nk = 6.4")),
        ("reflector-nan", changed("material = \"aluminium\"", "n = nan\nk = 6.4")),
        ("reflector-huge", changed("material = \"aluminium\"", "n = 1.0\nk = 1e300")),
        ("reflector-in-words", changed("material = \"aluminium\"", "n = \"one\"\nk = 6.4")),
        ("width-zero", changed("width_mm = 4.0", "width_mm = 0.0")),
        ("width-nan", changed("width_mm = 4.0", "width_mm = nan")),
        ("facets-and-a-half", changed("facets = 200", "facets = 2.5")),
        ("facets-too-many", changed("facets = 200", "facets = 4001")),
        ("projector-far-away", changed("[0.0, 0.0, 3.0]", "[0.0, 0.0, 1e9]")),
        ("corner-nan", changed("[-1.0, -0.65, 2.0]", "[-1.0, nan, 2.0]")),
        ("reflector-unphysical", changed("material = \"aluminium\"", "n = 1.0\nk = -6.4")),
        ("no-audience", with_audience("").replacen("schema = 1", "schema = 1\naudience = []", 1)),
        ("no-audience-key", with_audience("")),
        (
            "audience-flat",
            with_audience(&format!(
                "[[audience]]\nname = \"row\"\n{}",
                slab([-1.0, 1.0], [0.1, 0.1], [2.0, 3.0])
            )),
        ),
        (
            "audience-of-three-corners",
            with_audience(&format!(
                "[[audience]]\n{}",
                vertices(&[[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 3.0]])
            )),
        ),
        (
            "audience-behind-the-screen",
            with_audience(&format!(
                "[[audience]]\nname = \"box\"\n{}",
                slab([2.0, 3.0], [-1.0, 1.0], [-0.5, 3.0])
            )),
        ),
        (
            "audience-contains-a-screen-point",
            with_audience(&format!(
                "[[audience]]\nname = \"all\"\n{}",
                slab([-2.0, 2.0], [-1.0, 1.0], [-1.0, 4.0])
            )),
        ),
        (
            "audience-around-a-part-of-the-screen",
            with_audience(&format!(
                "[[audience]]\nname = \"spot\"\n{}",
                slab([0.31, 0.32], [0.1, 0.12], [-1.0, 4.0])
            )),
        ),
        ("corner-of-four-numbers", changed("[-1.0, -0.65, 2.0]", "[-1.0, -0.65, 2.0, 1.0]")),
        ("not-toml", "P3 12 12\n".into()),
    ];
    for (case, text) in cases {
        let error = Scene::parse(&text, "screen.toml").expect_err(case);
        check(case, "a scene with this, see tests/refuse_screen.rs", &error.to_string());
    }
}

#[test]
fn designs_that_cannot_be_made_are_refused() {
    let quiet = |_: usize, _: usize| ();
    let range = |c0, r0, c1, r1| Some(CellRange { c0, r0, c1, r1 });
    let scene = Scene::parse(&theatre(), "screen.toml").expect("the theatre");
    let flat = Scene::parse(&changed("\"poisson\"", "\"flat\""), "screen.toml").expect("the theatre");
    let refuse = |case: &str, scene: &Scene, cells, elevation: Option<&Elevation>| {
        let error = screen::design(scene, cells, elevation, &quiet).expect_err(case);
        check(case, "a design asked of the theatre, see tests/refuse_screen.rs", &error.to_string());
    };
    refuse("cells-outside", &scene, range(499, 0, 501, 1), None);
    refuse("cells-negative", &scene, range(-1, 0, 1, 1), None);
    refuse("cells-none", &scene, range(3, 0, 3, 1), None);
    let many = Scene::parse(&changed("facets = 200", "facets = 4000"), "screen.toml").expect("a scene");
    refuse("too-much-at-once", &many, None, None);
    let imax = changed("width_m = 2.0", "width_m = 22.0").replace("height_m = 1.0", "height_m = 16.1");
    let imax = Scene::parse(&imax, "screen.toml").expect("a scene");
    let error = screen::frame(&imax, None).expect_err("too large");
    check("too-much-for-a-file", "a design of 22 x 16.1 m, see tests/refuse_screen.rs", &error.to_string());
    let far = slab([40.0, 41.0], [0.0, 0.1], [0.01, 0.02]);
    let low = with_audience(&format!("[[audience]]\nname = \"low\"\n{far}"));
    let low = Scene::parse(&low, "screen.toml").expect("a scene");
    refuse("sees-no-audience", &low, range(0, 0, 1, 1), None);
    let point = slab([0.0, 0.002], [0.0, 0.002], [9.0, 9.001]);
    let tiny = with_audience(&format!("[[audience]]\nname = \"pinhole\"\n{point}"));
    let tiny = Scene::parse(&tiny.replace("\"poisson\"", "\"flat\""), "screen.toml").expect("a scene");
    refuse("sees-too-little", &tiny, range(0, 0, 1, 1), None);
    let given = |z_mm: f64| Elevation { columns: 500, rows: 250, z_mm: vec![z_mm; 125_000] };
    refuse(
        "elevation-shape",
        &scene,
        range(0, 0, 1, 1),
        Some(&Elevation { columns: 250, rows: 500, ..given(0.0) }),
    );
    refuse("elevation-nan", &scene, range(0, 0, 1, 1), Some(&given(f64::NAN)));
    refuse("behind-the-projector", &flat, range(0, 0, 1, 1), Some(&given(3500.0)));
    let near = Scene::parse(&changed("[0.0, 0.0, 3.0]", "[0.0, 0.0, 0.1]"), "screen.toml").expect("a scene");
    refuse("projector-too-near", &near, range(0, 0, 1, 1), None);
    // What evaluate asks of the same screen is refused as soon: no cell of it is possible.
    let error = evaluate(&tiny, &Silent).map(|_| ()).expect_err("too small");
    check(
        "evaluation-sees-too-little",
        "a design asked of the theatre, see tests/refuse_screen.rs",
        &error.to_string(),
    );
    let swept = changed("area_tolerance = 1e-6", "area_tolerance = 1e-6\narea_sweeps = 2")
        .replace("seam = \"step\"", "seam = \"stitched\"");
    let swept = Scene::parse(&swept, "screen.toml").expect("a scene");
    refuse("bases-apart", &swept, range(0, 0, 1, 1), Some(&given(0.0)));
    refuse("inside-the-audience", &flat, range(250, 90, 251, 91), Some(&given(2500.0)));
}

#[test]
fn elevation_files_that_are_none_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let refuse = |case: &str, bytes: Option<&[u8]>| {
        let path = folder.path().join(if bytes.is_some() { "e.npy" } else { "" });
        if let Some(bytes) = bytes {
            fs::write(&path, bytes).expect("written");
        }
        let error = Elevation::read(&path).expect_err(case).to_string();
        let message = error.replacen(path.to_str().expect("text"), "e.npy", 1);
        check(case, "a file of elevations with this, see tests/refuse_screen.rs", &message);
    };
    let npy = |kind: &str, shape: &str, values: usize| {
        let head = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
        let mut bytes = b"\x93NUMPY\x01\x00v\x00".to_vec();
        bytes.extend(format!("{head:<117}\n").bytes());
        bytes.extend(vec![0; 4 * values]);
        bytes
    };
    refuse("elevation-empty", Some(&[]));
    refuse("elevation-of-another-kind", Some(b"z, mm\n1, 2\n"));
    refuse("elevation-cut-off", Some(&npy("<f4", "(250, 500)", 77)));
    refuse("elevation-cut-in-its-head", Some(&npy("<f4", "(250, 500)", 0)[..40]));
    refuse("elevation-of-one-row", Some(&npy("<f4", "(500,)", 500)));
    refuse("elevation-of-whole-numbers", Some(&npy("<i4", "(250, 500)", 125_000)));
    refuse("elevation-is-a-folder", None);
}

fn archive(change: impl Fn(&mut Design)) -> Vec<u8> {
    let scene = Scene::parse(&changed("\"poisson\"", "\"flat\""), "screen.toml").expect("the theatre");
    let cells = CellRange { c0: 3, r0: 5, c1: 5, r1: 7 };
    let mut design = screen::design(&scene, Some(cells), None, &|_, _| ()).expect("a design");
    change(&mut design);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.npz");
    design.write(&path).expect("written");
    fs::read(&path).expect("read")
}

#[test]
fn containers_that_are_broken_are_refused() {
    let refuse = |case: &str, bytes: Vec<u8>| {
        let error = Design::from_archive(Cursor::new(bytes), "a.npz").expect_err(case);
        check(case, "a design container with this, see tests/refuse_screen.rs", &error.to_string());
    };
    let whole = archive(|_| ());
    Design::from_archive(Cursor::new(&whole), "a.npz").expect("the whole one is read");
    refuse("container-cut-off", whole[..whole.len() / 2].to_vec());
    refuse("container-empty", Vec::new());
    refuse("container-cell-twice", archive(|d| d.cells[1].column = 3));
    refuse("container-gap", archive(|d| drop(d.cells.remove(2))));
    refuse("container-core-outside", archive(|d| d.core.c1 = 9));
    refuse("container-nan", archive(|d| d.cells[0].facets[7].offset_mm = f64::NAN));
    refuse("container-no-facets", archive(|d| d.cells[1].facets.clear()));
    refuse("container-cell-width", archive(|d| d.cell_mm = -4.0));
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    zip.start_file("cell.npy", zip::write::SimpleFileOptions::default()).expect("a file");
    let shape = "{'descr': '<i4', 'fortran_order': False, 'shape': (99999999999, 2), }";
    zip.write_all(b"\x93NUMPY\x01\x00v\x00").expect("written");
    zip.write_all(format!("{shape:<117}\n").as_bytes()).expect("written");
    refuse("container-claims-more-than-it-has", zip.finish().expect("finished").into_inner());
    let empty = zip::ZipWriter::new(Cursor::new(Vec::new())).finish().expect("finished").into_inner();
    refuse("container-missing-array", empty);
}
