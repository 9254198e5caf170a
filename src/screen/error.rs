use crate::settings;

/// Why a screen was not designed. Positions are in metres in the screen's frame.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(transparent)]
    Settings(#[from] settings::Error),
    #[error(
        "{path}:{line}: no audience; hint: one [[audience]] for each convex region, with its corners in vertices_m"
    )]
    NoAudience { path: String, line: usize },
    #[error(
        "{path}:{line}: audience \"{name}\" has {found} corners, a solid takes 4 to {most}; hint: list the corners of its hull"
    )]
    Corners { path: String, line: usize, name: String, found: usize, most: usize },
    #[error(
        "{path}:{line}: audience \"{name}\" is flat, its {corners} corners lie in one plane; hint: give it a depth, as the space that heads move in"
    )]
    Flat { path: String, line: usize, name: String, corners: usize },
    #[error(
        "{path}:{line}: audience \"{name}\" contains the screen point ({x_m}, {y_m}, 0) m; hint: the screen is the plane z = 0, move the audience to z > 0"
    )]
    ContainsScreen { path: String, line: usize, name: String, x_m: f64, y_m: f64 },
    #[error(
        "{path}:{line}: audience \"{name}\" reaches behind the screen plane, to z = {z_m} m; hint: the screen is the plane z = 0, every corner needs z > 0"
    )]
    Behind { path: String, line: usize, name: String, z_m: f64 },
    #[error(
        "{path}:{line}: the projector stands at z = {z_m} m, on or behind the screen plane; hint: the screen is the plane z = 0, it needs z > 0"
    )]
    ProjectorBehind { path: String, line: usize, z_m: f64 },
    #[error(
        "{path}:{line}: cells of {width_mm} mm are larger than the screen of {screen_width_mm} x {screen_height_mm} mm; hint: microgeometry.width_mm is in mm, the screen in m"
    )]
    CellTooWide { path: String, line: usize, width_mm: f64, screen_width_mm: f64, screen_height_mm: f64 },
    #[error(
        "{path}:{line}: the screen has {columns} x {rows} cells, at most {most} can be designed; hint: wider cells or a smaller screen"
    )]
    TooManyCells { path: String, line: usize, columns: f64, rows: f64, most: f64 },
    #[error(
        "{path}:{line}: area_sweeps repair what stitching does to areas, and cells with steps keep theirs; hint: seam = \"stitched\", or leave area_sweeps out"
    )]
    SweepsOfSteps { path: String, line: usize },
    #[error(
        "{path}:{line}: area_sweeps repair cells of at least {fewest} facets, these have {facets}; hint: more facets, or leave area_sweeps out"
    )]
    SweepsOfFew { path: String, line: usize, facets: f64, fewest: f64 },
    #[error(
        "{path}:{line}: area_sweeps repair cells whose bases meet, and with method = \"flat\" they do not; hint: method = \"poisson\", or leave area_sweeps out"
    )]
    SweepsOfFlat { path: String, line: usize },
    #[error(
        "{path}:{line}: a mirror of n = {n}, k = {k} reflects {percent:.4} % of the light; hint: a metal reflects most of it, aluminium has n = 1, k = 6.4"
    )]
    NoMirror { path: String, line: usize, n: f64, k: f64, percent: f64 },
    #[error(
        "{path}:{line}: the reflector is {given}; hint: give material = \"aluminium\", or both n and k, or reflectance = 0.9 at every angle"
    )]
    Reflector { path: String, line: usize, given: &'static str },
    #[error(
        "cells {c0} {r0} {c1} {r1} do not lie in the screen's {columns} x {rows} cells; hint: --cells C0 R0 C1 R1 with 0 <= C0 < C1 <= {columns} and 0 <= R0 < R1 <= {rows}"
    )]
    CellsOutside { c0: i32, r0: i32, c1: i32, r1: i32, columns: usize, rows: usize },
    #[error(
        "{cells} cells of {facets} facets take {gib:.1} GiB, at most {most_gib:.1} GiB are designed at once; hint: design parts with --cells C0 R0 C1 R1"
    )]
    TooMuchAtOnce { cells: usize, facets: usize, gib: f64, most_gib: f64 },
    #[error(
        "{cells} cells of {facets} facets make a container of {gib:.1} GiB, at most {most_gib:.1} GiB are written in one; hint: design parts with --cells C0 R0 C1 R1"
    )]
    TooMuchForAFile { cells: usize, facets: usize, gib: f64, most_gib: f64 },
    #[error(
        "the bases of cells ({column}, {row}) and ({next_column}, {next_row}) are {step_mm:.3} mm apart where they meet, area_sweeps repair cells whose bases are within {most_mm:.3} mm; hint: an elevation whose bases meet, as method = \"poisson\" makes it, or leave area_sweeps out"
    )]
    BasesApart { column: i32, row: i32, next_column: i32, next_row: i32, step_mm: f64, most_mm: f64 },
    #[error("interrupted; nothing was written")]
    Interrupted,
    #[error(
        "cell ({column}, {row}) at ({x_m:.4}, {y_m:.4}, {z_m:.4}) m sees no audience; hint: the audience must be in front of every point of the screen, more than 0.06 degrees above its plane"
    )]
    SeesNoAudience { column: i32, row: i32, x_m: f64, y_m: f64, z_m: f64 },
    #[error(
        "cell ({column}, {row}) at ({x_m:.4}, {y_m:.4}, {z_m:.4}) m sees the audience under so small an angle that {facets} directions would take more than {most} samples; hint: a larger audience or fewer facets"
    )]
    SeesTooLittle { column: i32, row: i32, x_m: f64, y_m: f64, z_m: f64, facets: usize, most: f64 },
    #[error(
        "cell ({column}, {row}) at ({x_m:.4}, {y_m:.4}, {z_m:.4}) m lies inside audience \"{name}\"; hint: move the audience or flatten the elevation"
    )]
    Inside { column: i32, row: i32, x_m: f64, y_m: f64, z_m: f64, name: String },
    #[error(
        "cell ({column}, {row}) at z = {z_m:.4} m stands behind the projector at z = {projector_m} m; hint: a projector further from the screen; a given elevation is in mm"
    )]
    BehindProjector { column: i32, row: i32, z_m: f64, projector_m: f64 },
    #[error(
        "cell ({column}, {row}): a direction to the audience grazes the cell's own base, tilted by ({mx:.3}, {my:.3}); hint: area = \"paper\", or an audience further above the screen plane"
    )]
    Grazing { column: i32, row: i32, mx: f64, my: f64 },
    #[error(
        "cell ({column}, {row}): areas of {facets} facets are off by {error:.1e} after {iterations} iterations, {tolerance:.1e} is asked; hint: a larger area_tolerance or fewer facets"
    )]
    NotConverged { column: i32, row: i32, facets: usize, error: f64, iterations: usize, tolerance: f64 },
    #[error(
        "the elevation still changes by {change_m:.1e} m after {iterations} iterations; hint: method = \"flat\", or an audience further from the screen"
    )]
    ElevationNotSettled { change_m: f64, iterations: usize },
    #[error(
        "the elevation has {rows} x {columns} values, the screen {wanted_rows} x {wanted_columns} cells; hint: one value in mm a cell, rows x columns, the lowest row first"
    )]
    ElevationShape { rows: usize, columns: usize, wanted_rows: usize, wanted_columns: usize },
    #[error(
        "the elevation of cell ({column}, {row}) is {value_mm} mm; hint: it must be a number between -{most_mm} and {most_mm}"
    )]
    ElevationValue { column: usize, row: usize, value_mm: f64, most_mm: f64 },
}
