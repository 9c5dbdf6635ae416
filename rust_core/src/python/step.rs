//! What a step hands to Python: arrays that are filled again once nobody there holds them any longer.

use numpy::ndarray::Dimension;
use numpy::{Element, PyArray, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::batch::Batch;
use crate::environment::Autoreset;
use crate::reward::TERMS;
use crate::step_output::StepOutput;

/// Declares the arrays of a step. A set that somebody looks at counts more references than its own.
macro_rules! arrays {
    ($($field:ident: $Array:ty,)+) => {
        /// What one step of all environments gives; see `_core.pyi`.
        #[pyclass(frozen, get_all, name = "Step", module = "prosthesis_gym._core")]
        pub struct PyStep {
            $($field: Py<$Array>,)+
            final_observations: Option<Py<PyArray2<f32>>>,
            eventful: bool,
        }

        impl PyStep {
            fn share(&self, py: Python<'_>, eventful: bool) -> Self {
                Self {
                    $($field: self.$field.clone_ref(py),)+
                    final_observations: self.final_observations.as_ref().map(|finals| finals.clone_ref(py)),
                    eventful,
                }
            }

            /// Whether the arrays are nobody's, and as they were made.
            fn is_free(&self, py: Python<'_>, batch: &Batch) -> bool {
                let sizes = [batch.observation_size(), TERMS.len()];
                $(is_free(py, &self.$field, batch.num_envs(), &sizes))&&+
                    && self.final_observations.as_ref().is_none_or(|finals| is_free(py, finals, batch.num_envs(), &sizes))
            }
        }
    };
}

arrays! {
    observations: PyArray2<f32>,
    rewards: PyArray1<f64>,
    terminated: PyArray1<bool>,
    truncated: PyArray1<bool>,
    terms: PyArray2<f64>,
    reasons: PyArray1<u8>,
    started: PyArray1<bool>,
    episode_returns: PyArray1<f64>,
    episode_steps: PyArray1<u32>,
    episode_terms: PyArray2<f64>,
}

/// How many references to `object` there are: 1 if the caller's is the only one.
#[allow(unsafe_code)]
fn references<T>(_py: Python<'_>, object: &Py<T>) -> isize {
    // SAFETY: `object` is alive and the interpreter attached.
    unsafe { pyo3::ffi::Py_REFCNT(object.as_ptr()) }
}

/// Whether nobody else holds an array of `count` rows of one of `sizes`, and nobody who did has changed its shape, type or flags.
fn is_free<T: Element, D: Dimension>(py: Python<'_>, array: &Py<PyArray<T, D>>, count: usize, sizes: &[usize]) -> bool {
    if references(py, array) != 1 {
        return false;
    }
    let array = array.bind(py);
    let as_made = match array.shape() {
        [rows] => *rows == count,
        [rows, size] => *rows == count && sizes.contains(size),
        _ => false,
    };
    as_made && array.dtype().is_equiv_to(&T::get_dtype(py)) && array.is_c_contiguous() && array.try_readwrite().is_ok()
}

/// Sets of arrays that are kept: a training loop holds those of the last step while it takes the next.
const MOST_KEPT: usize = 3;

/// Arrays of the last steps. Fresh ones for each step would cost page faults in large batches, allocations in small ones.
#[derive(Default)]
pub(super) struct Outputs {
    kept: Vec<PyStep>,
}

impl Outputs {
    /// Advances every environment of `batch`, and hands out what that gives.
    pub fn step(&mut self, py: Python<'_>, batch: &mut Batch, actions: &[f64]) -> PyResult<PyStep> {
        let free = self.kept.iter().position(|step| step.is_free(py, batch));
        let arrays = free.map_or_else(|| PyStep::new(py, batch), |index| self.kept.remove(index));
        let eventful = arrays.fill(py, batch, actions)?;
        let step = arrays.share(py, eventful);
        if self.kept.len() == MOST_KEPT {
            self.kept.remove(0); // held for long, by whoever logs steps
        }
        self.kept.push(arrays);
        Ok(step)
    }
}

impl PyStep {
    fn new(py: Python<'_>, batch: &Batch) -> Self {
        let (count, size) = (batch.num_envs(), batch.observation_size());
        let finals = batch.autoreset() == Autoreset::SameStep;
        Self {
            observations: rows(py, count, size),
            rewards: column(py, count),
            terminated: column(py, count),
            truncated: column(py, count),
            terms: rows(py, count, TERMS.len()),
            reasons: column(py, count),
            started: column(py, count),
            final_observations: finals.then(|| rows(py, count, size)),
            episode_returns: column(py, count),
            episode_steps: column(py, count),
            episode_terms: rows(py, count, TERMS.len()),
            eventful: false,
        }
    }

    /// Returns whether any environment was reset or ended.
    fn fill(&self, py: Python<'_>, batch: &mut Batch, actions: &[f64]) -> PyResult<bool> {
        let mut observations = self.observations.bind(py).readwrite();
        let mut rewards = self.rewards.bind(py).readwrite();
        let mut terminated = self.terminated.bind(py).readwrite();
        let mut truncated = self.truncated.bind(py).readwrite();
        let mut terms = self.terms.bind(py).readwrite();
        let mut reasons = self.reasons.bind(py).readwrite();
        let mut started = self.started.bind(py).readwrite();
        let mut finals = self.final_observations.as_ref().map(|finals| finals.bind(py).readwrite());
        let mut episode_returns = self.episode_returns.bind(py).readwrite();
        let mut episode_steps = self.episode_steps.bind(py).readwrite();
        let mut episode_terms = self.episode_terms.bind(py).readwrite();
        let output = StepOutput {
            observations: observations.as_slice_mut()?,
            rewards: rewards.as_slice_mut()?,
            terminated: terminated.as_slice_mut()?,
            truncated: truncated.as_slice_mut()?,
            terms: terms.as_slice_mut()?,
            reasons: reasons.as_slice_mut()?,
            final_observations: finals.as_mut().map(|finals| finals.as_slice_mut()).transpose()?.unwrap_or(&mut []),
            started: started.as_slice_mut()?,
            episode_returns: episode_returns.as_slice_mut()?,
            episode_steps: episode_steps.as_slice_mut()?,
            episode_terms: episode_terms.as_slice_mut()?,
        };
        py.detach(|| batch.step(actions, output))?;
        Ok(started.as_slice()?.contains(&true) || reasons.as_slice()?.iter().any(|&reason| reason != 0))
    }
}

fn column<T: Element>(py: Python<'_>, length: usize) -> Py<PyArray1<T>> {
    PyArray1::zeros(py, length, false).unbind()
}

fn rows<T: Element>(py: Python<'_>, count: usize, length: usize) -> Py<PyArray2<T>> {
    PyArray2::zeros(py, [count, length], false).unbind()
}
