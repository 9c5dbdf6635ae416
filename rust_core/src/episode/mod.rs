//! What an episode is drawn from, what ends it, what it is worth, and what is recorded of it.

pub mod judgement;
pub mod randomisation;
pub mod recorder;
pub mod reward;
pub mod scenario;
pub mod termination;
