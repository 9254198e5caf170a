//! `report.html`: the verdict first, then what was found, the figures beside their limits, and the maps.

use std::path::Path;

use serde::Serialize;

use super::format::{degrees, duration, fixed, micrometres, percent};
use super::template::{self, Template};
use super::{Error, Fidelity, Finding, Parts, Report};

/// What the pages show beside the report itself.
#[derive(Clone, Debug)]
pub struct Page<'a> {
    /// Name of the job.
    pub title: String,
    /// One line: machine, blank, cutters.
    pub subtitle: String,
    pub report: &'a Report,
    pub limits: Limits,
    /// The picture of all tiles, where there are several.
    pub screen_map: Option<String>,
    pub pictures: Vec<Picture>,
    /// The largest cavities; about 20 read well.
    pub cavities: Vec<CavityRow>,
    /// Cavities that `cavities.csv` lists and that exist in all.
    pub cavities_listed: u64,
    /// Command lines that check the programs again.
    pub commands: Vec<String>,
    /// Sentences on how exact the figures are.
    pub accuracy: Vec<String>,
}

/// The job's limits, as far as it names them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    pub gouge_mm: Option<f64>,
    /// 99 % of the area lie within.
    pub deviation_mm: Option<f64>,
    pub normal_p95_deg: Option<f64>,
    pub on_audience_min: Option<f64>,
    pub hours_max: Option<f64>,
}

/// A picture of a map.
#[derive(Clone, Debug, Serialize)]
pub struct Picture {
    pub tile: String,
    /// `design`, `machined`, `deviation` or `cavity`.
    pub name: String,
    /// The PNG, relative to the page.
    pub file: String,
    /// The map itself, relative to the page.
    pub map_file: String,
}

/// A line of the list of cavities.
#[derive(Clone, Debug, Serialize)]
pub struct CavityRow {
    pub tile: String,
    pub centre_mm: [f64; 2],
    pub area_mm2: f64,
    pub depth_mm: f64,
    pub volume_mm3: f64,
    /// Empty when no cutter at hand reaches it.
    pub reached_by: String,
}

/// A figure, its limit and whether it holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KeyFigure {
    pub label: &'static str,
    pub value: String,
    /// Empty without a limit.
    pub limit: String,
    pub within: Option<bool>,
}

/// The figures of a report beside its limits, in the order people ask for them.
pub fn key_figures(report: &Report, limits: &Limits) -> Vec<KeyFigure> {
    let mut figures = Vec::new();
    if let Some(fidelity) = &report.fidelity {
        cut_figures(fidelity, limits, &mut figures);
    }
    if let Some(light) = &report.light {
        let (now, before) = (light.on_audience_machined, light.on_audience_designed);
        let value = format!("{} (design {})", percent(now), percent(before));
        figures.push(limited("Light on the audience", value, now, limits.on_audience_min, false, percent));
        let pairs = [
            ("Gain", light.gain_machined, light.gain_designed),
            ("Uniformity over the audience", light.uniformity_machined, light.uniformity_designed),
            (
                "Uniformity over the screen",
                light.screen_uniformity_machined,
                light.screen_uniformity_designed,
            ),
        ];
        for (label, machined, designed) in pairs {
            if let (Some(machined), Some(designed)) = (machined, designed) {
                figures.push(plain(label, format!("{machined:.3} (design {designed:.3})")));
            }
        }
    }
    let hours = report.time_s.total / 3600.0;
    figures.push(limited(
        "Machine time",
        duration(report.time_s.total),
        hours,
        limits.hours_max,
        true,
        |hours| duration(hours * 3600.0),
    ));
    figures
}

fn cut_figures(fidelity: &Fidelity, limits: &Limits, figures: &mut Vec<KeyFigure>) {
    let gouge_mm = fidelity.gouge_max_mm;
    figures.push(limited(
        "Deepest gouge",
        micrometres(gouge_mm),
        gouge_mm,
        limits.gouge_mm,
        true,
        micrometres,
    ));
    if let (Some(fraction), Some(limit_mm)) = (fidelity.within_limit_fraction, limits.deviation_mm) {
        let limit = |least| format!("{} within {}", percent(least), micrometres(limit_mm));
        figures.push(limited(
            "Area within the deviation",
            percent(fraction),
            fraction,
            Some(0.99),
            false,
            limit,
        ));
    }
    let mut measured = |label, value: Option<f64>, show: fn(f64) -> String| {
        figures.extend(value.map(|value| plain(label, show(value))));
    };
    measured("Deviation, half of the area within", fidelity.deviation_p50_mm, micrometres);
    measured("Deviation, 99 % of the area within", fidelity.deviation_p99_mm, micrometres);
    measured("Most material left standing", Some(fidelity.excess_max_mm), micrometres);
    measured("Normals' error, half of the area within", fidelity.normal_p50_deg, degrees);
    if let Some(p95) = fidelity.normal_p95_deg {
        let limit = limits.normal_p95_deg;
        figures.push(limited("Normals' error, 95 % within", degrees(p95), p95, limit, true, degrees));
    }
    let mut measured = |label, value: Option<f64>, show: fn(f64) -> String| {
        figures.extend(value.map(|value| plain(label, show(value))));
    };
    measured("Area that no cutter reaches", fidelity.cavity_area_fraction, percent);
    measured("Deepest cavity", fidelity.cavity_max_depth_mm, micrometres);
    measured("Cavities", fidelity.cavities.map(|count| count as f64), |count| fixed(count, 0));
}

fn plain(label: &'static str, value: String) -> KeyFigure {
    KeyFigure { label, value, limit: String::new(), within: None }
}

fn limited(
    label: &'static str,
    value: String,
    figure: f64,
    limit: Option<f64>,
    at_most: bool,
    show: impl Fn(f64) -> String,
) -> KeyFigure {
    let Some(limit) = limit else { return plain(label, value) };
    let words = if at_most { "at most" } else { "at least" };
    let within = if at_most { figure <= limit } else { figure >= limit };
    KeyFigure { label, value, limit: format!("{words} {}", show(limit)), within: Some(within) }
}

/// A bar of a chart: a named part and how much of the longest it is.
#[derive(Clone, Debug, Serialize)]
struct Bar {
    name: String,
    seconds: f64,
    share: f64,
    length: f64,
}

fn bars(parts: &Parts) -> Vec<Bar> {
    let sum: f64 = parts.0.iter().map(|(_, seconds)| seconds).sum();
    let longest = parts.0.iter().map(|&(_, seconds)| seconds).fold(0.0, f64::max);
    let of = |seconds: f64, whole: f64| if whole > 0.0 { seconds / whole } else { 0.0 };
    let bar = |(name, seconds): &(String, f64)| Bar {
        name: name.clone(),
        seconds: *seconds,
        share: of(*seconds, sum),
        length: of(*seconds, longest),
    };
    parts.0.iter().map(bar).collect()
}

/// Writes the page, whole or not at all.
pub fn write_report(path: &Path, page: &Page) -> Result<(), Error> {
    let report = page.report;
    let mut findings: Vec<&Finding> = report.findings.iter().collect();
    findings.sort_by_key(|finding| finding.severity);
    let filled = Filled {
        title: &page.title,
        subtitle: &page.subtitle,
        report,
        findings,
        figures: key_figures(report, &page.limits),
        by_operation: bars(&report.time_s.by_operation),
        by_tool: bars(&report.time_s.by_tool),
        gouge_limit_mm: page.limits.gouge_mm,
        gouge_budget_sum_mm: report.fidelity.as_ref().map(|fidelity| fidelity.gouge_budget_mm.total_mm()),
        screen_map: page.screen_map.as_deref(),
        pictures: &page.pictures,
        cavities: &page.cavities,
        cavities_listed: page.cavities_listed,
        commands: &page.commands,
        accuracy: &page.accuracy,
    };
    template::write(path, Template::Report, &filled)
}

/// What the template reads.
#[derive(Serialize)]
struct Filled<'a> {
    title: &'a str,
    subtitle: &'a str,
    report: &'a Report,
    findings: Vec<&'a Finding>,
    figures: Vec<KeyFigure>,
    by_operation: Vec<Bar>,
    by_tool: Vec<Bar>,
    gouge_limit_mm: Option<f64>,
    gouge_budget_sum_mm: Option<f64>,
    screen_map: Option<&'a str>,
    pictures: &'a [Picture],
    cavities: &'a [CavityRow],
    cavities_listed: u64,
    commands: &'a [String],
    accuracy: &'a [String],
}
