//! What recorders, rewards and meters read off the human-prosthesis system after an evaluation.

use crate::human::{reference, slip_leg};
use crate::mechanics::body::Body;
use crate::mechanics::compliant_ground::Contact;
use crate::mechanics::general_walker::{GeneralWalker, WalkerWorkspace};
use crate::mechanics::motion::{JointTorque, Loads, Motion, Point, PointForce, Prescribed};
use crate::mechanics::walker::{self, Reactions};
use crate::plant::contact_force::{level_force, point_force};
use crate::plant::contact_points::{BALL, CONTACT_POINTS, HEEL, HIP, KNEE};
use crate::plant::model::PlantModel;
use crate::plant::signals::Signals;
use crate::plant::state::State;
use crate::plant::torques::{DeviceTorque, EndJoints};
use crate::plant::walkers::Walkers;
use crate::prosthesis::knee::motor::geared_motor::{MotorSignals, Rotor};
use crate::prosthesis::knee::unit::UnitInputs;
use crate::signals::GRAVITY;

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

/// A state with the signals that were evaluated at it.
#[derive(Clone, Copy, Debug)]
pub struct PlantOutputs<'a, const L: usize> {
    pub(super) model: &'a PlantModel<L>,
    pub(super) walkers: &'a Walkers<L>,
    pub(super) signals: &'a Signals<L>,
    pub(super) state: &'a State<L>,
}

impl<'a, const L: usize> PlantOutputs<'a, L> {
    /// A state with the signals that were evaluated at it.
    #[inline(always)]
    pub fn new(
        model: &'a PlantModel<L>,
        walkers: &'a Walkers<L>,
        signals: &'a Signals<L>,
        state: &'a State<L>,
    ) -> Self {
        Self { model, walkers, signals, state }
    }

    /// Forward-dynamics coordinates.
    #[inline(always)]
    pub fn motion(&self, lane: usize) -> Motion {
        self.state.motion.get(lane)
    }

    /// Rotor of the knee unit.
    #[inline(always)]
    pub fn rotor(&self, lane: usize) -> Rotor {
        self.state.rotor.get(lane)
    }

    /// Mechanical constants.
    #[inline(always)]
    pub fn body(&self, lane: usize) -> Body {
        self.model.body.get(lane)
    }

    /// Ground contact of point `point` in `lane` (0 heel, 1 ball), along and across the surface below it.
    #[inline(always)]
    pub fn contact(&self, point: usize, lane: usize) -> Contact {
        self.signals.contacts[point].get(lane)
    }

    /// Normal force at point `point` (0 heel, 1 ball), N.
    #[inline(always)]
    pub fn contact_force(&self, point: usize, lane: usize) -> f64 {
        self.signals.contacts[point].normal[lane]
    }

    /// Normal force on the rear and on the front half of the sole, N: heel and ball, where there are no other points.
    #[inline(always)]
    pub fn sole_load(&self, lane: usize) -> [f64; 2] {
        let [rear, front] = self
            .model
            .general
            .as_ref()
            .zip(self.signals.general.as_ref())
            .map_or([0.0; 2], |(general, signals)| general.sole_load(signals, lane));
        [self.signals.contacts[HEEL].normal[lane] + rear, self.signals.contacts[BALL].normal[lane] + front]
    }

    /// Knee flexion, rad.
    #[inline(always)]
    pub fn knee_flexion(&self, lane: usize) -> f64 {
        self.signals.joint.flexion[lane]
    }

    /// Angles of hip and ankle to their proximal segments.
    #[inline(always)]
    pub fn joints(&self, lane: usize) -> EndJoints {
        self.signals.joints.get(lane)
    }

    /// Trunk angle, rad.
    pub fn trunk_angle(&self, lane: usize) -> f64 {
        match &self.state.general {
            Some(extra) if self.model.trunk_forward() => extra.deflection.trunk[lane],
            _ => self.state.reference.trunk[lane],
        }
    }

    /// Position and velocity of heel (0) or ball (1).
    #[inline(always)]
    pub fn foot_point(&self, point: usize, lane: usize) -> Point {
        if let Some((walker, work)) = self.general(lane) {
            return walker.point(work, point);
        }
        let kin = self.signals.kinematics.get(lane);
        let (x, y) = if point == HEEL { (kin.heel_x, kin.heel_y) } else { (kin.ball_x, kin.ball_y) };
        walker::foot_point(&self.state.motion.get(lane), &kin, x, y)
    }

    /// Height of heel (0) or ball (1) above the ground below it, m.
    pub fn foot_height(&self, point: usize, lane: usize) -> f64 {
        let point = self.foot_point(point, lane);
        point.y - self.model.ground_height(lane, point.x)
    }

    /// Hip torque tau_4, N m.
    #[inline(always)]
    pub fn hip_torque(&self, lane: usize) -> f64 {
        self.signals.hip_torque.torque[lane]
    }

    /// Device torques.
    #[inline(always)]
    pub fn device(&self, lane: usize) -> DeviceTorque {
        self.signals.device.get(lane)
    }

    /// Force of the intact leg on the trunk.
    pub fn trunk_force(&self, lane: usize) -> slip_leg::TrunkForce {
        self.signals.trunk_force.get(lane)
    }

    /// Prescribed trunk motion.
    pub fn prescribed(&self, lane: usize) -> Prescribed {
        self.signals.prescribed.get(lane)
    }

    /// Rough thigh reference, rad.
    pub fn rough_thigh(&self, lane: usize) -> f64 {
        reference::rough_thigh(&self.walkers.drive.get(lane), self.state.rest.time[lane])
    }

    /// The general walker in `lane` and its last evaluation, where it is one.
    pub(super) fn general(&self, lane: usize) -> Option<(&'a GeneralWalker, &'a WalkerWorkspace)> {
        let (model, signals) = (self.model.general.as_ref()?, self.signals.general.as_ref()?);
        Some((&model.walkers[lane], &signals.evaluations[lane]))
    }

    /// What the knee unit works on.
    #[inline(always)]
    pub(super) fn unit_inputs(&self) -> UnitInputs<'a, L> {
        UnitInputs {
            joint: &self.signals.joint,
            rotor: &self.state.rotor,
            direction: &self.walkers.direction,
            motor: &self.signals.motor,
            command: &self.walkers.command,
        }
    }

    /// Signals of the knee unit's motor; zero for a unit without.
    #[inline(always)]
    pub fn motor_signals(&self, lane: usize) -> MotorSignals {
        self.signals.motor.get(lane)
    }

    /// Electrical power of the knee unit and its Joule part, W.
    #[inline(always)]
    pub fn electrical_powers(&self, lane: usize) -> [f64; 2] {
        let signals = self.signals.motor.get(lane);
        self.model.unit.electrical_powers(lane, &signals, &self.state.rotor.get(lane))
    }

    /// Height of the hip above the ground below it, m.
    #[inline(always)]
    pub fn hip_height(&self, lane: usize) -> f64 {
        self.state.motion.hip_y[lane] - self.model.ground_height(lane, self.state.motion.hip_x[lane])
    }

    /// Forces of the ground on the walker, in the order of the contact points.
    #[inline(always)]
    fn ground_forces<const LEVEL: bool>(&self, lane: usize) -> [PointForce; CONTACT_POINTS] {
        [
            self.ground_force::<LEVEL>(HEEL, lane),
            self.ground_force::<LEVEL>(BALL, lane),
            self.ground_force::<LEVEL>(KNEE, lane),
            self.ground_force::<LEVEL>(HIP, lane),
        ]
    }

    #[inline(always)]
    pub(super) fn ground_force<const LEVEL: bool>(&self, point: usize, lane: usize) -> PointForce {
        let contact = self.signals.contacts[point].get(lane);
        if LEVEL { level_force(&contact) } else { point_force(&contact, &self.signals.surfaces[point].get(lane)) }
    }

    /// All forces and joint torques on a usual walker, for its equations.
    #[inline(always)]
    pub(super) fn loads<const LEVEL: bool>(&self, lane: usize) -> Loads {
        let device = self.signals.device.get(lane);
        let hip = self.signals.hip_torque.get(lane);
        let trunk = self.signals.trunk_force.get(lane);
        let ankle = self.model.ankle.get(lane);
        let [heel, ball, knee, hip_contact] = self.ground_forces::<LEVEL>(lane);
        Loads {
            trunk_x: trunk.x + self.walkers.push_x[lane] + hip_contact.x,
            trunk_y: trunk.y + self.walkers.push_y[lane] + hip_contact.y,
            knee_x: knee.x,
            knee_y: knee.y,
            hip: JointTorque { torque: hip.torque, damping: hip.damping, stiffness: hip.stiffness },
            hip_error_rate: hip.error_rate,
            knee: JointTorque { torque: device.knee, damping: device.knee_damping, stiffness: device.knee_stiffness },
            ankle: JointTorque { torque: device.ankle, damping: ankle.damping, stiffness: ankle.stiffness },
            heel,
            ball,
        }
    }

    /// Forces of trunk and tube joints at the last evaluation.
    #[inline(always)]
    pub fn reactions(&self, lane: usize) -> Reactions {
        if let Some((walker, work)) = self.general(lane) {
            let forces = walker.forces(work);
            let [tube_force, tube_torque] = forces.tube;
            return Reactions { trunk_torque: forces.trunk, tube_force, tube_torque };
        }
        walker::reactions(
            &self.model.body.get(lane),
            &self.signals.kinematics.get(lane),
            &self.state.motion.get(lane),
            &self.signals.prescribed.get(lane),
            &if self.model.level { self.loads::<true>(lane) } else { self.loads::<false>(lane) },
            &self.signals.acceleration.get(lane),
        )
    }

    /// Specific force at the inertial sensors of thigh and shank, mounted so far (m) below hip and knee.
    #[inline(always)]
    pub fn specific_forces(&self, lane: usize, thigh: f64, shank: f64) -> [SpecificForce; 2] {
        if let Some((walker, work)) = self.general(lane) {
            return walker.specific_forces(work, thigh, shank).map(|[forward, up]| SpecificForce { forward, up });
        }
        let motion = self.state.motion.get(lane);
        let kin = self.signals.kinematics.get(lane);
        let acceleration = self.signals.acceleration.get(lane);
        let (alpha, centripetal) = (acceleration.thigh, motion.thigh_rate * motion.thigh_rate);
        let knee_ax = acceleration.hip_x - alpha * kin.thigh_y - centripetal * kin.thigh_x;
        let knee_ay = acceleration.hip_y + alpha * kin.thigh_x - centripetal * kin.thigh_y;
        let down = |x: f64, y: f64, length: f64| [x / length, y / length];
        [
            specific_force(
                down(kin.thigh_x, kin.thigh_y, self.model.body.thigh_length[lane]),
                [acceleration.hip_x, acceleration.hip_y],
                motion.thigh_rate,
                acceleration.thigh,
                thigh,
            ),
            specific_force(
                down(kin.shank_x, kin.shank_y, self.model.body.shank_length[lane]),
                [knee_ax, knee_ay],
                motion.shank_rate,
                acceleration.shank,
                shank,
            ),
        ]
    }

    /// Socket at the last evaluation; zero for a rigid one.
    pub fn socket(&self, lane: usize) -> Socket {
        let (Some((walker, work)), Some(extra)) = (self.general(lane), &self.state.general) else {
            return Socket::default();
        };
        let [force, moment] = walker.forces(work).socket;
        let deflection = extra.deflection.get(lane);
        Socket { pistoning: deflection.socket_shift, tilt: deflection.socket_tilt, force: -force, moment: -moment }
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
