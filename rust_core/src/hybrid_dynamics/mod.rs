//! Hybrid dynamics: joints whose torque is given and acceleration wanted (forward), and the reverse (inverse).
//!
//! [`chain`] is the general engine for any planar serial chain; [`walker`] the specialised form for the walker's eight
//! joints that the lane loops run. [`walker_chain`] is the walker in the first, which tests
//! hold the second against.

pub mod body;
pub mod chain;
pub mod walker;
pub mod walker_chain;
