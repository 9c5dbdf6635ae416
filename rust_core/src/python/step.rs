//! What a step hands to Python: arrays that are filled again once nobody there holds them any longer.

use numpy::ndarray::{Ix1, Ix2};
use numpy::{PyArray, PyArray2};
use pyo3::prelude::*;

use std::sync::{Mutex, PoisonError};

use crate::episode::reward::TERMS;
use crate::python::recycled::Recycled;
use crate::vector::autoreset::Autoreset;
use crate::vector::batch::Batch;
use crate::vector::shared::Shared;
use crate::vector::step_output::StepOutput;

/// Declares the arrays of a step: one row per environment.
macro_rules! arrays {
    ($($field:ident: $T:ty, $D:ident,)+) => {
        /// What one step of all environments gives; see `_core.pyi`.
        #[pyclass(frozen, get_all, name = "Step", module = "prosthesis_gym._core")]
        pub struct PyStep {
            $($field: Py<PyArray<$T, $D>>,)+
            final_observations: Option<Py<PyArray2<f32>>>,
            eventful: bool,
        }

        /// The arrays of a step, which its `PyStep` shares.
        struct Arrays {
            $($field: Recycled<$T, $D>,)+
            final_observations: Option<Recycled<f32, Ix2>>,
        }

        impl Arrays {
            fn share(&self, py: Python<'_>, eventful: bool) -> PyStep {
                PyStep {
                    $($field: self.$field.share(py),)+
                    final_observations: self.final_observations.as_ref().map(|finals| finals.share(py)),
                    eventful,
                }
            }

            /// Whether nobody else holds any of them.
            fn are_free(&self, py: Python<'_>) -> bool {
                $(self.$field.is_free(py))&&+ && self.final_observations.as_ref().is_none_or(|finals| finals.is_free(py))
            }
        }
    };
}

arrays! {
    observations: f32, Ix2,
    rewards: f64, Ix1,
    terminated: bool, Ix1,
    truncated: bool, Ix1,
    terms: f64, Ix2,
    reasons: u8, Ix1,
    started: bool, Ix1,
    episode_returns: f64, Ix1,
    episode_steps: u32, Ix1,
    episode_terms: f64, Ix2,
}

/// Sets of arrays that are kept: a training loop holds those of the last step while it takes the next.
const MOST_KEPT: usize = 3;

/// What the arrays of a batch's steps have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub num_envs: usize,
    pub observation_size: usize,
    pub autoreset: Autoreset,
}

/// Arrays of the last steps. Fresh ones for each step would cost page faults in large batches, allocations in small ones.
#[derive(Default)]
pub(super) struct Outputs {
    /// Nobody who holds this runs Python code: that might come back here.
    kept: Mutex<Vec<Arrays>>,
}

impl Outputs {
    /// Advances every environment of `batch`, and hands out what that gives.
    pub fn step(&self, py: Python<'_>, batch: &Shared<Batch>, shape: Shape, actions: &[f64]) -> PyResult<PyStep> {
        let mut arrays = self.take(py).map_or_else(|| Arrays::new(py, shape), Ok)?;
        let eventful = arrays.fill(py, batch, actions)?;
        let step = arrays.share(py, eventful);
        self.keep(arrays);
        Ok(step)
    }

    /// Takes out arrays that nobody holds.
    fn take(&self, py: Python<'_>) -> Option<Arrays> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let free = kept.iter().position(|arrays| arrays.are_free(py))?;
        Some(kept.remove(free))
    }

    /// Keeps arrays, in place of those that have been held for longest, by whoever logs steps.
    fn keep(&self, arrays: Arrays) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let oldest = (kept.len() == MOST_KEPT).then(|| kept.remove(0));
        kept.push(arrays);
        drop(kept);
        drop(oldest);
    }
}

impl Arrays {
    fn new(py: Python<'_>, Shape { num_envs, observation_size, autoreset }: Shape) -> PyResult<Self> {
        let column = Ix1(num_envs);
        let observations = Ix2(num_envs, observation_size);
        let terms = Ix2(num_envs, TERMS.len());
        let finals = autoreset == Autoreset::SameStep;
        Ok(Self {
            observations: Recycled::zeros(py, observations)?,
            rewards: Recycled::zeros(py, column)?,
            terminated: Recycled::zeros(py, column)?,
            truncated: Recycled::zeros(py, column)?,
            terms: Recycled::zeros(py, terms)?,
            reasons: Recycled::zeros(py, column)?,
            started: Recycled::zeros(py, column)?,
            final_observations: finals.then(|| Recycled::zeros(py, observations)).transpose()?,
            episode_returns: Recycled::zeros(py, column)?,
            episode_steps: Recycled::zeros(py, column)?,
            episode_terms: Recycled::zeros(py, terms)?,
        })
    }

    /// Returns whether any environment was reset or ended.
    fn fill(&mut self, py: Python<'_>, batch: &Shared<Batch>, actions: &[f64]) -> PyResult<bool> {
        let finals = self.final_observations.as_mut().map(|finals| finals.entries(py)).transpose()?;
        let mut output = StepOutput {
            observations: self.observations.entries(py)?,
            rewards: self.rewards.entries(py)?,
            terminated: self.terminated.entries(py)?,
            truncated: self.truncated.entries(py)?,
            terms: self.terms.entries(py)?,
            reasons: self.reasons.entries(py)?,
            final_observations: finals.unwrap_or(&mut []),
            started: self.started.entries(py)?,
            episode_returns: self.episode_returns.entries(py)?,
            episode_steps: self.episode_steps.entries(py)?,
            episode_terms: self.episode_terms.entries(py)?,
        };
        py.detach(|| batch.with(|batch| batch.step(actions, output.reborrow())))?;
        Ok(output.started.contains(&true) || output.reasons.iter().any(|&reason| reason != 0))
    }
}
