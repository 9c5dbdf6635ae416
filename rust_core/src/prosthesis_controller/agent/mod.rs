//! The agent in place of a prosthesis controller: what it sees ([`observation`]) and what its actions do ([`action`]).

pub mod action;
pub mod actuation;
pub mod observation;

pub use action::{ActionMap, ActionParams, CommandScale, CommandScaleLanes};
pub use actuation::{Actuation, Actuations};
pub use observation::{Channel, Group, ObservationMap, ObservationParams};
