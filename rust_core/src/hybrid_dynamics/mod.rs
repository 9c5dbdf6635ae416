//! Hybrid dynamics: joints whose torque is given and acceleration wanted (forward), and the reverse (inverse).
//!
//! [`chain`] is the general engine for any planar serial chain; [`walker`] the specialised form for the walker's eight
//! joints that the lane loops run. Tests hold the second against the first.

pub mod body;
pub mod chain;
pub mod walker;
