//! N environments: a batch.

use crate::closed_loop::episode::Episode;
use crate::closed_loop::repetition::Repeats;
use crate::config::Config;
use crate::episode::recorder::{Recorder, Row};
use crate::schema::error::{Error, Result};
use crate::schema::params::within;
use crate::validation::randomiser::Randomiser;
use crate::vector::autoreset::Autoreset;
use crate::vector::block::{Block, LANES, block};
use crate::vector::crew::{Crew, Work};
use crate::vector::environment::SavedEnvironment;
use crate::vector::setup::Setup;
use crate::vector::statistics::Normaliser;
use crate::vector::step_output::StepOutput;
use crate::vector::{memory, saved_states};

/// Environments of a batch, at most.
pub const MOST_ENVIRONMENTS: usize = 16_777_216;
/// Outputs of steps that a caller holds at a time: those of the last step while the next is taken.
const OUTPUTS_HELD: usize = 2;
/// Below this many walkers a block holds one: a half-empty wide block is slower than scalar code.
const SCALAR_BELOW: usize = 4;

/// N environments.
#[derive(Debug)]
pub struct Batch {
    setup: Setup,
    blocks: Vec<Box<dyn Block>>,
    /// Environments per block.
    width: usize,
    num_envs: usize,
    /// The first environment that has never been reset.
    never_reset: Option<usize>,
    /// Memory that was there for it when it was made.
    bytes: u64,
    /// The environment that is recorded.
    recorded: Option<usize>,
    crew: Crew,
    /// Statistics of the observations, where they are normalised.
    pub normaliser: Option<Normaliser>,
}

impl Batch {
    /// Environments with one configuration, all waiting for [`reset`](Self::reset). `threads = 0` takes all cores. An error if
    /// there is not enough memory for them.
    pub fn new(num_envs: usize, config: Config, autoreset: Autoreset, threads: usize) -> Result<Self> {
        within(1.0, MOST_ENVIRONMENTS as f64).check("num_envs", num_envs as f64, "")?;
        within(0.0, 1024.0).check("threads", threads as f64, "")?;
        let threads = if threads == 0 { std::thread::available_parallelism().map_or(1, usize::from) } else { threads };
        let setup = Setup::new(config, autoreset)?;
        let width = if num_envs < SCALAR_BELOW { 1 } else { LANES };
        let (first, count) = (block(&setup, width), num_envs.div_ceil(width));
        let outputs = StepOutput::bytes_per_environment(setup.observation_size(), autoreset);
        let bytes = (count * first.most_bytes(&setup) + num_envs * OUTPUTS_HELD * outputs) as u64;
        memory::check(&format!("num_envs = {num_envs}"), bytes)?;
        let mut blocks = Vec::with_capacity(count);
        blocks.push(first);
        while blocks.len() < count {
            blocks.push(blocks[0].duplicate());
        }
        let crew = Crew::new(threads);
        Ok(Self { setup, blocks, width, num_envs, never_reset: Some(0), bytes, recorded: None, crew, normaliser: None })
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.num_envs
    }

    /// Memory of an environment in its block, without what its episode's profile and pushes hold.
    pub fn bytes_per_walker(&self) -> usize {
        self.blocks.first().map_or(0, |block| block.bytes() / self.width)
    }

    /// Memory of all environments with all that they may come to hold, and of what two steps give.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Length of an observation.
    pub fn observation_size(&self) -> usize {
        self.setup.observation_size()
    }

    /// How many numbers an action has.
    pub fn action_size(&self) -> usize {
        self.setup.action_size()
    }

    /// Control periods that had to be integrated again since the batch was made.
    pub fn repeats(&self) -> Repeats {
        self.blocks.iter().map(|block| block.repeats()).fold(Repeats::default(), Repeats::plus)
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
            block.reset(&self.setup, mask, seeds.map(|seeds| &seeds[i * self.width..]), &mut self.crew.scratches);
        }
        self.find_never_reset();
        Ok(())
    }

    fn find_never_reset(&mut self) {
        let was_reset = |i: &usize| self.blocks[i / self.width].episode(i % self.width).is_some();
        self.never_reset = (0..self.num_envs).find(|i| !was_reset(i));
    }

    /// Copies the newest observations, (N, observation size), normalised if that is asked for. Those in the mask `new` are seen
    /// for the first time: the others have been learnt from already.
    pub fn observations(&mut self, new: &[bool], into: &mut [f32]) -> Result<()> {
        self.check_length("new", new.len())?;
        self.raw_observations(into);
        if let Some(normaliser) = &mut self.normaliser {
            let size = self.setup.observation_size();
            let rows: Vec<f32> =
                into.chunks_exact(size).zip(new).filter(|(_, new)| **new).flat_map(|(row, _)| row).copied().collect();
            normaliser.see(&rows);
            normaliser.normalise(into);
        }
        Ok(())
    }

    /// Copies the newest observations as they are, (N, observation size).
    pub fn raw_observations(&self, into: &mut [f32]) {
        for (block, slot) in self.blocks.iter().zip(into.chunks_mut(self.width * self.observation_size())) {
            slot.copy_from_slice(&block.observations()[..slot.len()]);
        }
    }

    /// Advances every environment by `action.hold` control periods. Actions beyond [-1, 1] are limited, infinite ones too; NaN
    /// is an error.
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
        if let Some(index) = self.never_reset {
            return Err(Error::Invalid(format!("environment {index} has not been reset yet")));
        }
        output.check(self.num_envs, self.observation_size(), self.setup.autoreset)?;
        let size = self.setup.action_size();
        if actions.len() != size * self.num_envs {
            let reason =
                format!("actions have {} entries, must have {size} per environment: {}", actions.len(), self.num_envs);
            return Err(Error::Invalid(reason));
        }
        if let Some(index) = actions.iter().position(|action| action.is_nan()) {
            let reason = format!("actions[{index}] = NaN must be a number; those beyond [-1, 1] are limited");
            return Err(Error::Invalid(reason));
        }
        if self.setup.autoreset == Autoreset::Disabled
            && let Some(index) = (0..self.num_envs).find(|i| self.blocks[i / self.width].ended(i % self.width))
        {
            return Err(Error::Invalid(format!("environment {index} has ended: reset it before its next step")));
        }
        let work = Work { blocks: &mut self.blocks, width: self.width, actions, output };
        self.crew.run(work, &self.setup)
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

    /// Env steps of an episode at most; `None` without a limit.
    pub fn most_steps(&self) -> Option<u64> {
        self.setup.most_steps()
    }

    /// Ends episodes, those that run too, after so many env steps, in place of `scenario.duration_s`; `None` never.
    pub fn set_most_steps(&mut self, steps: Option<u64>) -> Result<()> {
        if let Some(steps) = steps {
            within(1.0, f64::MAX).check("max_episode_steps", steps as f64, "")?;
        }
        self.setup.set_most_steps(steps);
        Ok(())
    }

    /// Keys of the randomised parameters.
    pub fn randomised(&self) -> impl Iterator<Item = &str> {
        self.setup.randomiser.iter().flat_map(Randomiser::keys)
    }

    /// State of the environments at `indices`: put back, each goes on bit for bit.
    pub fn save(&self, indices: &[usize]) -> Result<Vec<u8>> {
        self.check_indices(indices)?;
        // What is saved, and twice its bytes while they grow.
        let bytes = 3 * indices.len() as u64 * SavedEnvironment::most_bytes(&self.setup) as u64;
        memory::check(&format!("the state of {} environments", indices.len()), bytes)?;
        let saved = indices.iter().map(|&index| {
            let saved = self.blocks[index / self.width].save(&self.setup, index % self.width);
            saved.ok_or_else(|| Error::Invalid(format!("environment {index} has not been reset yet")))
        });
        saved_states::encode(&self.setup.config, &saved.collect::<Result<Vec<_>>>()?)
    }

    /// Puts saved environments at `indices`; a single one at all of them. Returns which had ended and start anew.
    pub fn restore(&mut self, indices: &[usize], bytes: &[u8]) -> Result<Vec<bool>> {
        let saved = saved_states::decode(&self.setup.config, bytes)?;
        if saved.len() != 1 && saved.len() != indices.len() {
            let reason = format!("state holds {} environments, must hold 1 or {}", saved.len(), indices.len());
            return Err(Error::Invalid(reason));
        }
        self.check_indices(indices)?;
        saved.iter().try_for_each(|saved| saved.check(&self.setup))?;
        let mut restarts = Vec::with_capacity(indices.len());
        for (&index, saved) in indices.iter().zip(saved.iter().cycle()) {
            let block = &mut self.blocks[index / self.width];
            restarts.push(block.restore(&self.setup, index % self.width, saved, &mut self.crew.scratches));
        }
        self.find_never_reset();
        Ok(restarts)
    }

    /// The episode that runs in each environment.
    pub fn episodes(&self) -> impl Iterator<Item = &Episode> {
        (0..self.num_envs).filter_map(|index| self.blocks[index / self.width].episode(index % self.width))
    }

    /// Records environment `index` at 200 Hz from its next reset on, and no other any longer.
    pub fn record(&mut self, index: usize) -> Result<()> {
        self.check_index(index)?;
        let samples = self.setup.most_samples().ok_or_else(|| {
            Error::Invalid(format!("record({index}) needs episodes with an end: max_episode_steps must not be None"))
        })?;
        let bytes = samples.saturating_mul(size_of::<Row>() as u64);
        memory::check(
            &format!("record({index}) of scenario.duration_s = {} s", self.setup.config.scenario.duration_s),
            bytes,
        )?;
        if let Some(before) = self.recorded.replace(index) {
            self.blocks[before / self.width].record(None);
        }
        self.blocks[index / self.width].record(Some(index % self.width));
        Ok(())
    }

    /// What has been recorded since the last reset of the recorded environment; `None` if none is.
    pub fn recording(&self) -> Option<&Recorder> {
        self.blocks[self.recorded? / self.width].recording()
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

    fn check_indices(&self, indices: &[usize]) -> Result<()> {
        within(0.0, self.num_envs as f64).check("number of indices", indices.len() as f64, "")?;
        indices.iter().try_for_each(|&index| self.check_index(index))
    }

    fn check_length(&self, name: &str, length: usize) -> Result<()> {
        if length == self.num_envs {
            return Ok(());
        }
        Err(Error::Invalid(format!("{name} has {length} entries, must have one per environment: {}", self.num_envs)))
    }
}
