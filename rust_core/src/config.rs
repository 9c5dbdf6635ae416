//! The configuration tree: collects the blocks' parameters, which stand beside their equations.

use serde::{Deserialize, Serialize};

use crate::compliant_ground::GroundParams;
use crate::error::{Error, Result};
use crate::feasibility::Span;
use crate::human_controller::HumanParams;
use crate::hybrid_dynamics::body::BodyParams;
use crate::hybrid_dynamics::general_walker::MechanismParams;
use crate::idle::{self, Idle};
use crate::integrator::Stepper;
use crate::params::{ParameterDoc, within};
use crate::prosthesis_controller::agent::action::ActionMode;
use crate::prosthesis_controller::agent::{ActionParams, ObservationMap, ObservationParams};
use crate::prosthesis_controller::damper_fsm::DamperFsmParams;
use crate::prosthesis_controller::motor_fsm::MotorFsmParams;
use crate::prosthesis_device::constant_friction::ConstantFrictionParams;
use crate::prosthesis_device::end_stop::EndStopParams;
use crate::prosthesis_device::geared_motor::GearedMotorParams;
use crate::prosthesis_device::passive_ankle::AnkleParams;
use crate::prosthesis_device::socket::SocketParams;
use crate::prosthesis_device::tube::TubeParams;
use crate::prosthesis_device::variable_damper::VariableDamperParams;
use crate::prosthesis_device::{DeviceKind, DeviceParams};
use crate::randomisation::{DrawnSpan, Randomiser};
use crate::repetition::ATTEMPTS;
use crate::reward::RewardParams;
use crate::scenario::ScenarioParams;
use crate::sensors::SensorParams;
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

/// Steps per control period, at most.
pub const MOST_STEPS: f64 = 10_000.0;

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
        if self.action.mode == ActionMode::Impedance && !self.device.kind.has_motor() {
            return Err(Error::Invalid("action.mode = impedance needs a motor: device.kind = motor".into()));
        }
        ObservationMap::new(self).check()?;
        Span::of(self).check()?;
        Randomiser::new(self)?;
        Ok(())
    }

    /// Settings that change nothing for any walker, by their dotted keys, and what they need.
    pub fn idle(&self) -> Result<Vec<(String, Idle)>> {
        let drawn: Vec<_> = Randomiser::new(self)?.iter().flat_map(Randomiser::spans).collect();
        let mut spans: Vec<_> = drawn.iter().map(DrawnSpan::as_span).collect();
        if spans.is_empty() {
            spans.push(Span::of(self));
        }
        let keys = Self::table().into_iter().map(|row| row.key);
        Ok(keys.filter_map(|key| idle::set(&spans, &key).map(|idle| (key, idle))).collect())
    }

    /// Steps of the integration per control period, as many as any walker needs that may be drawn.
    pub fn steps(&self) -> usize {
        let steps = self.solver.steps_with(self.device.kind);
        if self.solver.steps != 0 || self.solver.stepper != Stepper::Rk4 {
            return steps;
        }
        let drawn = Randomiser::new(self).ok().flatten();
        let drawn = drawn.iter().flat_map(Randomiser::spans).map(|span| span.as_span().explicit_steps());
        steps.max(drawn.fold(Span::of(self).explicit_steps(), f64::max) as usize)
    }

    /// The solver as it is asked for, and those that repeat a control period in which it diverges: the same stepper in steps
    /// a quarter as long, and the reference in steps a quarter of its own.
    pub fn solvers(&self) -> [SolverParams; ATTEMPTS] {
        const FINER: usize = 4;
        let own = SolverParams { steps: self.steps(), ..self.solver };
        let finer = SolverParams { steps: FINER * own.steps, ..own };
        let coarsest = Self { solver: SolverParams { steps: 0, ..SolverParams::REFERENCE }, ..self.clone() }.steps();
        let coarsest = if own.stepper == Stepper::Rk4 { coarsest.max(finer.steps) } else { coarsest };
        [own, finer, SolverParams { steps: FINER * coarsest, ..SolverParams::REFERENCE }]
    }
}
