//! What happens to an environment after its episode has ended.

use strum::{EnumString, VariantNames};

/// What happens to an environment after its episode has ended (Gymnasium's `AutoresetMode`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, VariantNames)]
#[strum(serialize_all = "snake_case")]
pub enum Autoreset {
    /// Its next step ignores the action and resets it.
    NextStep,
    /// It is reset at once; the last observation of the old episode is handed out beside.
    SameStep,
    /// The caller resets it; stepping it before is an error.
    Disabled,
}
