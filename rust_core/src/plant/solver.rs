//! How the human-prosthesis system is integrated.

use crate::numerics::integrator::Stepper;
use crate::prosthesis::knee::kind::DeviceKind;
use crate::schema::error::Result;
use crate::schema::params::{ANY, Choice, params, within};

/// Steps per control period, at most.
pub const MOST_STEPS: f64 = 10_000.0;
/// Explicit steps per control period, at least: longer ones diverge on the contact damping.
const FEWEST_EXPLICIT_STEPS: f64 = 20.0;

impl Choice for Stepper {}

params! {
    /// Which stepper advances the continuous system, and in how many steps per control period.
    pub struct SolverParams {
        /// One-step method; two_stage_w is the fast one, rk4 with 50 steps the reference.
        stepper: Stepper = Stepper::TwoStageW, "", ANY;
        /// Steps per 5 ms control period; 0 for as many as the accuracy needs: 5, with a motor 9, with rk4 50. With rk4 otherwise at least 20.
        steps: usize = 0, "", within(0.0, MOST_STEPS);
    }
}

impl Copy for SolverParams {}

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

    /// Checks that explicit steps are not too long; `path` is the dotted path of this struct.
    pub fn check_explicit(&self, path: &str) -> Result<()> {
        if self.stepper != Stepper::Rk4 || self.steps == 0 {
            return Ok(());
        }
        within(FEWEST_EXPLICIT_STEPS, MOST_STEPS).check(&format!("{path}.steps"), self.steps as f64, "")
    }
}
