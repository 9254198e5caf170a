use super::super::pen::Pen;
use super::super::{Error, GridPoint, Site, Toolpath};
use crate::cutter::Shape;

/// A bridge of metal between a tile and its blank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tab {
    /// On each side of the tile.
    pub count: u32,
    pub width_mm: f64,
    /// From the blank's underside.
    pub height_mm: f64,
}

/// A slot around the tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutOut {
    pub shape: Shape,
    /// Of a turn.
    pub stepdown_mm: f64,
    pub thickness_mm: f64,
    /// Past the blank's underside; below 0 a skin is left.
    pub through_mm: f64,
    /// What may be cut under the blank.
    pub sacrificial_mm: f64,
    pub tab: Option<Tab>,
}

/// A corner of the way, or where it rises onto a tab or comes down from one.
struct Station {
    at: [i32; 2],
    /// Units from the start.
    way: f64,
    /// Whether a tab stands between this station and the next.
    tab: bool,
}

/// Winds down around the tile, clockwise, so that the tile is on the right and the cutter climbs. The cutter enters
/// along the slot, never straight down into solid metal but behind a tab, and there by a turn's depth.
pub fn cut_out(site: &Site, params: &CutOut) -> Result<Toolpath, Error> {
    site.validate(params.shape.radius_mm())?;
    let diameter_mm = 2.0 * params.shape.radius_mm();
    let depth_mm = params.thickness_mm + params.through_mm;
    if params.through_mm > params.sacrificial_mm + 1e-9 {
        return Err(Error::Deep { depth_mm, most_mm: params.thickness_mm + params.sacrificial_mm });
    }
    if depth_mm.is_nan() || depth_mm < site.unit_mm {
        let (name, value) = ("through_mm", params.through_mm);
        return Err(Error::Number { name, value, wanted: "a skin thinner than the blank" });
    }
    let stepdown_mm = params.stepdown_mm;
    if stepdown_mm.is_nan() || stepdown_mm < site.unit_mm {
        return Err(Error::Stepdown { stepdown_mm, unit_mm: site.unit_mm });
    }
    if params.tab.is_some() && diameter_mm >= site.margin_mm {
        let cutter = params.shape.to_string();
        return Err(Error::Slot { cutter, needed_mm: diameter_mm, margin_mm: site.margin_mm });
    }
    let stations = stations(site, params)?;
    let around = stations[stations.len() - 1].way;
    let top_mm = site.top_allowance_mm;
    let floor_mm = top_mm - depth_mm;
    let tab = match params.tab {
        None => i32::MIN,
        Some(Tab { height_mm, .. })
            if height_mm >= params.thickness_mm || height_mm <= -params.through_mm =>
        {
            return Err(Error::TabHeight { height_mm, depth_mm });
        }
        Some(tab) => site.unit_above(top_mm - params.thickness_mm + tab.height_mm),
    };
    let turns = (depth_mm / stepdown_mm - 1e-9).ceil().max(1.0) as usize;
    let mut pen = Pen::new(site);
    let start = stations[0].at;
    let first: GridPoint = [start[0], start[1], pen.top()];
    pen.begin(first, pen.top());
    // The last turn is level.
    for turn in 0..=turns {
        let level = |way: f64| {
            let turned = (turn as f64 + way / around).min(turns as f64);
            site.unit_above(floor_mm + depth_mm * (1.0 - turned / turns as f64))
        };
        for pair in stations.windows(2) {
            let [[x, y], [to_x, to_y]] = [pair[0].at, pair[1].at];
            let (from, to) = (level(pair[0].way), level(pair[1].way));
            if pair[0].tab {
                pen.cut([x, y, from.max(tab)]);
                pen.cut([to_x, to_y, to.max(tab)]);
                pen.cut([to_x, to_y, to]);
            } else {
                pen.cut([to_x, to_y, to]);
            }
        }
    }
    Ok(pen.finish())
}

/// The way around the tile from its lower left corner and back there.
fn stations(site: &Site, params: &CutOut) -> Result<Vec<Station>, Error> {
    let lattice = site.surface.lattice();
    let radius = params.shape.radius_mm();
    // Rounded away from the tile.
    let low = -(radius / site.unit_mm - 1e-6).ceil() as i32;
    let high = |length_mm: f64| ((length_mm + radius) / site.unit_mm - 1e-6).ceil() as i32;
    let (right, back) = (high(lattice.width_mm), high(lattice.height_mm));
    let corners = [[low, low], [low, back], [right, back], [right, low], [low, low]];
    let mut out: Vec<Station> = Vec::new();
    let mut way = 0.0;
    for (side, pair) in corners.windows(2).enumerate() {
        let length = f64::from((pair[1][0] - pair[0][0]).abs() + (pair[1][1] - pair[0][1]).abs());
        let step = [0, 1].map(|axis| (pair[1][axis] - pair[0][axis]).signum());
        out.push(Station { at: pair[0], way, tab: false });
        if let Some(tab) = params.tab {
            let side_mm = [lattice.height_mm, lattice.width_mm][side % 2];
            let zone_mm = tab.width_mm + 2.0 * radius;
            let needed_mm = zone_mm * f64::from(tab.count);
            if needed_mm >= side_mm {
                let Tab { count: tabs, width_mm, .. } = tab;
                return Err(Error::Tabs { tabs, width_mm, needed_mm, side_mm });
            }
            let half = (0.5 * zone_mm / site.unit_mm).ceil();
            for k in 0..tab.count {
                let middle = (length * (f64::from(k) + 0.5) / f64::from(tab.count)).round();
                for (along, tab) in [(middle - half, true), (middle + half, false)] {
                    let at = [0, 1].map(|axis| pair[0][axis] + step[axis] * along as i32);
                    out.push(Station { at, way: way + along, tab });
                }
            }
        }
        way += length;
    }
    out.push(Station { at: corners[0], way, tab: false });
    Ok(out)
}
