use glam::DVec3;
use serde::Serialize;

use super::{
    AudienceMap, Curve, Grid, HIGH_GAIN_PEAK, Seat, SeatView, Tolerance, Wall, audience_map, gain_curves,
    misalignment, patch, seat_view, seats, wall,
};
use crate::progress::Progress;
use crate::screen::{self, Acuity, Calibration, Elevation, ElevationMethod, Error, Figures, Scene, View};

/// Side of the paper's first prototype, here the middle of the screen, in mm.
pub const FRAGMENT_MM: f64 = 200.0;
/// Cells along the longer side of the screen that views are worked out at.
const ACROSS: usize = 120;
/// The same for the mean over the screen from many places, and for misalignment.
const ACROSS_COARSE: usize = 30;
/// Cells along a side of the white patch, and of the fragment in its views.
const ACROSS_PATCH: usize = 15;
const ACROSS_FRAGMENT: usize = 50;
/// Places of the audience's map.
const PLACES: (usize, usize) = (60, 40);
const WALL: (usize, usize) = (150, 90);
/// Angles of the fragment's views in degrees, as the paper shows them.
const VIEWS_DEG: [f64; 5] = [-10.0, 0.0, 10.0, 20.0, 30.0];

/// Everything that the paper's section 5.2 shows, for one scene.
pub struct Evaluation {
    /// Eq. 9 on the flat screen, as the paper has it.
    pub flat: Figures,
    /// The calibration in use: of the elevated screen where the scene has one.
    pub calibration: Calibration,
    pub elevated: bool,
    pub size_m: [f64; 2],
    pub acuity: Acuity,
    /// Columns of the grid that the views are on.
    pub columns: usize,
    pub curves: Vec<Curve>,
    /// Largest and smallest gain with attenuation over the angles of the curve that lead well into the audience.
    pub gain_within: [f64; 2],
    /// Left, middle and right of the middle row of one audience.
    pub views: Vec<SeatView>,
    /// The same over all audiences, where the middle may be in none.
    pub pictures: Vec<SeatView>,
    pub map: AudienceMap,
    pub sections: Vec<Vec<DVec3>>,
    pub wall: Wall,
    pub wall_outlines: Vec<Vec<DVec3>>,
    /// Gain of the fragment's cells from each of the paper's angles, through the mask.
    pub fragment: Vec<(f64, Vec<f64>)>,
    pub fragment_columns: usize,
    pub tolerance: Vec<Tolerance>,
    pub claims: Vec<Claim>,
}

/// What the paper says in words, and what comes out here.
#[derive(Clone, Debug, Serialize)]
pub struct Claim {
    pub paper: String,
    pub here: String,
}

/// Works out everything, from the scene alone. None if it was interrupted. Errors: as of the scene's design.
pub fn evaluate(scene: &Scene, progress: &dyn Progress) -> Result<Option<Evaluation>, Error> {
    progress.begin("elevation and calibration", 1);
    let elevation: Option<Elevation> =
        (scene.elevation == ElevationMethod::Poisson).then(|| screen::elevation(scene)).transpose()?;
    let flat = screen::calibrate(scene, None)?;
    let (flat_figures, calibration) = match &elevation {
        None => (flat.figures, flat),
        Some(elevation) => (flat.figures, screen::calibrate(scene, Some(elevation))?),
    };
    let mask_of = |grid: &Grid| -> Vec<f64> {
        grid.cells.iter().map(|cell| calibration.mask_at(cell.point_m.truncate())).collect()
    };
    if progress.interrupted() {
        return Ok(None);
    }
    progress.begin("beams of the cells", 1);
    let fine = Grid::over(scene, elevation.as_ref(), ACROSS)?;
    let coarse = Grid::over(scene, elevation.as_ref(), ACROSS_COARSE)?;
    let white = patch(scene, elevation.as_ref(), FRAGMENT_MM, ACROSS_PATCH)?;
    let fragment = patch(scene, elevation.as_ref(), FRAGMENT_MM, ACROSS_FRAGMENT)?;
    if progress.interrupted() {
        return Ok(None);
    }
    progress.begin("gain", 1);
    let corners = || scene.audience.iter().flat_map(|p| p.vertices_m().iter().copied());
    let middle = corners().sum::<DVec3>() / corners().count().max(1) as f64;
    let white_mask = mask_of(&white);
    let mean_mask = white_mask.iter().sum::<f64>() / white_mask.len().max(1) as f64;
    let curves = gain_curves(&white, middle, mean_mask, &calibration.figures);
    let centre = white.cells.iter().map(|cell| cell.point_m).sum::<DVec3>() / white.cells.len().max(1) as f64;
    let gain_within = within(scene, &curves[0], &white, centre, middle);
    progress.begin("views from the audience", 1);
    let fine_mask = mask_of(&fine);
    let view = |seat: Seat| seat_view(&fine, &fine_mask, scene.projector_m, seat);
    let [one, all] = seats(scene);
    let (views, pictures) = (one.map(view), all.map(view));
    if progress.interrupted() {
        return Ok(None);
    }
    progress.begin("the audience", 1);
    let (low, high) =
        corners().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let grown = |low: f64, high: f64, part: f64| [low - part * (high - low), high + part * (high - low)];
    let (xs, zs) = (grown(low.x, high.x, 0.3), grown(low.z, high.z, 0.25));
    let inside = |p: DVec3| scene.audience.iter().any(|polyhedron| polyhedron.contains(p));
    let floor_m = 0.2 * low.z;
    let map = audience_map(
        &coarse,
        &mask_of(&coarse),
        ([xs[0], zs[0].max(floor_m)], [xs[1], zs[1]]),
        middle.y,
        PLACES,
        inside,
    );
    let ys = grown(low.y, high.y, 0.6);
    let wall = wall(&white, middle.z, [xs[0], ys[0]], [xs[1], ys[1]], WALL);
    let sections = scene.audience.iter().map(|p| super::section(p, DVec3::Y, middle.y));
    let sections: Vec<Vec<DVec3>> = sections.filter(|section| section.len() > 2).collect();
    let wall_outlines = scene.audience.iter().map(|p| super::thrown(p, centre, middle.z)).collect();
    if progress.interrupted() {
        return Ok(None);
    }
    progress.begin("fragment and misalignment", 1);
    let way = middle - centre;
    let lift = way.y.atan2(way.z);
    let fragment_mask = mask_of(&fragment);
    let fragment_views = VIEWS_DEG
        .iter()
        .map(|&angle| {
            let (sin, cos) = angle.to_radians().sin_cos();
            let place = centre + way.length() * DVec3::new(sin, cos * lift.sin(), cos * lift.cos());
            let gain = fragment.cells.iter().zip(&fragment_mask);
            (angle, gain.map(|(cell, mask)| mask * cell.gain_towards(place)).collect())
        })
        .collect();
    let tolerance = misalignment(scene, &coarse, &white);
    let claims = claims(&flat_figures, &calibration.figures, elevation.is_some(), gain_within, &views, &map);
    Ok(Some(Evaluation {
        flat: flat_figures,
        calibration,
        elevated: elevation.is_some(),
        size_m: [scene.width_m, scene.height_m],
        acuity: screen::acuity(scene),
        columns: fine.columns,
        curves,
        gain_within,
        views: views.into(),
        pictures: pictures.into(),
        map,
        sections,
        wall,
        wall_outlines,
        fragment: fragment_views,
        fragment_columns: fragment.columns,
        tolerance,
        claims,
    }))
}

/// Smallest and largest gain of a curve over angles whose rays meet the audience from every cell of the patch, and
/// two spreads of a beam to both sides of it too.
fn within(scene: &Scene, curve: &Curve, patch: &Grid, centre: DVec3, middle: DVec3) -> [f64; 2] {
    let lift = (middle - centre).y.atan2((middle - centre).z);
    let margin = 2.0 * patch.cells.iter().map(|cell| cell.spread_rad()).fold(0.0, f64::max);
    let views: Vec<View> = patch.cells.iter().map(|cell| scene.view(cell.point_m)).collect();
    let meets = |angle: f64| {
        let (sin, cos) = angle.sin_cos();
        let o = DVec3::new(sin, cos * lift.sin(), cos * lift.cos());
        views.iter().all(|view| view.hit(o))
    };
    let of_audience = curve.angle_deg.iter().zip(&curve.gain).filter(|(angle, _)| {
        let angle = angle.to_radians();
        meets(angle) && meets(angle - margin) && meets(angle + margin)
    });
    of_audience.fold([f64::INFINITY, 0.0], |[low, high], (_, &gain)| [low.min(gain), high.max(gain)])
}

fn claims(
    flat: &Figures,
    used: &Figures,
    elevated: bool,
    within: [f64; 2],
    views: &[SeatView],
    map: &AudienceMap,
) -> Vec<Claim> {
    let claim = |paper: &str, here: String| Claim { paper: paper.into(), here };
    let times = |value: f64| format!("{value:.2} times");
    let of_screens = |value: &dyn Fn(&Figures) -> String| -> String {
        if elevated {
            format!("{} by Eq. 9 on the flat screen, {} as elevated", value(flat), value(used))
        } else {
            format!("{} by Eq. 9", value(flat))
        }
    };
    let (mean, deviation) = map.inside_spread();
    let seats = |of: &dyn Fn(&SeatView) -> f64| {
        let list: Vec<String> = views.iter().map(|view| format!("{:.1} %", 100.0 * of(view))).collect();
        list.join(", ")
    };
    vec![
        claim(
            "the theatre's screen gives more than 8 times the light of a matte one, by attenuation (5.3)",
            format!(
                "{}; {:.2} to {:.2} times by the facets of a white patch, over its viewing angles",
                of_screens(&|f| times(f.gain_attenuation)),
                within[0],
                within[1]
            ),
        ),
        claim(
            "almost 3 times the brightest spot of a silver screen of gain 2.9 (5.3)",
            of_screens(&|f| times(f.gain_attenuation / HIGH_GAIN_PEAK)),
        ),
        claim(
            "20 % more by redirection, for each screen (5.2)",
            of_screens(&|f| format!("{:+.1} %", 100.0 * (f.gain_redirection / f.gain_attenuation - 1.0))),
        ),
        claim(
            "the screen's mean luminance varies very little over the audience (Fig. 11)",
            format!(
                "standard deviation {:.1} % of the mean, a gain of {mean:.2}, over the places of a horizontal plane \
                 inside the audience, its edge included",
                100.0 * deviation
            ),
        ),
        claim(
            "in one view, luminance keeps closer to its mean than on a high-gain screen (Fig. 12)",
            format!(
                "standard deviation over the screen from three seats: {}; high-gain model: {}",
                seats(&|view| view.deviation),
                seats(&|view| view.high_gain_deviation)
            ),
        ),
        claim(
            "two designs of Coleman et al. (Fig. 13), Crystal Screens, other commercial screens",
            "not shown: the paper draws the curves and prints no figures".into(),
        ),
    ]
}
