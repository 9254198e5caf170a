//! From judged tiles to the report: figures, findings, verdict, and the programs that must not be run set aside.

use std::path::Path;

use super::cut::{Milled, Motions, TileResult};
use super::part::Part;
use super::remarks::{of_face, of_motions, of_rounding, of_wear};
use super::shop::Shop;
use super::{Error, WITHIN, light, pages, plan};
use crate::fidelity::light::LightTally;
use crate::fidelity::{Figures, Tally};
use crate::job::{Form, Job, Kind};
use crate::report::cavity_list::{self, TileCavities};
use crate::report::picture::{Caption, write_png};
use crate::report::{self, Bounds, Fidelity, Finding, GougeBudget, Report, Severity, finding};
use crate::screen::Seam;
use crate::tolerance::Budget;

/// Where in the room the light of the whole job goes.
pub(super) const ROOM_PICTURE: &str = "maps/light-room.png";

/// Writes everything but the programs and maps, which are there already, and gives the verdict.
pub fn finish(
    job: &Job,
    shop: &Shop,
    part: &Part,
    mut results: Vec<TileResult>,
    staging: &Path,
) -> Result<Milled, Error> {
    let lattice = part.whole.lattice();
    let top_mm = part.whole.top_mm();
    let mut report = Report::new(report::Part {
        width_mm: lattice.width_mm,
        height_mm: lattice.height_mm,
        columns: lattice.columns,
        rows: lattice.rows,
        step_mm: lattice.step_mm,
        z_min_mm: part.whole.bottom_mm() - top_mm,
    });
    for found in of_shop(job, shop, part) {
        report.finding(found);
    }
    for result in &mut results {
        for found in std::mem::take(&mut result.findings) {
            report.finding(found);
        }
        report.tiles.push(tile(job, shop, result));
    }
    let mut whole = Tally::new(crate::fidelity::Params {
        step_mm: lattice.step_mm,
        limit_mm: Some(job.limits.deviation_or_default_mm()),
    });
    let mut budget: Option<Budget> = None;
    let mut cavities = 0;
    for result in &results {
        whole.merge(result.tally(0));
        budget.get_or_insert(result.posts[0].budget);
        cavities += result.verdict.cavities.count;
    }
    let figures = whole.figures();
    report.fidelity = budget.map(|budget| Fidelity::of(&figures, shares(&budget), Some(cavities)));
    report.light = of_light(part, job, &results, staging)?;
    times(job, shop, &results, &mut report);
    for found in of_limits(job, &report, &figures) {
        report.finding(found);
    }
    let candidates = results.iter().map(|result| TileCavities {
        tile: &result.tile.setup.tile.name,
        found: &result.verdict.cavities,
        candidates: &result.candidates,
    });
    let cavities: Vec<TileCavities> = candidates.collect();
    cavity_list::write_csv(&staging.join("cavities.csv"), &cavities)?;
    cavity_list::write_geojson(&staging.join("cavities.geojson"), &cavities)?;
    report::write_json(&staging.join("report.json"), &report)?;
    let simulate: Vec<String> = results.iter().filter_map(|result| simulate(shop, result)).collect();
    pages::write(job, shop, part, &report, &results, &simulate, staging)?;
    Ok(Milled { report, simulate })
}

fn shares(budget: &Budget) -> GougeBudget {
    GougeBudget {
        raster: budget.raster_mm,
        simplify: budget.simplify_mm,
        rounding: budget.rounding_mm,
        controller: budget.controller_mm,
    }
}

/// What is to be said before any tile.
fn of_shop(job: &Job, shop: &Shop, part: &Part) -> Vec<Finding> {
    let mut found: Vec<Finding> =
        part.notes.iter().map(|note| finding(Severity::Warning, "input", note.clone())).collect();
    let machine = &shop.machine;
    for dialect in &shop.dialects {
        if !machine.reads(&dialect.name) {
            let message = format!(
                "{} programs are written, and {} does not read them; it reads {}",
                dialect.name,
                machine.title,
                machine.dialects.join(", ")
            );
            found.push(finding(Severity::Warning, "dialect", message));
        }
    }
    let unconfirmed = machine.unconfirmed();
    if !unconfirmed.is_empty() {
        let message = format!(
            "no source confirms {} of the profile {}; verify against your machine",
            unconfirmed.join(", "),
            machine.name
        );
        found.push(finding(Severity::Warning, "unconfirmed", message));
    }
    if let (Some(_), Some(what)) = (job.polish, part.lightless(job)) {
        let message =
            format!("[polish] is left out: it is a model of light after polishing, and the part is {what}");
        found.push(finding(Severity::Warning, "polish", message));
    }
    found.extend(of_stepdowns(job, shop));
    if job.part.form == Form::Die {
        let message = of_a_die(part.design.as_ref().map(|design| design.seam));
        found.push(finding(Severity::Warning, "die", message));
    }
    found
}

/// Stepdowns that a tool does not take, and what is cut instead.
fn of_stepdowns<'a>(job: &'a Job, shop: &'a Shop) -> impl Iterator<Item = Finding> + 'a {
    job.operations.iter().zip(&shop.tools).enumerate().filter_map(|(index, (operation, tool))| {
        let wanted_mm = operation.stepdown_mm?;
        let cut_mm = plan::stepdown_mm(operation, tool).filter(|cut_mm| *cut_mm < wanted_mm)?;
        let message = format!(
            "operation {} ({}, {}) is cut in steps of {cut_mm} mm, the max_depth_mm of its tool; stepdown_mm asks for {wanted_mm}",
            index + 1,
            operation.kind.word(),
            tool.name
        );
        Some(finding(Severity::Warning, "stepdown", message))
    })
}

/// What is to be said of a die of cells with these seams, or of another part.
fn of_a_die(seam: Option<Seam>) -> &'static str {
    if seam == Some(Seam::Step) {
        "a die reflects nothing: no light is reported; step walls between cells do not release from a pressed \
         sheet; hint: seam = \"stitched\""
    } else {
        "a die reflects nothing: no light is reported"
    }
}

/// What a tile shows, with the programs that must not be run moved to `rejected/`.
pub(super) fn of_tile(
    job: &Job,
    shop: &Shop,
    result: &mut TileResult,
    staging: &Path,
) -> Result<Vec<Finding>, Error> {
    let name = result.tile.setup.tile.name.clone();
    let gouge_limit_mm = job.limits.gouge_or_default_mm();
    let mut found = Vec::new();
    if let Some(undercuts) = result.tile.piece.undercuts {
        let message = format!(
            "levelling turned {} faces ({:.3} mm2) so far that a vertical cutter cannot reach under them",
            undercuts.faces, undercuts.area_mm2
        );
        found.push(finding(Severity::Warning, "undercut", message).on(&name));
    }
    for index in &result.posts[0].left_out {
        let why = match shop.kinds[*index] {
            Kind::Rough => "no metal stands over its stock_to_leave_mm where it can get",
            _ => "the cutters before leave no more than its leftover_mm",
        };
        let message = format!(
            "operation {} ({}, {}) has nothing to cut: {why}",
            index + 1,
            shop.kinds[*index].word(),
            shop.tools[*index].name
        );
        found.push(finding(Severity::Note, "left-out", message).on(&name));
    }
    for post in 0..result.posts.len() {
        let mut of_post = Vec::new();
        let figures = result.tally(post).figures();
        if figures.gouge_max_mm > gouge_limit_mm {
            let message = format!(
                "{}: the read-back programs cut {:.4} mm below the design, {gouge_limit_mm} mm are allowed",
                result.posts[post].dialect, figures.gouge_max_mm
            );
            let place = figures.gouge_where_mm.unwrap_or_default();
            of_post.push(finding(Severity::Error, "gouge", message).on(&name).at(&result.in_part(place)));
        }
        if figures.samples == 0 {
            let message = format!("{}: nothing was judged", result.posts[post].dialect);
            of_post.push(finding(Severity::Error, "unjudged", message).on(&name));
        }
        let mut of_programs = Vec::new();
        for (index, program) in result.posts[post].programs.iter().enumerate() {
            let cut = &result.motions[post][index].cut;
            let mut remarks = Vec::from_iter(of_rounding(result, program));
            remarks.extend(of_wear(shop, program, cut));
            remarks.extend(of_motions(shop, result, post, index));
            remarks.extend(of_face(job, shop, result, post, index));
            of_programs.push(remarks);
        }
        let remarked = of_programs.iter().flatten().map(|remark| &remark.finding);
        if of_post.iter().chain(remarked).any(|found| found.severity == Severity::Error) {
            for program in &mut result.posts[post].programs {
                let away = TileResult::rejected(&program.file);
                let (from, to) = (staging.join(&program.file), staging.join(&away));
                let output = |source| Error::Output { path: to.clone(), source };
                if let Some(folder) = to.parent() {
                    std::fs::create_dir_all(folder).map_err(output)?;
                }
                std::fs::rename(&from, &to).map_err(output)?;
                program.file = away;
            }
        }
        for (program, remarks) in result.posts[post].programs.iter().zip(of_programs) {
            found.extend(remarks.into_iter().map(|remark| remark.on(program).on(&name)));
        }
        found.extend(of_post);
    }
    Ok(found)
}

fn tile(job: &Job, shop: &Shop, result: &TileResult) -> report::Tile {
    let at = &result.tile.setup.tile;
    let mut programs = Vec::new();
    for (post, motions) in result.posts.iter().zip(&result.motions) {
        for (program, Motions { cut, .. }) in post.programs.iter().zip(motions) {
            let tool = &shop.tools[program.operation];
            let (low, high) = (program.extent.low_mm, program.extent.high_mm);
            programs.push(report::Program {
                file: program.file.display().to_string(),
                post: post.dialect.clone(),
                operation: job.operations[program.operation].kind.word().into(),
                tool: tool.name.clone(),
                cutter: tool.shape.to_string(),
                blocks: program.reading.summary.blocks,
                bytes: program.reading.summary.bytes,
                cutting_mm: program.extent.cutting_mm,
                rapid_mm: program.extent.rapid_mm,
                time_s: program.timing.total_s,
                deepest_bite_mm: cut.deepest_bite_mm(),
                bounds_mm: Bounds { x: [low[0], high[0]], y: [low[1], high[1]], z: [low[2], high[2]] },
            });
        }
    }
    let surface = result.tile.surface();
    let figures = result.tally(0).figures();
    let shares = shares(&result.posts[0].budget);
    report::Tile {
        name: at.name.clone(),
        row: at.row,
        column: at.column,
        x_mm: at.x_mm,
        y_mm: at.y_mm,
        width_mm: at.width_mm,
        height_mm: at.height_mm,
        z_range_mm: surface.top_mm() - surface.bottom_mm(),
        program_zero_mm: result.tile.program_zero_mm(),
        wedge_deg: result.tile.piece.wedge_deg,
        programs,
        maps: Some(result.maps.clone()),
        fidelity: Some(Fidelity::of(&figures, shares, Some(result.verdict.cavities.count))),
    }
}

/// The light of all tiles together, before and after, and its picture.
fn of_light(
    part: &Part,
    job: &Job,
    results: &[TileResult],
    staging: &Path,
) -> Result<Option<report::Light>, Error> {
    let Some(scene) = &part.scene else { return Ok(None) };
    let [mut designed, mut machined, mut polished] = [(); 3].map(|()| LightTally::default());
    let mut points = Vec::new();
    for result in results {
        let (Some(pose), Some(light)) =
            (part.pose(job, &result.tile.piece), result.verdict.light_machined.first())
        else {
            return Ok(None);
        };
        designed.merge(&result.verdict.light_designed);
        machined.merge(light);
        polished.merge(&result.verdict.light_polished);
        points.extend(light::points(&pose, &result.tile.surface().lattice()));
    }
    let view = light::view(scene, &points);
    let mut light = light::summary(&designed, &machined, &view);
    if let Some(light) = &mut light {
        let over_screen = |which: usize| {
            let cells = results.iter().filter_map(|result| result.on_audience.as_ref());
            light::over_screen(cells.flat_map(|shares| shares[which].iter().copied()))
        };
        light.screen_uniformity_designed = over_screen(0);
        light.screen_uniformity_machined = over_screen(1);
        light.polished =
            job.polish.and_then(|polish| light::polished(&polished, 1e-3 * polish.removal_um, &view));
        let middle_m = points.iter().sum::<glam::DVec3>() / points.len() as f64;
        let caption = Caption { part: job.name.clone(), ..Caption::default() };
        let picture = light::room_picture(scene, middle_m, &designed, &machined, &caption);
        write_png(&staging.join(ROOM_PICTURE), &picture)?;
    }
    Ok(light)
}

/// Machine time of the first post's programs; the other posts are the same work in other words.
fn times(job: &Job, shop: &Shop, results: &[TileResult], report: &mut Report) {
    for program in results.iter().flat_map(|result| &result.posts[0].programs) {
        let tool = &shop.tools[program.operation];
        let kind = job.operations[program.operation].kind.word();
        let time_s = program.timing.total_s;
        report.time_s.total += time_s;
        report.time_s.by_operation.add(&format!("{:02}-{kind}-{}", program.operation + 1, tool.name), time_s);
        report.time_s.by_tool.add(&tool.name, time_s);
    }
}

/// The limits that the job names and the cut does not keep.
fn of_limits(job: &Job, report: &Report, figures: &Figures) -> Vec<Finding> {
    let limits = &job.limits;
    let mut found = Vec::new();
    let mut miss = |code: &str, message: String| found.push(finding(Severity::Error, code, message));
    if let (Some(limit_mm), Some(within)) = (limits.deviation_mm, figures.within_limit_fraction)
        && within < WITHIN
    {
        let message = format!(
            "{:.2} % of the area lie within {limit_mm} mm of the design, {:.0} % are asked for",
            100.0 * within,
            100.0 * WITHIN
        );
        miss("deviation", message);
    }
    if let (Some(limit_deg), Some(normal_deg)) = (limits.normal_p95_deg, figures.normal_p95_deg)
        && normal_deg > limit_deg
    {
        let message = format!(
            "5 % of the normals are off by more than {normal_deg:.2} degrees, {limit_deg} are allowed"
        );
        miss("normals", message);
    }
    if let (Some(least), Some(light)) = (limits.on_audience_min, &report.light)
        && light.on_audience_machined < least
    {
        let message = format!(
            "{:.4} of the light reaches the audience (the design: {:.4}), {least} are asked for",
            light.on_audience_machined, light.on_audience_designed
        );
        miss("on-audience", message);
    }
    let hours = report.time_s.total / 3600.0;
    if let Some(most) = limits.hours_max
        && hours > most
    {
        miss("hours", format!("{hours:.2} machine hours, {most} are allowed"));
    }
    found
}

/// The command that judges a tile's surface again from the files of the programs that make it; None where none does.
fn simulate(shop: &Shop, result: &TileResult) -> Option<String> {
    let post = &result.posts[0];
    let shaping = post.programs.iter().filter(|program| shop.kinds[program.operation].shapes());
    let files: Vec<String> = shaping.clone().map(|p| format!("{{out}}/{}", p.file.display())).collect();
    let cutters: Vec<String> = shaping.map(|p| shop.tools[p.operation].shape.to_string()).collect();
    if files.is_empty() {
        return None;
    }
    let top_mm = result.tile.piece.origin_mm.z;
    let tile = &result.tile;
    let name = &tile.setup.tile.name;
    let command = format!(
        "screenmill simulate {} --cutter {} --part {{out}}/maps/{name}-design.tif --zero 0 0 {:.6} --stock-top-mm {:.6} --machine {} --out {{out}}/simulate-{name}",
        files.join(" "),
        cutters.join(" "),
        top_mm + tile.z_zero_mm,
        top_mm + tile.allowance_mm,
        shop.machine.name
    );
    Some(if result.map_factor == 1 {
        command
    } else {
        format!("{command}  (the maps are reduced by {}; set [maps] full = true first)", result.map_factor)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_dies_of_cells_with_steps_are_told_that_these_do_not_release() {
        assert!(of_a_die(Some(Seam::Step)).contains("do not release"));
        for part in [Some(Seam::Stitched), None] {
            assert_eq!(of_a_die(part), "a die reflects nothing: no light is reported");
        }
    }
}
