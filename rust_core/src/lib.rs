//! Planar human-prosthesis walking simulator after Driessen, Laffranchi & De Michieli (2023), Wearable Technologies 4, e10.
//!
//! ```text
//!              intent, speed (episode::scenario)             pushes (closed_loop::disturbance)
//!                        |                                            |
//!        ┌───────────────v──────────────── plant ─────────────────────v──────────────┐
//!        │      human ────────────> mechanics (joints, ground, terrain)              │
//!        │                              ^                                            │
//!        │                          prosthesis                                       │
//!        └──────────────────────────────^──────────────────────────┬─────────────────┘
//!                                       | command                  | loads, angles     closed_loop: 200 Hz
//!               prosthesis::reference_controller <── readings ── sensors
//!                                       ^
//!                                     agent <── vector (environments, blocks, threads) <── python
//! ```
//!
//! Floors, from the ground up: numerics, schema, signals; human, mechanics, prosthesis, sensors; plant; closed_loop; agent,
//! episode; config; validation; vector; python. Nothing imports upwards, rooms of one floor know nothing of each other, and no
//! file imports itself by way of others: `tests/floors.rs` reads the imports.

pub mod numerics;
pub mod schema;
pub mod signals;

pub mod human;
pub mod mechanics;
pub mod prosthesis;
pub mod sensors;

pub mod closed_loop;
pub mod plant;

pub mod agent;
pub mod episode;

pub mod config;
pub mod trial;
pub mod validation;

#[cfg(feature = "python")]
mod python;
pub mod vector;
