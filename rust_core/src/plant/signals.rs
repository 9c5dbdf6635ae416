//! Signals of one evaluation: they follow from state, constants and inputs, so blocks can share their storage.

use crate::human::impedance::ImpedanceTorqueLanes;
use crate::human::slip_leg::TrunkForceLanes;
use crate::mechanics::compliant_ground::ContactLanes;
use crate::mechanics::motion::{AccelerationLanes, KinematicsLanes, PrescribedLanes};
use crate::mechanics::terrain::{Surface, SurfaceLanes};
use crate::numerics::lanes::lanes;
use crate::plant::contact_points::CONTACT_POINTS;
use crate::plant::general_model::GeneralSignals;
use crate::plant::model::PlantModel;
use crate::plant::torques::{DeviceTorqueLanes, EndJointsLanes};
use crate::prosthesis::knee::joint::{JointMotionLanes, UnitTorqueLanes};
use crate::prosthesis::knee::motor::geared_motor::MotorSignalsLanes;

lanes! {
    /// What the walker's knee and foot touch.
    pub struct Touch, TouchLanes {
        /// Knee flexion above contact with the extension stop, rad.
        stop_gap: f64,
        /// Normal force on the heel, N.
        heel: f64,
        /// Normal force on the ball, N.
        ball: f64,
    }
}

impl Touch {
    /// Whether the knee has reached its stop, or the ground has let go of the foot, since things were as in `before`.
    #[inline(always)]
    pub fn jumps(&self, before: &Self) -> bool {
        let impact = (before.stop_gap >= 0.0) & (self.stop_gap < 0.0);
        let heel_off = (before.heel > 0.0) & (self.heel <= 0.0);
        let ball_off = (before.ball > 0.0) & (self.ball <= 0.0);
        impact | heel_off | ball_off
    }
}

/// Signals of the last evaluation of a block of walkers.
#[derive(Clone, Debug)]
pub struct Signals<const L: usize> {
    pub(super) kinematics: KinematicsLanes<L>,
    pub(super) contacts: [ContactLanes<L>; CONTACT_POINTS],
    /// Ground below each contact point; never touched on level ground.
    pub(super) surfaces: [SurfaceLanes<L>; CONTACT_POINTS],
    /// Height of the ground where the intact leg would touch down, m.
    pub(super) ground_ahead: [f64; L],
    /// Whether the contacts of any knee or hip are not zero.
    pub(super) fall_contact: bool,
    pub(super) trunk_force: TrunkForceLanes<L>,
    pub(super) midfoot: [f64; L],
    /// Normal force on the rear half of the sole, N.
    pub(super) heel_force: [f64; L],
    pub(super) prescribed: PrescribedLanes<L>,
    pub(super) hip_torque: ImpedanceTorqueLanes<L>,
    pub(super) joint: JointMotionLanes<L>,
    pub(super) joints: EndJointsLanes<L>,
    pub(super) motor: MotorSignalsLanes<L>,
    pub(super) unit_torque: UnitTorqueLanes<L>,
    pub(super) device: DeviceTorqueLanes<L>,
    pub(super) acceleration: AccelerationLanes<L>,
    /// What touched what at the start of the present step.
    pub(super) touch: TouchLanes<L>,
    pub(super) flexion_acceleration: [f64; L],
    pub(super) general: Option<Box<GeneralSignals<L>>>,
}

impl<const L: usize> Signals<L> {
    /// Storage for evaluations of walkers like these.
    pub fn new(model: &PlantModel<L>) -> Self {
        Self {
            kinematics: KinematicsLanes::default(),
            contacts: std::array::from_fn(|_| ContactLanes::default()),
            surfaces: std::array::from_fn(|_| SurfaceLanes::splat(Surface::LEVEL)),
            ground_ahead: [0.0; L],
            fall_contact: false,
            trunk_force: TrunkForceLanes::default(),
            midfoot: [0.0; L],
            heel_force: [0.0; L],
            prescribed: PrescribedLanes::default(),
            hip_torque: ImpedanceTorqueLanes::default(),
            joint: JointMotionLanes::default(),
            joints: EndJointsLanes::default(),
            motor: MotorSignalsLanes::default(),
            unit_torque: UnitTorqueLanes::default(),
            device: DeviceTorqueLanes::default(),
            acceleration: AccelerationLanes::default(),
            touch: TouchLanes::default(),
            flexion_acceleration: [0.0; L],
            general: model.general.as_ref().map(|general| Box::new(GeneralSignals::new(general))),
        }
    }
}
