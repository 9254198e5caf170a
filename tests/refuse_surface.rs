//! Every bad part is refused with the message in tests/refuse/surface, exit 2, and leaves nothing.
//! `BLESS=1` writes the messages anew.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use screenmill::screen::{Cell, CellRange, Design, Facet, Profile, Seam};

/// A binary STL of these triangles that announces `count` of them.
fn binary_stl(count: u32, triangles: &[[f32; 9]]) -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend(count.to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

const FLAT: [f32; 9] = [0.0, 0.0, 1.0, 8.0, 0.0, 1.0, 0.0, 8.0, 2.0];

fn npy(header: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    let text = format!("{header:<117}\n");
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes.extend(data);
    bytes
}

fn npy_of(shape: &str, kind: &str, fortran: &str, data: &[u8]) -> Vec<u8> {
    npy(&format!("{{'descr': '{kind}', 'fortran_order': {fortran}, 'shape': {shape}, }}"), data)
}

fn png(color: ::png::ColorType, depth: ::png::BitDepth, bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut out, 4, 2);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(bytes).unwrap();
    out
}

/// A TIFF of 2 x 2 samples, its fields (tag, kind, count, value) and its data after them.
fn tiff(fields: &[(u16, u16, u32, u32)], data: &[u8]) -> Vec<u8> {
    let mut bytes = b"II\x2a\0\x08\0\0\0".to_vec();
    bytes.extend((fields.len() as u16).to_le_bytes());
    for (tag, kind, count, value) in fields {
        bytes.extend(tag.to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(count.to_le_bytes());
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend([0; 4]);
    bytes.resize(256, 0);
    bytes.extend(data);
    bytes
}

fn float_tiff(columns: u32, rows: u32, data: &[f32]) -> Vec<u8> {
    let bytes: Vec<u8> = data.iter().flat_map(|z| z.to_le_bytes()).collect();
    let size = columns.wrapping_mul(rows).wrapping_mul(4);
    let fields = [
        (256, 4, 1, columns),
        (257, 4, 1, rows),
        (258, 3, 1, 32),
        (259, 3, 1, 1),
        (262, 3, 1, 1),
        (273, 4, 1, 256),
        (277, 3, 1, 1),
        (278, 4, 1, rows),
        (279, 4, 1, size),
        (339, 3, 1, 3),
    ];
    tiff(&fields, &bytes)
}

/// One flat cell of 15 um.
fn fine_design() -> Vec<u8> {
    let facet = Facet { gradient: [0.0; 2], offset_mm: 0.0, area_mm2: 0.015 * 0.015 };
    let design = Design {
        core: CellRange { c0: 0, r0: 0, c1: 1, r1: 1 },
        cell_mm: 0.015,
        profile: Profile::Bump,
        seam: Seam::Step,
        cells: vec![Cell { column: 0, row: 0, elevation_mm: 0.0, facets: vec![facet] }],
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fine.npz");
    design.write(&path).unwrap();
    fs::read(path).unwrap()
}

/// Case, file name, its bytes, further arguments.
fn cases() -> Vec<(&'static str, &'static str, Vec<u8>, &'static str)> {
    use ::png::{BitDepth, ColorType};
    let nan = [f32::NAN; 4];
    let mut with_nan = FLAT;
    with_nan[4] = f32::NAN;
    let wall = [0.0, 0.0, 1.0, 8.0, 0.0, 1.0, 8.0, 0.0, 2.0];
    let good = float_tiff(2, 2, &[1.0, 2.0, 3.0, 4.0]);
    let mut many = b"II\x2a\0\x08\0\0\0".to_vec();
    many.extend([0; 16]);
    let stl = || binary_stl(1, &[FLAT]);
    let grey = || png(ColorType::Grayscale, BitDepth::Sixteen, &[0; 16]);
    let ascii = "solid part\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 zero 0\n";
    let f4 = |shape| npy_of(shape, "<f4", "False", &[0; 16]);
    vec![
        ("missing", "none.stl", vec![], ""),
        ("kind", "part.step", b"ISO-10303-21;".to_vec(), ""),
        ("stl-empty", "empty.stl", vec![], ""),
        ("stl-short", "short.stl", vec![0; 60], ""),
        ("stl-truncated", "cut.stl", binary_stl(3, &[FLAT, FLAT]), ""),
        ("stl-claims-much", "claim.stl", binary_stl(u32::MAX, &[FLAT]), ""),
        ("stl-garbage", "garbage.stl", ascii.into(), ""),
        ("stl-ascii-cut", "cut-text.stl", ascii[..60].into(), ""),
        ("stl-no-triangles", "nothing.stl", binary_stl(0, &[]), ""),
        ("stl-ascii-no-triangles", "nothing-text.stl", b"solid\nendsolid\n".to_vec(), ""),
        ("stl-nan", "nan.stl", binary_stl(2, &[FLAT, with_nan]), ""),
        ("stl-walls-only", "wall.stl", binary_stl(1, &[wall]), ""),
        ("stl-unit", "unit.stl", stl(), "--unit cm"),
        ("stl-up", "up.stl", stl(), "--up w"),
        ("step-zero", "zero.stl", stl(), "--step-mm 0"),
        ("step-negative", "negative.stl", stl(), "--step-mm -0.01"),
        ("step-tiny", "tiny.stl", stl(), "--step-mm 1e-9"),
        ("out-kind", "kind.stl", stl(), "--out h.bmp"),
        ("out-folder", "folder.stl", stl(), "--out nowhere/h.tif"),
        ("out-png-no-data", "holes.stl", stl(), "--out h.png --step-mm 1"),
        ("out-png-range", "range.stl", stl(), "--out h.png --step-mm 4 --z-max-mm 1.2"),
        ("out-png-ends", "ends.stl", stl(), "--out h.png --step-mm 4 --z-min-mm 3 --z-max-mm 1.2"),
        ("tif-empty", "empty.tif", vec![], ""),
        ("tif-garbage", "garbage.tif", b"no picture at all".to_vec(), "--pixel-mm 0.1"),
        ("tif-no-directory", "many.tif", many, "--pixel-mm 0.1"),
        ("tif-no-pitch", "pitch.tif", good.clone(), ""),
        ("tif-cut", "cut.tif", good[..good.len() - 1].to_vec(), "--pixel-mm 0.1"),
        ("tif-claims-much", "claim.tif", float_tiff(u32::MAX, u32::MAX, &[1.0]), "--pixel-mm 0.1"),
        ("tif-no-data", "nan.tif", float_tiff(2, 2, &nan), "--pixel-mm 0.1"),
        ("tif-infinite", "inf.tif", float_tiff(2, 2, &[1.0, f32::INFINITY, 1.0, 1.0]), "--pixel-mm 0.1"),
        ("pixel-zero", "pixel.tif", good.clone(), "--pixel-mm 0"),
        ("pixel-huge", "huge.tif", good, "--pixel-mm 1e9"),
        (
            "npy-garbage",
            "garbage.npy",
            b"no array at all, but long enough for one".to_vec(),
            "--pixel-mm 0.1",
        ),
        ("npy-three", "three.npy", f4("(1, 2, 2)"), "--pixel-mm 0.1"),
        ("npy-integers", "int.npy", npy_of("(2, 2)", "<i4", "False", &[0; 16]), "--pixel-mm 0.1"),
        ("npy-fortran-cut", "fortran.npy", npy_of("(2, 2)", "<f4", "True", &[0; 12]), "--pixel-mm 0.1"),
        ("npy-cut", "cut.npy", f4("(2, 3)"), "--pixel-mm 0.1"),
        ("npy-claims-much", "claim.npy", f4("(4000000000, 4000000000)"), "--pixel-mm 0.1"),
        ("npy-wide", "wide.npy", f4("(2, 20000000)"), "--pixel-mm 0.1"),
        ("npy-no-pitch", "pitch.npy", f4("(2, 2)"), ""),
        ("out-is-part", "same.npy", f4("(2, 2)"), "--pixel-mm 0.1 --out same.npy"),
        ("npy-nothing", "nothing.npy", f4("(0, 2)"), "--pixel-mm 0.1"),
        ("png-garbage", "garbage.png", b"no picture at all".to_vec(), "--pixel-mm 0.1"),
        ("png-colour", "colour.png", png(ColorType::Rgb, BitDepth::Eight, &[0; 24]), "--pixel-mm 0.1"),
        ("png-cut", "cut.png", grey()[..50].to_vec(), "--pixel-mm 0.1 --z-min-mm 0 --z-max-mm 1"),
        ("png-no-range", "range.png", grey(), "--pixel-mm 0.1 --z-min-mm 0"),
        ("png-bad-range", "bad.png", grey(), "--pixel-mm 0.1 --z-min-mm 1 --z-max-mm 1"),
        ("png-no-pitch", "pitch.png", grey(), "--z-min-mm 0 --z-max-mm 1"),
        ("npz-garbage", "garbage.npz", b"no archive".to_vec(), ""),
        ("npz-cells-below-the-step", "fine.npz", fine_design(), ""),
    ]
}

#[test]
fn bad_parts_are_refused_with_their_message() {
    let messages = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/refuse/surface");
    let bless = std::env::var_os("BLESS").is_some();
    let cases = cases();
    for (case, file, bytes, more) in &cases {
        let folder = tempfile::tempdir().unwrap();
        if *case != "missing" {
            fs::write(folder.path().join(file), bytes).unwrap();
        }
        let out = if more.contains("--out") { "" } else { " --out h.tif" };
        let line = format!("raster {file}{out} {more}");
        let started = std::time::Instant::now();
        let done = Command::cargo_bin("screenmill")
            .unwrap()
            .args(line.split_whitespace())
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert!(started.elapsed().as_secs() < 20, "{case} took too long");
        assert_eq!(done.status.code(), Some(2), "{case}: {}", String::from_utf8_lossy(&done.stdout));
        let text = String::from_utf8(done.stderr).unwrap();
        assert!(text.lines().count() <= 12, "{case}: {text}");
        let said = text.lines().next().unwrap_or_default();
        let said = said.strip_prefix("error: ").unwrap_or_else(|| panic!("{case}: {text}"));
        let left: Vec<_> =
            fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert!(left.iter().all(|name| name == file), "{case} left {left:?}");
        let path = messages.join(format!("{case}.txt"));
        if bless {
            fs::write(&path, format!("{said}\nargs: {}\n", line.trim())).unwrap();
        }
        let kept = fs::read_to_string(&path).unwrap_or_else(|_| panic!("{}", path.display()));
        assert_eq!(kept.lines().next(), Some(said), "{case}");
    }
    assert_eq!(fs::read_dir(&messages).unwrap().count(), cases.len(), "a message without its case");
}

#[test]
fn doubtful_parts_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let run = |line: &str| {
        let done = Command::cargo_bin("screenmill")
            .unwrap()
            .args(line.split_whitespace())
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert!(done.status.success(), "{line}: {}", String::from_utf8_lossy(&done.stderr));
        String::from_utf8(done.stdout).unwrap()
    };
    let scaled = |factor: f32| binary_stl(1, &[FLAT.map(|v| v * factor)]);
    fs::write(folder.path().join("m.stl"), scaled(1e-3)).unwrap();
    assert!(run("raster m.stl --out m.tif --step-mm 0.001").contains("is it in metres? hint: --unit m"));
    assert!(!run("raster m.stl --out m.tif --step-mm 1 --unit m").contains("note"));
    fs::write(folder.path().join("in.stl"), scaled(0.5)).unwrap();
    assert!(run("raster in.stl --out in.tif --step-mm 0.1").contains("is it in inches? hint: --unit inch"));
    let eight = png(::png::ColorType::Grayscale, ::png::BitDepth::Eight, &[0, 1, 2, 3, 4, 5, 6, 255]);
    fs::write(folder.path().join("eight.png"), eight).unwrap();
    let line = "raster eight.png --out eight.tif --pixel-mm 0.02 --z-min-mm 0 --z-max-mm 5.1";
    let said = run(line);
    assert!(said.contains("8 bits make steps of 0.0200 mm"), "{said}");
    assert!(said.contains("resampled from a pitch of 0.02 mm to 0.01 mm, bilinear"), "{said}");
}
