//! The motor and strain-wave gear of section 5.3.

pub mod geared_motor;
pub mod state_machine;
