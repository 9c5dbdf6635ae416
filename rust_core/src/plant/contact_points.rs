//! Points at which the walker may touch the ground.

use crate::mechanics::motion::{Motion, Point};

/// Contact points, in the order of every array over them.
pub const CONTACT_POINTS: usize = 4;
pub(super) const HEEL: usize = 0;
pub(super) const BALL: usize = 1;
/// Knee and hip touch the ground only in a fall.
pub(super) const KNEE: usize = 2;
pub(super) const HIP: usize = 3;

/// Position and velocity of the hip.
#[inline(always)]
pub(super) fn hip_point(motion: &Motion) -> Point {
    Point { x: motion.hip_x, y: motion.hip_y, vx: motion.hip_vx, vy: motion.hip_vy }
}
