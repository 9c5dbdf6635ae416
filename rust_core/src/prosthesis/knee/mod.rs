//! Knee units, a folder each.

pub mod command;
pub mod damper;
pub mod friction;
pub mod joint;
pub mod kind;
pub mod motor;
pub mod unit;
