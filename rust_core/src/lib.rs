//! Planar human-prosthesis walking simulator after Driessen, Laffranchi & De Michieli (2023), Wearable Technologies 4, e10.
//!
//! ```text
//!                 intent, speed (scenario)                     pushes (disturbance)
//!                        |                                            |
//!        ┌───────────────v─────────── human_prosthesis ───────────────v──────────────┐
//!        │   human_controller ──> hybrid_dynamics <──> compliant_ground              │
//!        │                              ^                                            │
//!        │                     prosthesis_device                                     │
//!        └──────────────────────────────^──────────────────────────┬─────────────────┘
//!                                       | command                  | loads, angles
//!                            prosthesis_controller <── readings ── sensors
//!                                       ^
//!                                  agent (batch, environment)
//! ```

pub mod error;
pub mod integrator;
mod lanes;
pub mod math;
pub mod params;
mod prefetch;
pub mod signals;

pub mod compliant_ground;
pub mod distribution;
pub mod disturbance;
pub mod energy_meter;
pub mod human_controller;
pub mod human_prosthesis;
pub mod hybrid_dynamics;
pub mod prosthesis_controller;
pub mod prosthesis_device;
pub mod randomisation;
pub mod repetition;
pub mod scenario;
pub mod sensors;
pub mod simulation;
pub mod terrain;
pub mod trial;

pub mod batch;
pub mod block;
pub mod config;
mod crew;
pub mod environment;
pub mod judgement;
#[cfg(feature = "python")]
mod python;
pub mod recorder;
pub mod reward;
mod shared_job;
pub mod snapshot;
pub mod statistics;
pub mod step_output;
pub mod termination;
