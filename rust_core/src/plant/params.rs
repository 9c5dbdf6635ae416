//! Parameters of all blocks of the human-prosthesis system, as its configuration holds them.

use crate::human::params::HumanParams;
use crate::mechanics::body::BodyParams;
use crate::mechanics::compliant_ground::GroundParams;
use crate::mechanics::joint_drives::MechanismParams;
use crate::prosthesis::ankle::passive_ankle::AnkleParams;
use crate::prosthesis::end_stop::EndStopParams;
use crate::prosthesis::knee::unit::KneeParams;
use crate::prosthesis::socket::SocketParams;
use crate::prosthesis::tube::TubeParams;

/// Parameters of the human-prosthesis system.
#[derive(Clone, Copy, Debug)]
pub struct PlantParams<'a> {
    /// Segments.
    pub body: &'a BodyParams,
    /// Joints and how they are driven.
    pub mechanism: &'a MechanismParams,
    /// Ground.
    pub ground: &'a GroundParams,
    /// Human controller.
    pub human: &'a HumanParams,
    /// Knee unit.
    pub knee: KneeParams<'a>,
    /// End stops of the knee.
    pub end_stop: &'a EndStopParams,
    /// Ankle.
    pub ankle: &'a AnkleParams,
    /// Socket.
    pub socket: &'a SocketParams,
    /// Tube with the load cell.
    pub tube: &'a TubeParams,
}
