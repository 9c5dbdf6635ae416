//! Prosthesis controllers, run at 200 Hz on sensor readings.

pub mod agent;
pub mod damper_fsm;
