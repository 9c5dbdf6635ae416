//! Environments in blocks of lanes: episodes, observations, rewards and autoreset around the closed loop.
//!
//! The random stream of an episode depends on (seed, episode number) alone, and lanes never mix, so trajectories do not
//! depend on batch size, position in the batch or number of threads.

use rand_pcg::Pcg64;

use crate::config::Config;
use crate::error::Result;
use crate::math::{SPLITMIX_STEP, scramble};
use crate::prosthesis_controller::agent::{self, ActionMap, LONGEST_FRAME};
use crate::recorder::Recorder;
use crate::reward::{self, Outcome, TERMS};
use crate::scenario::Episode;
use crate::signals::GRAVITY;
use crate::simulation::{Scratch, Simulation};
use crate::termination::{Posture, Reason};

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

/// What all environments of a batch share.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The configuration.
    pub config: Config,
    /// What happens after an episode's end.
    pub autoreset: Autoreset,
    action: ActionMap,
    weights: [f64; TERMS.len()],
    last_sample: u64,
    frame_size: usize,
}

impl Setup {
    /// Checks the configuration.
    pub fn new(config: Config, autoreset: Autoreset) -> Result<Self> {
        config.validate()?;
        let weights = config.reward.weights();
        let last_sample = config.scenario.samples();
        let action = ActionMap::new(&config);
        let frame_size = agent::channels(config.device.kind).len();
        Ok(Self { config, autoreset, action, weights, last_sample, frame_size })
    }

    /// Length of one environment's observation.
    pub fn observation_size(&self) -> usize {
        self.config.observation.frames * self.frame_size
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
    /// Newest observation of each lane, newest frame first.
    observations: Vec<f32>,
    recorder: Option<(usize, Recorder)>,
}

impl<const L: usize> Environments<L> {
    /// Environments that walk along until their first [`reset`](Self::reset), so that unused lanes need no special case.
    pub fn new(setup: &Setup) -> Self {
        let mut environments = Self {
            simulation: Simulation::new(&setup.config),
            envs: [Env::default(); L],
            observations: vec![0.0; L * setup.observation_size()],
            recorder: None,
        };
        environments.start(setup, &[true; L]);
        environments
    }

    /// Starts lane `i` where `lanes[i]` is set: at episode 0 of a new seed, or at the next episode of its old one.
    pub fn reset(&mut self, setup: &Setup, lanes: &[bool; L], seed: impl Fn(usize) -> Option<u64>) {
        for lane in (0..L).filter(|&lane| lanes[lane]) {
            if let Some(seed) = seed(lane) {
                self.envs[lane] = Env { seed, ..Env::default() };
            }
        }
        if lanes.contains(&true) {
            self.start(setup, lanes);
        }
    }

    /// Storage for steps of environments like these.
    pub fn scratch(&self) -> Scratch<L> {
        Scratch::new(&self.simulation)
    }

    /// Newest observations, (L, observation size).
    pub fn observations(&self) -> &[f32] {
        &self.observations
    }

    /// Whether the episode in `lane` has ended and waits for its reset.
    pub fn ended(&self, lane: usize) -> bool {
        self.envs[lane].ended
    }

    /// The episode that runs in `lane`.
    pub fn episode(&self, lane: usize) -> Option<&Episode> {
        self.simulation.episode(lane)
    }

    /// Records `lane` from its next reset on.
    pub fn record(&mut self, lane: usize) {
        self.recorder = Some((lane, Recorder::default()));
    }

    /// What has been recorded since the last reset of the recorded lane.
    pub fn recording(&self) -> Option<&Recorder> {
        self.recorder.as_ref().map(|(_, recorder)| recorder)
    }

    fn observation_mut(&mut self, setup: &Setup, lane: usize) -> &mut [f32] {
        let size = setup.observation_size();
        &mut self.observations[lane * size..(lane + 1) * size]
    }

    /// Starts the next episode of the given lanes.
    #[inline(always)]
    fn start(&mut self, setup: &Setup, lanes: &[bool; L]) {
        for lane in (0..L).filter(|&lane| lanes[lane]) {
            let env = &mut self.envs[lane];
            let mut random = random_stream(env.seed, env.episode);
            env.episode += 1;
            env.ended = false;
            env.last_command = 0.0;
            self.simulation.start(lane, setup.config.scenario.draw(&mut random));
        }
        self.simulation.observe_started(lanes);
        for lane in (0..L).filter(|&lane| lanes[lane]) {
            let frame = self.frame(setup, lane);
            self.observation_mut(setup, lane)
                .chunks_exact_mut(setup.frame_size)
                .for_each(|slot| slot.copy_from_slice(&frame[..setup.frame_size]));
            if let Some((_, recorder)) = self.recorder.as_mut().filter(|(recorded, _)| *recorded == lane) {
                *recorder = Recorder::default();
                recorder.push(&self.simulation, lane);
            }
        }
    }

    fn frame(&self, setup: &Setup, lane: usize) -> [f32; LONGEST_FRAME] {
        agent::frame(
            &setup.action,
            &self.simulation.readings.get(lane),
            self.envs[lane].last_command,
            self.simulation.state_machine_command[lane],
        )
    }

    /// Pushes the newest frame in front of the older ones.
    fn push_frame(&mut self, setup: &Setup, lane: usize) {
        let frame = self.frame(setup, lane);
        let frame = &frame[..setup.frame_size];
        let observation = self.observation_mut(setup, lane);
        let kept = observation.len() - frame.len();
        observation.copy_within(..kept, frame.len());
        observation[..frame.len()].copy_from_slice(frame);
    }

    /// Advances every lane by one action of `action.hold` control periods; `actions` and `output` cover the used lanes.
    #[inline(always)]
    pub fn step(&mut self, setup: &Setup, actions: &[f64], output: &mut StepOutput<'_>, scratch: &mut Scratch<L>) {
        let used = actions.len();
        let skipped: [bool; L] = std::array::from_fn(|lane| self.envs[lane].ended);
        let mut reasons = [Reason::None; L];
        let mut terms = [[0.0; TERMS.len()]; L];
        let running =
            |reasons: &[Reason; L], lane: usize| lane < used && !skipped[lane] && reasons[lane] == Reason::None;

        for held in 0..setup.config.action.hold {
            let mut commands = [0.0; L];
            for lane in 0..used {
                let fsm = self.simulation.state_machine_command[lane];
                commands[lane] = setup.action.command(actions[lane], fsm);
            }
            self.simulation.advance_with(&commands, scratch);
            for lane in 0..used {
                if !running(&reasons, lane) {
                    continue;
                }
                let reason = self.check(setup, lane);
                let change = if held == 0 { commands[lane] - self.envs[lane].last_command } else { 0.0 };
                let outcome = self.outcome(setup, lane, reason, change);
                for (sum, term) in terms[lane].iter_mut().zip(reward::terms(&outcome)) {
                    *sum += term;
                }
                self.envs[lane].last_command = commands[lane];
                reasons[lane] = reason;
                if reason != Reason::None || held + 1 == setup.config.action.hold {
                    self.push_frame(setup, lane);
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
            starting[lane] = match setup.autoreset {
                Autoreset::NextStep => skipped[lane],
                Autoreset::SameStep => ends,
                Autoreset::Disabled => false,
            };
            output.rewards[lane] = terms[lane].iter().zip(&setup.weights).map(|(term, weight)| term * weight).sum();
            output.terms[lane * TERMS.len()..(lane + 1) * TERMS.len()].copy_from_slice(&terms[lane]);
            output.terminated[lane] = ends && reasons[lane] != Reason::TimeLimit;
            output.truncated[lane] = reasons[lane] == Reason::TimeLimit;
            output.reasons[lane] = reasons[lane] as u8;
            output.started[lane] = starting[lane];
        }
        let size = setup.observation_size();
        if starting.contains(&true) {
            if setup.autoreset == Autoreset::SameStep {
                output.final_observations.copy_from_slice(&self.observations[..used * size]);
            }
            self.start(setup, &starting);
        }
        output.observations.copy_from_slice(&self.observations[..used * size]);
    }

    fn check(&self, setup: &Setup, lane: usize) -> Reason {
        let simulation = &self.simulation;
        let motion = simulation.state.motion.get(lane);
        let posture = Posture {
            hip_height: simulation.plant.hip_height(&simulation.state, lane),
            knee_flexion: simulation.plant.knee_flexion(lane),
            ankle: simulation.plant.joints(lane).ankle,
            fastest_rad_s: motion.thigh_rate.abs().max(motion.shank_rate.abs()).max(motion.foot_rate.abs()),
            extension_stop_nm: simulation.plant.extension_stop_peak[lane],
            checksum: simulation.state.checksum(lane),
        };
        match setup.config.termination.check(&posture) {
            Reason::None if simulation.sample[lane] >= setup.last_sample => Reason::TimeLimit,
            reason => reason,
        }
    }

    fn outcome(&self, setup: &Setup, lane: usize, reason: Reason, command_change: f64) -> Outcome {
        let simulation = &self.simulation;
        let plant = &simulation.plant;
        let mass = plant.body(lane).mass;
        let points = [0, 1]
            .map(|point| (plant.contact(point, lane).normal, plant.foot_point(&simulation.state, point, lane).vx));
        let touching_speed = |&(normal, vx): &(f64, f64)| if normal > 0.0 { vx } else { 0.0 };
        Outcome {
            failed: !matches!(reason, Reason::None | Reason::TimeLimit),
            diverged: reason == Reason::NonFinite,
            extension_stop_peak: plant.extension_stop_peak[lane],
            mass,
            hip_power: plant.hip_torque(lane) * plant.joints(lane).hip_rate,
            knee_angle: plant.knee_flexion(lane),
            tube_force_bw: simulation.truth.tube_force_bw[lane],
            ground_force_bw: plant.sole_load(lane).iter().sum::<f64>() / (mass * GRAVITY),
            sole_speed: points.iter().map(touching_speed).fold(0.0, f64::max),
            electrical_power: plant.unit.electrical_powers(lane, &simulation.state.rotor.get(lane))[0],
            command_change: setup.action.relative(command_change),
        }
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
