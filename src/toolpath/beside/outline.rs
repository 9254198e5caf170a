use super::super::pen::Pen;
use super::super::{Error, Site, Toolpath};

/// Runs in air around rectangles (lowest and highest X and Y, tile frame), one after the other, `above_mm` over
/// the stock's top: an operator sees where the work lies before anything is cut.
pub fn outline(site: &Site, rectangles_mm: &[[[f64; 2]; 2]], above_mm: f64) -> Result<Toolpath, Error> {
    site.validate(0.0)?;
    if !(above_mm > 0.0 && above_mm <= site.clearance_mm) {
        return Err(Error::Number {
            name: "above_mm",
            value: above_mm,
            wanted: "above 0 and no higher than the clearance plane",
        });
    }
    let z_mm = site.top_allowance_mm + above_mm;
    let mut pen = Pen::new(site);
    for [low, high] in rectangles_mm {
        let corner = |x: f64, y: f64| site.nearest([x, y], z_mm);
        let first = corner(low[0], low[1]);
        let top = pen.top();
        pen.begin(first, top);
        for to in [corner(high[0], low[1]), corner(high[0], high[1]), corner(low[0], high[1]), first] {
            pen.cut(to);
        }
    }
    Ok(pen.finish())
}
