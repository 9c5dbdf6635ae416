//! A block: environments side by side in the lanes of one walker, stepped by one thread.

use std::sync::Arc;

use crate::closed_loop::episode::Episode;
use crate::closed_loop::repetition::Repeats;
use crate::closed_loop::simulation::{LoopModel, Scratch};
use crate::episode::recorder::{Recorder, Row};
use crate::numerics::lanes::vectorised;
use crate::numerics::prefetch::Ahead;
use crate::vector::environment::{Environments, SavedEnvironment};
use crate::vector::setup::Setup;
use crate::vector::step_output::StepOutput;

/// Walkers per wide block: one AVX-512 register of `f64`.
pub const LANES: usize = 8;

/// A block of environments of some width; `lane` and the slices' lengths cover its used lanes.
pub trait Block: Send + Sync + std::fmt::Debug {
    /// Resets the lanes in `mask`, to episode 0 of new seeds or to their next episode.
    fn reset(&mut self, setup: &Setup, mask: &[bool], seeds: Option<&[u64]>, scratches: &mut Scratches);
    /// Advances all lanes by one action each, and has `ahead` fetched meanwhile.
    fn step(
        &mut self,
        setup: &Setup,
        actions: &[f64],
        output: &mut StepOutput<'_>,
        scratches: &mut Scratches,
        ahead: Ahead,
    );
    /// The newest observations, (lanes, observation size).
    fn observations(&self) -> &[f32];
    /// Whether the lane's episode has ended.
    fn ended(&self, lane: usize) -> bool;
    /// The episode that runs, unless the lane has never been reset.
    fn episode(&self, lane: usize) -> Option<&Episode>;
    /// The lane's state, unless it has never been reset.
    fn save(&self, setup: &Setup, lane: usize) -> Option<SavedEnvironment>;
    /// Puts a saved state into the lane; returns whether that had ended and starts anew.
    fn restore(&mut self, setup: &Setup, lane: usize, saved: &SavedEnvironment, scratches: &mut Scratches) -> bool;
    /// Records the lane from its next reset on, or none any longer.
    fn record(&mut self, lane: Option<usize>);
    /// What has been recorded.
    fn recording(&self) -> Option<&Recorder>;
    /// Control periods that had to be integrated again.
    fn repeats(&self) -> Repeats;
    /// The lane's present state, as a recorder would append it.
    fn snapshot(&self, lane: usize) -> Row;
    /// Height of the ground under the lane's walker at `x`, m.
    fn ground_height(&self, lane: usize, x: f64) -> f64;
    /// Memory of the block, without what its episodes' profiles and pushes hold.
    fn bytes(&self) -> usize;
    /// Memory of the block with all that it may come to hold.
    fn most_bytes(&self, setup: &Setup) -> usize;
    /// Another block like this one.
    fn duplicate(&self) -> Box<dyn Block>;
    /// The block's memory, to be fetched while another block is stepped.
    fn memory(&self) -> Ahead;
}

/// What a thread needs for a step, made when it is first needed. Boxed: Python aligns the batch to 16 bytes, columns need 64.
#[derive(Debug, Default)]
pub struct Scratches {
    narrow: Option<Box<Scratch<1>>>,
    wide: Option<Box<Scratch<LANES>>>,
}

/// Environments and the constants of their walkers, which all blocks share.
#[derive(Clone, Debug)]
struct Walking<const L: usize> {
    model: Arc<LoopModel<L>>,
    environments: Environments<L>,
}

macro_rules! block {
    ($width:expr, $scratch:ident) => {
        impl Block for Walking<$width> {
            fn reset(&mut self, setup: &Setup, mask: &[bool], seeds: Option<&[u64]>, scratches: &mut Scratches) {
                let lanes = std::array::from_fn(|lane| mask.get(lane).is_some_and(|&selected| selected));
                let scratch = scratches.$scratch.get_or_insert_with(|| Box::new(Scratch::new(&self.model)));
                let seed = |lane: usize| seeds.map(|seeds| seeds[lane]);
                self.environments.reset(setup, &mut self.model, &lanes, seed, scratch);
            }
            fn step(
                &mut self,
                setup: &Setup,
                actions: &[f64],
                output: &mut StepOutput<'_>,
                scratches: &mut Scratches,
                ahead: Ahead,
            ) {
                let scratch = scratches.$scratch.get_or_insert_with(|| Box::new(Scratch::new(&self.model)));
                scratch.ahead = ahead;
                let starting = step(&mut self.environments, setup, &self.model, actions, output, scratch);
                self.environments.finish(setup, &mut self.model, &starting, output, scratch);
            }
            fn observations(&self) -> &[f32] {
                self.environments.observations()
            }
            fn ended(&self, lane: usize) -> bool {
                self.environments.ended(lane)
            }
            fn episode(&self, lane: usize) -> Option<&Episode> {
                self.environments.episode(lane)
            }
            fn save(&self, setup: &Setup, lane: usize) -> Option<SavedEnvironment> {
                self.environments.save(setup, lane)
            }
            fn restore(
                &mut self,
                setup: &Setup,
                lane: usize,
                saved: &SavedEnvironment,
                scratches: &mut Scratches,
            ) -> bool {
                let scratch = scratches.$scratch.get_or_insert_with(|| Box::new(Scratch::new(&self.model)));
                self.environments.restore(setup, &mut self.model, lane, saved, scratch)
            }
            fn record(&mut self, lane: Option<usize>) {
                self.environments.record(lane);
            }
            fn recording(&self) -> Option<&Recorder> {
                self.environments.recording()
            }
            fn repeats(&self) -> Repeats {
                self.environments.repeats()
            }
            fn snapshot(&self, lane: usize) -> Row {
                self.environments.snapshot(&self.model, lane)
            }
            fn ground_height(&self, lane: usize, x: f64) -> f64 {
                self.model.plant.ground_height(lane, x)
            }
            fn memory(&self) -> Ahead {
                Ahead::of(self)
            }
            fn bytes(&self) -> usize {
                size_of::<Self>() + size_of_val(self.environments.observations())
            }
            fn most_bytes(&self, setup: &Setup) -> usize {
                let model = if setup.randomiser.is_some() { self.model.bytes() } else { 0 };
                size_of::<Self>() + self.environments.most_heap_bytes(setup) + model
            }
            fn duplicate(&self) -> Box<dyn Block> {
                Box::new(self.clone())
            }
        }
    };
}
block!(1, narrow);
block!(LANES, wide);

vectorised! {
    /// One step of a block.
    fn step<const L: usize>(
        block: &mut Environments<L>,
        setup: &Setup,
        model: &LoopModel<L>,
        actions: &[f64],
        output: &mut StepOutput<'_>,
        scratch: &mut Scratch<L>,
    ) -> [bool; L] {
        block.step(setup, model, actions, output, scratch)
    }
}

/// A block of `width` equal walkers: 1 or [`LANES`].
pub fn block(setup: &Setup, width: usize) -> Box<dyn Block> {
    if width == 1 { equal::<1>(setup) } else { equal::<LANES>(setup) }
}

fn equal<const L: usize>(setup: &Setup) -> Box<dyn Block>
where
    Walking<L>: Block + 'static,
{
    let mut model = Arc::new(LoopModel::new(&setup.config.loop_params(), setup.config.solvers()));
    let mut scratch = Scratch::new(&model);
    let environments = Environments::new(setup, &mut model, &mut scratch);
    Box::new(Walking { model, environments })
}
