//! Prosthesis device: what turns the command into knee and ankle torque.

pub mod end_stop;
pub mod passive_ankle;
pub mod variable_damper;
