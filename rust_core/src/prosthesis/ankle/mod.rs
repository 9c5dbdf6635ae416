//! Ankles.

pub mod passive_ankle;
