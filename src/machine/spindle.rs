use super::profile::{Spindle, SpindleLaw};

/// What a program says to set the spindle, and what the machine makes of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpindleSetting {
    /// The speed that comes out, by the profile's law.
    pub rpm: f64,
    /// The code that stands for it, on machines that take codes.
    pub code: Option<u8>,
    /// The operator has to set it.
    pub by_hand: bool,
}

impl Spindle {
    /// The setting nearest to `rpm`; None outside the spindle's range.
    pub fn setting(&self, rpm: f64) -> Option<SpindleSetting> {
        if !(rpm >= self.rpm_min && rpm <= self.rpm_max) {
            return None;
        }
        let coded = |first: u8| {
            let step = (self.rpm_max - self.rpm_min) / f64::from(15 - first);
            let above = if step > 0.0 { ((rpm - self.rpm_min) / step).round() } else { 0.0 };
            let code = Some(first + above as u8);
            SpindleSetting { rpm: self.rpm_min + above * step, code, by_hand: false }
        };
        Some(match self.set {
            SpindleLaw::Rpm => SpindleSetting { rpm, code: None, by_hand: false },
            SpindleLaw::ByHand => SpindleSetting { rpm, code: None, by_hand: true },
            SpindleLaw::CodeFrom0 => coded(0),
            SpindleLaw::CodeFrom1 => coded(1),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    #[test]
    fn both_published_laws_agree_at_the_top_and_differ_below() {
        let mut spindle = Machine::find("roland-egx-600", None).expect("embedded").spindle;
        let at = |spindle: &Spindle, rpm: f64| {
            let setting = spindle.setting(rpm).expect("in range");
            (setting.code.expect("a coded law"), setting.rpm.round())
        };
        spindle.set = SpindleLaw::CodeFrom0;
        assert_eq!(at(&spindle, 8000.0), (0, 8000.0));
        assert_eq!(at(&spindle, 20000.0), (8, 19733.0));
        assert_eq!(at(&spindle, 24000.0), (11, 24133.0));
        assert_eq!(at(&spindle, 30000.0), (15, 30000.0));
        spindle.set = SpindleLaw::CodeFrom1;
        assert_eq!(at(&spindle, 8000.0), (1, 8000.0));
        assert_eq!(at(&spindle, 20000.0), (9, 20571.0));
        assert_eq!(at(&spindle, 30000.0), (15, 30000.0));
        assert!(spindle.setting(7999.0).is_none() && spindle.setting(f64::NAN).is_none());
    }
}
