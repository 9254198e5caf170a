//! Height files written and read back.

use std::fs::{self, File};
use std::path::Path;

use npyz::WriterBuilder;
use screenmill::grid::{Heights, Window};
use screenmill::surface::{HeightWriter, Options, Surface, open};

const COLUMNS: usize = 37;
const ROWS: usize = 301;

/// A relief at 40 mm with holes.
fn relief() -> Heights {
    let window = Window { column: 0, row: 0, columns: COLUMNS, rows: ROWS };
    let z_mm = (0..COLUMNS * ROWS)
        .map(|k| if k % 97 == 5 { f32::NAN } else { 40.0 + ((k * k) % 1009) as f32 * 1e-3 })
        .collect();
    Heights { window, z_mm }
}

fn write(path: &Path, heights: &Heights, band: usize, range: [f64; 2]) {
    let Window { columns, rows, .. } = heights.window;
    let mut writer = HeightWriter::create(path, columns, rows, 0.02, range).unwrap();
    for row in (0..rows).step_by(band) {
        let window = Window { row: row as i64, rows: band.min(rows - row), ..heights.window };
        writer.write(&heights.crop(window)).unwrap();
    }
    writer.finish().unwrap();
}

fn read(path: &Path, options: &Options) -> (Box<dyn Surface>, Heights) {
    let surface = open(path, options).unwrap().surface;
    let heights = surface.heights(surface.lattice().window(), 0.0).unwrap();
    (surface, heights)
}

fn assert_same(a: &Heights, b: &Heights) {
    assert_eq!(a.window, b.window);
    assert!(
        a.z_mm.iter().zip(&b.z_mm).all(|(a, b)| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()))
    );
}

#[test]
fn floats_come_back_bit_for_bit_whatever_the_bands() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["h.tif", "h.npy"] {
        let path = folder.path().join(name);
        write(&path, &relief(), ROWS, [0.0; 2]);
        let whole = fs::read(&path).unwrap();
        for band in [1, 16, 100] {
            write(&path, &relief(), band, [0.0; 2]);
            assert_eq!(fs::read(&path).unwrap(), whole, "{name} in bands of {band}");
        }
        let pixel_mm = name.ends_with("npy").then_some(0.02);
        let (surface, heights) = read(&path, &Options { pixel_mm, ..Options::at_step(0.02) });
        assert_same(&heights, &relief());
        let window = Window { column: -2, row: 290, columns: 20, rows: 30 };
        assert_same(&surface.heights(window, 0.0).unwrap(), &relief().crop(window));
        assert!((surface.top_mm() - f64::from(40.0 + 1008.0f32 * 1e-3)).abs() < 1e-5);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), if name == "h.tif" { 1 } else { 2 });
    }
}

#[test]
fn a_tiff_says_where_it_lies_and_what_no_data_is() {
    use tiff::tags::Tag;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("h.tif");
    write(&path, &relief(), 50, [0.0; 2]);
    let mut decoder = tiff::decoder::Decoder::new(File::open(&path).unwrap()).unwrap();
    assert_eq!(decoder.dimensions().unwrap(), (COLUMNS as u32, ROWS as u32));
    assert_eq!(decoder.get_tag_f64_vec(Tag::ModelPixelScaleTag).unwrap(), [0.02, 0.02, 0.0]);
    let top = ROWS as f64 * 0.02;
    assert_eq!(decoder.get_tag_f64_vec(Tag::ModelTiepointTag).unwrap(), [0.0, 0.0, 0.0, 0.0, top, 0.0]);
    assert_eq!(decoder.get_tag_ascii_string(Tag::GdalNodata).unwrap(), "nan");
    let tiff::decoder::DecodingResult::F32(image) = decoder.read_image().unwrap() else {
        panic!("floats");
    };
    // The top row of the image is the highest y.
    assert_eq!(image[3], relief().row(ROWS as i64 - 1)[3]);
}

#[test]
fn a_png_keeps_heights_to_half_a_value() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("h.png");
    let mut heights = relief();
    for z in heights.z_mm.iter_mut().filter(|z| z.is_nan()) {
        *z = 40.5;
    }
    write(&path, &heights, 7, [39.5, 41.5]);
    let options = Options {
        pixel_mm: Some(0.02),
        z_min_mm: Some(39.5),
        z_max_mm: Some(41.5),
        ..Options::at_step(0.02)
    };
    let (_, found) = read(&path, &options);
    let worst = found.z_mm.iter().zip(&heights.z_mm).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst > 0.0 && f64::from(worst) < 0.5 * 2.0 / 65535.0 + 4e-6, "{worst}");
}

#[test]
fn compressed_tiled_and_integer_tiffs_are_read_like_plain_ones() {
    use tiff::encoder::{Compression, DeflateLevel, TiffEncoder, colortype};
    let folder = tempfile::tempdir().unwrap();
    let top_first: Vec<f32> = (0..ROWS).rev().flat_map(|row| relief().row(row as i64).to_vec()).collect();
    for (name, compression) in [
        ("deflate.tif", Compression::Deflate(DeflateLevel::Fast)),
        ("lzw.tif", Compression::Lzw),
        ("packbits.tif", Compression::Packbits),
    ] {
        let path = folder.path().join(name);
        let mut encoder =
            TiffEncoder::new(File::create(&path).unwrap()).unwrap().with_compression(compression);
        let image = encoder.new_image::<colortype::Gray32Float>(COLUMNS as u32, ROWS as u32).unwrap();
        image.write_data(&top_first).unwrap();
        let (_, heights) = read(&path, &Options { pixel_mm: Some(0.02), ..Options::at_step(0.02) });
        assert_same(&heights, &relief());
    }
    let path = folder.path().join("u16.tif");
    let values: Vec<u16> = (0..COLUMNS * ROWS).map(|k| (k * 5) as u16).collect();
    let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
    encoder.write_image::<colortype::Gray16>(COLUMNS as u32, ROWS as u32, &values).unwrap();
    let options =
        Options { pixel_mm: Some(0.02), z_min_mm: Some(-1.0), z_max_mm: Some(1.0), ..Options::at_step(0.02) };
    let (_, heights) = read(&path, &options);
    for (index, z) in heights.z_mm.iter().enumerate() {
        let (row, column) = (ROWS - 1 - index / COLUMNS, index % COLUMNS);
        let wanted = -1.0 + f64::from(values[row * COLUMNS + column]) * (2.0 / 65535.0);
        assert_eq!(*z, wanted as f32);
    }
}

#[test]
fn another_step_is_bilinear_and_holes_spread_to_what_leans_on_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plane.npy");
    let (columns, rows) = (20, 10);
    let pixel = |k: usize| ((k % columns) as f64 + 0.5, (k / columns) as f64 + 0.5);
    let mut z_mm: Vec<f32> = (0..columns * rows).map(|k| (2.0 * pixel(k).0 - pixel(k).1) as f32).collect();
    z_mm[5 * columns + 7] = f32::NAN;
    let window = Window { column: 0, row: 0, columns, rows };
    write(&path, &Heights { window, z_mm }, 3, [0.0; 2]);
    let options = Options { pixel_mm: Some(1.0), ..Options::at_step(0.25) };
    let opened = open(&path, &options).unwrap();
    assert!(opened.notes[0].ends_with("resampled from a pitch of 1 mm to 0.25 mm, bilinear"));
    let surface = opened.surface;
    let lattice = surface.lattice();
    assert_eq!((lattice.columns, lattice.rows), (80, 40));
    let heights = surface.heights(lattice.window(), 0.0).unwrap();
    let mut holes = 0;
    for (index, &z) in heights.z_mm.iter().enumerate() {
        let (x, y) = (lattice.x_mm(index as i64 % 80), lattice.y_mm(index as i64 / 80));
        if (x - 7.5).abs() < 1.0 && (y - 5.5).abs() < 1.0 {
            assert!(z.is_nan());
            holes += 1;
            continue;
        }
        let (x, y) = (x.clamp(0.5, 19.5), y.clamp(0.5, 9.5));
        assert!((f64::from(z) - (2.0 * x - y)).abs() < 1e-5, "{x} {y} {z}");
    }
    assert_eq!(holes, 64);
    assert_eq!(surface.steepest(), [2.0, 1.0]);
}

#[test]
fn nothing_is_left_of_a_file_that_was_not_finished() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("h.tif");
    let mut writer = HeightWriter::create(&path, COLUMNS, ROWS, 0.02, [0.0; 2]).unwrap();
    writer.write(&relief().crop(Window { column: 0, row: 0, columns: COLUMNS, rows: 10 })).unwrap();
    assert!(writer.finish().unwrap_err().to_string().contains("10 of 301 rows"));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// Two solids of two triangles each, as a text.
fn text_stl() -> String {
    let mut text = String::new();
    for (name, x) in [("left hand", 0.0), ("", 3.0)] {
        text += &format!("solid {name}\n");
        for [b, c] in [[[4, 0], [4, 2]], [[4, 2], [0, 2]]] {
            text += " facet normal 0 0 1\n  outer loop\n";
            for [dx, dy] in [[0, 0], b, c] {
                text += &format!("   vertex {}e0 {dy} {}\n", x + f64::from(dx), x - 1.5);
            }
            text += "  endloop\n endfacet\n";
        }
        text += &format!("endsolid {name}\n");
    }
    text
}

#[test]
fn every_solid_of_a_text_is_read_however_it_is_spelt() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.stl");
    let text = text_stl();
    let mut latin = text.clone().into_bytes();
    latin[8] = 0xFC;
    let spelt: [Vec<u8>; 6] = [
        text.clone().into(),
        text.to_uppercase().into(),
        text.replace('\n', "\r\n").into(),
        text.replace("solid \n", "solid\n").replace("endfacet\n", "endfacet ").into(),
        format!("\u{feff} \n\n{text}").into(),
        latin,
    ];
    for bytes in spelt {
        fs::write(&path, bytes).unwrap();
        let (surface, heights) = read(&path, &Options::at_step(0.5));
        assert_eq!([surface.lattice().columns, surface.lattice().rows], [14, 4]);
        for (k, z) in heights.z_mm.iter().enumerate() {
            assert_eq!(*z, if k % 14 < 6 { -1.5 } else { 1.5 }, "{k}");
        }
    }
}

/// numpy.save of a transposed array.
#[test]
fn an_array_saved_by_columns_is_the_same_part() {
    let folder = tempfile::tempdir().unwrap();
    let relief = relief();
    let path = folder.path().join("t.npy");
    let file = File::create(&path).unwrap();
    let mut writer = npyz::WriteOptions::new()
        .default_dtype()
        .order(npyz::Order::Fortran)
        .shape(&[ROWS as u64, COLUMNS as u64])
        .writer(file)
        .begin_nd()
        .unwrap();
    let by_columns = (0..COLUMNS).flat_map(|column| (0..ROWS).map(move |row| row * COLUMNS + column));
    writer.extend(by_columns.map(|k| relief.z_mm[k])).unwrap();
    writer.finish().unwrap();
    let (_, found) = read(&path, &Options { pixel_mm: Some(0.02), ..Options::at_step(0.02) });
    assert_same(&found, &relief);
}
