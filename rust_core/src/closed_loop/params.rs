//! Parameters of all blocks of the closed loop, as its configuration holds them.

use crate::plant::params::PlantParams;
use crate::prosthesis::reference_controller::ReferenceParams;
use crate::sensors::params::SensorParams;

/// Parameters of the closed loop.
#[derive(Clone, Copy, Debug)]
pub struct LoopParams<'a> {
    /// Human, mechanism, ground and device.
    pub plant: PlantParams<'a>,
    /// Sensors.
    pub sensors: &'a SensorParams,
    /// Reference controllers.
    pub reference: ReferenceParams<'a>,
}
