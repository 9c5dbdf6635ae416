//! How a block declares its parameters, and what goes wrong with them.

pub mod distribution;
pub mod error;
pub mod params;
pub(crate) mod record;
