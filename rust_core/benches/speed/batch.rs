//! Environments: steps under random actions, autoreset included, and starts of episodes. One thread.

use criterion::{BenchmarkId, Criterion, Throughput};
use rand::RngExt;
use rand_pcg::Pcg64;
use serde_json::json;

use prosthesis_gym_core::config::Config;
use prosthesis_gym_core::episode::reward::TERMS;
use prosthesis_gym_core::prosthesis::knee::kind::DeviceKind;
use prosthesis_gym_core::vector::autoreset::Autoreset;
use prosthesis_gym_core::vector::batch::Batch;
use prosthesis_gym_core::vector::step_output::StepOutput;

use crate::walk::{LANES, config};

/// Batches.
pub fn all(criterion: &mut Criterion) {
    for kind in [DeviceKind::Damper, DeviceKind::Motor, DeviceKind::Friction] {
        for num_envs in [64, 1024] {
            step(criterion, kind, num_envs);
        }
    }
    start(criterion, "episode start/plain", &Config::default());
    let randomise =
        json!({"scenario": {"randomise": {"body.trunk_mass_kg": [50.0, 75.0], "ground.friction": [0.4, 0.6]}}});
    let randomised = Config::from_deserializer(randomise).expect("parameters lie in their ranges");
    start(criterion, "episode start/randomised", &randomised);
}

/// What a batch writes.
struct Buffers {
    observations: Vec<f32>,
    rewards: Vec<f64>,
    terminated: Vec<bool>,
    truncated: Vec<bool>,
    terms: Vec<f64>,
    reasons: Vec<u8>,
    final_observations: Vec<f32>,
    started: Vec<bool>,
    episode_returns: Vec<f64>,
    episode_steps: Vec<u32>,
    episode_terms: Vec<f64>,
}

impl Buffers {
    fn new(batch: &Batch) -> Self {
        let count = batch.num_envs();
        Self {
            observations: vec![0.0; count * batch.observation_size()],
            rewards: vec![0.0; count],
            terminated: vec![false; count],
            truncated: vec![false; count],
            terms: vec![0.0; count * TERMS.len()],
            reasons: vec![0; count],
            final_observations: vec![0.0; count * batch.observation_size()],
            started: vec![false; count],
            episode_returns: vec![0.0; count],
            episode_steps: vec![0; count],
            episode_terms: vec![0.0; count * TERMS.len()],
        }
    }

    fn output(&mut self) -> StepOutput<'_> {
        StepOutput {
            observations: &mut self.observations,
            rewards: &mut self.rewards,
            terminated: &mut self.terminated,
            truncated: &mut self.truncated,
            terms: &mut self.terms,
            reasons: &mut self.reasons,
            final_observations: &mut self.final_observations,
            started: &mut self.started,
            episode_returns: &mut self.episode_returns,
            episode_steps: &mut self.episode_steps,
            episode_terms: &mut self.episode_terms,
        }
    }
}

fn batch(num_envs: usize, config: &Config) -> Batch {
    let mut batch = Batch::new(num_envs, config.clone(), Autoreset::SameStep, 1).expect("the configuration is valid");
    let seeds: Vec<u64> = (0..num_envs as u64).collect();
    batch.reset(Some(&seeds), &vec![true; num_envs]).expect("one seed per environment");
    batch
}

fn step(criterion: &mut Criterion, kind: DeviceKind, num_envs: usize) {
    const ROUNDS: usize = 64;
    let mut batch = batch(num_envs, &config(kind));
    let mut random = Pcg64::new(1, 1);
    let mut round = || (0..num_envs * batch.action_size()).map(|_| random.random_range(-1.0..1.0)).collect();
    let rounds: Vec<Vec<f64>> = (0..ROUNDS).map(|_| round()).collect();
    let mut actions = rounds.iter().cycle();
    let mut buffers = Buffers::new(&batch);
    let mut group = criterion.benchmark_group(format!("env step/{kind:?}").to_lowercase());
    group.throughput(Throughput::Elements(num_envs as u64));
    group.bench_function(BenchmarkId::from_parameter(num_envs), |bencher| {
        bencher.iter(|| actions.next().map(|actions| batch.step(actions, buffers.output())));
    });
}

/// Starts the next episode of every walker of a narrow and of a wide block.
fn start(criterion: &mut Criterion, name: &str, config: &Config) {
    let mut group = criterion.benchmark_group(name);
    for num_envs in [1, LANES] {
        let mut batch = batch(num_envs, config);
        let all = vec![true; num_envs];
        group.throughput(Throughput::Elements(num_envs as u64));
        group.bench_function(BenchmarkId::from_parameter(num_envs), |bencher| {
            bencher.iter(|| batch.reset(None, &all));
        });
    }
}
