//! `check`: what each cutter of the library cannot reach, in area and in light, and the smallest set of cutters that
//! keeps the job's limits. No paths are planned.

use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use super::cut::{distinct, setups};
use super::judge::blocks;
use super::light;
use super::measure::{Looked, MOST_CUTTERS, Measured};
use super::part::Part;
use super::plan::TileSetup;
use super::share::standard_error;
use super::shop::Shop;
use super::{Error, WITHIN, maps};
use crate::compensation::{self, Closings, Tables};
use crate::fidelity::light::{LightTally, View};
use crate::grid::Heights;
use crate::job::Job;
use crate::machine::Tool;
use crate::progress::Progress;
use crate::report::{Finding, Light, Severity, Verdict, finding};

/// Sets of cutters whose light and normals are worked out before the job is called infeasible.
const TRIED_SETS: usize = 4;

/// Standard errors from a limit within which a share of the area does not tell.
const NEAR: f64 = 3.0;

/// How much of a part is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Look {
    /// This part of the area, up to 1 for all of it.
    Share(f64),
    /// Under each cutter so many samples at most, and all of the part under the set that they come to.
    Most(u64),
}

impl Default for Look {
    /// Figures of so many samples of a screen are off by about a tenth of a per cent of the area, and a library takes
    /// less than a minute.
    fn default() -> Look {
        Look::Most(64_000_000)
    }
}

/// What one cutter, or a set, leaves of a part at best.
#[derive(Clone, Debug, Serialize)]
pub struct Reach {
    /// Names in the library.
    pub tools: Vec<String>,
    pub cutters: Vec<String>,
    /// Part of the area that is left standing by more than the job's deviation limit.
    pub unreachable_fraction: f64,
    /// Part of the area that is left standing by more than 1 um.
    pub cavity_area_fraction: f64,
    pub cavity_max_depth_mm: f64,
    pub normal_p95_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light: Option<Light>,
    /// Where a share of the area was looked at: standard errors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_error: Option<StandardError>,
    /// Why it cannot be used at all: stick-out, machine.
    pub refused: Option<String>,
}

/// How far figures that a share of the area gave are from those of all of it, in two cases of three.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct StandardError {
    pub unreachable_fraction: f64,
    pub cavity_area_fraction: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on_audience_machined: Option<f64>,
}

/// The answer of `check`.
#[derive(Clone, Debug, Serialize)]
pub struct Checked {
    pub schema: u32,
    pub screenmill: String,
    pub verdict: Verdict,
    pub deviation_mm: f64,
    pub tiles: usize,
    /// Part of the area that was looked at under each cutter, where that is not all of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub looked_at_fraction: Option<f64>,
    pub z_range_mm: f64,
    /// Each cutter by itself, as in the library.
    pub cutters: Vec<Reach>,
    /// The smallest set that keeps the limits.
    pub smallest_set: Option<Reach>,
    pub findings: Vec<Finding>,
}

/// One cutter under test.
pub(super) struct Candidate<'a> {
    pub tool: &'a Tool,
    pub tables: Tables,
    pub refused: Option<String>,
}

/// The design's light, and the audience as it is seen from the part.
struct Designed {
    light: LightTally,
    view: Option<View>,
}

/// Checks a job. With `out`, the cavities of the set (or of all cutters, if none will do) are written as maps there,
/// all of them however little was looked at.
pub fn check(
    job: &Job,
    folder: &Path,
    out: Option<&Path>,
    look: Look,
    progress: &dyn Progress,
) -> Result<Checked, Error> {
    let shop = Shop::open(job, folder)?;
    let part = Part::load(job, progress)?;
    part.check_light(job)?;
    let tiles = setups(job, &shop, &part)?;
    let candidates = candidates(job, &shop, &tiles)?;
    let usable: Vec<usize> = (0..candidates.len()).filter(|&i| candidates[i].refused.is_none()).collect();
    let whole = Facts { job, part: &part, tiles: &tiles, candidates: &candidates, share: 1.0 };
    // A set that some of the area found is measured on all of it, unless only a share was asked for.
    let (share, of_sets, near) = match look {
        Look::Share(share) => (share, Facts { share, ..whole }, 0.0),
        Look::Most(samples) => ((samples as f64 / whole.samples() as f64).min(1.0), whole, NEAR),
    };
    let job_facts = Facts { share, ..whole };
    let singles: Vec<Vec<usize>> = (0..candidates.len()).map(|i| vec![i]).collect();
    progress.begin("cutters one by one", job_facts.looked_at());
    let looked = job_facts.measure(&singles, progress)?;
    let designed = Designed { light: looked.designed, view: job_facts.view() };
    let mut cutters = Vec::new();
    for (index, measured) in looked.sets.iter().enumerate() {
        cutters.push(job_facts.reach(&[index], measured, &designed));
    }
    let mut smallest_set = None;
    let mut best: Vec<usize> = usable.clone();
    for set in sets(&usable, &looked.masks, job_facts.share, near).into_iter().take(TRIED_SETS) {
        let reach = match set[..] {
            [index] if of_sets.share == job_facts.share => cutters[index].clone(),
            _ => {
                progress.begin("the set that will do", of_sets.looked_at());
                let together = of_sets.measure(std::slice::from_ref(&set), progress)?;
                let designed = Designed { light: together.designed, view: designed.view.clone() };
                of_sets.reach(&set, &together.sets[0], &designed)
            }
        };
        if keeps(job, &reach) {
            best = set;
            smallest_set = Some(reach);
            break;
        }
    }
    let mut findings = Vec::new();
    for note in &part.notes {
        findings.push(finding(Severity::Warning, "input", note.clone()));
    }
    for candidate in &candidates {
        if let Some(why) = &candidate.refused {
            findings.push(finding(Severity::Warning, "cutter", why.clone()));
        }
    }
    if let Some(set) = &smallest_set
        && let Some(error) = set.standard_error
        && set.unreachable_fraction + NEAR * error.unreachable_fraction > 1.0 - WITHIN
    {
        let [percent, off] = [set.unreachable_fraction, error.unreachable_fraction].map(|part| 100.0 * part);
        let message = format!(
            "{} leave {percent:.2} +- {off:.2} % of the area out of the limit, 1 % is allowed: too near to tell by a share \
             of the area; hint: check without --share",
            set.tools.join(" and ")
        );
        findings.push(finding(Severity::Warning, "share", message));
    }
    if smallest_set.is_none() {
        findings.push(finding(Severity::Error, "unreachable", job_facts.why_not(&cutters)));
    }
    if let Some(out) = out {
        progress.begin("maps", job_facts.samples());
        job_facts.write_maps(&best, out, progress)?;
    }
    Ok(Checked {
        schema: 1,
        screenmill: env!("CARGO_PKG_VERSION").into(),
        verdict: if smallest_set.is_some() { Verdict::Pass } else { Verdict::Fail },
        deviation_mm: job.limits.deviation_or_default_mm(),
        tiles: tiles.len(),
        looked_at_fraction: (job_facts.share < 1.0)
            .then(|| job_facts.looked_at() as f64 / job_facts.samples() as f64),
        z_range_mm: part.whole.top_mm() - part.whole.bottom_mm(),
        cutters,
        smallest_set,
        findings,
    })
}

/// The library's cutters of distinct shapes, and why some cannot be used on this part.
fn candidates<'a>(job: &Job, shop: &'a Shop, tiles: &[TileSetup]) -> Result<Vec<Candidate<'a>>, Error> {
    let needs = tiles.iter().map(|tile| tile.need());
    let depth_mm = needs.map(|need| need.depth_mm + need.top_allowance_mm).fold(0.0, f64::max);
    let mut candidates: Vec<Candidate> = Vec::new();
    let tools = shop.library.tools.iter().chain(shop.shaping());
    for tool in tools.filter(|tool| tool.shape.radius_mm() >= job.part.step_mm) {
        if candidates.iter().any(|known| known.tool.shape == tool.shape) {
            continue;
        }
        let reach = tool.check_reach(depth_mm).err().map(|refusal| refusal.to_string());
        let machine = shop.machine.run(tool).err().map(|refusal| refusal.to_string());
        let profile = distinct(std::iter::once(tool.shape), job.part.step_mm)?.remove(0);
        candidates.push(Candidate { tool, tables: Tables::new(profile), refused: reach.or(machine) });
    }
    // The finest cutters decide, so they are the ones to keep where there are too many.
    candidates.sort_by(|a, b| a.tool.shape.radius_mm().total_cmp(&b.tool.shape.radius_mm()));
    candidates.truncate(MOST_CUTTERS);
    Ok(candidates)
}

/// Whether the limits on the shape and its light hold for a set.
fn keeps(job: &Job, reach: &Reach) -> bool {
    let limits = &job.limits;
    let normals = match (limits.normal_p95_deg, reach.normal_p95_deg) {
        (Some(limit), Some(value)) => value <= limit,
        _ => true,
    };
    let light = match (limits.on_audience_min, &reach.light) {
        (Some(limit), Some(light)) => light.on_audience_machined >= limit,
        _ => true,
    };
    reach.unreachable_fraction <= 1.0 - WITHIN && normals && light
}

/// Sets of usable cutters that leave at most 1 % of the area out of the limit, smallest first, then those with the
/// larger cutters. `masks[block][m]` counts the samples of a block that exactly the cutters of the bits of m reach.
/// Where a share of the area is looked at, also those that are `near` standard errors from this.
fn sets(usable: &[usize], masks: &[Vec<u64>], share: f64, near: f64) -> Vec<Vec<usize>> {
    let bits = usable.iter().fold(0usize, |bits, index| bits | 1 << index);
    // Few of all combinations occur.
    let occur =
        |block: &Vec<u64>| block.iter().copied().enumerate().filter(|(_, count)| *count > 0).collect();
    let blocks: Vec<Vec<(usize, u64)>> = masks.iter().map(occur).collect();
    let keep = |set: usize| {
        let [mut all_missed, mut total] = [0.0; 2];
        let mut by_block = Vec::with_capacity(blocks.len());
        for block in &blocks {
            let count = |out_of: usize| -> u64 {
                block.iter().filter(|(mask, _)| mask & out_of == 0).map(|(_, count)| count).sum()
            };
            let (missed, samples) = (count(set) as f64, count(0) as f64);
            by_block.push((missed, samples));
            all_missed += missed;
            total += samples;
        }
        let error = standard_error(&by_block, share).unwrap_or(0.0);
        all_missed <= (1.0 - WITHIN + near * error) * total
    };
    let mut found: Vec<usize> =
        (1..masks.first().map_or(0, Vec::len)).filter(|set| set & !bits == 0 && keep(*set)).collect();
    found.sort_by_key(|set| (set.count_ones(), std::cmp::Reverse(*set)));
    found
        .into_iter()
        .map(|set| usable.iter().copied().filter(|index| set >> index & 1 == 1).collect())
        .collect()
}

/// The part and the cutters that are tried on it.
#[derive(Clone, Copy)]
pub(super) struct Facts<'a> {
    pub job: &'a Job,
    pub part: &'a Part,
    pub tiles: &'a [TileSetup],
    pub candidates: &'a [Candidate<'a>],
    /// Part of the area that is looked at.
    pub share: f64,
}

impl Facts<'_> {
    fn samples(&self) -> u64 {
        self.tiles.iter().map(|tile| tile.surface().lattice()).map(|l| (l.columns * l.rows) as u64).sum()
    }

    fn reach(&self, set: &[usize], measured: &Measured, designed: &Designed) -> Reach {
        let figures = measured.tally.figures();
        let tools: Vec<&Tool> = set.iter().map(|&index| self.candidates[index].tool).collect();
        Reach {
            tools: tools.iter().map(|tool| tool.name.clone()).collect(),
            cutters: tools.iter().map(|tool| tool.shape.to_string()).collect(),
            unreachable_fraction: 1.0 - figures.within_limit_fraction.unwrap_or(0.0),
            cavity_area_fraction: figures.cavity_area_fraction.unwrap_or(0.0),
            cavity_max_depth_mm: figures.cavity_max_depth_mm.unwrap_or(0.0),
            normal_p95_deg: figures.normal_p95_deg,
            light: designed
                .view
                .as_ref()
                .and_then(|view| light::summary(&designed.light, &measured.light, view)),
            standard_error: self.standard_error(measured),
            refused: set.iter().find_map(|&index| self.candidates[index].refused.clone()),
        }
    }

    fn standard_error(&self, measured: &Measured) -> Option<StandardError> {
        if self.share >= 1.0 {
            return None;
        }
        let error = |of: fn(&Looked) -> (f64, f64)| {
            let squares: Vec<(f64, f64)> = measured.squares.iter().map(of).collect();
            standard_error(&squares, self.share)
        };
        Some(StandardError {
            unreachable_fraction: error(|square| (square.unreachable, square.samples))?,
            cavity_area_fraction: error(|square| (square.cavity, square.samples))?,
            on_audience_machined: error(|square| (square.on_audience, square.incident)),
        })
    }

    /// The audience as the part sees it.
    fn view(&self) -> Option<View> {
        let scene = self.part.scene.as_ref()?;
        let mut points = Vec::new();
        for tile in self.tiles {
            let pose = self.part.pose(self.job, &tile.piece)?;
            points.extend(light::points(&pose, &tile.surface().lattice()));
        }
        Some(light::view(scene, &points))
    }

    /// Which limit breaks first, by how much.
    fn why_not(&self, cutters: &[Reach]) -> String {
        let best = cutters
            .iter()
            .filter(|reach| reach.refused.is_none())
            .min_by(|a, b| a.unreachable_fraction.total_cmp(&b.unreachable_fraction));
        match best {
            Some(best) => format!(
                "no set of the library's cutters keeps the limits; the best single one, {}, leaves {:.2}{} % of the \
                 area more than {} mm too high, 1 % is allowed; hint: a smaller ball, a stitched dish, or a wider limit",
                best.tools.join(", "),
                100.0 * best.unreachable_fraction,
                best.standard_error
                    .map_or(String::new(), |error| format!(" +- {:.2}", 100.0 * error.unreachable_fraction)),
                self.job.limits.deviation_or_default_mm()
            ),
            None => "no cutter of the library can be used on this part; hint: see the findings".into(),
        }
    }

    fn write_maps(&self, set: &[usize], out: &Path, progress: &dyn Progress) -> Result<(), Error> {
        for tile in self.tiles {
            tile.piece.hold()?;
            let surface = tile.surface();
            let lattice = surface.lattice();
            let mut map = maps::CavityMap::create(out, &tile.setup.tile.name, &lattice, self.job.maps.full)?;
            let reach = set.iter().map(|&i| self.candidates[i].tables.profile().reach()).max().unwrap_or(0);
            for row in blocks(&lattice) {
                let done: Vec<(Heights, Heights)> = row
                    .par_iter()
                    .map_init(Closings::new, |closings, &window| {
                        let around = surface.heights(window.grown(2 * reach), surface.top_mm())?;
                        let design = around.crop(window);
                        let closing = self.closing(closings, &around, set, window);
                        let cavity = compensation::residual(&closing, &design);
                        progress.advance(window.samples() as u64);
                        Ok((design, cavity))
                    })
                    .collect::<Result<_, Error>>()?;
                map.push(&done, lattice.columns)?;
            }
            let names: Vec<&str> = set.iter().map(|&i| self.candidates[i].tool.name.as_str()).collect();
            let at = &tile.setup.tile;
            let note = format!(
                "what {} leave at best, sampled every {} um",
                names.join(", "),
                lattice.step_mm * 1e3
            );
            map.finish(&self.job.name, [at.x_mm, at.y_mm], note)?;
            self.done(tile);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_set_comes_first() {
        // Cutter 0 reaches 60, cutter 1 50, cutter 2 nothing more; together 0 and 1 reach all.
        let mut masks = vec![0u64; 8];
        masks[0b001] = 50;
        masks[0b011] = 10;
        masks[0b010] = 40;
        let sets = |usable: &[usize], masks: &[u64]| sets(usable, &[masks.to_vec()], 1.0, 0.0);
        assert_eq!(sets(&[0, 1, 2], &masks)[0], vec![0, 1]);
        assert!(sets(&[0, 2], &masks).is_empty());
        masks[0b100] = 10_000;
        assert_eq!(sets(&[0, 1, 2], &masks)[0], vec![2]);
    }

    #[test]
    fn a_share_also_gives_the_sets_that_may_do() {
        // Cutter 0 misses 1.2 % of what was looked at, more in some blocks than in others; cutter 1 misses 5 %.
        let block = |missed: u64| vec![missed.min(50), 0, missed.saturating_sub(50), 1000 - missed];
        let mut blocks: Vec<Vec<u64>> = [2, 30, 4, 20, 6, 10].map(block).to_vec();
        for block in &mut blocks {
            // What 0 reaches and 1 does not.
            (block[0b01], block[0b11]) = (40, block[0b11] - 40);
        }
        assert!(sets(&[0, 1], &blocks, 0.1, 0.0).is_empty());
        assert!(sets(&[0, 1], &blocks, 1.0, 3.0).is_empty(), "all of it has no error");
        assert_eq!(sets(&[0, 1], &blocks, 0.1, 3.0)[0], vec![0]);
    }
}
