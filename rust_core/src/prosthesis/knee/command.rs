//! What knee units are commanded.

/// The quantity that a knee unit is commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Command {
    /// What it is.
    pub quantity: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Whether it has a sign: then it is proportional to an action in [-1, 1], else quadratic from 0 at -1.
    pub signed: bool,
}
