//! The variable damper of section 5.2.

pub mod state_machine;
pub mod variable_damper;
