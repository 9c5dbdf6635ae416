//! What recorders, rewards and meters read off the human-prosthesis system after an evaluation.

use super::{DeviceTorque, HEEL, HumanProsthesis, State, hip_point};
use crate::compliant_ground::Contact;
use crate::human_controller::gait_fsm::Memory;
use crate::human_controller::{reference, slip_leg};
use crate::hybrid_dynamics::body::Body;
use crate::hybrid_dynamics::walker::{self, Point, Prescribed, Reactions};

/// Power of everything that does work on the segments, W; see [`HumanProsthesis::powers`].
pub const POWERS: [&str; 12] = [
    "hip",
    "trunk_rotation",
    "trunk_force",
    "push",
    "knee_command",
    "knee_spring",
    "knee_friction",
    "extension_stop",
    "flexion_stop",
    "ankle",
    "contact_normal",
    "contact_tangential",
];

impl<const L: usize> HumanProsthesis<L> {
    /// Memory of the human in `lane`.
    pub fn memory(&self, lane: usize) -> &Memory {
        &self.memory[lane]
    }

    /// Ground contact of point `point` in `lane` (0 heel, 1 ball), along and across the surface below it.
    pub fn contact(&self, point: usize, lane: usize) -> Contact {
        self.contacts[point].get(lane)
    }

    /// Position and velocity of heel (0) or ball (1).
    pub fn foot_point(&self, state: &State<L>, point: usize, lane: usize) -> Point {
        let kin = self.kinematics.get(lane);
        let (x, y) = if point == HEEL { (kin.heel_x, kin.heel_y) } else { (kin.ball_x, kin.ball_y) };
        walker::foot_point(&state.motion.get(lane), &kin, x, y)
    }

    /// Height of heel (0) or ball (1) above the ground below it, m.
    pub fn foot_height(&self, state: &State<L>, point: usize, lane: usize) -> f64 {
        let point = self.foot_point(state, point, lane);
        point.y - self.ground_height(lane, point.x)
    }

    /// Hip torque tau_4, N m.
    pub fn hip_torque(&self, lane: usize) -> f64 {
        self.hip_torque.torque[lane]
    }

    /// Device torques.
    pub fn device(&self, lane: usize) -> DeviceTorque {
        self.device.get(lane)
    }

    /// Force of the intact leg on the trunk.
    pub fn trunk_force(&self, lane: usize) -> slip_leg::TrunkForce {
        self.trunk_force.get(lane)
    }

    /// Mechanical constants.
    pub fn body(&self, lane: usize) -> Body {
        self.body.get(lane)
    }

    /// Prescribed trunk motion.
    pub fn prescribed(&self, lane: usize) -> Prescribed {
        self.prescribed.get(lane)
    }

    /// Rough thigh reference, rad.
    pub fn rough_thigh(&self, state: &State<L>, lane: usize) -> f64 {
        reference::rough_thigh(&self.drive.get(lane), state.rest.time[lane])
    }

    /// Foot of the intact leg's pendulum, m, and whether it stands on the ground.
    pub fn pendulum_foot(&self, lane: usize) -> (f64, bool) {
        (self.drive.slip_foot_x[lane], self.drive.slip_stiffness[lane] > 0.0)
    }

    /// Forces of the inverse-dynamics joints at the last evaluation.
    #[inline(always)]
    pub fn reactions(&self, state: &State<L>, lane: usize) -> Reactions {
        walker::reactions(
            &self.body.get(lane),
            &self.kinematics.get(lane),
            &state.motion.get(lane),
            &self.prescribed.get(lane),
            &self.loads::<false>(lane),
            &self.acceleration.get(lane),
        )
    }

    /// Kinetic and potential energy of segments and knee unit's rotor.
    pub fn energy(&self, state: &State<L>, lane: usize) -> walker::Energy {
        let (_, rotor) =
            self.unit.powers(lane, &self.joint.get(lane), &state.rotor.get(lane), &self.unit_torque.get(lane));
        let segments = walker::energy(
            &self.body.get(lane),
            &self.kinematics.get(lane),
            &state.motion.get(lane),
            &self.prescribed.get(lane),
        );
        walker::Energy { kinetic: segments.kinetic + rotor, ..segments }
    }

    /// Power of each of [`POWERS`] at the last evaluation, W; their sum is the rate of kinetic plus potential energy.
    pub fn powers(&self, state: &State<L>, lane: usize) -> [f64; POWERS.len()] {
        let motion = state.motion.get(lane);
        let kin = self.kinematics.get(lane);
        let knee_rate = motion.shank_rate - motion.thigh_rate;
        let device = self.device.get(lane);
        let (unit, _) =
            self.unit.powers(lane, &self.joint.get(lane), &state.rotor.get(lane), &self.unit_torque.get(lane));
        let trunk = self.trunk_force.get(lane);
        let prescribed = self.prescribed.get(lane);
        let points = [
            walker::foot_point(&motion, &kin, kin.heel_x, kin.heel_y),
            walker::foot_point(&motion, &kin, kin.ball_x, kin.ball_y),
            walker::knee_point(&motion, &kin),
            hip_point(&motion),
        ];
        let contacts = self.contacts.iter().zip(&self.surfaces).zip(&points).map(|((contact, surface), point)| {
            let (along, across) = surface.get(lane).along_and_across(point.vx, point.vy);
            (contact.normal[lane] * across, contact.tangential[lane] * along)
        });
        let (contact_normal, contact_tangential) =
            contacts.fold((0.0, 0.0), |sum, power| (sum.0 + power.0, sum.1 + power.1));
        [
            self.hip_torque.torque[lane] * (motion.thigh_rate - prescribed.rate),
            self.reactions(state, lane).trunk_torque * prescribed.rate,
            trunk.x * motion.hip_vx + trunk.y * motion.hip_vy,
            self.push_x[lane] * motion.hip_vx,
            unit[0],
            unit[1],
            unit[2],
            -device.extension_stop * knee_rate,
            device.flexion_stop * knee_rate,
            device.ankle * (motion.foot_rate - motion.shank_rate),
            contact_normal,
            contact_tangential,
        ]
    }
}
