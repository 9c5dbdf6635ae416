//! The configuration tree: collects the blocks' parameters, which stand beside their equations.

use serde::{Deserialize, Serialize};

use crate::compliant_ground::GroundParams;
use crate::error::{Error, Result};
use crate::human_controller::HumanParams;
use crate::hybrid_dynamics::body::BodyParams;
use crate::hybrid_dynamics::general_walker::MechanismParams;
use crate::integrator::Stepper;
use crate::params::{ParameterDoc, within};
use crate::prosthesis_controller::agent::action::ActionMode;
use crate::prosthesis_controller::agent::{ActionParams, ObservationParams};
use crate::prosthesis_controller::damper_fsm::DamperFsmParams;
use crate::prosthesis_controller::motor_fsm::MotorFsmParams;
use crate::prosthesis_device::constant_friction::ConstantFrictionParams;
use crate::prosthesis_device::end_stop::EndStopParams;
use crate::prosthesis_device::geared_motor::GearedMotorParams;
use crate::prosthesis_device::passive_ankle::AnkleParams;
use crate::prosthesis_device::socket::{SocketParams, socket};
use crate::prosthesis_device::spring_damper::Connection;
use crate::prosthesis_device::tube::{TubeParams, tube};
use crate::prosthesis_device::variable_damper::VariableDamperParams;
use crate::prosthesis_device::{DeviceKind, DeviceParams};
use crate::randomisation::Randomiser;
use crate::repetition::ATTEMPTS;
use crate::reward::RewardParams;
use crate::scenario::ScenarioParams;
use crate::sensors::SensorParams;
use crate::signals::CONTROL_PERIOD_S;
use crate::termination::TerminationParams;

/// Which stepper advances the continuous system, and in how many steps per control period.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SolverParams {
    /// One-step method.
    pub stepper: Stepper,
    /// Steps per 5 ms control period; 0 for as many as the accuracy needs.
    pub steps: usize,
}

impl Default for SolverParams {
    fn default() -> Self {
        Self { stepper: Stepper::TwoStageW, steps: 0 }
    }
}

impl SolverParams {
    /// The converged reference: RK4 at 0.1 ms with located events.
    pub const REFERENCE: Self = Self { stepper: Stepper::Rk4, steps: 50 };

    /// Steps per control period of a walker with the given knee unit. Friction makes a motor stick and slip many times in a
    /// stride, which takes shorter steps (docs/numerics.md).
    pub fn steps_with(&self, device: DeviceKind) -> usize {
        match (self.steps, self.stepper) {
            (0, Stepper::Rk4) => Self::REFERENCE.steps,
            (0, _) if device.has_motor() => 9,
            (0, _) => 5,
            (steps, _) => steps,
        }
    }

    fn table(path: &str) -> Vec<ParameterDoc> {
        let defaults = Self::default();
        let row = |field: &str, default: String, range: &str, doc: &str| ParameterDoc {
            key: format!("{path}.{field}"),
            default,
            unit: "",
            range: range.to_owned(),
            doc: doc.to_owned(),
        };
        let steppers = "two_stage_w | linearly_implicit_euler | rk4";
        vec![
            row(
                "stepper",
                "two_stage_w".into(),
                steppers,
                "One-step method; two_stage_w is the fast one, rk4 with 50 steps the reference.",
            ),
            row(
                "steps",
                defaults.steps.to_string(),
                "[0, 10000], rk4 0 or [20, 10000]",
                "Steps per 5 ms control period; 0 for as many as the accuracy needs: 5, with a motor 9, with rk4 50.",
            ),
        ]
    }

    fn validate(&self, path: &str) -> Result<()> {
        // Explicit steps diverge on the contact damping above about 0.3 ms.
        let fewest = if self.stepper == Stepper::Rk4 && self.steps != 0 { 20.0 } else { 0.0 };
        within(fewest, MOST_STEPS).check(&format!("{path}.steps"), self.steps as f64, "")
    }
}

const MOST_STEPS: f64 = 10_000.0;

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

            fn validate_sections(&self) -> Result<()> {
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
    /// Reads a configuration; missing keys take their defaults, unknown keys and impossible values are errors.
    pub fn from_deserializer<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self> {
        let config: Self = serde_path_to_error::deserialize(deserializer)
            .map_err(|error| Error::Schema { key: error.path().to_string(), reason: error.inner().to_string() })?;
        config.validate()?;
        Ok(config)
    }

    /// Checks every value against its range, and those that must fit together.
    pub fn validate(&self) -> Result<()> {
        self.validate_sections()?;
        Randomiser::new(self)?;
        for end in [0.0, 1.0] {
            let variation = self.scenario.human.at(|| end);
            self.human.varied(&variation).validate("human (varied by scenario.human)")?;
        }
        if self.action.mode == ActionMode::Impedance && !self.device.kind.has_motor() {
            return Err(Error::Invalid("action.mode = impedance needs a motor: device.kind = motor".into()));
        }
        let (stop, body) = (&self.end_stop, &self.body);
        if stop.extension_angle_deg + stop.thickness_deg >= stop.flexion_angle_deg {
            return Err(Error::Invalid(format!(
                "end_stop.flexion_angle_deg = {} must lie above end_stop.extension_angle_deg + end_stop.thickness_deg = {}",
                stop.flexion_angle_deg,
                stop.extension_angle_deg + stop.thickness_deg
            )));
        }
        if body.ball_x_m <= body.heel_x_m {
            return Err(Error::Invalid(format!(
                "body.ball_x_m = {} must lie ahead of body.heel_x_m = {}",
                body.ball_x_m, body.heel_x_m
            )));
        }
        let half_sole = 0.5 * (body.ball_x_m - body.heel_x_m);
        if body.sole_radius_m != 0.0 && body.sole_radius_m < half_sole {
            return Err(Error::Invalid(format!(
                "body.sole_radius_m = {} must be 0 (straight) or at least half of heel to ball = {half_sole} m",
                body.sole_radius_m
            )));
        }
        let ground = &self.ground;
        if ground.stair_rise_m != 0.0 && ground.edge_m > ground.stair_run_m {
            return Err(Error::Invalid(format!(
                "ground.edge_m = {} must not be longer than ground.stair_run_m = {}",
                ground.edge_m, ground.stair_run_m
            )));
        }
        let (steps, fewest) = (self.steps(), self.explicit_steps());
        if self.solver.stepper == Stepper::Rk4 && (steps as f64) < fewest {
            return Err(Error::Invalid(format!(
                "solver.steps = {steps} must be at least {fewest} for solver.stepper = rk4 with this compliant socket or tube"
            )));
        }
        Ok(())
    }

    /// Steps of the integration per control period.
    pub fn steps(&self) -> usize {
        let steps = self.solver.steps_with(self.device.kind);
        let explicit = self.solver.steps == 0 && self.solver.stepper == Stepper::Rk4;
        if explicit { steps.max(self.explicit_steps() as usize) } else { steps }
    }

    /// The solver as it is asked for, and those that repeat a control period in which it diverges: the same stepper in steps
    /// a quarter as long, and the reference in steps a quarter of its own.
    pub fn solvers(&self) -> [SolverParams; ATTEMPTS] {
        const FINER: usize = 4;
        let own = SolverParams { steps: self.steps(), ..self.solver };
        let finer = SolverParams { steps: FINER * own.steps, ..own };
        let coarsest = SolverParams::REFERENCE.steps.max(self.explicit_steps() as usize);
        let coarsest = if own.stepper == Stepper::Rk4 { coarsest.max(finer.steps) } else { coarsest };
        [own, finer, SolverParams { steps: FINER * coarsest, ..SolverParams::REFERENCE }]
    }

    /// Steps per control period below which explicit steps diverge on the dampers of socket and tube.
    fn explicit_steps(&self) -> f64 {
        let socket =
            if self.socket.connection == Connection::Compliant { self.explicit_steps_with_socket() } else { 0.0 };
        let tube = if self.tube.connection == Connection::Compliant { self.explicit_steps_with_tube() } else { 0.0 };
        socket.max(tube)
    }

    /// Measured: with the paper's tilt damping RK4 diverges with 35 steps and agrees with 200 from 40 on.
    fn explicit_steps_with_socket(&self) -> f64 {
        const STEPS: f64 = 40.0;
        const TILT_DAMPING_NMS_RAD: f64 = 531.0;
        let body = &self.body;
        let mass = body.trunk_mass_kg + body.thigh_mass_kg + body.calf_mass_kg + body.foot_mass_kg;
        let [_, tilt] = socket(&self.socket, mass);
        (STEPS * (tilt.damping / TILT_DAMPING_NMS_RAD).max(1.0)).ceil()
    }

    /// The fastest decay that contact, damper and spring of the tube can have together on a foot that the tube alone holds,
    /// over what RK4 bears.
    fn explicit_steps_with_tube(&self) -> f64 {
        /// Just below the 2.785 of RK4's real stability interval.
        const STABILITY: f64 = 2.5;
        /// Deepest usual penetration, m.
        const DEPTH: f64 = 0.025;
        let body = &self.body;
        let [extension, _] = tube(&self.tube, body.foot_mass_kg, body.foot_inertia_about_tube());
        let inverse_mass = |x: f64| 1.0 / body.foot_mass_kg + (x - body.foot_com_x_m).powi(2) / body.foot_inertia_kg_m2;
        let at_end = inverse_mass(body.heel_x_m).max(inverse_mass(body.ball_x_m));
        let at_ankle = inverse_mass(0.0);
        let rate = self.ground.damping_ns_m15 * DEPTH.sqrt() * at_end
            + extension.damping * at_ankle
            + (extension.stiffness * at_ankle).sqrt();
        (rate * CONTROL_PERIOD_S / STABILITY).ceil()
    }
}
