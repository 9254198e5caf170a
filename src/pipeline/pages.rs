//! What `report.html` and the setup sheet say, gathered from a judged job.

use std::path::Path;

use super::Error;
use super::cut::TileResult;
use super::shop::Shop;
use crate::fidelity::CAVITY_THRESHOLD_MM;
use crate::job::{Blanks, Job, ZZero};
use crate::report::pages::{self, CavityRow, Page, Picture};
use crate::report::setup_sheet::{self, SetupSheet, SheetProgram, SheetTile, SheetTool};
use crate::report::{Bounds, Report, Severity};

/// Cavities on the page.
const SHOWN_CAVITIES: usize = 20;

/// Writes both pages into the job's staging folder.
pub fn write(
    job: &Job,
    shop: &Shop,
    report: &Report,
    results: &[TileResult],
    commands: &[String],
    staging: &Path,
) -> Result<(), Error> {
    pages::write_report(&staging.join("report.html"), &page(job, shop, report, results, commands))?;
    setup_sheet::write_setup_sheet(&staging.join("setup-sheet.html"), &sheet(job, shop, report, results))?;
    Ok(())
}

fn page<'a>(
    job: &Job,
    shop: &Shop,
    report: &'a Report,
    results: &[TileResult],
    commands: &[String],
) -> Page<'a> {
    let mut pictures = Vec::new();
    for result in results {
        let maps = &result.maps;
        let tile = &result.tile.setup.tile.name;
        for (name, map_file) in [
            ("design", &maps.design),
            ("machined", &maps.machined),
            ("deviation", &maps.deviation),
            ("cavity", &maps.cavity),
        ] {
            pictures.push(Picture {
                tile: tile.clone(),
                name: name.into(),
                file: map_file.replace(".tif", ".png"),
                map_file: map_file.clone(),
            });
        }
    }
    let mut cavities = Vec::new();
    let mut listed = 0;
    for result in results {
        let found = &result.verdict.cavities;
        listed += found.cavities.len() as u64;
        for cavity in found.cavities.iter().take(SHOWN_CAVITIES) {
            let reached = cavity.reached_by(CAVITY_THRESHOLD_MM);
            cavities.push(CavityRow {
                tile: result.tile.setup.tile.name.clone(),
                centre_mm: cavity.centre_mm,
                area_mm2: cavity.area_mm2,
                depth_mm: cavity.depth_mm,
                volume_mm3: cavity.volume_mm3,
                reached_by: reached.map(|index| result.candidates[index].clone()).unwrap_or_default(),
            });
        }
    }
    cavities.sort_by(|a, b| b.volume_mm3.total_cmp(&a.volume_mm3));
    cavities.truncate(SHOWN_CAVITIES);
    let tools: Vec<&str> = shop.tools.iter().map(|tool| tool.name.as_str()).collect();
    Page {
        title: job.name.clone(),
        subtitle: format!(
            "{}, {} of {} mm, {}",
            shop.machine.title,
            if job.stock.material.is_empty() { "blank" } else { &job.stock.material },
            job.stock.thickness_mm,
            tools.join(", ")
        ),
        report,
        limits: pages::Limits {
            gouge_mm: Some(job.limits.gouge_or_default_mm()),
            deviation_mm: job.limits.deviation_mm,
            normal_p95_deg: job.limits.normal_p95_deg,
            on_audience_min: job.limits.on_audience_min,
            hours_max: job.limits.hours_max,
        },
        pictures,
        cavities,
        cavities_listed: listed,
        commands: commands.iter().map(|command| command.replace("{out}/", "")).collect(),
        accuracy: accuracy(job),
    }
}

/// Sentences on how exact the figures are; docs/accuracy.md has the bounds.
fn accuracy(job: &Job) -> Vec<String> {
    vec![
        format!(
            "Every figure is measured at full resolution, a sample every {} um, on the surface that the read-back \
             program texts leave.",
            job.part.step_mm * 1e3
        ),
        "The sweep is exact to 1 nm at each sample; between samples the designed planes of a ridge or a step can \
         stand higher than the samples say."
            .into(),
        "Percentiles are read from a histogram of 1 nm; gouge, excess and fractions are exact.".into(),
        "Times follow the profile's accelerations and corner rule; values marked unconfirmed are to be calibrated."
            .into(),
    ]
}

fn sheet(job: &Job, shop: &Shop, report: &Report, results: &[TileResult]) -> SetupSheet {
    let machine = &shop.machine;
    let warned = report.findings.iter().filter(|finding| finding.severity != Severity::Note);
    SetupSheet {
        title: job.name.clone(),
        machine: machine.title.clone(),
        material: job.stock.material.clone(),
        made_by: format!("screenmill {}", env!("CARGO_PKG_VERSION")),
        warnings: warned.map(|finding| finding.message.clone()).collect(),
        unconfirmed: unconfirmed(shop),
        machine_notes: machine_notes(shop),
        abort: vec![
            "Stop the spindle and the motion on the machine's panel; clear its buffer before anything else is sent."
                .into(),
            "A stopped program begins again at a pass start: send it from a place where it has retracted.".into(),
        ],
        safety: vec![
            "Covers closed, eye protection, chips cleared; aluminium chips burn and conduct.".into(),
            "Do not leave long jobs alone.".into(),
        ],
        tiles: results.iter().map(|result| sheet_tile(job, shop, result)).collect(),
    }
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

fn sheet_tile(job: &Job, shop: &Shop, result: &TileResult) -> SheetTile {
    let tile = &result.tile;
    let at = &tile.setup.tile;
    let blank = tile.setup.blank;
    let size_mm = [blank.high_mm[0] - blank.low_mm[0], blank.high_mm[1] - blank.low_mm[1]];
    let mut tools: Vec<SheetTool> = Vec::new();
    let mut programs = Vec::new();
    for post in &result.posts {
        let mut before = None;
        for program in &post.programs {
            let tool = &shop.tools[program.operation];
            let number = tool.number.unwrap_or(program.operation as u32 + 1);
            if !tools.iter().any(|known| known.name == tool.name) {
                let setting = shop.machine.run(tool).ok();
                tools.push(SheetTool {
                    number,
                    name: tool.name.clone(),
                    cutter: tool.shape.to_string(),
                    flutes: tool.flutes,
                    stick_out_mm: tool.body.map(|body| body.stick_out_mm),
                    spindle_rpm: setting.map_or(tool.spindle_rpm, |setting| setting.rpm),
                    spindle_code: setting.and_then(|s| s.code).map(|code| format!("!RC{code}")),
                    feed_mm_min: tool.feed_mm_min,
                    plunge_mm_min: tool.plunge_mm_min,
                });
            }
            let (low, high) = (program.extent.low_mm, program.extent.high_mm);
            programs.push(SheetProgram {
                file: program.file.display().to_string(),
                operation: job.operations[program.operation].kind.word().into(),
                tool_number: number,
                tool: tool.name.clone(),
                time_s: program.timing.total_s,
                bounds_mm: Bounds { x: [low[0], high[0]], y: [low[1], high[1]], z: [low[2], high[2]] },
                re_zero_z: before.is_some_and(|name| name != tool.name.as_str())
                    || program.section.is_some_and(|section| section.index > 1 && section.fresh_cutter),
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
    let depth_mm = tile.allowance_mm + tile.surface().top_mm() - tile.surface().bottom_mm();
    SheetTile {
        name: at.name.clone(),
        place_mm: [at.x_mm, at.y_mm],
        size_mm: [at.width_mm, at.height_mm],
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
        wedge_deg: tile.piece.wedge_deg,
        tools,
        programs,
        checks: vec![
            format!(
                "The blank is at least {:.2} mm thick: the deepest cut goes {depth_mm:.2} mm down.",
                job.stock.thickness_mm
            ),
            "Run the first program with Z raised by its depth, spindle off, and watch the corners.".into(),
            "After roughing, measure the depth at one corner before the next tool.".into(),
        ],
        notes,
    }
}
