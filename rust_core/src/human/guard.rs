//! What the human's state machine waits for.

use crate::numerics::lanes::lanes;

lanes! {
    /// Guard of the one transition that can come next: it fires when every quantity has passed its threshold.
    pub struct Guard, GuardLanes {
        /// Time must exceed, s.
        after: f64,
        /// Hip height must be at most, m.
        hip_below: f64,
        /// Heel force must exceed, N.
        heel_force_above: f64,
        /// Pendulum force must be below, N.
        pendulum_below: f64,
        /// Mid-foot must be ahead of the hip by less than, m.
        midfoot_below: f64,
        /// Intent (0 or 1) must exceed.
        intent_above: f64,
    }
}

/// What the guards look at.
#[derive(Clone, Copy, Debug, Default)]
pub struct Percept {
    /// Time, s.
    pub time: f64,
    /// Hip height above the ground that the intact leg would touch down on, m.
    pub hip_y: f64,
    /// Heel normal force, N.
    pub heel_force: f64,
    /// Pendulum force, N.
    pub pendulum: f64,
    /// Mid-foot ahead of the hip, m.
    pub midfoot: f64,
    /// Intent, 0 or 1.
    pub intent: f64,
}

/// Whether the guard holds.
#[inline(always)]
pub fn holds(guard: &Guard, percept: &Percept) -> bool {
    (percept.time > guard.after)
        & (percept.hip_y <= guard.hip_below)
        & (percept.heel_force > guard.heel_force_above)
        & (percept.pendulum < guard.pendulum_below)
        & (percept.midfoot < guard.midfoot_below)
        & (percept.intent > guard.intent_above)
}
