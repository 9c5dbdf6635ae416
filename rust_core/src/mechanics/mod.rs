//! Hybrid dynamics: joints whose torque is given and acceleration wanted (forward), and the reverse (inverse).
//!
//! [`chain`] is the general engine for any planar serial chain; [`walker`] the specialised form for the walker's eight
//! joints that the lane loops run. [`walker_chain`] is the walker in the first, which tests hold the second against, and
//! which [`general_walker`] runs for walkers with more joints or other ones driven.

pub mod body;
pub mod chain;
pub mod compliant_ground;
mod equations;
pub mod general_walker;
pub mod joint_drives;
pub mod motion;
pub mod terrain;
pub mod walker;
pub mod walker_chain;
