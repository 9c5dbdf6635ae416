//! The agent in place of a prosthesis controller: what it sees ([`observation`]) and what its actions do ([`action`]).

pub mod action;
pub mod observation;

pub use action::{ActionMap, ActionParams, Actuation, Actuations, CommandScale, CommandScaleLanes};
pub use observation::{Channel, ObservationMap, ObservationParams};
