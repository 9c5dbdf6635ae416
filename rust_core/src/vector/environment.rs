//! Environments in blocks of lanes: episodes, observations, rewards and autoreset around the closed loop.
//!
//! The random stream of an episode depends on (seed, episode number) alone, and lanes never mix, so trajectories do not
//! depend on batch size, position in the batch or number of threads.

use std::collections::VecDeque;
use std::sync::Arc;

use rand_pcg::Pcg64;

use crate::agent::action::{CommandScale, CommandScaleLanes};
use crate::agent::actuation::{Actuation, Actuations};
use crate::agent::observation::{Sight, Truth};
use crate::closed_loop::episode::Episode;
use crate::closed_loop::repetition::Repeats;
use crate::closed_loop::saved::SavedWalker;
use crate::closed_loop::simulation::{LoopModel, Sampled, Scratch, Simulation};
use crate::episode::recorder::{self, Recorder, Row};
use crate::episode::reward::Terms;
use crate::numerics::math::{SPLITMIX_STEP, scramble};
use crate::schema::error::{Error, Result};
use crate::schema::params::within;
use crate::vector::autoreset::Autoreset;
use crate::vector::setup::Setup;

/// What an environment keeps beside its walker.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Env {
    pub(super) seed: u64,
    pub(super) episode: u64,
    pub(super) ended: bool,
    /// That the present episode was drawn with.
    pub(super) difficulty: f64,
    /// Of the present episode so far.
    pub(super) steps: u32,
    pub(super) total_reward: f64,
    pub(super) terms: Terms,
}

/// One environment between two steps. What its episode says follows from its seed.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct SavedEnvironment {
    env: Env,
    actuation: (Actuation, VecDeque<f64>),
    observation: Vec<f32>,
    walker: SavedWalker,
}

impl SavedEnvironment {
    /// Memory of one, at most.
    pub fn most_bytes(setup: &Setup) -> usize {
        size_of::<Self>() + size_of::<f32>() * setup.observation_size() + setup.most_sensor_bytes
    }

    /// An error if it cannot be one of these environments.
    pub fn check(&self, setup: &Setup) -> Result<()> {
        within(0.0, 1.0).check("state: difficulty", self.env.difficulty, "")?;
        if self.observation.len() == setup.observation_size() {
            return Ok(());
        }
        Err(Error::Invalid("state is damaged: its observation has another size".to_owned()))
    }
}

/// Random numbers of an episode. Neighbouring streams of PCG are correlated, so seed and episode are scrambled first.
fn random_stream(seed: u64, episode: u64) -> Pcg64 {
    let seed = scramble(seed.wrapping_add(SPLITMIX_STEP));
    let state = scramble((seed ^ episode).wrapping_add(SPLITMIX_STEP));
    let wide = |high: u64, low: u64| (u128::from(high) << 64) | u128::from(low);
    Pcg64::new(wide(state, scramble(state.wrapping_add(SPLITMIX_STEP))), wide(seed, episode))
}

/// A block of `L` environments.
#[derive(Clone, Debug)]
pub struct Environments<const L: usize> {
    pub(super) simulation: Simulation<L>,
    pub(super) envs: [Env; L],
    pub(super) actuation: Actuations<L>,
    pub(super) scale: CommandScaleLanes<L>,
    /// Newest observation of each lane, newest frame first.
    pub(super) observations: Vec<f32>,
    /// Hip height that counts as a fall, m.
    pub(super) fall_height: [f64; L],
    pub(super) recorder: Option<(usize, Recorder)>,
}

impl<const L: usize> Environments<L> {
    /// Environments that walk along until their first [`reset`](Self::reset), so that unused lanes need no special case.
    pub fn new(setup: &Setup, model: &mut Arc<LoopModel<L>>, scratch: &mut Scratch<L>) -> Self {
        let mut environments = Self {
            simulation: Simulation::new(model),
            envs: [Env::default(); L],
            actuation: Actuations::default(),
            scale: CommandScaleLanes::splat(CommandScale::new(&setup.config.action, &setup.config.knee_params())),
            observations: vec![0.0; L * setup.observation_size()],
            fall_height: [setup.config.termination.hip_height_m; L],
            recorder: None,
        };
        environments.start(setup, model, &[true; L], scratch);
        environments.envs = [Env::default(); L];
        environments
    }

    /// Starts lane `i` where `lanes[i]` is set: at episode 0 of a new seed, or at the next episode of its old one.
    pub fn reset(
        &mut self,
        setup: &Setup,
        model: &mut Arc<LoopModel<L>>,
        lanes: &[bool; L],
        seed: impl Fn(usize) -> Option<u64>,
        scratch: &mut Scratch<L>,
    ) {
        for lane in (0..L).filter(|&lane| lanes[lane]) {
            if let Some(seed) = seed(lane) {
                self.envs[lane] = Env { seed, ..Env::default() };
            }
        }
        if lanes.contains(&true) {
            self.start(setup, model, lanes, scratch);
        }
    }

    /// Newest observations, (L, observation size).
    pub fn observations(&self) -> &[f32] {
        &self.observations
    }

    /// Whether the episode in `lane` has ended and waits for its reset.
    pub fn ended(&self, lane: usize) -> bool {
        self.envs[lane].ended
    }

    /// The episode that runs in `lane`; `None` before its first reset.
    pub fn episode(&self, lane: usize) -> Option<&Episode> {
        self.simulation.episode(lane).filter(|_| self.envs[lane].episode > 0)
    }

    /// Control periods that had to be integrated again since these environments were made.
    pub fn repeats(&self) -> Repeats {
        self.simulation.repeats
    }

    /// Records `lane` from its next reset on, or none any longer.
    pub fn record(&mut self, lane: Option<usize>) {
        self.recorder = lane.map(|lane| (lane, Recorder::default()));
    }

    /// Memory that the block may come to hold beside itself, its recording apart.
    pub fn most_heap_bytes(&self, setup: &Setup) -> usize {
        let delayed = L * setup.config.action.delay_samples.next_power_of_two() * size_of::<f64>();
        size_of_val(self.observations()) + delayed + self.simulation.heap_bytes() + setup.most_sensor_bytes * L
    }

    /// What has been recorded since the last reset of the recorded lane.
    pub fn recording(&self) -> Option<&Recorder> {
        self.recorder.as_ref().map(|(_, recorder)| recorder)
    }

    /// What a recorder would append for `lane` now, less the mean powers.
    pub fn snapshot(&self, model: &LoopModel<L>, lane: usize) -> Row {
        // Of a copy, so that looking at walkers can change nothing.
        let mut simulation = self.simulation.clone();
        let mut scratch = Scratch::new(model);
        simulation.evaluate(model, &mut scratch);
        recorder::snapshot(&Sampled { model, simulation: &simulation, scratch: &scratch }, lane)
    }

    fn observation_mut(&mut self, setup: &Setup, lane: usize) -> &mut [f32] {
        let size = setup.observation_size();
        &mut self.observations[lane * size..(lane + 1) * size]
    }

    /// Starts the next episode of the given lanes.
    pub(super) fn start(
        &mut self,
        setup: &Setup,
        model: &mut Arc<LoopModel<L>>,
        lanes: &[bool; L],
        scratch: &mut Scratch<L>,
    ) {
        for lane in (0..L).filter(|&lane| lanes[lane]) {
            let Env { seed, episode, .. } = self.envs[lane];
            let next = Env { seed, episode: episode + 1, difficulty: setup.difficulty, ..Env::default() };
            let episode = self.draw(setup, model, lane, &next);
            self.envs[lane] = next;
            self.actuation.set(lane, Default::default());
            self.simulation.start(model, lane, episode, scratch);
        }
        self.simulation.observe_started(model, lanes, scratch);
        for lane in (0..L).filter(|&lane| lanes[lane]) {
            // The first frame stands for those before it.
            for _ in 0..setup.config.observation.frames {
                self.push_frame(setup, model, scratch, lane);
            }
            if let Some((_, recorder)) = self.recorder.as_mut().filter(|(recorded, _)| *recorded == lane) {
                *recorder = Recorder::default();
                recorder.push(&Sampled { model, simulation: &self.simulation, scratch }, lane);
            }
        }
    }

    /// Draws the present episode of `env`, and gives `lane` the walker of it.
    fn draw(&mut self, setup: &Setup, model: &mut Arc<LoopModel<L>>, lane: usize, env: &Env) -> Episode {
        let mut random = random_stream(env.seed, env.episode - 1);
        let randomiser = setup.randomiser.as_ref();
        let episode = setup.config.scenario.draw(&mut random, env.difficulty, |random| {
            randomiser.map(|randomiser| randomiser.draw(random, env.difficulty))
        });
        if let (Some(randomiser), Some(drawn)) = (randomiser, &episode.drawn) {
            let config = randomiser.config(drawn);
            self.fall_height[lane] = config.termination.hip_height_m;
            self.scale.set(lane, CommandScale::new(&config.action, &config.knee_params()));
            Arc::make_mut(model).set(lane, &config.loop_params(), setup.uneven);
        }
        episode
    }

    /// The environment in `lane`; `None` before its first reset.
    pub fn save(&self, setup: &Setup, lane: usize) -> Option<SavedEnvironment> {
        self.episode(lane)?;
        let size = setup.observation_size();
        Some(SavedEnvironment {
            env: self.envs[lane],
            actuation: self.actuation.get(lane),
            observation: self.observations[lane * size..(lane + 1) * size].to_vec(),
            walker: self.simulation.save(lane)?,
        })
    }

    /// Puts the environment in `lane` where a saved one was; its recording goes on. Where environments are reset in the step
    /// that ends them, one that had ended starts its next episode: returns whether it did.
    pub fn restore(
        &mut self,
        setup: &Setup,
        model: &mut Arc<LoopModel<L>>,
        lane: usize,
        saved: &SavedEnvironment,
        scratch: &mut Scratch<L>,
    ) -> bool {
        let episode = self.draw(setup, model, lane, &saved.env);
        self.simulation.restore(model, lane, episode, &saved.walker, scratch);
        self.envs[lane] = saved.env;
        self.actuation.set(lane, saved.actuation.clone());
        self.observation_mut(setup, lane).copy_from_slice(&saved.observation);
        let restarts = saved.env.ended && setup.autoreset == Autoreset::SameStep;
        if restarts {
            self.start(setup, model, &std::array::from_fn(|other| other == lane), scratch);
        }
        restarts
    }

    /// Pushes the newest frame in front of the older ones.
    #[inline(always)]
    pub(super) fn push_frame(&mut self, setup: &Setup, model: &LoopModel<L>, scratch: &Scratch<L>, lane: usize) {
        let (simulation, size) = (&self.simulation, setup.observation_size());
        let truth = if setup.observation.privileged {
            Truth::of(&Sampled { model, simulation, scratch }, lane)
        } else {
            Truth::default()
        };
        let sight = Sight {
            lane,
            readings: &simulation.readings,
            last_command: self.scale.relative(lane, self.actuation.now.command[lane]),
            state_machine: self.scale.relative(lane, simulation.state_machine_command[lane]),
            phase: simulation.state_machine[lane].phase(),
            truth: &truth,
        };
        let observation = &mut self.observations[lane * size..(lane + 1) * size];
        let frame = setup.frame_size();
        observation.copy_within(..size - frame, frame);
        setup.observation.write(&sight, &mut observation[..frame]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    #[test]
    fn neighbouring_seeds_and_episodes_draw_unrelated_numbers() {
        let count = 4096;
        let draws = |stream: fn(u64) -> Pcg64| -> Vec<f64> { (0..count).map(|i| stream(i).random::<f64>()).collect() };
        for draws in [draws(|seed| random_stream(seed, 0)), draws(|episode| random_stream(7, episode))] {
            let mean = draws.iter().sum::<f64>() / count as f64;
            assert!((mean - 0.5).abs() < 4.0 / (12.0 * count as f64).sqrt(), "mean {mean}");
            let covariance = draws.windows(2).map(|pair| (pair[0] - 0.5) * (pair[1] - 0.5)).sum::<f64>() / count as f64;
            assert!((12.0 * covariance).abs() < 4.0 / (count as f64).sqrt(), "correlation {}", 12.0 * covariance);
        }
    }
}
