use super::time::{Corner, Kinematics};
use crate::machine;

impl From<&machine::Machine> for Kinematics {
    /// What a profile says about motion. A byte takes ten bits of the line.
    fn from(profile: &machine::Machine) -> Kinematics {
        let (rate, motion) = (&profile.rate, &profile.motion);
        let axes = motion.acceleration_mm_s2;
        Kinematics {
            feed_max_mm_min: [rate.feed_xy_max_mm_min, rate.feed_xy_max_mm_min, rate.feed_z_max_mm_min],
            rapid_mm_min: [rate.rapid_xy_mm_min, rate.rapid_xy_mm_min, rate.rapid_z_mm_min],
            acceleration_mm_s2: [axes.x, axes.y, axes.z],
            corner: match motion.corner {
                machine::Corner::JunctionDeviation => Corner::JunctionDeviation { mm: motion.corner_mm },
                machine::Corner::Blend => Corner::Blend { mm: motion.corner_mm },
                machine::Corner::Stop => Corner::Stop,
            },
            look_ahead_blocks: motion.look_ahead_blocks as usize,
            block_s: motion.block_s,
            servo_period_s: motion.servo_period_s.unwrap_or(0.0),
            bytes_per_s: profile.transfer.baud.map(|baud| f64::from(baud) / 10.0),
        }
    }
}
