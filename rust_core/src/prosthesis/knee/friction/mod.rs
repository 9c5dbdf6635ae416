//! The mechanical knee with constant friction.

pub mod constant_friction;
