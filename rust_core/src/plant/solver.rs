//! How the human-prosthesis system is integrated.

use serde::{Deserialize, Serialize};

use crate::numerics::integrator::Stepper;
use crate::prosthesis::knee::kind::DeviceKind;
use crate::schema::error::Result;
use crate::schema::params::{ParameterDoc, within};

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

    /// The parameter table of this struct.
    pub fn table(path: &str) -> Vec<ParameterDoc> {
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

    /// Checks every field against its range; `path` is the dotted path of this struct.
    pub fn validate(&self, path: &str) -> Result<()> {
        // Explicit steps diverge on the contact damping above about 0.3 ms.
        let fewest = if self.stepper == Stepper::Rk4 && self.steps != 0 { 20.0 } else { 0.0 };
        within(fewest, MOST_STEPS).check(&format!("{path}.steps"), self.steps as f64, "")
    }
}

/// Steps per control period, at most.
pub const MOST_STEPS: f64 = 10_000.0;
