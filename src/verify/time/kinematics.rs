use super::{Corner, Kinematics};
use crate::machine;

/// Grbl's $12 as delivered.
const GRBL_ARC_MM: f64 = 0.002;
/// LinuxCNC's SERVO_PERIOD as delivered.
const SERVO_PERIOD_S: f64 = 0.001;

impl From<&machine::Machine> for Kinematics {
    /// What a profile says about motion. A byte takes ten bits of the line.
    fn from(profile: &machine::Machine) -> Kinematics {
        let (rate, motion) = (&profile.rate, &profile.motion);
        let axes = motion.acceleration_mm_s2;
        Kinematics {
            feed_max_mm_min: [rate.feed_xy_max_mm_min, rate.feed_xy_max_mm_min, rate.feed_z_max_mm_min],
            rapid_mm_min: [rate.rapid_xy_mm_min, rate.rapid_xy_mm_min, rate.rapid_z_mm_min],
            acceleration_mm_s2: [axes.x, axes.y, axes.z],
            path_max_mm_min: motion.path_max_mm_min.unwrap_or(f64::INFINITY),
            corner: match motion.corner {
                machine::Corner::JunctionDeviation => Corner::JunctionDeviation { mm: motion.corner_mm },
                machine::Corner::Blend => Corner::Blend { mm: motion.corner_mm },
                machine::Corner::Stop => Corner::Stop,
            },
            arc_mm: motion.arc_mm.unwrap_or(GRBL_ARC_MM),
            look_ahead_blocks: motion.look_ahead_blocks as usize,
            block_s: motion.block_s,
            servo_period_s: motion.servo_period_s.unwrap_or(match motion.corner {
                machine::Corner::Blend => SERVO_PERIOD_S,
                _ => 0.0,
            }),
            bytes_per_s: profile.transfer.baud.map(|baud| f64::from(baud) / 10.0),
        }
    }
}
