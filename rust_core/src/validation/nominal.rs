//! Checks of a configuration for itself, whatever episodes draw around it.

use crate::agent::action::ActionMode;
use crate::agent::observation::ObservationMap;
use crate::config::Config;
use crate::schema::error::{Error, Result};
use crate::validation::span::Span;

/// Checks every value against its range, and those that must fit together.
pub(super) fn check(config: &Config) -> Result<()> {
    config.validate_sections()?;
    config.solver.check_explicit("solver")?;
    if config.action.mode == ActionMode::Impedance && !config.device.kind.has_motor() {
        return Err(Error::Invalid("action.mode = impedance needs a motor: device.kind = motor".into()));
    }
    ObservationMap::new(&config.observation, config.device.kind).check()?;
    Span::of(config).check()
}
