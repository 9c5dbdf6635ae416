//! N environments as blocks of lanes, stepped on the caller's thread and on those of its helpers.

use std::sync::{Arc, Mutex, PoisonError};

use crate::config::Config;
use crate::environment::{Autoreset, Environments, SavedEnvironment, Setup};
use crate::error::{Error, Result};
use crate::lanes::vectorised;
use crate::params::within;
use crate::prefetch::prefetch;
use crate::randomisation::Randomiser;
use crate::recorder::{Recorder, Row};
use crate::scenario::Episode;
use crate::simulation::{Model, Scratch};
use crate::snapshot;
use crate::statistics::Normaliser;
use crate::step_output::{StepOutput, split};

/// Walkers per wide block: one AVX-512 register of `f64`.
pub const LANES: usize = 8;
/// Below this many walkers a block holds one: a half-empty wide block is slower than scalar code.
const SCALAR_BELOW: usize = 4;
/// Below this many blocks a step runs on the caller's thread: waking helpers costs more than it saves.
const PARALLEL_FROM: usize = 6;
/// Blocks that a thread takes at least.
const BLOCKS_PER_TASK: usize = 4;
/// Tasks that a step is cut into at most: enough for threads to end together, few enough to be handed out at no cost.
const MOST_TASKS: usize = 128;

/// A block of environments of some width; `lane` and the slices' lengths cover its used lanes.
trait Block: Send + Sync + std::fmt::Debug {
    fn reset(&mut self, setup: &Setup, mask: &[bool], seeds: Option<&[u64]>, scratches: &mut Scratches);
    fn step(&mut self, setup: &Setup, actions: &[f64], output: &mut StepOutput<'_>, scratches: &mut Scratches);
    fn observations(&self) -> &[f32];
    fn ended(&self, lane: usize) -> bool;
    fn episode(&self, lane: usize) -> Option<&Episode>;
    fn save(&self, setup: &Setup, lane: usize) -> Option<SavedEnvironment>;
    fn restore(&mut self, setup: &Setup, lane: usize, saved: &SavedEnvironment, scratches: &mut Scratches);
    fn record(&mut self, lane: usize);
    fn recording(&self) -> Option<&Recorder>;
    fn snapshot(&self, lane: usize) -> Row;
    fn ground_height(&self, lane: usize, x: f64) -> f64;
    fn bytes(&self) -> usize;
    fn prefetch(&self);
}

/// What a thread needs for a step, made when it is first needed. Boxed: Python aligns the batch to 16 bytes, columns need 64.
#[derive(Debug, Default)]
struct Scratches {
    narrow: Option<Box<Scratch<1>>>,
    wide: Option<Box<Scratch<LANES>>>,
}

/// Environments and the constants of their walkers, which all blocks share.
#[derive(Debug)]
struct Walking<const L: usize> {
    model: Arc<Model<L>>,
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
            fn step(&mut self, setup: &Setup, actions: &[f64], output: &mut StepOutput<'_>, scratches: &mut Scratches) {
                let scratch = scratches.$scratch.get_or_insert_with(|| Box::new(Scratch::new(&self.model)));
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
            fn restore(&mut self, setup: &Setup, lane: usize, saved: &SavedEnvironment, scratches: &mut Scratches) {
                let scratch = scratches.$scratch.get_or_insert_with(|| Box::new(Scratch::new(&self.model)));
                self.environments.restore(setup, &mut self.model, lane, saved, scratch);
            }
            fn record(&mut self, lane: usize) {
                self.environments.record(lane);
            }
            fn recording(&self) -> Option<&Recorder> {
                self.environments.recording()
            }
            fn snapshot(&self, lane: usize) -> Row {
                self.environments.snapshot(&self.model, lane)
            }
            fn ground_height(&self, lane: usize, x: f64) -> f64 {
                self.model.plant.ground_height(lane, x)
            }
            fn prefetch(&self) {
                self.environments.prefetch();
            }
            fn bytes(&self) -> usize {
                size_of::<Self>() + size_of_val(self.environments.observations())
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
        model: &Model<L>,
        actions: &[f64],
        output: &mut StepOutput<'_>,
        scratch: &mut Scratch<L>,
    ) -> [bool; L] {
        block.step(setup, model, actions, output, scratch)
    }
}

/// N environments.
#[derive(Debug)]
pub struct Batch {
    setup: Setup,
    blocks: Vec<Box<dyn Block>>,
    /// Environments per block.
    width: usize,
    num_envs: usize,
    /// The caller's and its helpers.
    threads: usize,
    helpers: Option<Helpers>,
    /// The caller's.
    scratches: Scratches,
    /// Statistics of the observations, where they are normalised.
    pub normaliser: Option<Normaliser>,
}

/// Threads beside the caller's, their scratches, and the process that they live in.
#[derive(Debug)]
struct Helpers {
    process: u32,
    threads: rayon::ThreadPool,
    scratches: Vec<Scratches>,
}

impl Batch {
    /// Environments with one configuration, all waiting for [`reset`](Self::reset). `threads = 0` takes all cores.
    pub fn new(num_envs: usize, config: Config, autoreset: Autoreset, threads: usize) -> Result<Self> {
        within(1.0, 16_777_216.0).check("num_envs", num_envs as f64, "")?;
        within(0.0, 1024.0).check("threads", threads as f64, "")?;
        let threads = if threads == 0 { std::thread::available_parallelism().map_or(1, usize::from) } else { threads };
        let setup = Setup::new(config, autoreset)?;
        let width = if num_envs < SCALAR_BELOW { 1 } else { LANES };
        let blocks = num_envs.div_ceil(width);
        let blocks = if width == 1 { walkers::<1>(&setup, blocks) } else { walkers::<LANES>(&setup, blocks) };
        Ok(Self {
            setup,
            blocks,
            width,
            num_envs,
            threads,
            helpers: None,
            scratches: Scratches::default(),
            normaliser: None,
        })
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.num_envs
    }

    /// Memory of an environment in its block, without what its episode's profile and pushes hold.
    pub fn bytes_per_walker(&self) -> usize {
        self.blocks.first().map_or(0, |block| block.bytes() / self.width)
    }

    /// Length of an observation.
    pub fn observation_size(&self) -> usize {
        self.setup.observation_size()
    }

    /// How many numbers an action has.
    pub fn action_size(&self) -> usize {
        self.setup.action_size()
    }

    /// Steps of the integration per control period.
    pub fn solver_steps(&self) -> usize {
        self.setup.config.steps()
    }

    /// What happens after an episode's end.
    pub fn autoreset(&self) -> Autoreset {
        self.setup.autoreset
    }

    /// Resets the environments in `mask` (N,): to episode 0 of their new seed, or to the next episode of their old one.
    pub fn reset(&mut self, seeds: Option<&[u64]>, mask: &[bool]) -> Result<()> {
        self.check_length("mask", mask.len())?;
        if let Some(seeds) = seeds {
            self.check_length("seeds", seeds.len())?;
        }
        for ((i, block), mask) in self.blocks.iter_mut().enumerate().zip(mask.chunks(self.width)) {
            block.reset(&self.setup, mask, seeds.map(|seeds| &seeds[i * self.width..]), &mut self.scratches);
        }
        Ok(())
    }

    /// Copies the newest observations, (N, observation size), normalised if that is asked for. Those in the mask `new` are seen
    /// for the first time: the others have been learnt from already.
    pub fn observations(&mut self, new: &[bool], into: &mut [f32]) {
        self.raw_observations(into);
        if let Some(normaliser) = &mut self.normaliser {
            let size = self.setup.observation_size();
            let rows: Vec<f32> =
                into.chunks_exact(size).zip(new).filter(|(_, new)| **new).flat_map(|(row, _)| row).copied().collect();
            normaliser.see(&rows);
            normaliser.normalise(into);
        }
    }

    fn raw_observations(&self, into: &mut [f32]) {
        for (block, slot) in self.blocks.iter().zip(into.chunks_mut(self.width * self.observation_size())) {
            slot.copy_from_slice(&block.observations()[..slot.len()]);
        }
    }

    /// Advances every environment by `action.hold` control periods. Actions must be finite.
    pub fn step(&mut self, actions: &[f64], mut output: StepOutput<'_>) -> Result<()> {
        self.step_raw(actions, output.reborrow())?;
        if let Some(normaliser) = &mut self.normaliser {
            normaliser.see(output.observations);
            normaliser.normalise(output.observations);
            normaliser.normalise(output.final_observations);
        }
        Ok(())
    }

    fn step_raw(&mut self, actions: &[f64], output: StepOutput<'_>) -> Result<()> {
        let size = self.setup.action_size();
        if actions.len() != size * self.num_envs {
            let reason =
                format!("actions have {} entries, must have {size} per environment: {}", actions.len(), self.num_envs);
            return Err(Error::Invalid(reason));
        }
        if let Some(index) = actions.iter().position(|action| !action.is_finite()) {
            let reason = format!("actions[{index}] = {} must be a finite number in [-1, 1]", actions[index]);
            return Err(Error::Invalid(reason));
        }
        if self.setup.autoreset == Autoreset::Disabled
            && let Some(index) = (0..self.num_envs).find(|i| self.blocks[i / self.width].ended(i % self.width))
        {
            return Err(Error::Invalid(format!("environment {index} has ended: reset it before its next step")));
        }
        let setup = &self.setup;
        let blocks = self.blocks.len();
        if self.threads == 1 || blocks < PARALLEL_FROM {
            run(&mut self.blocks, self.width, setup, actions, output, &mut self.scratches);
            return Ok(());
        }
        let helpers = helpers(&mut self.helpers, self.threads)?;
        let task = BLOCKS_PER_TASK.max(blocks.div_ceil(MOST_TASKS));
        let tasks = self.blocks.chunks_mut(task).zip(split(actions, output, self.width * task, setup));
        // The caller starts at once; helpers take what is left when they have woken up.
        let (tasks, width) = (Mutex::new(tasks), self.width);
        let work = |scratches: &mut Scratches| {
            let next = || tasks.lock().unwrap_or_else(PoisonError::into_inner).next();
            while let Some((blocks, (actions, output))) = next() {
                run(blocks, width, setup, actions, output, scratches);
            }
        };
        helpers.threads.in_place_scope(|scope| {
            for scratches in helpers.scratches.iter_mut().take(blocks.div_ceil(task) - 1) {
                scope.spawn(|_| work(scratches));
            }
            work(&mut self.scratches);
        });
        Ok(())
    }

    /// Share of disturbances and randomisation, in [0, 1], that episodes have from their next start on.
    pub fn set_difficulty(&mut self, difficulty: f64) -> Result<()> {
        within(0.0, 1.0).check("difficulty", difficulty, "")?;
        self.setup.difficulty = difficulty;
        Ok(())
    }

    /// That share.
    pub fn difficulty(&self) -> f64 {
        self.setup.difficulty
    }

    /// Keys of the randomised parameters.
    pub fn randomised(&self) -> impl Iterator<Item = &str> {
        self.setup.randomiser.iter().flat_map(Randomiser::keys)
    }

    /// State of the environments at `indices`: put back, each goes on bit for bit.
    pub fn save(&self, indices: &[usize]) -> Result<Vec<u8>> {
        let saved = indices.iter().map(|&index| {
            self.check_index(index)?;
            let saved = self.blocks[index / self.width].save(&self.setup, index % self.width);
            saved.ok_or_else(|| Error::Invalid(format!("environment {index} has not been reset yet")))
        });
        snapshot::encode(&self.setup.config, &saved.collect::<Result<Vec<_>>>()?)
    }

    /// Puts saved environments at `indices`; a single one at all of them.
    pub fn restore(&mut self, indices: &[usize], bytes: &[u8]) -> Result<()> {
        let saved = snapshot::decode(&self.setup.config, bytes)?;
        if saved.len() != 1 && saved.len() != indices.len() {
            let reason = format!("state holds {} environments, must hold 1 or {}", saved.len(), indices.len());
            return Err(Error::Invalid(reason));
        }
        indices.iter().try_for_each(|&index| self.check_index(index))?;
        for (&index, saved) in indices.iter().zip(saved.iter().cycle()) {
            let block = &mut self.blocks[index / self.width];
            block.restore(&self.setup, index % self.width, saved, &mut self.scratches);
        }
        Ok(())
    }

    /// The episode that runs in each environment.
    pub fn episodes(&self) -> impl Iterator<Item = &Episode> {
        (0..self.num_envs).filter_map(|index| self.blocks[index / self.width].episode(index % self.width))
    }

    /// Records environment `index` at 200 Hz from its next reset on.
    pub fn record(&mut self, index: usize) -> Result<()> {
        self.check_index(index)?;
        self.blocks[index / self.width].record(index % self.width);
        Ok(())
    }

    /// What has been recorded since the last reset of the recorded environment.
    pub fn recording(&self) -> Option<&Recorder> {
        self.blocks.iter().find_map(|block| block.recording())
    }

    /// The present state of environment `index`, as a recorder would append it, less the mean powers.
    pub fn snapshot(&self, index: usize) -> Result<Row> {
        self.check_index(index)?;
        Ok(self.blocks[index / self.width].snapshot(index % self.width))
    }

    /// Heights of the ground under environment `index` at the places `x`, m.
    pub fn ground_height(&self, index: usize, x: &[f64]) -> Result<Vec<f64>> {
        self.check_index(index)?;
        let block = &self.blocks[index / self.width];
        Ok(x.iter().map(|&x| block.ground_height(index % self.width, x)).collect())
    }

    fn check_index(&self, index: usize) -> Result<()> {
        within(0.0, (self.num_envs - 1) as f64).check("index", index as f64, "")
    }

    fn check_length(&self, name: &str, length: usize) -> Result<()> {
        if length == self.num_envs {
            return Ok(());
        }
        Err(Error::Invalid(format!("{name} has {length} entries, must have one per environment: {}", self.num_envs)))
    }
}

/// Steps blocks one after another.
fn run(
    blocks: &mut [Box<dyn Block>],
    width: usize,
    setup: &Setup,
    actions: &[f64],
    output: StepOutput<'_>,
    scratches: &mut Scratches,
) {
    let mut work = blocks.iter_mut().zip(split(actions, output, width, setup)).peekable();
    while let Some((block, (actions, mut output))) = work.next() {
        if let Some((next, (actions, output))) = work.peek() {
            next.prefetch();
            prefetch(*actions);
            output.prefetch();
        }
        block.step(setup, actions, &mut output, scratches);
    }
}

/// Blocks of equal walkers.
fn walkers<const L: usize>(setup: &Setup, blocks: usize) -> Vec<Box<dyn Block>>
where
    Walking<L>: Block + 'static,
{
    let mut model = Arc::new(Model::new(&setup.config));
    let mut scratch = Scratch::new(&model);
    let environments = Environments::new(setup, &mut model, &mut scratch);
    let block = || Walking { model: Arc::clone(&model), environments: environments.clone() };
    (0..blocks).map(|_| -> Box<dyn Block> { Box::new(block()) }).collect()
}

/// The helpers of this process: threads do not survive a fork, so a child starts its own.
fn helpers(slot: &mut Option<Helpers>, threads: usize) -> Result<&mut Helpers> {
    let process = std::process::id();
    if slot.as_ref().is_none_or(|helpers| helpers.process != process) {
        let threads = rayon::ThreadPoolBuilder::new()
            .num_threads(threads - 1)
            .build()
            .map_err(|error| Error::Invalid(format!("cannot start {threads} threads: {error}")))?;
        let scratches = (0..threads.current_num_threads()).map(|_| Scratches::default()).collect();
        // The parent's have no threads here; dropping them would wait for them.
        std::mem::forget(slot.replace(Helpers { process, threads, scratches }));
    }
    slot.as_mut().ok_or_else(|| Error::Invalid("no threads".into()))
}
