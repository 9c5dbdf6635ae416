//! Many environments at once: episodes in blocks of lanes, blocks on threads.

pub mod autoreset;
pub mod batch;
pub mod block;
mod crew;
pub mod environment;
pub(crate) mod memory;
pub mod saved_states;
pub mod setup;
pub mod shared;
mod shared_job;
pub mod statistics;
pub mod step;
pub mod step_output;
