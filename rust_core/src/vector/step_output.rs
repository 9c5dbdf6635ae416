//! What a step writes.

use crate::episode::reward::TERMS;
use crate::numerics::prefetch::prefetch;
use crate::schema::error::{Error, Result};
use crate::vector::autoreset::Autoreset;

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
    /// (N,): [`Reason`](crate::episode::termination::Reason) as number.
    pub reasons: &'a mut [u8],
    /// (N, observation size): last observation of an episode that ended in this step; only with autoreset in the same step.
    pub final_observations: &'a mut [f32],
    /// (N,): reset in this step.
    pub started: &'a mut [bool],
    /// (N,): sum of rewards of the episode that this step belongs to, so far.
    pub episode_returns: &'a mut [f64],
    /// (N,): its steps so far.
    pub episode_steps: &'a mut [u32],
    /// (N, number of terms): sums of its terms; written where the episode has ended.
    pub episode_terms: &'a mut [f64],
}

impl StepOutput<'_> {
    /// Memory that the output of one environment takes.
    pub fn bytes_per_environment(observation_size: usize, autoreset: Autoreset) -> usize {
        let observations = if autoreset == Autoreset::SameStep { 2 * observation_size } else { observation_size };
        let flags = 3 * size_of::<bool>() + size_of::<u8>() + size_of::<u32>();
        observations * size_of::<f32>() + 2 * (1 + TERMS.len()) * size_of::<f64>() + flags
    }

    /// An error that names the first array that does not fit so many environments.
    pub fn check(&self, num_envs: usize, observation_size: usize, autoreset: Autoreset) -> Result<()> {
        let finals = if autoreset == Autoreset::SameStep { observation_size } else { 0 };
        let lengths = [
            ("observations", self.observations.len(), observation_size),
            ("rewards", self.rewards.len(), 1),
            ("terminated", self.terminated.len(), 1),
            ("truncated", self.truncated.len(), 1),
            ("terms", self.terms.len(), TERMS.len()),
            ("reasons", self.reasons.len(), 1),
            ("final_observations", self.final_observations.len(), finals),
            ("started", self.started.len(), 1),
            ("episode_returns", self.episode_returns.len(), 1),
            ("episode_steps", self.episode_steps.len(), 1),
            ("episode_terms", self.episode_terms.len(), TERMS.len()),
        ];
        for (name, length, each) in lengths {
            if length != each * num_envs {
                let reason = format!("{name} has {length} entries, must have {each} per environment: {num_envs}");
                return Err(Error::Invalid(reason));
            }
        }
        Ok(())
    }

    /// Has what a step writes fetched into the caches.
    #[inline(always)]
    pub fn prefetch(&self) {
        prefetch(self.observations);
        prefetch(self.rewards);
        prefetch(self.terminated);
        prefetch(self.truncated);
        prefetch(self.terms);
        prefetch(self.reasons);
        prefetch(self.started);
        prefetch(self.episode_returns);
        prefetch(self.episode_steps);
    }

    /// Takes the part of the first `count` environments away; None if there are fewer.
    pub fn take(&mut self, count: usize) -> Option<Self> {
        let size = self.observations.len() / self.rewards.len();
        let final_size = if self.final_observations.is_empty() { 0 } else { size };
        Some(Self {
            observations: self.observations.split_off_mut(..count * size)?,
            rewards: self.rewards.split_off_mut(..count)?,
            terminated: self.terminated.split_off_mut(..count)?,
            truncated: self.truncated.split_off_mut(..count)?,
            terms: self.terms.split_off_mut(..count * TERMS.len())?,
            reasons: self.reasons.split_off_mut(..count)?,
            final_observations: self.final_observations.split_off_mut(..count * final_size)?,
            started: self.started.split_off_mut(..count)?,
            episode_returns: self.episode_returns.split_off_mut(..count)?,
            episode_steps: self.episode_steps.split_off_mut(..count)?,
            episode_terms: self.episode_terms.split_off_mut(..count * TERMS.len())?,
        })
    }

    /// The same for a shorter time.
    pub fn reborrow(&mut self) -> StepOutput<'_> {
        StepOutput {
            observations: self.observations,
            rewards: self.rewards,
            terminated: self.terminated,
            truncated: self.truncated,
            terms: self.terms,
            reasons: self.reasons,
            final_observations: self.final_observations,
            started: self.started,
            episode_returns: self.episode_returns,
            episode_steps: self.episode_steps,
            episode_terms: self.episode_terms,
        }
    }
}
