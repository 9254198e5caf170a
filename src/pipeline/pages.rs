//! What `report.html` and the setup sheet say, gathered from a judged job.

use std::path::Path;

use super::cut::TileResult;
use super::part::Part;
use super::shop::Shop;
use super::{Error, sheet};
use crate::fidelity::CAVITY_THRESHOLD_MM;
use crate::job::{Form, Job};
use crate::report::pages::{self, CavityRow, Page, Picture};
use crate::report::screen_map::{MapTile, ScreenMap, write_screen_map};
use crate::report::{Report, setup_sheet};

/// Name of the picture of all tiles.
const SCREEN_MAP: &str = "screen-map.svg";

/// Cavities on the page.
const SHOWN_CAVITIES: usize = 20;

/// Writes both pages into the job's staging folder.
pub fn write(
    job: &Job,
    shop: &Shop,
    part: &Part,
    report: &Report,
    results: &[TileResult],
    commands: &[String],
    staging: &Path,
) -> Result<(), Error> {
    let mut page = page(job, shop, report, results, commands);
    if let Some(map) = screen_map(job, part, report) {
        write_screen_map(&staging.join(SCREEN_MAP), &map)?;
        page.screen_map = Some(SCREEN_MAP.into());
    }
    pages::write_report(&staging.join("report.html"), &page)?;
    let sheet = sheet::sheet(job, shop, report, results, staging)?;
    setup_sheet::write_setup_sheet(&staging.join("setup-sheet.html"), &sheet)?;
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
        for (name, made) in [("normals", true), ("light", result.on_audience.is_some())] {
            let file = format!("maps/{tile}-{name}.png");
            if made {
                pictures.push(Picture {
                    tile: tile.clone(),
                    name: name.into(),
                    map_file: file.clone(),
                    file,
                });
            }
        }
    }
    if report.light.is_some() {
        let file = super::report::ROOM_PICTURE.to_string();
        pictures.push(Picture { tile: "all".into(), name: "light".into(), map_file: file.clone(), file });
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
        screen_map: None,
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

/// The tiles of a part and their place on its screen; None for a part in one piece.
fn screen_map(job: &Job, part: &Part, report: &Report) -> Option<ScreenMap> {
    let tiles = report.tiles.iter().map(|tile| MapTile {
        name: tile.name.clone(),
        corner_mm: [tile.x_mm, tile.y_mm],
        size_mm: [tile.width_mm, tile.height_mm],
        place: [tile.row, tile.column],
    });
    (report.tiles.len() > 1).then(|| ScreenMap {
        title: job.name.clone(),
        part_mm: [report.part.width_mm, report.part.height_mm],
        die: job.part.form == Form::Die,
        tiles: tiles.collect(),
        screen_mm: part.on_screen_mm(),
    })
}
