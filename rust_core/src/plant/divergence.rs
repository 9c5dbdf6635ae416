//! What only a diverged integration reaches.

use crate::numerics::math::max;
use crate::plant::outputs::PlantOutputs;

/// Torque of the extension stop that only a diverged integration reaches, N m: impacts of walking stay below 200.
const DIVERGED_NM: f64 = 5000.0;
/// Rotation that only a diverged integration reaches, rad/s: walking stays below 20, impacts in a fall below 100.
const DIVERGED_RAD_S: f64 = 300.0;

impl<const L: usize> PlantOutputs<'_, L> {
    /// Whether the integration of the walker in `lane` has diverged since its extension stop's peak was last cleared: its state
    /// is not finite, or a segment or the stop does what none can.
    #[inline(always)]
    pub fn diverged(&self, lane: usize) -> bool {
        let motion = self.motion(lane);
        let fastest = max(max(motion.thigh_rate.abs(), motion.shank_rate.abs()), motion.foot_rate.abs());
        !self.state.checksum(lane).is_finite()
            | (fastest > DIVERGED_RAD_S)
            | (self.walkers.extension_stop_peak[lane] > DIVERGED_NM)
    }
}
