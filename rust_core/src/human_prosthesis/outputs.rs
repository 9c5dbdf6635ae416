//! What recorders, rewards and meters read off the human-prosthesis system after an evaluation.

use super::{BALL, DeviceTorque, EndJoints, HEEL, HumanProsthesis, State, hip_point};
use crate::compliant_ground::Contact;
use crate::human_controller::gait_fsm::Memory;
use crate::human_controller::{reference, slip_leg};
use crate::hybrid_dynamics::body::Body;
use crate::hybrid_dynamics::walker::{self, Point, Prescribed, Reactions};
use crate::signals::GRAVITY;
use crate::terrain::Surface;

/// Power of everything that does work on the segments, W; see [`HumanProsthesis::powers`].
pub const POWERS: [&str; 14] = [
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
    "socket",
    "tube",
];

/// Stump against socket (section 5.2.3).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Socket {
    /// The leg's shift into the stump, m.
    pub pistoning: f64,
    /// Tilt, rad.
    pub tilt: f64,
    /// F_s, N, positive in compression.
    pub force: f64,
    /// M_s, N m.
    pub moment: f64,
}

/// Acceleration less gravity in the frame of a segment, m/s^2: what an accelerometer senses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpecificForce {
    /// Forward across the segment.
    pub forward: f64,
    /// Up along the segment.
    pub up: f64,
}

/// Specific force `below` (m) under the upper joint of a segment with unit vector `down` and the given joint acceleration
/// (m/s^2), angular velocity (rad/s) and acceleration (rad/s^2).
#[inline(always)]
fn specific_force(
    [down_x, down_y]: [f64; 2],
    [joint_ax, joint_ay]: [f64; 2],
    rate: f64,
    acceleration: f64,
    below: f64,
) -> SpecificForce {
    let lift = joint_ay + GRAVITY;
    SpecificForce {
        forward: down_x * lift - down_y * joint_ax + acceleration * below,
        up: rate * rate * below - down_x * joint_ax - down_y * lift,
    }
}

impl<const L: usize> HumanProsthesis<L> {
    /// Memory of the human in `lane`.
    pub fn memory(&self, lane: usize) -> &Memory {
        &self.memory[lane]
    }

    /// Ground contact of point `point` in `lane` (0 heel, 1 ball), along and across the surface below it.
    pub fn contact(&self, point: usize, lane: usize) -> Contact {
        self.contacts[point].get(lane)
    }

    /// Normal force on the rear and on the front half of the sole, N: heel and ball, where there are no other points.
    pub fn sole_load(&self, lane: usize) -> [f64; 2] {
        let [rear, front] = self.general.as_ref().map_or([0.0; 2], |general| general.sole_load(lane));
        [self.contacts[HEEL].normal[lane] + rear, self.contacts[BALL].normal[lane] + front]
    }

    /// Knee flexion, rad.
    pub fn knee_flexion(&self, lane: usize) -> f64 {
        self.joint.flexion[lane]
    }

    /// Angles of hip and ankle to their proximal segments.
    pub fn joints(&self, lane: usize) -> EndJoints {
        self.joints.get(lane)
    }

    /// Trunk angle, rad.
    pub fn trunk_angle(&self, state: &State<L>, lane: usize) -> f64 {
        match &state.general {
            Some(extra) if self.trunk_forward() => extra.deflection.trunk[lane],
            _ => state.reference.trunk[lane],
        }
    }

    /// Position and velocity of heel (0) or ball (1).
    pub fn foot_point(&self, state: &State<L>, point: usize, lane: usize) -> Point {
        if let Some(general) = &self.general {
            return general.walker.point(&general.evaluations[lane], point);
        }
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

    /// Forces of trunk and tube joints at the last evaluation.
    #[inline(always)]
    pub fn reactions(&self, state: &State<L>, lane: usize) -> Reactions {
        if let Some(general) = &self.general {
            let forces = general.walker.forces(&general.evaluations[lane]);
            let [tube_force, tube_torque] = forces.tube;
            return Reactions { trunk_torque: forces.trunk, tube_force, tube_torque };
        }
        walker::reactions(
            &self.body.get(lane),
            &self.kinematics.get(lane),
            &state.motion.get(lane),
            &self.prescribed.get(lane),
            &if self.level { self.loads::<true>(lane) } else { self.loads::<false>(lane) },
            &self.acceleration.get(lane),
        )
    }

    /// Specific force at the inertial sensors of thigh and shank, mounted so far (m) below hip and knee.
    #[inline(always)]
    pub fn specific_forces(&self, state: &State<L>, lane: usize, thigh: f64, shank: f64) -> [SpecificForce; 2] {
        if let Some(general) = &self.general {
            return general
                .walker
                .specific_forces(&general.evaluations[lane], thigh, shank)
                .map(|[forward, up]| SpecificForce { forward, up });
        }
        let motion = state.motion.get(lane);
        let kin = self.kinematics.get(lane);
        let acceleration = self.acceleration.get(lane);
        let (alpha, centripetal) = (acceleration.thigh, motion.thigh_rate * motion.thigh_rate);
        let knee_ax = acceleration.hip_x - alpha * kin.thigh_y - centripetal * kin.thigh_x;
        let knee_ay = acceleration.hip_y + alpha * kin.thigh_x - centripetal * kin.thigh_y;
        let down = |x: f64, y: f64, length: f64| [x / length, y / length];
        [
            specific_force(
                down(kin.thigh_x, kin.thigh_y, self.body.thigh_length[lane]),
                [acceleration.hip_x, acceleration.hip_y],
                motion.thigh_rate,
                acceleration.thigh,
                thigh,
            ),
            specific_force(
                down(kin.shank_x, kin.shank_y, self.body.shank_length[lane]),
                [knee_ax, knee_ay],
                motion.shank_rate,
                acceleration.shank,
                shank,
            ),
        ]
    }

    /// Socket at the last evaluation; zero for a rigid one.
    pub fn socket(&self, state: &State<L>, lane: usize) -> Socket {
        let (Some(general), Some(extra)) = (&self.general, &state.general) else { return Socket::default() };
        let [force, moment] = general.walker.forces(&general.evaluations[lane]).socket;
        let deflection = extra.deflection.get(lane);
        Socket { pistoning: deflection.socket_shift, tilt: deflection.socket_tilt, force: -force, moment: -moment }
    }

    /// Kinetic and potential energy of segments and knee unit's rotor.
    pub fn energy(&self, state: &State<L>, lane: usize) -> walker::Energy {
        let (_, rotor) =
            self.unit.powers(lane, &self.joint.get(lane), &state.rotor.get(lane), &self.unit_torque.get(lane));
        let segments = if let Some(general) = &self.general {
            let [kinetic, potential] = general.walker.energy(&general.evaluations[lane]);
            walker::Energy { kinetic, potential }
        } else {
            walker::energy(
                &self.body.get(lane),
                &self.kinematics.get(lane),
                &state.motion.get(lane),
                &self.prescribed.get(lane),
            )
        };
        walker::Energy { kinetic: segments.kinetic + rotor, ..segments }
    }

    /// Power of each of [`POWERS`] at the last evaluation, W; their sum is the rate of kinetic plus potential energy.
    pub fn powers(&self, state: &State<L>, lane: usize) -> [f64; POWERS.len()] {
        let motion = state.motion.get(lane);
        let knee_rate = -self.joint.flexion_rate[lane];
        let device = self.device.get(lane);
        let (unit, _) =
            self.unit.powers(lane, &self.joint.get(lane), &state.rotor.get(lane), &self.unit_torque.get(lane));
        let trunk = self.trunk_force.get(lane);
        let joints = self.joints.get(lane);
        let [contact_normal, contact_tangential] = self.contact_powers(state, lane);
        let ([socket, tube], trunk_rate) = self.general.as_ref().map_or_else(
            || ([0.0; 2], self.prescribed.rate[lane]),
            |general| {
                let work = &general.evaluations[lane];
                let (forces, rates) = (general.walker.forces(work), general.walker.rates(work));
                let power = |force: [f64; 2], rate: [f64; 2]| force[0] * rate[0] + force[1] * rate[1];
                ([power(forces.socket, rates.socket), power(forces.tube, rates.tube)], rates.trunk)
            },
        );
        [
            self.hip_torque.torque[lane] * joints.hip_rate,
            self.reactions(state, lane).trunk_torque * trunk_rate,
            trunk.x * motion.hip_vx + trunk.y * motion.hip_vy,
            self.push_x[lane] * motion.hip_vx + self.push_y[lane] * motion.hip_vy,
            unit[0],
            unit[1],
            unit[2],
            -device.extension_stop * knee_rate,
            device.flexion_stop * knee_rate,
            device.ankle * joints.ankle_rate,
            contact_normal,
            contact_tangential,
            socket,
            tube,
        ]
    }

    /// Power of the ground's normal and tangential forces, W.
    fn contact_powers(&self, state: &State<L>, lane: usize) -> [f64; 2] {
        let motion = state.motion.get(lane);
        let power = |contact: Contact, surface: Surface, point: Point| {
            let (along, across) = surface.along_and_across(point.vx, point.vy);
            [contact.normal * across, contact.tangential * along]
        };
        let usual = self.contacts.iter().zip(&self.surfaces).map(|(c, s)| (c.get(lane), s.get(lane)));
        let powers: Vec<[f64; 2]> = if let Some(general) = &self.general {
            let more = general.contacts.iter().zip(&general.surfaces).map(|(c, s)| (c.get(lane), s.get(lane)));
            let point = |index| general.walker.point(&general.evaluations[lane], index);
            usual.chain(more).enumerate().map(|(i, (contact, surface))| power(contact, surface, point(i))).collect()
        } else {
            let kin = self.kinematics.get(lane);
            let points = [
                walker::foot_point(&motion, &kin, kin.heel_x, kin.heel_y),
                walker::foot_point(&motion, &kin, kin.ball_x, kin.ball_y),
                walker::knee_point(&motion, &kin),
                hip_point(&motion),
            ];
            usual.zip(points).map(|((contact, surface), point)| power(contact, surface, point)).collect()
        };
        powers.iter().fold([0.0; 2], |sum, power| [sum[0] + power[0], sum[1] + power[1]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resting_accelerometer_senses_gravity_in_the_frame_of_its_segment() {
        for angle in [-1.2_f64, -0.3, 0.0, 0.4, 1.5] {
            let force = specific_force([angle.sin(), -angle.cos()], [0.0; 2], 0.0, 0.0, 0.3);
            assert!((force.forward - GRAVITY * angle.sin()).abs() < 1e-12);
            assert!((force.up - GRAVITY * angle.cos()).abs() < 1e-12);
        }
    }

    #[test]
    fn a_falling_and_turning_accelerometer_senses_its_own_rotation_alone() {
        let force = specific_force([0.6, -0.8], [0.0, -GRAVITY], 3.0, -5.0, 0.2);
        assert!((force.forward + 5.0 * 0.2).abs() < 1e-12);
        assert!((force.up - 9.0 * 0.2).abs() < 1e-12);
    }
}
