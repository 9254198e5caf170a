//! `mill`: every tile planned, written, read back and judged.

use std::path::{Path, PathBuf};

use super::judge::{Case, Pictures, Verdict, judge};
use super::light::Sight;
use super::maps::Maps;
use super::part::Part;
use super::plan::{self, PostPrograms, TileSetup};
use super::rescue::{shift, try_candidates};
use super::shop::Shop;
use super::tabs::{self, Slot};
use super::underside::{self, Thin};
use super::{Error, light, report};
use crate::compensation::{Profile, Tables};
use crate::cutter::Shape;
use crate::fidelity::light::LightTally;
use crate::fidelity::{self, Pixels, Tally};
use crate::job::{Blanks, Face, Job, Kind, Level};
use crate::machine::{self, Setup};
use crate::progress::Progress;
use crate::report::picture::{self, Caption};
use crate::report::{Finding, Report, light_picture};
use crate::screen::Scene;
use crate::verify::{self, Blank, BodyHit, Judged, LateralRapid, ProgramCut};

/// Pieces of a part are not made shorter than this to save travel in Z.
const SMALLEST_TILE_MM: f64 = 20.0;

/// Cutters tried beyond the job's own on what they leave.
const CANDIDATES: usize = 4;

/// A judged job.
pub struct Milled {
    pub report: Report,
    /// The command that repeats the judgement of a tile from its files, for each whose surface is cut.
    pub simulate: Vec<String>,
}

/// What the motions of one program do to the blank.
#[derive(Clone, Debug, Default)]
pub struct Motions {
    pub cut: ProgramCut,
    pub lateral_rapid: Option<LateralRapid>,
    /// A shank or holder that runs into metal.
    pub body_hit: Option<BodyHit>,
    /// Where a cut of the underside comes nearest to the part.
    pub thin: Option<Thin>,
}

/// One tile with its programs and what became of it.
pub struct TileResult {
    pub tile: TileSetup,
    pub posts: Vec<PostPrograms>,
    pub verdict: Verdict,
    /// For each post and program, in run order.
    pub motions: Vec<Vec<Motions>>,
    /// For each post, the slots around the tile.
    pub slots: Vec<Vec<Slot>>,
    pub maps: crate::report::MapFiles,
    pub map_factor: usize,
    /// Names of the cutters that were tried on the cavities, largest first.
    pub candidates: Vec<String>,
    /// The part of each cell's light that reaches the audience, of the design and of the cut.
    pub on_audience: Option<[Vec<f64>; 2]>,
    pub findings: Vec<Finding>,
}

/// Cuts a job under `staging`. `folder` is the job's own, where it looks for its files.
pub fn mill(job: &Job, folder: &Path, staging: &Path, progress: &dyn Progress) -> Result<Milled, Error> {
    let shop = Shop::open(job, folder)?;
    let part = Part::load(job, progress)?;
    part.check_light(job)?;
    let tiles = setups(job, &shop, &part)?;
    let mut results = Vec::new();
    for tile in tiles {
        tile.piece.hold()?;
        let mut posts = Vec::new();
        for dialect in &shop.dialects {
            posts.push(plan::programs(job, &shop, &tile, dialect, staging, progress)?);
        }
        let mut result = judged(job, &shop, &part, tile, posts, staging, progress)?;
        result.findings = report::of_tile(job, &shop, &mut result, staging)?;
        // A part has any number of tiles: what is as large as a tile goes with it.
        for program in result.posts.iter_mut().flat_map(|post| &mut post.programs) {
            program.reading.motions = Vec::new();
        }
        result.tile.piece.shed();
        results.push(result);
    }
    report::finish(job, &shop, &part, results, staging)
}

/// The tiles of a part, each checked against machine, blank and cutters before anything is planned.
pub fn setups(job: &Job, shop: &Shop, part: &Part) -> Result<Vec<TileSetup>, Error> {
    let steepest = part.whole.steepest();
    let overruns = shop.shaping().map(|tool| plan::overrun_mm(job, &tool.shape, steepest));
    let slots = shop.tools.iter().zip(&shop.kinds).filter(|(_, kind)| **kind == Kind::CutOut);
    let slots = slots.map(|(tool, _)| tool.shape.radius_mm());
    let overrun_mm = overruns.chain(slots).fold(0.0, f64::max);
    let part_top_mm = part.whole.top_mm();
    let size_mm = part.size_mm();
    let put = |tile: &machine::Tile| -> Result<TileSetup, Error> {
        let piece = part.tile(job, tile)?;
        let mut lies = tile.clone();
        if job.part.level == Level::Plane && job.stock.blanks == Blanks::PerTile {
            // Turned, it is wider than its place in the part.
            let lattice = piece.surface.lattice();
            (lies.width_mm, lies.height_mm) = (lattice.width_mm, lattice.height_mm);
        }
        let setup = Setup::place(lies, size_mm, &shop.stock, &shop.machine, &shop.fixture);
        let setup = Setup { tile: tile.clone(), ..setup };
        Ok(TileSetup::new(job, shop, setup, piece, part_top_mm))
    };
    let blanks_differ = job.stock.blanks == Blanks::PerTile;
    let refusal = |tile: &machine::Tile| -> Result<Option<machine::Error>, Error> {
        let tile_setup = put(tile)?;
        let fits = machine::fits_z(&tile.name, tile_setup.need(), &shop.machine);
        let lies = match blanks_differ {
            true => tile_setup.setup.check_blank(&shop.machine, &shop.fixture),
            false => Ok(()),
        };
        Ok(fits.and(lies).err())
    };
    let tiles = machine::split_to_fit(
        size_mm,
        part.quantum(),
        overrun_mm,
        SMALLEST_TILE_MM,
        &shop.stock,
        &shop.machine,
        &shop.fixture,
        refusal,
    )?;
    let mut setups = Vec::new();
    for tile in &tiles {
        let setup = put(tile)?;
        let need = setup.need();
        machine::floor_mm(&tile.name, need, &shop.stock)?;
        let depth_mm = need.depth_mm + need.top_allowance_mm;
        let [reach_mm, widest_mm] = plan::reach_mm(job, shop, steepest, depth_mm);
        setup.setup.check_reach(reach_mm, widest_mm, depth_mm, shop.stock.margin_mm)?;
        for tool in shop.shaping() {
            tool.check_reach(depth_mm)?;
        }
        for (operation, tool) in job.operations.iter().zip(&shop.tools) {
            let cut_mm = match operation.kind {
                Kind::CutOut => job.stock.thickness_mm + operation.through_mm.unwrap_or(0.0),
                _ => operation.depth_mm.unwrap_or(0.0),
            };
            tool.check_reach(cut_mm)?;
            if operation.kind == Kind::CutOut || operation.kind == Kind::Drill {
                let own_mm = 2.0 * tool.shape.radius_mm();
                tool.check_neck(operation.diameter_mm.unwrap_or(own_mm), cut_mm)?;
            }
            let stroke = machine::ZNeed { depth_mm: cut_mm, top_allowance_mm: 0.0, ..need };
            machine::fits_z(&setup.setup.tile.name, stroke, &shop.machine)?;
        }
        if tiles.len() > 1 {
            setup.piece.shed();
        }
        setups.push(setup);
    }
    Ok(setups)
}

/// The job's cutters that can reach a place which no other of them reaches. A ball is a union of smaller balls, so
/// of several balls only the smallest counts (on samples its closing is the lowest to 0.25 um at 10 um).
fn reaching(shop: &Shop) -> Vec<Shape> {
    let shapes = shop.shaping().map(|tool| tool.shape);
    let is_ball = |shape: &Shape| matches!(shape, Shape::Ball { .. });
    let balls = shapes.clone().filter(is_ball);
    let smallest = balls.min_by(|a, b| a.radius_mm().total_cmp(&b.radius_mm()));
    shapes.filter(|shape| !is_ball(shape) || Some(*shape) == smallest).collect()
}

/// Profiles of cutters without repetition, in order.
pub fn distinct(shapes: impl Iterator<Item = Shape>, step_mm: f64) -> Result<Vec<Profile>, Error> {
    let mut profiles: Vec<Profile> = Vec::new();
    for shape in shapes {
        if !profiles.iter().any(|profile| profile.shape() == shape) {
            profiles.push(Profile::new(shape, step_mm, 0.0)?);
        }
    }
    Ok(profiles)
}

fn judged(
    job: &Job,
    shop: &Shop,
    part: &Part,
    tile: TileSetup,
    posts: Vec<PostPrograms>,
    staging: &Path,
    progress: &dyn Progress,
) -> Result<TileResult, Error> {
    let surface = tile.surface();
    let lattice = surface.lattice();
    let step_mm = lattice.step_mm;
    let blank = blank(job, part, &tile);
    let zero_mm = [0.0, 0.0, tile.z_zero_mm];
    // The underside is judged by itself.
    let up = |face: Face| move |program: &&plan::Program| program.face == face;
    let tops: Vec<Vec<&plan::Program>> =
        posts.iter().map(|post| post.programs.iter().filter(up(Face::Top)).collect()).collect();
    let judged: Vec<Vec<Judged>> = tops
        .iter()
        .map(|programs| {
            let programs = programs.iter();
            programs.map(|p| Judged::new(&p.reading, shop.tools[p.operation].shape, zero_mm)).collect()
        })
        .collect();
    let cutters = distinct(reaching(shop).into_iter(), step_mm)?;
    let cutters: Vec<Tables> = cutters.into_iter().map(Tables::new).collect();
    let (names, candidates) = candidates(shop, step_mm)?;
    let steepest = part.whole.steepest();
    let sight = match (part.pose(job, &tile.piece), &part.scene) {
        (Some(pose), Some(scene)) => {
            Some(Sight { scene, pose, steepest: steepest[0].hypot(steepest[1]), far_field: None })
        }
        _ => None,
    };
    let case = Case {
        surface,
        blank,
        posts: &judged,
        cutters: &cutters,
        passes: &posts[0].passes,
        tally: fidelity::Params { step_mm, limit_mm: Some(job.limits.deviation_or_default_mm()) },
        cavities: fidelity::cavities::Params::at_step(step_mm),
        sight: sight.as_ref(),
        polish_mm: job.polish.map(|polish| 1e-3 * polish.removal_um),
        most_pixels: light_picture::MOST_PIXELS,
    };
    progress.begin("judge", (lattice.columns * lattice.rows) as u64);
    crate::memory::give_back();
    let offset_mm = tile.piece.origin_mm.z;
    let mut maps = Maps::create(staging, &tile.setup.tile.name, &lattice, job.maps.full, offset_mm)?;
    // Shanks and holders are followed by one thread, beside the blocks.
    let (verdict, mut hits) = rayon::join(
        || judge(&case, progress, &mut |strip| maps.push(&strip)),
        || body_hits(shop, &blank, &tops, &judged, progress),
    );
    let mut verdict = verdict?;
    progress.begin("smaller cutters", 1);
    try_candidates(surface, &candidates, &mut verdict.cavities.cavities)?;
    shift(&mut verdict.cavities.cavities, [tile.setup.tile.x_mm, tile.setup.tile.y_mm]);
    progress.begin("maps", 1);
    let at = &tile.setup.tile;
    let pictures = verdict.pictures.take();
    let (finished, drawn) = rayon::join(
        || maps.finish(&job.name, [at.x_mm, at.y_mm], &notes(job, &verdict)),
        || match &pictures {
            Some(pictures) => draw_means(staging, job, &tile, &verdict, pictures, lattice.step_mm),
            None => Ok(()),
        },
    );
    let (maps, map_factor) = finished?;
    drawn?;
    let of_cells = |scene: &Scene, maps: &[Pixels; 2]| {
        maps.each_ref().map(|map| light::of_cells(scene, map, job.part.step_mm))
    };
    let light = pictures.as_ref().and_then(|pictures| pictures.light.as_ref());
    let on_audience = part.scene.as_ref().zip(light).map(|(scene, maps)| of_cells(scene, maps));
    let mut motions = Vec::new();
    let mut slots = Vec::new();
    for (nth, (post, judged)) in posts.iter().zip(&judged).enumerate() {
        let top = judged.iter().zip(std::mem::take(&mut hits[nth])).zip(&verdict.cuts[nth]).map(
            |((judged, body_hit), &cut)| Motions {
                cut,
                lateral_rapid: judged.lateral_rapid(&blank),
                body_hit,
                thin: None,
            },
        );
        let under: Vec<&plan::Program> = post.programs.iter().filter(up(Face::Underside)).collect();
        let mut of_faces = (top, underside::judge(shop, &tile, &under)?.into_iter());
        let in_order = post.programs.iter().filter_map(|program| match program.face {
            Face::Top => of_faces.0.next(),
            Face::Underside => of_faces.1.next(),
        });
        motions.push(in_order.collect());
        slots.push(tabs::slots(job, shop, &tile, &blank, judged));
    }
    drop(judged);
    drop(tops);
    Ok(TileResult {
        tile,
        posts,
        verdict,
        motions,
        slots,
        maps,
        map_factor,
        candidates: names,
        on_audience,
        findings: Vec::new(),
    })
}

/// For each post and program, where a shank or holder runs into metal.
fn body_hits(
    shop: &Shop,
    blank: &Blank,
    programs: &[Vec<&plan::Program>],
    judged: &[Vec<Judged>],
    progress: &dyn Progress,
) -> Vec<Vec<Option<BodyHit>>> {
    let nose_mm = shop.machine.spindle.nose_diameter_mm;
    let of_post = |(programs, judged): (&Vec<&plan::Program>, &Vec<Judged>)| {
        if progress.interrupted() {
            return vec![None; programs.len()];
        }
        let bodies: Vec<_> = programs.iter().map(|p| shop.tools[p.operation].cylinders(nose_mm)).collect();
        verify::body_hits(blank, judged, &bodies)
    };
    programs.iter().zip(judged).map(of_post).collect()
}

/// Pictures of the normals' errors and of lost light.
fn draw_means(
    staging: &Path,
    job: &Job,
    tile: &TileSetup,
    verdict: &Verdict,
    Pictures { normals, light }: &Pictures,
    step_mm: f64,
) -> Result<(), Error> {
    let at = &tile.setup.tile;
    let caption = |notes| Caption {
        part: job.name.clone(),
        tile: at.name.clone(),
        origin_mm: [at.x_mm, at.y_mm],
        notes,
    };
    let figures = verdict.tallies[0].figures();
    let degrees = |value: Option<f64>| value.map_or("-".into(), |deg| format!("{deg:.2}"));
    let note = format!(
        "half within {} degrees, 95 % within {}; by central differences every {} um, in the design and in the cut",
        degrees(figures.normal_p50_deg),
        degrees(figures.normal_p95_deg),
        1e3 * step_mm
    );
    let shape = light_picture::Frame {
        columns: normals.columns,
        rows: normals.rows,
        pitch_mm: step_mm * normals.factor as f64,
    };
    let means: Vec<f32> = normals.means().into_iter().map(|deg| deg as f32).collect();
    let path = staging.join("maps").join(format!("{}-normals.png", at.name));
    picture::write_png(&path, &light_picture::normals(&shape, &means, &caption(vec![note])))?;
    if let (Some([before, after]), Some(designed), Some(machined)) =
        (light, verdict.light_designed.shares(), verdict.light_machined.first().and_then(LightTally::shares))
    {
        let note = format!(
            "on the audience {:.2} % of what falls (the design {:.2} %), beside it {:.2} % ({:.2} %)",
            100.0 * machined.on_audience,
            100.0 * designed.on_audience,
            100.0 * machined.leak,
            100.0 * designed.leak
        );
        let lost = light_picture::lost(&before.means(), &after.means());
        let path = staging.join("maps").join(format!("{}-light.png", at.name));
        picture::write_png(&path, &light_picture::loss(&shape, &lost, &caption(vec![note])))?;
    }
    Ok(())
}

/// What a picture says at its foot.
fn notes(job: &Job, verdict: &Verdict) -> Vec<String> {
    let figures = verdict.tallies[0].figures();
    let um = |mm: f64| format!("{:.1} um", mm * 1e3);
    vec![
        format!(
            "sampled every {} um, judged on the read-back programs; deepest gouge {} of {} allowed",
            job.part.step_mm * 1e3,
            um(figures.gouge_max_mm),
            um(job.limits.gouge_or_default_mm())
        ),
        format!(
            "99 % of the area within {}; {} cavities deeper than 1 um on {:.2} % of it",
            um(figures.deviation_p99_mm.unwrap_or_default()),
            verdict.cavities.count,
            100.0 * figures.cavity_area_fraction.unwrap_or_default()
        ),
    ]
}

/// The metal around a tile, in the tile's frame.
fn blank(job: &Job, part: &Part, tile: &TileSetup) -> Blank {
    let margin_mm = job.stock.margin_mm;
    let lattice = tile.surface().lattice();
    let (low, high) = match job.stock.blanks {
        Blanks::PerTile => ([0.0; 2], [lattice.width_mm, lattice.height_mm]),
        Blanks::One => {
            let (at, size) = (&tile.setup.tile, part.size_mm());
            ([-at.x_mm, -at.y_mm], [size[0] - at.x_mm, size[1] - at.y_mm])
        }
    };
    Blank {
        low_mm: low.map(|v| v - margin_mm),
        high_mm: high.map(|v| v + margin_mm),
        top_mm: tile.allowance_mm,
    }
}

/// The library's cutters below the job's smallest, largest first.
fn candidates(shop: &Shop, step_mm: f64) -> Result<(Vec<String>, Vec<Profile>), Error> {
    let smallest = shop.shaping().map(|tool| tool.shape.radius_mm()).fold(f64::INFINITY, f64::min);
    let mut tools: Vec<_> = shop.library.tools.iter().collect();
    tools.retain(|tool| {
        let radius = tool.shape.radius_mm();
        radius < smallest && radius >= 2.0 * step_mm
    });
    tools.sort_by(|a, b| b.shape.radius_mm().total_cmp(&a.shape.radius_mm()).then(a.name.cmp(&b.name)));
    tools.truncate(CANDIDATES);
    let profiles =
        tools.iter().map(|tool| Profile::new(tool.shape, step_mm, 0.0)).collect::<Result<Vec<_>, _>>()?;
    Ok((tools.iter().map(|tool| tool.name.clone()).collect(), profiles))
}

impl TileResult {
    /// The figures of a post, by default the first.
    pub fn tally(&self, post: usize) -> &Tally {
        &self.verdict.tallies[post]
    }

    /// A place of the tile's frame in the part's.
    pub fn in_part(&self, place_mm: [f64; 2]) -> [f64; 2] {
        [self.tile.setup.tile.x_mm + place_mm[0], self.tile.setup.tile.y_mm + place_mm[1]]
    }

    /// The folder that a program is moved to when it must not be run.
    pub fn rejected(file: &Path) -> PathBuf {
        let name: PathBuf = file.components().skip(1).collect();
        Path::new("rejected").join(name)
    }
}
