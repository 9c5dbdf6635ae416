//! Where the walker is and what pushes it from below: what a picture shows.

use crate::mechanics::motion::Point;
use crate::mechanics::walker;
use crate::numerics::math::sin_cos;
use crate::plant::contact_points::{BALL, HEEL, KNEE};
use crate::plant::outputs::PlantOutputs;

/// Where the parts of the walker are, (x, y) in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Skeleton {
    /// Top of the trunk; the hip is part of the state.
    pub trunk_top: [f64; 2],
    /// Knee.
    pub knee: [f64; 2],
    /// Ankle.
    pub ankle: [f64; 2],
    /// Heel.
    pub heel: [f64; 2],
    /// Ball.
    pub ball: [f64; 2],
}

impl<const L: usize> PlantOutputs<'_, L> {
    /// Where trunk and residual leg are.
    pub fn skeleton(&self, lane: usize) -> Skeleton {
        let motion = self.motion(lane);
        let (sin, cos) = sin_cos(self.trunk_angle(lane));
        let top = self.model.trunk_top[lane];
        let (knee, ankle) = if let Some((walker, work)) = self.general(lane) {
            (walker.point(work, KNEE), walker.ankle_point(work))
        } else {
            let kin = self.signals.kinematics.get(lane);
            (walker::knee_point(&motion, &kin), walker::foot_point(&motion, &kin, 0.0, 0.0))
        };
        let place = |point: Point| [point.x, point.y];
        Skeleton {
            trunk_top: [motion.hip_x - top * sin, motion.hip_y + top * cos],
            knee: place(knee),
            ankle: place(ankle),
            heel: place(self.foot_point(HEEL, lane)),
            ball: place(self.foot_point(BALL, lane)),
        }
    }

    /// Foot of the intact leg in the attitude that it touches down in, m: where it waits while it swings.
    pub fn touch_down_foot(&self, lane: usize) -> [f64; 2] {
        let (human, motion) = (self.model.human.get(lane), self.motion(lane));
        [motion.hip_x + human.leg_length * human.touch_down_sin, motion.hip_y - human.touch_down_height]
    }

    /// Ground force on the rear and on the front half of the sole, forward and up, N.
    pub fn sole_force(&self, lane: usize) -> [[f64; 2]; 2] {
        let [rear, front] = self
            .model
            .general
            .as_ref()
            .zip(self.signals.general.as_ref())
            .map_or([[0.0; 2]; 2], |(general, signals)| general.sole_force(signals, lane));
        let add = |point: usize, more: [f64; 2]| {
            let force = if self.model.level {
                self.ground_force::<true>(point, lane)
            } else {
                self.ground_force::<false>(point, lane)
            };
            [force.x + more[0], force.y + more[1]]
        };
        [add(HEEL, rear), add(BALL, front)]
    }
}
