use crate::screen::ContainerError;

/// Why a surface was refused, or a height file could not be written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("{path}: {source}")]
    Io { path: String, source: std::io::Error },
    #[error("{path} cannot be written: {source}; hint: name a file in a folder that exists and is writable")]
    Unwritable { path: String, source: std::io::Error },
    #[error(
        "{path}: no known kind of part; hint: .npz (design), .stl (mesh), .tif, .png or .npy (heights), not \".{extension}\""
    )]
    PartKind { path: String, extension: String },
    #[error("{path}: heights are not written as \".{extension}\"; hint: .tif, .npy or .png")]
    OutputKind { path: String, extension: String },
    #[error(transparent)]
    Container(#[from] ContainerError),
    #[error("\"{text}\" is no unit of a mesh; hint: mm, m or inch")]
    UnitName { text: String },
    #[error("\"{text}\" is no axis; hint: x, y or z, the one that points out of the stock")]
    UpName { text: String },
    #[error("the step is {step_mm} mm; hint: a length above 0, as --step-mm 0.01")]
    Step { step_mm: f64 },
    #[error(
        "cells of {cell_mm} mm at a step of {step_mm} mm: fewer than two samples across a cell; hint: a step of at most {most_mm} mm"
    )]
    CellBelowStep { cell_mm: f64, step_mm: f64, most_mm: f64 },
    #[error("the pixel size is {pixel_mm} mm; hint: a length above 0, as --pixel-mm 0.01")]
    Pixel { pixel_mm: f64 },
    #[error(
        "{width_mm} x {height_mm} mm at a step of {step_mm} mm is {samples:.3e} samples, at most {limit:.0e} can be held; hint: a coarser step, or cut the part into pieces"
    )]
    TooManySamples { width_mm: f64, height_mm: f64, step_mm: f64, samples: f64, limit: f64 },
    #[error(
        "{path}: {columns} x {rows} samples of {bytes} bytes each, at most {limit:.0e} samples can be held; hint: is the file damaged?"
    )]
    HugeClaim { path: String, columns: u64, rows: u64, bytes: u64, limit: f64 },
    #[error(
        "{path}: {columns} columns ({rows} rows), at most {most} can be held side by side; hint: cut it into pieces, or turn it by 90 degrees"
    )]
    Wide { path: String, columns: u64, rows: u64, most: u64 },
    #[error("{path}: {columns} x {rows} samples are no image; hint: is the file damaged?")]
    NoSamples { path: String, columns: u64, rows: u64 },
    #[error("{path}: the file is empty (0 bytes); hint: export or copy it again")]
    Empty { path: String },
    #[error(
        "{path}: cut off: {wanted} bytes of data announced, {found} there; hint: export or copy the file again"
    )]
    Truncated { path: String, wanted: u64, found: u64 },
    #[error(
        "{path}: a binary STL that announces {triangles} triangles takes {wanted} bytes, the file has {found}; hint: export or copy it again"
    )]
    StlSize { path: String, triangles: u64, wanted: u64, found: u64 },
    #[error(
        "{path}: not an STL: {found} bytes, neither \"solid\" at the start nor the 84 bytes of a binary header; hint: export it as binary STL"
    )]
    StlHeader { path: String, found: u64 },
    #[error(
        "{path}: ASCII STL, line {line}, after {triangles} triangles: {wanted} expected, found {found}; hint: export it as binary STL"
    )]
    StlText { path: String, line: u64, triangles: u64, wanted: &'static str, found: String },
    #[error("{path}: the mesh has no triangles; hint: export the body, not an empty selection")]
    NoTriangles { path: String },
    #[error(
        "{path}: triangle {triangle} has a corner at ({x}, {y}, {z}); hint: repair the mesh and export it again"
    )]
    NotFinite { path: String, triangle: u64, x: f64, y: f64, z: f64 },
    #[error(
        "{path}: none of the {triangles} triangles can be seen from above (up is {up}); hint: --up x, y or z"
    )]
    NoFaces { path: String, triangles: u64, up: char },
    #[error("{path}: {reason}; hint: write 32-bit float heights in mm, one channel, one page")]
    Tiff { path: String, reason: String },
    #[error(
        "{path}: {reason}; hint: numpy.save of a two-dimensional float32 or float64 array, heights in mm"
    )]
    Npy { path: String, reason: String },
    #[error("{path}: {reason}; hint: a 16-bit greyscale PNG without interlacing")]
    Png { path: String, reason: String },
    #[error(
        "{path}: {bits}-bit integers carry no heights of their own; hint: --z-min-mm and --z-max-mm for the darkest and the brightest value (z_min_mm, z_max_mm in a job)"
    )]
    NoRange { path: String, bits: u32 },
    #[error(
        "{path}: z_min_mm is {z_min_mm}, z_max_mm is {z_max_mm}; hint: both finite, the second above the first"
    )]
    BadRange { path: String, z_min_mm: f64, z_max_mm: f64 },
    #[error(
        "{path} carries no pitch; hint: --pixel-mm (pixel_mm in a job), the distance between two samples"
    )]
    NoPitch { path: String },
    #[error(
        "{path} carries a pitch of {file_mm} mm, pixel_mm says {asked_mm} mm; hint: leave pixel_mm out, or correct the file"
    )]
    PitchDiffers { path: String, file_mm: f64, asked_mm: f64 },
    #[error("{path}: pixels of {x_mm} x {y_mm} mm are not square; hint: resample it to one pitch")]
    NotSquare { path: String, x_mm: f64, y_mm: f64 },
    #[error(
        "{path}: the height at column {column}, row {row} (from below) is {value}; hint: use NaN for no data"
    )]
    InfiniteHeight { path: String, column: u64, row: u64, value: f64 },
    #[error("{path}: all {samples} samples are no-data")]
    AllNoData { path: String, samples: u64 },
    #[error(
        "{path}: decoding takes {wanted} bytes in {folder}, {free} are free; hint: point TMPDIR at a larger disk or store the image uncompressed"
    )]
    NoSpace { path: String, folder: String, wanted: u64, free: u64 },
    #[error("{path}: {wanted} bytes to write, {free} are free there; hint: a coarser step or another disk")]
    NoSpaceToWrite { path: String, wanted: u64, free: u64 },
    #[error(
        "{path}: a PNG holds no no-data, the sample at column {column}, row {row} has none; hint: write .tif"
    )]
    PngNoData { path: String, column: usize, row: usize },
    #[error(
        "{path}: height {z_mm} mm lies outside z_min_mm {z_min_mm} .. z_max_mm {z_max_mm}; hint: widen --z-min-mm and --z-max-mm"
    )]
    PngRange { path: String, z_mm: f32, z_min_mm: f64, z_max_mm: f64 },
    #[error(
        "{path}: a PNG has at most 2147483647 columns and rows, this is {columns} x {rows}; hint: write .tif"
    )]
    PngSize { path: String, columns: usize, rows: usize },
    #[error("{path}: {given} of {rows} rows were written before the file was closed")]
    Unfinished { path: String, given: usize, rows: usize },
    #[error("the design has no cell in columns {c0} .. {c1}, rows {r0} .. {r1}")]
    NoCells { c0: i32, r0: i32, c1: i32, r1: i32 },
    #[error("cell ({column}, {row}) of the design has no facets")]
    NoFacets { column: i32, row: i32 },
    #[error("cell ({column}, {row}) of the design has a number that is not finite")]
    CellNotFinite { column: i32, row: i32 },
    #[error("cells of {cell_mm} mm; hint: a design has cells wider than 0")]
    CellSize { cell_mm: f64 },
    #[error(
        "a part of {length_mm} mm cannot be turned over on a step of {step_mm} mm: {count} steps; hint: a step that divides the part's width"
    )]
    NotWholeSteps { length_mm: f64, step_mm: f64, count: f64 },
    #[error(
        "a height image cannot be levelled without resampling; hint: level a design or a mesh, or level = \"none\""
    )]
    NotLevelled,
    #[error(
        "the part's best-fit plane leans {tilt_deg:.2} degrees, at most {limit_deg} can be levelled; hint: turn the part first (--up)"
    )]
    TooSteep { tilt_deg: f64, limit_deg: f64 },
}
