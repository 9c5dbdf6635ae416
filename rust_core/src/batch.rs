//! Environments in batches: blocks of lanes over threads; episodes, rewards and autoreset natively batched.
//!
//! The random stream of an episode depends on (seed, episode number) alone, and lanes never mix, so trajectories do not
//! depend on batch size, position in the batch or number of threads.

use rand_pcg::Pcg64;
use rayon::prelude::*;

use crate::config::Config;
use crate::error::{Error, Result};
use crate::prosthesis_controller::agent::{self, CHANNELS};
use crate::recorder::Recorder;
use crate::reward::{self, Outcome, TERMS};
use crate::signals::GRAVITY;
use crate::simulation::Simulation;
use crate::termination::{Posture, Reason};

/// Walkers per block: one AVX-512 register of `f64`.
pub const LANES: usize = 8;
/// Below this many walkers a block holds one: a half-empty wide block is slower than scalar code.
const SCALAR_BELOW: usize = 4;
/// Below this many blocks a step runs on the caller's thread: waking a pool costs more than it saves.
const PARALLEL_FROM: usize = 6;

/// What happens to an environment after its episode has ended (Gymnasium's `AutoresetMode`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Autoreset {
    /// Its next step ignores the action and resets it.
    NextStep,
    /// It is reset at once; the last observation of the old episode is handed out beside.
    SameStep,
    /// The caller resets it; stepping it before is an error.
    Disabled,
}

/// What an environment keeps beside its walker.
#[derive(Clone, Copy, Debug, Default)]
struct Env {
    seed: u64,
    episode: u64,
    last_command: f64,
    ended: bool,
}

/// What one step of a slice of environments writes.
#[derive(Debug)]
pub struct StepOutput<'a> {
    /// (N, observation size).
    pub observations: &'a mut [f32],
    /// (N,).
    pub rewards: &'a mut [f64],
    /// (N,): ended early.
    pub terminated: &'a mut [bool],
    /// (N,): time over.
    pub truncated: &'a mut [bool],
    /// (N, number of terms).
    pub terms: &'a mut [f64],
    /// (N,): [`Reason`] as number.
    pub reasons: &'a mut [u8],
    /// (N, observation size): last observation of an episode that ended in this step; only with [`Autoreset::SameStep`].
    pub final_observations: &'a mut [f32],
    /// (N,): reset in this step.
    pub started: &'a mut [bool],
}

/// What all environments share.
#[derive(Clone, Debug)]
struct Shared {
    config: Config,
    autoreset: Autoreset,
    weights: [f64; TERMS.len()],
    last_sample: u64,
}

impl Shared {
    fn frame_size(&self) -> usize {
        CHANNELS.len()
    }

    fn observation_size(&self) -> usize {
        self.config.observation.frames * self.frame_size()
    }
}

#[derive(Clone, Debug)]
struct Block<const L: usize> {
    simulation: Simulation<L>,
    envs: [Env; L],
    /// Newest observation of each lane, newest frame first.
    observations: Vec<f32>,
    recorder: Option<(usize, Recorder)>,
}

impl<const L: usize> Block<L> {
    fn new(shared: &Shared) -> Self {
        Self {
            simulation: Simulation::new(&shared.config),
            envs: [Env::default(); L],
            observations: vec![0.0; L * shared.observation_size()],
            recorder: None,
        }
    }

    fn observation_mut(&mut self, shared: &Shared, lane: usize) -> &mut [f32] {
        let size = shared.observation_size();
        &mut self.observations[lane * size..(lane + 1) * size]
    }

    /// Starts the next episode of the given lanes.
    #[inline(always)]
    fn start(&mut self, shared: &Shared, lanes: &[bool; L]) {
        for lane in (0..L).filter(|&lane| lanes[lane]) {
            let env = &mut self.envs[lane];
            let stream = (u128::from(env.seed) << 64) | u128::from(env.episode);
            let mut random = Pcg64::new(0x9e37_79b9_7f4a_7c15_f39c_c060_5ced_c834, stream);
            env.episode += 1;
            env.ended = false;
            env.last_command = 0.0;
            let episode = shared.config.scenario.draw(&mut random);
            self.simulation.start(lane, episode);
        }
        self.simulation.observe_started(lanes);
        for lane in (0..L).filter(|&lane| lanes[lane]) {
            let frame = self.frame(shared, lane);
            let size = shared.frame_size();
            self.observation_mut(shared, lane).chunks_exact_mut(size).for_each(|slot| slot.copy_from_slice(&frame));
            if let Some((_, recorder)) = self.recorder.as_mut().filter(|(recorded, _)| *recorded == lane) {
                *recorder = Recorder::default();
                recorder.push(&self.simulation, lane);
            }
        }
    }

    fn frame(&self, shared: &Shared, lane: usize) -> [f32; CHANNELS.len()] {
        agent::frame(
            &shared.config.action,
            &self.simulation.readings[lane],
            self.envs[lane].last_command,
            self.simulation.state_machine_command[lane],
        )
    }

    /// Pushes the newest frame in front of the older ones.
    fn push_frame(&mut self, shared: &Shared, lane: usize) {
        let frame = self.frame(shared, lane);
        let observation = self.observation_mut(shared, lane);
        let kept = observation.len() - frame.len();
        observation.copy_within(..kept, frame.len());
        observation[..frame.len()].copy_from_slice(&frame);
    }

    #[inline(always)]
    fn step(&mut self, shared: &Shared, actions: &[f64], output: &mut StepOutput<'_>) {
        let used = actions.len();
        let skipped: [bool; L] = std::array::from_fn(|lane| self.envs[lane].ended);
        let mut reasons = [Reason::None; L];
        let mut terms = [[0.0; TERMS.len()]; L];
        let running =
            |reasons: &[Reason; L], lane: usize| lane < used && !skipped[lane] && reasons[lane] == Reason::None;

        for held in 0..shared.config.action.hold {
            let mut commands = [0.0; L];
            for lane in 0..used {
                let fsm = self.simulation.state_machine_command[lane];
                let limit = shared.config.knee.max_damping_nms2_rad2;
                commands[lane] = shared.config.action.command(actions[lane], fsm).min(limit);
            }
            self.simulation.advance(&commands);
            for lane in 0..used {
                if !running(&reasons, lane) {
                    continue;
                }
                let reason = self.check(shared, lane);
                let change = if held == 0 { commands[lane] - self.envs[lane].last_command } else { 0.0 };
                let outcome = self.outcome(shared, lane, reason, change);
                for (sum, term) in terms[lane].iter_mut().zip(reward::terms(&outcome)) {
                    *sum += term;
                }
                self.envs[lane].last_command = commands[lane];
                reasons[lane] = reason;
                if reason != Reason::None || held + 1 == shared.config.action.hold {
                    self.push_frame(shared, lane);
                }
                if let Some((_, recorder)) = self.recorder.as_mut().filter(|(recorded, _)| *recorded == lane) {
                    recorder.push(&self.simulation, lane);
                }
            }
        }

        let mut starting = [false; L];
        for lane in 0..used {
            let ends = reasons[lane] != Reason::None;
            self.envs[lane].ended |= ends;
            starting[lane] = match shared.autoreset {
                Autoreset::NextStep => skipped[lane],
                Autoreset::SameStep => ends,
                Autoreset::Disabled => false,
            };
            output.rewards[lane] = terms[lane].iter().zip(&shared.weights).map(|(term, weight)| term * weight).sum();
            output.terms[lane * TERMS.len()..(lane + 1) * TERMS.len()].copy_from_slice(&terms[lane]);
            output.terminated[lane] = ends && reasons[lane] != Reason::TimeLimit;
            output.truncated[lane] = reasons[lane] == Reason::TimeLimit;
            output.reasons[lane] = reasons[lane] as u8;
            output.started[lane] = starting[lane];
        }
        let size = shared.observation_size();
        if starting.contains(&true) {
            if shared.autoreset == Autoreset::SameStep {
                output.final_observations.copy_from_slice(&self.observations[..used * size]);
            }
            self.start(shared, &starting);
        }
        output.observations.copy_from_slice(&self.observations[..used * size]);
    }

    fn check(&self, shared: &Shared, lane: usize) -> Reason {
        let simulation = &self.simulation;
        let motion = simulation.state.motion.get(lane);
        let posture = Posture {
            hip_height: motion.hip_y,
            knee_flexion: motion.thigh - motion.shank,
            ankle: motion.foot - motion.shank - simulation.plant.body(lane).foot_mount,
            checksum: simulation.checksum(lane),
        };
        match shared.config.termination.check(&posture) {
            Reason::None if simulation.sample[lane] >= shared.last_sample => Reason::TimeLimit,
            reason => reason,
        }
    }

    fn outcome(&self, shared: &Shared, lane: usize, reason: Reason, command_change: f64) -> Outcome {
        let simulation = &self.simulation;
        let plant = &simulation.plant;
        let motion = simulation.state.motion.get(lane);
        let mass = plant.body(lane).mass;
        let points = [0, 1]
            .map(|point| (plant.contact(point, lane).normal, plant.foot_point(&simulation.state, point, lane).vx));
        let touching_speed = |&(normal, vx): &(f64, f64)| if normal > 0.0 { vx } else { 0.0 };
        Outcome {
            failed: !matches!(reason, Reason::None | Reason::TimeLimit),
            extension_stop_peak: plant.extension_stop_peak[lane],
            mass,
            hip_power: plant.hip_torque(lane) * (motion.thigh_rate - plant.prescribed(lane).rate),
            knee_angle: motion.thigh - motion.shank,
            tube_force_bw: simulation.readings[lane].tube_force_bw,
            ground_force_bw: points.iter().map(|(normal, _)| normal).sum::<f64>() / (mass * GRAVITY),
            sole_speed: points.iter().map(touching_speed).fold(0.0, f64::max),
            command_change: command_change / shared.config.action.max_command_nms2_rad2,
        }
    }
}

/// One step of a wide block, compiled for each vector unit and chosen at run time.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512vl+avx512dq+avx512bw+avx512cd+bmi1+bmi2",
    "x86_64+avx2+bmi1+bmi2"
))]
fn step_wide(block: &mut Block<LANES>, shared: &Shared, actions: &[f64], output: &mut StepOutput<'_>) {
    block.step(shared, actions, output);
}

#[derive(Debug)]
enum Blocks {
    Scalar(Vec<Block<1>>),
    Wide(Vec<Block<LANES>>),
}

/// N environments.
#[derive(Debug)]
pub struct Batch {
    shared: Shared,
    blocks: Blocks,
    num_envs: usize,
    threads: usize,
    pool: Option<(u32, rayon::ThreadPool)>,
}

impl Batch {
    /// Environments with one configuration, all waiting for [`reset`](Self::reset). `threads = 0` takes all cores.
    pub fn new(num_envs: usize, config: Config, autoreset: Autoreset, threads: usize) -> Result<Self> {
        config.validate()?;
        if !(1..=1 << 24).contains(&num_envs) {
            return Err(Error::Invalid(format!("num_envs = {num_envs} is outside its allowed range [1, {}]", 1 << 24)));
        }
        if threads > 1024 {
            return Err(Error::Invalid(format!("threads = {threads} is outside its allowed range [0, 1024]")));
        }
        let weights = config.reward.weights();
        let last_sample = config.scenario.samples();
        let shared = Shared { config, autoreset, weights, last_sample };
        let mut blocks = if num_envs < SCALAR_BELOW {
            Blocks::Scalar((0..num_envs).map(|_| Block::new(&shared)).collect())
        } else {
            Blocks::Wide(vec![Block::new(&shared); num_envs.div_ceil(LANES)])
        };
        // Lanes beyond the last environment walk along unseen, so that blocks need no special case.
        match &mut blocks {
            Blocks::Scalar(blocks) => blocks.iter_mut().for_each(|block| block.start(&shared, &[true])),
            Blocks::Wide(blocks) => blocks.iter_mut().for_each(|block| block.start(&shared, &[true; LANES])),
        }
        Ok(Self { shared, blocks, num_envs, threads, pool: None })
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.num_envs
    }

    /// Length of an observation.
    pub fn observation_size(&self) -> usize {
        self.shared.observation_size()
    }

    /// Resets the environments in `mask` (length N): to episode 0 of their new seed, or to the next episode of their old one.
    pub fn reset(&mut self, seeds: Option<&[u64]>, mask: &[bool]) -> Result<()> {
        self.check_length("mask", mask.len())?;
        if let Some(seeds) = seeds {
            self.check_length("seeds", seeds.len())?;
        }
        let shared = &self.shared;
        fn reset_block<const L: usize>(
            block: &mut Block<L>,
            first: usize,
            shared: &Shared,
            seeds: Option<&[u64]>,
            mask: &[bool],
        ) {
            let lanes: [bool; L] = std::array::from_fn(|lane| mask.get(first + lane).copied().unwrap_or(false));
            for lane in (0..L).filter(|&lane| lanes[lane]) {
                if let Some(seeds) = seeds {
                    block.envs[lane].seed = seeds[first + lane];
                    block.envs[lane].episode = 0;
                }
            }
            if lanes.contains(&true) {
                block.start(shared, &lanes);
            }
        }
        match &mut self.blocks {
            Blocks::Scalar(blocks) => {
                for (i, block) in blocks.iter_mut().enumerate() {
                    reset_block(block, i, shared, seeds, mask);
                }
            }
            Blocks::Wide(blocks) => {
                for (i, block) in blocks.iter_mut().enumerate() {
                    reset_block(block, i * LANES, shared, seeds, mask);
                }
            }
        }
        Ok(())
    }

    /// Copies the newest observations, (N, observation size).
    pub fn observations(&self, into: &mut [f32]) {
        let mut slots = into.chunks_exact_mut(self.observation_size());
        let mut copy = |observations: &[f32]| {
            for (from, slot) in observations.chunks_exact(self.shared.observation_size()).zip(&mut slots) {
                slot.copy_from_slice(from);
            }
        };
        match &self.blocks {
            Blocks::Scalar(blocks) => blocks.iter().for_each(|block| copy(&block.observations)),
            Blocks::Wide(blocks) => blocks.iter().for_each(|block| copy(&block.observations)),
        }
    }

    /// Advances every environment by `action.hold` control periods. Actions must be finite.
    pub fn step(&mut self, actions: &[f64], output: StepOutput<'_>) -> Result<()> {
        self.check_length("actions", actions.len())?;
        if let Some(index) = actions.iter().position(|action| !action.is_finite()) {
            return Err(Error::OutOfRange {
                key: format!("actions[{index}]"),
                value: actions[index].to_string(),
                range: "[-1, 1]".into(),
            });
        }
        if self.shared.autoreset == Autoreset::Disabled
            && let Some(index) = (0..self.num_envs).find(|&index| self.env(index).ended)
        {
            return Err(Error::Invalid(format!("environment {index} has ended: reset it before its next step")));
        }
        match &mut self.blocks {
            Blocks::Scalar(blocks) => {
                for (block, (actions, mut output)) in blocks.iter_mut().zip(split(actions, output, 1, &self.shared)) {
                    block.step(&self.shared, actions, &mut output);
                }
            }
            Blocks::Wide(blocks) => {
                let parts = split(actions, output, LANES, &self.shared);
                let work = blocks.iter_mut().zip(parts);
                let shared = &self.shared;
                if self.threads == 1 || work.len() < PARALLEL_FROM {
                    for (block, (actions, mut output)) in work {
                        step_wide(block, shared, actions, &mut output);
                    }
                } else {
                    let pool = pool(&mut self.pool, self.threads)?;
                    let work: Vec<_> = work.collect();
                    pool.install(|| {
                        work.into_par_iter().with_min_len(4).for_each(|(block, (actions, mut output))| {
                            step_wide(block, shared, actions, &mut output);
                        });
                    });
                }
            }
        }
        Ok(())
    }

    /// Records environment `index` at 200 Hz from its next reset on.
    pub fn record(&mut self, index: usize) -> Result<()> {
        if index >= self.num_envs {
            return Err(Error::Invalid(format!(
                "index = {index} is outside its allowed range [0, {}]",
                self.num_envs - 1
            )));
        }
        match &mut self.blocks {
            Blocks::Scalar(blocks) => blocks[index].recorder = Some((0, Recorder::default())),
            Blocks::Wide(blocks) => blocks[index / LANES].recorder = Some((index % LANES, Recorder::default())),
        }
        Ok(())
    }

    /// What has been recorded since the last reset of the recorded environment.
    pub fn recording(&self) -> Option<&Recorder> {
        match &self.blocks {
            Blocks::Scalar(blocks) => blocks.iter().find_map(|block| block.recorder.as_ref()),
            Blocks::Wide(blocks) => blocks.iter().find_map(|block| block.recorder.as_ref()),
        }
        .map(|(_, recorder)| recorder)
    }

    fn env(&self, index: usize) -> &Env {
        match &self.blocks {
            Blocks::Scalar(blocks) => &blocks[index].envs[0],
            Blocks::Wide(blocks) => &blocks[index / LANES].envs[index % LANES],
        }
    }

    fn check_length(&self, name: &str, length: usize) -> Result<()> {
        if length == self.num_envs {
            return Ok(());
        }
        Err(Error::Invalid(format!("{name} has {length} entries, must have one per environment: {}", self.num_envs)))
    }
}

/// The pool of this process: a pool does not survive a fork, so a child builds its own.
fn pool(slot: &mut Option<(u32, rayon::ThreadPool)>, threads: usize) -> Result<&rayon::ThreadPool> {
    let process = std::process::id();
    if slot.as_ref().is_none_or(|(owner, _)| *owner != process) {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|error| Error::Invalid(format!("cannot start {threads} threads: {error}")))?;
        // The parent's pool has no threads here; dropping it would wait for them.
        std::mem::forget(slot.replace((process, pool)));
    }
    slot.as_ref().map(|(_, pool)| pool).ok_or_else(|| Error::Invalid("no thread pool".into()))
}

/// Cuts actions and outputs into one part per block of `lanes` environments.
fn split<'a>(
    actions: &'a [f64],
    output: StepOutput<'a>,
    lanes: usize,
    shared: &Shared,
) -> impl ExactSizeIterator<Item = (&'a [f64], StepOutput<'a>)> {
    let size = shared.observation_size() * lanes;
    let final_size = if shared.autoreset == Autoreset::SameStep { size } else { 0 };
    let mut finals = output.final_observations;
    let mut next_final = move || {
        let cut = final_size.min(finals.len());
        let (head, tail) = std::mem::take(&mut finals).split_at_mut(cut);
        finals = tail;
        head
    };
    actions
        .chunks(lanes)
        .zip(output.observations.chunks_mut(size))
        .zip(output.rewards.chunks_mut(lanes))
        .zip(output.terminated.chunks_mut(lanes))
        .zip(output.truncated.chunks_mut(lanes))
        .zip(output.terms.chunks_mut(lanes * TERMS.len()))
        .zip(output.reasons.chunks_mut(lanes))
        .zip(output.started.chunks_mut(lanes))
        .map(move |(((((((actions, observations), rewards), terminated), truncated), terms), reasons), started)| {
            let final_observations = next_final();
            let part = StepOutput {
                observations,
                rewards,
                terminated,
                truncated,
                terms,
                reasons,
                final_observations,
                started,
            };
            (actions, part)
        })
}
