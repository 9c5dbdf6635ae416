//! What must hold between the parameters of several blocks, and what follows from all of them together.

pub mod idle;
mod nominal;
pub mod randomiser;
pub mod span;

use crate::closed_loop::repetition::ATTEMPTS;
use crate::config::Config;
use crate::numerics::integrator::Stepper;
use crate::plant::solver::SolverParams;
use crate::schema::error::Result;
use idle::Idle;
use randomiser::{DrawnSpan, Randomiser};
use span::Span;

impl Config {
    /// Reads a configuration; missing keys take their defaults, unknown keys and impossible values are errors.
    pub fn from_deserializer<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self> {
        let config = Self::parse(deserializer)?;
        config.validate()?;
        Ok(config)
    }

    /// Checks every value against its range, and those that must fit together, of this walker and of all that episodes draw.
    pub fn validate(&self) -> Result<()> {
        nominal::check(self)?;
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
