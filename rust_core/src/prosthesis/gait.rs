//! The gait as a prosthesis sees it.

use serde::{Deserialize, Serialize};
use strum::VariantNames;

/// Phase of the gait as the prosthesis sees it (numbers of Figures 6 and 10).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, VariantNames)]
#[strum(serialize_all = "snake_case")]
#[repr(u8)]
pub enum Phase {
    /// 1: knee flexes under load.
    #[default]
    EarlyStance = 1,
    /// 2: knee extends under load.
    MidStance,
    /// 3: push-off.
    LateStance,
    /// 4: swing, knee flexing.
    SwingFlexion,
    /// 5: swing, knee extending.
    SwingExtension,
}

/// What a reference controller remembers of its walker between samples. All of them share it, so that none can meet the memory
/// of another; one that needs less leaves the rest as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GaitMemory {
    /// Present phase; always early stance where there is but one.
    pub phase: Phase,
    /// Samples since the phase began.
    pub(in crate::prosthesis) in_phase: u32,
    /// Samples for which the knee has been extended, counted from the first.
    pub(in crate::prosthesis) extended: u32,
}

impl GaitMemory {
    /// Number of the phase, 1 to 5.
    pub fn phase(&self) -> u8 {
        self.phase as u8
    }
}
