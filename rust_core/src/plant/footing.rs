//! Where the walker meets the ground: contact points on level ground or terrain, and the force that each hands to the dynamics.
//!
//! On terrain a contact happens in the frame of the surface below the point: depth and normal force across the local slope,
//! deformation and friction along it. Level ground, chosen for a whole block, skips all of that.

use crate::mechanics::motion::{Motion, Point};
use crate::mechanics::{compliant_ground, walker};
use crate::plant::contact_force::touch;
use crate::plant::contact_points::{BALL, HEEL, HIP, KNEE, hip_point};
use crate::plant::state::{Rest, State};
use crate::plant::system::HumanProsthesis;

impl<const L: usize> HumanProsthesis<'_, L> {
    /// Contacts of the foot, and where the intact leg would find the ground.
    #[inline(always)]
    pub(super) fn sense_feet<const LEVEL: bool>(&mut self, state: &State<L>) {
        for lane in 0..L {
            let motion = state.motion.get(lane);
            let kin = self.signals.kinematics.get(lane);
            let ground = self.model.ground.get(lane);
            let heel = walker::foot_point(&motion, &kin, kin.heel_x, kin.heel_y);
            let ball = walker::foot_point(&motion, &kin, kin.ball_x, kin.ball_y);
            let (below_heel, below_ball) =
                (self.model.surface::<LEVEL>(lane, heel.x), self.model.surface::<LEVEL>(lane, ball.x));
            self.signals.contacts[HEEL].set(lane, touch::<LEVEL>(&ground, &below_heel, &heel, state.rest.heel[lane]));
            self.signals.contacts[BALL].set(lane, touch::<LEVEL>(&ground, &below_ball, &ball, state.rest.ball[lane]));
            self.signals.heel_force[lane] = self.signals.contacts[HEEL].normal[lane];
            self.signals.midfoot[lane] = heel.x + 0.5 * self.model.human.foot_length[lane] - motion.hip_x;
            if !LEVEL {
                self.signals.surfaces[HEEL].set(lane, below_heel);
                self.signals.surfaces[BALL].set(lane, below_ball);
            }
        }
        if !LEVEL {
            for lane in 0..L {
                let reach = self.model.human.leg_length[lane] * self.model.human.touch_down_sin[lane];
                self.signals.ground_ahead[lane] =
                    self.model.surface::<LEVEL>(lane, state.motion.hip_x[lane] + reach).height;
            }
        }
    }

    /// Contacts of knee and hip.
    #[inline(always)]
    pub(super) fn sense_fall<const LEVEL: bool>(&mut self, state: &State<L>) {
        if !LEVEL {
            for lane in 0..L {
                let hip_x = state.motion.hip_x[lane];
                let (below_knee, below_hip) = (
                    self.model.surface::<LEVEL>(lane, hip_x + self.signals.kinematics.thigh_x[lane]),
                    self.model.surface::<LEVEL>(lane, hip_x),
                );
                self.signals.surfaces[KNEE].set(lane, below_knee);
                self.signals.surfaces[HIP].set(lane, below_hip);
            }
        }
        // NaN is not above: what a diverged walker leaves behind must be recomputed once its lane starts anew.
        let above = |lane: usize| {
            let hip_y = state.motion.hip_y[lane];
            (hip_y > self.signals.surfaces[HIP].height[lane])
                & (hip_y + self.signals.kinematics.thigh_y[lane] > self.signals.surfaces[KNEE].height[lane])
        };
        let falls = !(0..L).all(above);
        if !(falls || self.signals.fall_contact) {
            return; // Contacts above ground are zero already; skipping them changes no result.
        }
        self.signals.fall_contact = falls;
        for lane in 0..L {
            let ground = self.model.ground.get(lane);
            let motion = state.motion.get(lane);
            let knee = walker::knee_point(&motion, &self.signals.kinematics.get(lane));
            let hip = hip_point(&motion);
            let (below_knee, below_hip) = (self.signals.surfaces[KNEE].get(lane), self.signals.surfaces[HIP].get(lane));
            self.signals.contacts[KNEE].set(lane, touch::<LEVEL>(&ground, &below_knee, &knee, state.rest.knee[lane]));
            self.signals.contacts[HIP].set(lane, touch::<LEVEL>(&ground, &below_hip, &hip, state.rest.hip[lane]));
        }
    }

    /// Whether any knee or hip touches the ground, or has left it deformed.
    #[inline(always)]
    pub(super) fn falls(&self, state: &State<L>) -> bool {
        self.signals.fall_contact || !(0..L).all(|lane| (state.rest.knee[lane] == 0.0) & (state.rest.hip[lane] == 0.0))
    }

    /// Rates of the ground's deformations for a walker whose motion has the given rates; without `falls`, knee and hip have
    /// left the ground undeformed.
    #[inline(always)]
    pub(super) fn deformation_rates<const LEVEL: bool>(
        &self,
        state: &State<L>,
        lane: usize,
        rates: &Motion,
        step: f64,
        falls: bool,
    ) -> Rest {
        let ground = self.model.ground.get(lane);
        let kin = self.signals.kinematics.get(lane);
        let deformation = state.rest.get(lane);
        // The velocities at the end of the step stand where `rates` has those of the positions.
        let end = &Motion {
            hip_vx: rates.hip_x,
            hip_vy: rates.hip_y,
            thigh_rate: rates.thigh,
            shank_rate: rates.shank,
            foot_rate: rates.foot,
            ..*rates
        };
        let follow = |point: usize, deformation: f64, velocity: Point| {
            let along = if LEVEL {
                velocity.vx
            } else {
                self.signals.surfaces[point].get(lane).along_and_across(velocity.vx, velocity.vy).0
            };
            compliant_ground::deformation_rate(
                &ground,
                &self.signals.contacts[point].get(lane),
                deformation,
                along,
                step,
            )
        };
        let (knee, hip) = if falls {
            (
                follow(KNEE, deformation.knee, walker::knee_point(end, &kin)),
                follow(HIP, deformation.hip, hip_point(end)),
            )
        } else {
            (0.0, 0.0)
        };
        Rest {
            time: 1.0,
            heel: follow(HEEL, deformation.heel, walker::foot_point(end, &kin, kin.heel_x, kin.heel_y)),
            ball: follow(BALL, deformation.ball, walker::foot_point(end, &kin, kin.ball_x, kin.ball_y)),
            knee,
            hip,
        }
    }
}
