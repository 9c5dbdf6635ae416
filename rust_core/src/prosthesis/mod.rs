//! The prosthesis: knee unit with end stops, tube, ankle and socket, and the reference controllers of the knee units.

pub mod ankle;
pub mod end_stop;
pub mod gait;
pub mod knee;
pub mod reference_controller;
pub mod socket;
pub mod spring_damper;
pub mod tube;
