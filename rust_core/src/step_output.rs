//! What a step writes, and how it is cut into parts.

use crate::environment::{Autoreset, Setup};
use crate::prefetch::prefetch;
use crate::reward::TERMS;

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
    /// (N,): sum of rewards of the episode that this step belongs to, so far.
    pub episode_returns: &'a mut [f64],
    /// (N,): its steps so far.
    pub episode_steps: &'a mut [u32],
    /// (N, number of terms): sums of its terms; written where the episode has ended.
    pub episode_terms: &'a mut [f64],
}

impl StepOutput<'_> {
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

/// Cuts actions and outputs into one part per block of `lanes` environments.
pub fn split<'a>(
    actions: &'a [f64],
    output: StepOutput<'a>,
    lanes: usize,
    setup: &Setup,
) -> impl ExactSizeIterator<Item = (&'a [f64], StepOutput<'a>)> {
    let size = setup.observation_size() * lanes;
    let final_size = if setup.autoreset == Autoreset::SameStep { size } else { 0 };
    let mut finals = output.final_observations;
    let mut next_final = move || {
        let cut = final_size.min(finals.len());
        let (head, tail) = std::mem::take(&mut finals).split_at_mut(cut);
        finals = tail;
        head
    };
    actions
        .chunks(lanes * setup.action_size())
        .zip(output.observations.chunks_mut(size))
        .zip(output.rewards.chunks_mut(lanes))
        .zip(output.terminated.chunks_mut(lanes))
        .zip(output.truncated.chunks_mut(lanes))
        .zip(output.terms.chunks_mut(lanes * TERMS.len()))
        .zip(output.reasons.chunks_mut(lanes))
        .zip(output.started.chunks_mut(lanes))
        .zip(output.episode_returns.chunks_mut(lanes))
        .zip(output.episode_steps.chunks_mut(lanes))
        .zip(output.episode_terms.chunks_mut(lanes * TERMS.len()))
        .map(move |(((((part, reasons), started), episode_returns), episode_steps), episode_terms)| {
            let (((((actions, observations), rewards), terminated), truncated), terms) = part;
            let part = StepOutput {
                observations,
                rewards,
                terminated,
                truncated,
                terms,
                reasons,
                final_observations: next_final(),
                started,
                episode_returns,
                episode_steps,
                episode_terms,
            };
            (actions, part)
        })
}
