//! The configuration tree: collects the blocks' parameters, which stand beside their equations.

use serde::{Deserialize, Serialize};

use crate::agent::action::ActionParams;
use crate::agent::observation::ObservationParams;
use crate::closed_loop::params::LoopParams;
use crate::episode::reward::RewardParams;
use crate::episode::scenario::ScenarioParams;
use crate::episode::termination::TerminationParams;
use crate::human::params::HumanParams;
use crate::mechanics::body::BodyParams;
use crate::mechanics::compliant_ground::GroundParams;
use crate::mechanics::joint_drives::MechanismParams;
use crate::plant::params::PlantParams;
use crate::plant::solver::SolverParams;
use crate::prosthesis::ankle::passive_ankle::AnkleParams;
use crate::prosthesis::end_stop::EndStopParams;
use crate::prosthesis::knee::damper::state_machine::DamperFsmParams;
use crate::prosthesis::knee::damper::variable_damper::VariableDamperParams;
use crate::prosthesis::knee::friction::constant_friction::ConstantFrictionParams;
use crate::prosthesis::knee::kind::DeviceParams;
use crate::prosthesis::knee::motor::geared_motor::GearedMotorParams;
use crate::prosthesis::knee::motor::state_machine::MotorFsmParams;
use crate::prosthesis::knee::unit::KneeParams;
use crate::prosthesis::reference_controller::ReferenceParams;
use crate::prosthesis::socket::SocketParams;
use crate::prosthesis::tube::TubeParams;
use crate::schema::error::{Error, Result};
use crate::schema::params::ParameterDoc;
use crate::sensors::params::SensorParams;

macro_rules! tree {
    ($(#[$meta:meta])* pub struct $Name:ident { $($(#[$field_meta:meta])* $field:ident: $kind:ty,)+ }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $Name { $($(#[$field_meta])* pub $field: $kind,)+ }

        impl $Name {
            /// Every parameter with default, unit, range and meaning.
            pub fn table() -> Vec<ParameterDoc> {
                [$(<$kind>::table(stringify!($field))),+].concat()
            }

            /// Checks every value against its range.
            pub fn validate_sections(&self) -> Result<()> {
                $(self.$field.validate(stringify!($field))?;)+
                Ok(())
            }
        }
    };
}

tree! {
    /// Everything that can be configured: the walker's closed loop, then the episode around it.
    pub struct Config {
        /// Segments.
        body: BodyParams,
        /// Joints and how they are driven.
        mechanism: MechanismParams,
        /// Ground.
        ground: GroundParams,
        /// Human controller.
        human: HumanParams,
        /// Choice of the knee unit.
        device: DeviceParams,
        /// Damper knee.
        knee: VariableDamperParams,
        /// Motor knee.
        motor: GearedMotorParams,
        /// Friction knee.
        friction_knee: ConstantFrictionParams,
        /// End stops of the knee.
        end_stop: EndStopParams,
        /// Ankle.
        ankle: AnkleParams,
        /// Socket.
        socket: SocketParams,
        /// Tube with the load cell.
        tube: TubeParams,
        /// Sensors.
        sensors: SensorParams,
        /// Reference controller of the damper knee.
        state_machine: DamperFsmParams,
        /// Reference controller of the motor knee.
        motor_state_machine: MotorFsmParams,
        /// Integration.
        solver: SolverParams,
        /// What happens in an episode.
        scenario: ScenarioParams,
        /// What ends an episode early.
        termination: TerminationParams,
        /// What the agent sets.
        action: ActionParams,
        /// What the agent sees.
        observation: ObservationParams,
        /// What the agent is rewarded for.
        reward: RewardParams,
    }
}

impl Config {
    /// Reads a configuration; missing keys take their defaults, unknown keys are errors. What it says is not checked yet.
    pub fn parse<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self> {
        serde_path_to_error::deserialize(deserializer)
            .map_err(|error| Error::Schema { key: error.path().to_string(), reason: error.inner().to_string() })
    }

    /// Parameters of the knee units.
    pub fn knee_params(&self) -> KneeParams<'_> {
        KneeParams { kind: self.device.kind, damper: &self.knee, motor: &self.motor, friction: &self.friction_knee }
    }

    /// Parameters of the human-prosthesis system.
    pub fn plant_params(&self) -> PlantParams<'_> {
        PlantParams {
            body: &self.body,
            mechanism: &self.mechanism,
            ground: &self.ground,
            human: &self.human,
            knee: self.knee_params(),
            end_stop: &self.end_stop,
            ankle: &self.ankle,
            socket: &self.socket,
            tube: &self.tube,
        }
    }

    /// Parameters of the closed loop.
    pub fn loop_params(&self) -> LoopParams<'_> {
        LoopParams {
            plant: self.plant_params(),
            sensors: &self.sensors,
            reference: ReferenceParams {
                knee: self.knee_params(),
                damper: &self.state_machine,
                motor: &self.motor_state_machine,
            },
        }
    }
}
