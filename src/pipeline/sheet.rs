//! What the setup sheet says, gathered from a judged job.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use sha2::{Digest, Sha256};

use super::Error;
use super::cut::TileResult;
use super::plan::Program;
use super::shop::Shop;
use crate::cutter::Shape;
use crate::job::{Blanks, Face, Job, Kind, ZZero};
use crate::machine::{Fixture, Side};
use crate::report::setup_sheet::{SetupSheet, SheetProgram, SheetTile, SheetTool};
use crate::report::{Bounds, Report, Severity};

/// Said where the blank is turned over.
const UNDERSIDE_UP: &str = "Turn the blank over left to right, its underside up. X0 Y0 is the tile's lower left corner as it lies then, Z0 the face that is up.";
const TOP_UP: &str = "Turn the blank back, its top up. Find X0 Y0 and Z0 anew.";

/// Rim of uncut metal that a paper or a probe needs.
const RIM_MM: f64 = 1.5;

/// The sheet; programs stand in the job's staging folder.
pub fn sheet(
    job: &Job,
    shop: &Shop,
    report: &Report,
    results: &[TileResult],
    staging: &Path,
) -> Result<SetupSheet, Error> {
    let machine = &shop.machine;
    let warned = report.findings.iter().filter(|finding| finding.severity != Severity::Note);
    let mut abort = vec![
        "Stop the spindle and the motion on the machine's panel; clear its buffer before anything else is sent."
            .to_string(),
    ];
    if shop.dialects.iter().any(|dialect| dialect.extension == "rml") {
        abort.push(
            "From the computer ESC.K ends an RML-1 job after the command that runs; then raise Z.".into(),
        );
    }
    abort.push(
        "A stopped program begins again at a pass start: send it from a place where it has retracted.".into(),
    );
    Ok(SetupSheet {
        title: job.name.clone(),
        machine: machine.title.clone(),
        material: job.stock.material.clone(),
        made_by: format!("screenmill {}", env!("CARGO_PKG_VERSION")),
        warnings: warned
            .map(|finding| match &finding.tile {
                Some(tile) => format!("{tile}: {}", finding.message),
                None => finding.message.clone(),
            })
            .collect(),
        unconfirmed: unconfirmed(shop),
        machine_notes: machine_notes(shop),
        abort,
        safety: vec![
            "Covers closed, eye protection, chips cleared; aluminium chips burn and conduct.".into(),
            "Do not leave long jobs alone.".into(),
        ],
        tiles: results.iter().map(|result| tile(job, shop, result, staging)).collect::<Result<_, Error>>()?,
    })
}

/// Figures of machine and dialects that no source confirms.
fn unconfirmed(shop: &Shop) -> Vec<String> {
    let mut lines = shop.machine.unconfirmed_figures();
    for dialect in shop.dialects.iter().filter(|dialect| !dialect.unconfirmed.is_empty()) {
        lines.push(format!("{} of the post {}", dialect.unconfirmed.join(", "), dialect.name));
    }
    lines
}

/// What machine and dialects ask of the operator.
fn machine_notes(shop: &Shop) -> Vec<String> {
    let dialects = shop.dialects.iter();
    let of_posts = dialects.flat_map(|d| d.notes.iter().map(|note| format!("{}: {note}", d.name)));
    shop.machine.notes.iter().cloned().chain(of_posts).collect()
}

fn tile(job: &Job, shop: &Shop, result: &TileResult, staging: &Path) -> Result<SheetTile, Error> {
    let tile = &result.tile;
    let at = &tile.setup.tile;
    let blank = tile.setup.blank;
    let size_mm = [blank.high_mm[0] - blank.low_mm[0], blank.high_mm[1] - blank.low_mm[1]];
    let mut tools: Vec<SheetTool> = Vec::new();
    let mut programs = Vec::new();
    for post in &result.posts {
        let mut before = None;
        let mut face = Face::Top;
        for program in &post.programs {
            let turn = (program.face != face).then_some(match program.face {
                Face::Underside => UNDERSIDE_UP,
                Face::Top => TOP_UP,
            });
            face = program.face;
            let tool = &shop.tools[program.operation];
            let number = tool.number.unwrap_or(program.operation as u32 + 1);
            if !tools.iter().any(|known| known.name == tool.name) {
                let setting = shop.machine.run(tool).ok();
                tools.push(SheetTool {
                    number,
                    name: tool.name.clone(),
                    cutter: tool.shape.to_string(),
                    flutes: tool.flutes,
                    neck_mm: tool.body.map(|body| [body.neck_diameter_mm, body.neck_length_mm]),
                    shank_mm: tool.body.map(|body| body.shank_diameter_mm),
                    tool_life_m: tool.tool_life_m,
                    stick_out_mm: tool.body.map(|body| body.stick_out_mm),
                    spindle_rpm: setting.map_or(tool.spindle_rpm, |setting| setting.rpm),
                    spindle_code: setting.and_then(|s| s.code).map(|code| format!("!RC{code}")),
                    feed_mm_min: tool.feed_mm_min,
                    plunge_mm_min: tool.plunge_mm_min,
                });
            }
            let (low, high) = (program.extent.low_mm, program.extent.high_mm);
            programs.push(SheetProgram {
                begins_post: (result.posts.len() > 1 && before.is_none()).then(|| post.dialect.clone()),
                file: program.file.display().to_string(),
                operation: job.operations[program.operation].kind.word().into(),
                tool_number: number,
                tool: tool.name.clone(),
                time_s: program.timing.total_s,
                bounds_mm: Bounds { x: [low[0], high[0]], y: [low[1], high[1]], z: [low[2], high[2]] },
                sha256: sha256(&staging.join(&program.file))?,
                turn: turn.map(String::from),
                re_zero_z: turn.is_none()
                    && (before.is_some_and(|name| name != tool.name.as_str())
                        || program.section.is_some_and(|section| section.index > 1 && section.fresh_cutter)),
            });
            before = Some(tool.name.as_str());
        }
    }
    let mut notes = Vec::new();
    if job.stock.blanks == Blanks::One {
        notes.push(
            "One sheet for all tiles: move it, not the cutter, and find this tile's corner anew.".into(),
        );
    }
    if result.posts.len() > 1 {
        notes.push(
            "The programs of the posts are the same work in other words: run those of one of them.".into(),
        );
    }
    notes.extend(beside(job, shop, result));
    Ok(SheetTile {
        name: at.name.clone(),
        place_mm: [at.x_mm, at.y_mm],
        size_mm: tile.setup.size_mm,
        blank_mm: [size_mm[0], size_mm[1], job.stock.thickness_mm],
        margin_mm: job.stock.margin_mm,
        origin_on_blank_mm: [-blank.low_mm[0], -blank.low_mm[1]],
        fixture: shop.fixture.title.clone(),
        fixture_notes: vec![shop.fixture.note.clone()],
        keep_out_mm: tile
            .setup
            .obstacles
            .iter()
            .map(|o| [o.bounds.low_mm[0], o.bounds.low_mm[1], o.bounds.high_mm[0], o.bounds.high_mm[1]])
            .collect(),
        wcs: job.machine.wcs.clone(),
        xy_zero: shop.fixture.wcs_found.clone(),
        z_zero: match job.stock.z_zero {
            ZZero::StockTop => "the top of the blank".into(),
            ZZero::PartTop => {
                format!("{:.3} mm below the top of the blank", tile.allowance_mm)
            }
        },
        re_zero: re_zero(job, shop, result),
        clamped: clamped(&shop.fixture, tile.setup.zero_on_table_mm[2]),
        wedge_deg: tile.piece.wedge_deg,
        tools,
        programs,
        time_s: result.posts[0].programs.iter().map(|program| program.timing.total_s).sum(),
        checks: checks(job, shop, result),
        limits: limits(job, shop, result),
        notes,
    })
}

/// What is cut beside the surface, and how the blank lies for it.
fn beside(job: &Job, shop: &Shop, result: &TileResult) -> Vec<String> {
    let programs = &result.posts[0].programs;
    let files = |wanted: &dyn Fn(&Program) -> bool| -> Option<String> {
        let files = programs.iter().filter(|program| wanted(program));
        let files: Vec<String> = files.map(|program| program.file.display().to_string()).collect();
        (!files.is_empty()).then(|| files.join(", "))
    };
    let mut notes = Vec::new();
    for slot in &result.slots[0] {
        let Some(files) = files(&|program| program.operation == slot.operation) else { continue };
        let skin_mm = -slot.cut_out.through_mm;
        let held = match slot.cut_out.tab {
            Some(tab) => format!(
                "{} tabs of {} mm, {} mm high, hold it: saw them off and dress the edge",
                slot.standing, tab.width_mm, tab.height_mm
            ),
            None if skin_mm > 0.0 => "there are no tabs".into(),
            None => "there are no tabs: only what lies under it holds it at the end".into(),
        };
        let floor = if skin_mm > 0.0 {
            format!("leaves a skin of {skin_mm} mm")
        } else {
            format!("goes {} mm past the blank's underside", slot.cut_out.through_mm)
        };
        notes.push(format!("{files} cuts the tile out of its blank and {floor}; {held}."));
    }
    for (index, (operation, tool)) in job.operations.iter().zip(&shop.tools).enumerate() {
        let Some(files) = files(&|program| program.operation == index) else { continue };
        if operation.kind == Kind::Drill {
            notes.push(format!(
                "{files}: {} holes of {} mm, {} mm deep.",
                operation.holes_mm.len() + operation.places.len(),
                operation.diameter_mm.unwrap_or(2.0 * tool.shape.radius_mm()),
                operation.depth_mm.unwrap_or_default()
            ));
        }
        if operation.kind == Kind::Mark {
            notes.push(format!(
                "{files}: engraves \"{}\" with an arrow that points to the back of the machine, the tile's upper edge.",
                result.tile.setup.tile.name
            ));
        }
    }
    notes
}

fn clamped(fixture: &Fixture, top_on_table_mm: f64) -> String {
    let mut sides: Vec<String> = Vec::new();
    for clamp in &fixture.clamp {
        let side = match clamp.side {
            Side::Left => "left",
            Side::Right => "right",
            Side::Front => "front",
            Side::Back => "back",
        };
        let height = if clamp.height_mm < 0.0 {
            format!("{} mm below the top", -clamp.height_mm)
        } else {
            format!("{} mm above the top", clamp.height_mm)
        };
        sides.push(format!("{side} ({}), {height}", clamp.name));
    }
    let held = if sides.is_empty() { "from below, all sides free".to_string() } else { sides.join("; ") };
    format!("{held}; the blank's top stands {top_on_table_mm:.2} mm above the table")
}

/// Where Z0 is found for the tools after the first: the tile's own top is cut away by then.
fn re_zero(job: &Job, shop: &Shop, result: &TileResult) -> String {
    let margin_mm = job.stock.margin_mm;
    let size = result.tile.setup.size_mm;
    // How far past each side of the tile something of the top is cut.
    let mut past = [0.0f64; 4];
    let cuts = |program: &&Program| {
        let kind = job.operations[program.operation].kind;
        program.face == Face::Top && (kind.shapes() || kind == Kind::CutOut)
    };
    for program in result.posts.iter().flat_map(|post| &post.programs).filter(cuts) {
        let radius = shop.tools[program.operation].shape.radius_mm();
        let (low, high) = (program.extent.low_mm, program.extent.high_mm);
        let sides = [-low[0], high[0] - size[0], -low[1], high[1] - size[1]];
        for (past, side) in past.iter_mut().zip(sides) {
            *past = past.max(side + radius);
        }
    }
    let names = ["left", "right", "front", "back"];
    let best = (0..4).min_by(|&a, &b| past[a].total_cmp(&past[b])).unwrap_or(0);
    if margin_mm - past[best] >= RIM_MM {
        return format!(
            "Touch off on the rim that stays at the blank's top: on the {}, between {:.1} and {margin_mm:.1} mm outside the tile.",
            names[best], past[best]
        );
    }
    format!(
        "No rim of {RIM_MM} mm stays at the blank's top: before the first program note the height of a fixed face beside the blank, and set Z0 from it ({:.2} mm below the blank's top if it is the one that the blank lies on).",
        job.stock.thickness_mm
    )
}

fn checks(job: &Job, shop: &Shop, result: &TileResult) -> Vec<String> {
    let tile = &result.tile;
    let depth_mm = tile.allowance_mm + tile.surface().top_mm() - tile.surface().bottom_mm();
    let mut checks = vec![format!(
        "The blank is at least {:.2} mm thick: the deepest cut goes {depth_mm:.2} mm down and leaves {:.2} mm.",
        job.stock.thickness_mm,
        job.stock.thickness_mm - depth_mm
    )];
    let air = |program: &&Program| job.operations[program.operation].kind == Kind::Outline;
    checks.push(match result.posts[0].programs.iter().find(air) {
        Some(program) => format!(
            "Run {} first: spindle off, {} mm above the blank, round the tile and then round all that is cut. Watch the clamps and the corners.",
            program.file.display(),
            // It only rises from the height that it runs at.
            program.extent.low_mm[2] + tile.z_zero_mm - tile.allowance_mm
        ),
        None => "Run the first program with Z raised by its depth, spindle off, and watch the corners.".into(),
    });
    let kind = |program: &&Program| job.operations[program.operation].kind == Kind::Rough;
    if let Some(rough) = result.posts[0].programs.iter().find(kind)
        && let Some(lowest) = rough.lowest_mm
    {
        let operation = &job.operations[rough.operation];
        let below_mm = tile.allowance_mm - tile.z_zero_mm - lowest[2];
        checks.push(format!(
            "After {}: at X {:.2} Y {:.2} the floor lies {below_mm:.2} mm below the blank's top. Measure it; if it is deeper by {:.2} mm or more, stop: {}.",
            rough.file.display(),
            lowest[0],
            lowest[1],
            operation.stock_to_leave_mm.max(0.01),
            if operation.stock_to_leave_mm > 0.0 {
                "that is what was left for the next cutter"
            } else {
                "nothing was left for the next cutter"
            }
        ));
    }
    if shop.tools.iter().any(|tool| tool.body.is_none()) {
        checks.push(
            "Nothing is known of neck, shank and stick-out of the inline cutters: see that they clear the metal.".into(),
        );
    }
    checks
}

/// What is owed to the controller's grid, the cutter's radius and the stepover.
fn limits(job: &Job, shop: &Shop, result: &TileResult) -> Vec<String> {
    let mut limits = Vec::new();
    for post in &shop.dialects {
        limits.push(format!(
            "{} rounds heights to {} mm: for that alone a facet of 1 mm may tilt by up to {:.2} degrees.",
            post.name,
            post.unit_mm,
            post.unit_mm.atan().to_degrees()
        ));
    }
    let steepest = result.tile.surface().steepest();
    for (operation, tool) in job.operations.iter().zip(&shop.tools) {
        if !operation.finishes() {
            continue;
        }
        let Shape::Ball { diameter_mm } = tool.shape else { continue };
        let radius = 0.5 * diameter_mm;
        let across = if operation.direction_deg.rem_euclid(180.0) == 0.0 { steepest[1] } else { steepest[0] };
        // Walls that levelling leans are no mirrors.
        let (across, place) =
            if across > 1.0 { (1.0, "faces of 45 degrees") } else { (across, "the steepest face") };
        let scallop_mm = match (operation.stepover_mm, operation.scallop_mm) {
            // w = stepover / cos of the slope across; h = R - sqrt(R^2 - (w/2)^2).
            (Some(stepover_mm), _) => {
                let half = (0.5 * stepover_mm * across.hypot(1.0)).min(radius);
                radius - (radius * radius - half * half).sqrt()
            }
            (None, scallop_mm) => scallop_mm.unwrap_or_default(),
        };
        limits.push(format!(
            "Passes of {} leave scallops of up to {:.2} um on {place}.",
            tool.name,
            scallop_mm * 1e3
        ));
    }
    let figures = result.tally(0).figures();
    if let (Some(depth_mm), Some(area)) = (figures.cavity_max_depth_mm, figures.cavity_area_fraction) {
        limits.push(format!(
            "Valleys keep the cutters' fillet: up to {:.1} um high, on {:.2} % of the area.",
            depth_mm * 1e3,
            100.0 * area
        ));
    }
    limits
}

/// SHA-256 of a file, in hexadecimal.
fn sha256(path: &Path) -> Result<String, Error> {
    let output = |source| Error::Output { path: path.to_path_buf(), source };
    let mut file = File::open(path).map_err(output)?;
    let mut hash = Sha256::new();
    let mut buffer = vec![0u8; 1 << 16];
    loop {
        let read = file.read(&mut buffer).map_err(output)?;
        if read == 0 {
            break;
        }
        hash.update(&buffer[..read]);
    }
    Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}
