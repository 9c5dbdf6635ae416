//! The human-prosthesis system of Figure 1: everything that runs in continuous time, wired together.
//!
//! ```text
//!  intent ─> human ─────────────────── hip torque, trunk motion and force ──┐
//!               ^ heel force, hip                                           v
//!               └──────────────── compliant ground <── points ──────── mechanics ──> loads, motion
//!                                        └── forces ───────────────────^    ^
//!  command ─> prosthesis ───────────────────── knee and ankle torque ───────┘
//! ```

pub mod contact_force;
pub mod contact_points;
mod divergence;
pub mod flow;
mod footing;
mod general;
mod general_model;
pub mod model;
pub mod outputs;
pub mod params;
pub mod posture;
pub mod powers;
pub mod signals;
pub mod skeleton;
pub mod solver;
pub mod start;
pub mod state;
pub mod system;
pub mod torques;
pub mod walkers;
