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
use crate::closed_loop::simulation::{Model, Sampled, Scratch, Simulation};
use crate::episode::judgement;
use crate::episode::recorder::{self, Recorder, Row};
use crate::episode::reward::{TERMS, Terms, TermsLanes};
use crate::episode::termination::Reason;
use crate::numerics::math::{SPLITMIX_STEP, scramble};
use crate::schema::error::{Error, Result};
use crate::schema::params::within;
use crate::vector::autoreset::Autoreset;
use crate::vector::setup::Setup;
use crate::vector::step_output::StepOutput;

/// What an environment keeps beside its walker.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
struct Env {
    seed: u64,
    episode: u64,
    ended: bool,
    /// That the present episode was drawn with.
    difficulty: f64,
    /// Of the present episode so far.
    steps: u32,
    total_reward: f64,
    terms: Terms,
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
    simulation: Simulation<L>,
    envs: [Env; L],
    actuation: Actuations<L>,
    scale: CommandScaleLanes<L>,
    /// Newest observation of each lane, newest frame first.
    observations: Vec<f32>,
    /// Hip height that counts as a fall, m.
    fall_height: [f64; L],
    recorder: Option<(usize, Recorder)>,
}

impl<const L: usize> Environments<L> {
    /// Environments that walk along until their first [`reset`](Self::reset), so that unused lanes need no special case.
    pub fn new(setup: &Setup, model: &mut Arc<Model<L>>, scratch: &mut Scratch<L>) -> Self {
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
        model: &mut Arc<Model<L>>,
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
    pub fn snapshot(&self, model: &Model<L>, lane: usize) -> Row {
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
    fn start(&mut self, setup: &Setup, model: &mut Arc<Model<L>>, lanes: &[bool; L], scratch: &mut Scratch<L>) {
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
    fn draw(&mut self, setup: &Setup, model: &mut Arc<Model<L>>, lane: usize, env: &Env) -> Episode {
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
        model: &mut Arc<Model<L>>,
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
    fn push_frame(&mut self, setup: &Setup, model: &Model<L>, scratch: &Scratch<L>, lane: usize) {
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

    /// Advances every lane by one action of `action.hold` control periods; `actions` and `output` cover the used lanes. Returns
    /// the lanes that are due to start anew: [`finish`](Self::finish) does so, and hands out the observations.
    #[inline(always)]
    pub fn step(
        &mut self,
        setup: &Setup,
        model: &Model<L>,
        actions: &[f64],
        output: &mut StepOutput<'_>,
        scratch: &mut Scratch<L>,
    ) -> [bool; L] {
        let used = actions.len() / setup.action_size();
        let skipped: [bool; L] = std::array::from_fn(|lane| self.envs[lane].ended);
        let mut reasons = [Reason::None; L];
        let mut terms = TermsLanes::<L>::default();

        for held in 0..setup.config.action.hold {
            let before = self.actuation.now.requested;
            let mut phases = [0; L];
            for lane in 0..L {
                phases[lane] = self.simulation.state_machine[lane].phase();
            }
            let Simulation { readings, state_machine_command, .. } = &self.simulation;
            let (scale, memory) = (&self.scale, &mut self.actuation);
            let commands = setup.action.commands(scale, memory, actions, readings, &phases, state_machine_command);
            let mut changes = [0.0; L];
            if held == 0 {
                for lane in 0..L {
                    changes[lane] = self.scale.relative(lane, self.actuation.now.requested[lane] - before[lane]);
                }
            }
            let live = std::array::from_fn(|lane| lane < used && !skipped[lane] && reasons[lane] == Reason::None);
            self.simulation.advance(model, &commands, &live, scratch);
            let sampled = Sampled { model, simulation: &self.simulation, scratch };
            let limits = &setup.config.termination;
            let (period_terms, period_reasons) =
                judgement::judge(&sampled, limits, &self.fall_height, setup.last_sample, &changes);
            for lane in 0..used {
                if skipped[lane] || reasons[lane] != Reason::None {
                    continue;
                }
                terms.set(lane, terms.get(lane).plus(&period_terms.get(lane)));
                reasons[lane] = period_reasons[lane];
                if let Some((_, recorder)) = self.recorder.as_mut().filter(|(recorded, _)| *recorded == lane) {
                    recorder.push(&Sampled { model, simulation: &self.simulation, scratch }, lane);
                }
                if reasons[lane] != Reason::None || held + 1 == setup.config.action.hold {
                    self.push_frame(setup, model, scratch, lane);
                }
            }
        }

        let mut starting = [false; L];
        for lane in 0..used {
            let ends = reasons[lane] != Reason::None;
            self.envs[lane].ended |= ends;
            starting[lane] = match setup.autoreset {
                Autoreset::NextStep => skipped[lane],
                Autoreset::SameStep => ends,
                Autoreset::Disabled => false,
            };
            let terms = terms.get(lane);
            let reward = terms.reward(&setup.config.reward);
            let row = lane * TERMS.len()..(lane + 1) * TERMS.len();
            output.rewards[lane] = reward;
            output.terms[row.clone()].copy_from_slice(&terms.values());
            let env = &mut self.envs[lane];
            if !skipped[lane] {
                env.steps += 1;
                env.total_reward += reward;
                env.terms = env.terms.plus(&terms);
            }
            output.episode_returns[lane] = env.total_reward;
            output.episode_steps[lane] = env.steps;
            if ends {
                output.episode_terms[row].copy_from_slice(&env.terms.values());
            }
            output.terminated[lane] = ends && reasons[lane] != Reason::TimeLimit;
            output.truncated[lane] = reasons[lane] == Reason::TimeLimit;
            output.reasons[lane] = reasons[lane] as u8;
            output.started[lane] = starting[lane];
        }
        starting
    }

    /// Starts the lanes that a step has found due, and hands out the newest observations.
    pub fn finish(
        &mut self,
        setup: &Setup,
        model: &mut Arc<Model<L>>,
        starting: &[bool; L],
        output: &mut StepOutput<'_>,
        scratch: &mut Scratch<L>,
    ) {
        let used = output.observations.len();
        if starting.contains(&true) {
            if setup.autoreset == Autoreset::SameStep {
                output.final_observations.copy_from_slice(&self.observations[..used]);
            }
            self.start(setup, model, starting, scratch);
        }
        output.observations.copy_from_slice(&self.observations[..used]);
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
