//! One episode as it has been drawn: what happens to a walker.

use crate::closed_loop::disturbance::Disturbance;
use crate::human::intent::Profile;
use crate::human::variation::HumanVariation;
use crate::plant::start::Start;

/// What an episode has drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawn {
    /// Index among the variants; `None` for the nominal walker.
    pub variant: Option<usize>,
    /// Values of the randomised parameters, in the order of their keys.
    pub numbers: Vec<f64>,
}

/// One drawn episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    /// Start posture.
    pub start: Start,
    /// Intent and speed.
    pub profile: Profile,
    /// Seed of the sensors' noise.
    pub sensor_seed: u64,
    /// Pushes and gusts.
    pub disturbance: Disturbance,
    /// What the human does otherwise than the paper's.
    pub human: HumanVariation,
    /// Parameters of the walker, where episodes draw them.
    pub drawn: Option<Drawn>,
}

impl Episode {
    /// An episode without disturbances, of the paper's human and with a given start and intent.
    pub fn undisturbed(start: Start, profile: Profile) -> Self {
        Self {
            start,
            profile,
            sensor_seed: 0,
            disturbance: Disturbance::default(),
            human: HumanVariation::default(),
            drawn: None,
        }
    }
}
