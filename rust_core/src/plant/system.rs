//! Human, mechanism, ground and device of a block of walkers, put together for an evaluation.

use crate::plant::model::PlantModel;
use crate::plant::outputs::PlantOutputs;
use crate::plant::signals::Signals;
use crate::plant::state::State;
use crate::plant::walkers::Walkers;

/// Human, mechanism, ground and device of a block of walkers: constants, what they keep, and room for an evaluation.
#[derive(Debug)]
pub struct HumanProsthesis<'a, const L: usize> {
    /// Constants.
    pub model: &'a PlantModel<L>,
    /// Inputs and discrete state.
    pub walkers: &'a mut Walkers<L>,
    /// Signals of the last evaluation.
    pub signals: &'a mut Signals<L>,
}

impl<const L: usize> HumanProsthesis<'_, L> {
    /// What there is to read at `state`, which must have been evaluated.
    #[inline(always)]
    pub fn at<'b>(&'b self, state: &'b State<L>) -> PlantOutputs<'b, L> {
        PlantOutputs::new(self.model, self.walkers, self.signals, state)
    }

    /// The same system for a function of its own. Its pointers stay in registers, and lane loops vector code, only as long as
    /// nobody takes the address of this struct: no closure and no function that is not inlined.
    #[inline(always)]
    pub(super) fn lend(&mut self) -> HumanProsthesis<'_, L> {
        HumanProsthesis { model: self.model, walkers: self.walkers, signals: self.signals }
    }
}
