//! The closed loop of Figure 1: plant, sensors and reference controller, one control period (5 ms) at a time.

pub mod disturbance;
pub mod energy_meter;
pub mod episode;
mod measurand;
pub mod params;
pub mod repetition;
pub mod saved;
pub mod simulation;
