//! The agent in place of a prosthesis controller: what it sees ([`observation`]) and what its actions do ([`action`]).

pub mod action;
pub mod actuation;
pub mod observation;
