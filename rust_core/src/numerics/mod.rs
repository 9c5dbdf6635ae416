//! What knows no walker: lanes, functions, noise, integration.

pub mod integrator;
pub(crate) mod lanes;
pub mod math;
pub(crate) mod noise;
pub(crate) mod prefetch;
