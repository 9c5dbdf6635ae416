//! Repeating the control period of a walker whose integration has diverged in it.
//!
//! Long steps of the fast stepper blow up now and then where a foot is slammed into the ground. Nobody should take that for a
//! fall, so the period is integrated again, in finer steps and then by the reference, before it counts as diverged. Lanes never mix:
//! the whole block goes back to the period's start, and only the walkers that had diverged keep what comes of it.

use crate::plant::model::PlantModel;
use crate::plant::state::State;
use crate::plant::walkers::{WalkerMemory, Walkers};

/// Integrations of a control period at most: by the configured solver, in finer steps, by the reference.
pub const ATTEMPTS: usize = 3;

/// Control periods that were integrated more than once, by what came of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Repeats {
    /// Settled in finer steps of the configured stepper.
    pub finer: u64,
    /// Settled by the reference alone.
    pub reference: u64,
    /// Diverged by all.
    pub diverged: u64,
}

impl Repeats {
    /// Adds the periods that were settled by an attempt, and those that none has settled.
    pub fn count<const L: usize>(&mut self, attempt: usize, open: &[bool; L], diverged: &[bool; L]) {
        for lane in (0..L).filter(|&lane| open[lane]) {
            match (diverged[lane], attempt) {
                (false, 1) => self.finer += 1,
                (false, _) => self.reference += 1,
                (true, attempt) => self.diverged += u64::from(attempt + 1 == ATTEMPTS),
            }
        }
    }

    /// Those of both.
    pub fn plus(self, other: Self) -> Self {
        Self {
            finer: self.finer + other.finer,
            reference: self.reference + other.reference,
            diverged: self.diverged + other.diverged,
        }
    }
}

/// A block of walkers at some time within a control period; the inputs of the period are as they are.
#[derive(Clone, Debug)]
pub struct Moment<const L: usize> {
    state: State<L>,
    walkers: [WalkerMemory; L],
}

impl<const L: usize> Moment<L> {
    /// Room for walkers like these.
    pub fn new(state: &State<L>) -> Self {
        let walkers = Walkers::<L>::default();
        Self { state: state.clone(), walkers: std::array::from_fn(|lane| walkers.get(lane)) }
    }

    /// Takes it down.
    #[inline(always)]
    pub fn keep(&mut self, state: &State<L>, walkers: &Walkers<L>) {
        self.state.clone_from(state);
        for lane in 0..L {
            self.walkers[lane] = walkers.get(lane);
        }
    }

    /// Puts the walkers of `lanes` back there.
    pub fn restore(&self, model: &PlantModel<L>, lanes: &[bool; L], state: &mut State<L>, walkers: &mut Walkers<L>) {
        for lane in (0..L).filter(|&lane| lanes[lane]) {
            state.set(lane, &self.state.get(lane));
            walkers.set(model, lane, &self.walkers[lane]);
        }
    }
}
