//! Batches for Python.

use std::str::FromStr;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use strum::VariantNames;

use crate::closed_loop::disturbance::Push;
use crate::closed_loop::episode::{Drawn, Episode};
use crate::closed_loop::repetition::Repeats;
use crate::episode::recorder::{FootStrike, Row};
use crate::human::intent::Knot;
use crate::human::variation::HumanVariation;
use crate::python::arguments::{Input1, indices_of, read_config, zeros};
use crate::python::step::{Outputs, PyStep, Shape};
use crate::schema::error::{Error, Result};
use crate::schema::params::{above, within};
use crate::vector::autoreset::Autoreset;
use crate::vector::batch::Batch;
use crate::vector::shared::{Shared, guarded};
use crate::vector::statistics::{Moments, Normaliser};

/// Observations that moments may have seen: the largest whole number below which all others are.
const MOST_SEEN: f64 = 9_007_199_254_740_992.0;

/// Count, mean and variance.
type PyMoments<'py> = (f64, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// A batch that any number of threads may call: they take turns. No Python code runs in a turn, and who waits for one is detached
/// from the interpreter: nobody can wait for somebody who waits in turn.
#[pyclass(name = "Batch", module = "prosthesis_gym._core", frozen)]
pub(super) struct PyBatch {
    batch: Shared<Batch>,
    outputs: Outputs,
    shape: Shape,
    bytes: u64,
    bytes_per_walker: usize,
    solver_steps: usize,
}

#[pymethods]
impl PyBatch {
    #[new]
    #[pyo3(signature = (num_envs, config, autoreset = "next_step", threads = None))]
    fn new(
        py: Python<'_>,
        num_envs: usize,
        config: &Bound<'_, PyAny>,
        autoreset: &str,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let autoreset = Autoreset::from_str(autoreset).map_err(|_| {
            let modes = Autoreset::VARIANTS.join("', '");
            PyValueError::new_err(format!("autoreset = {autoreset:?} must be one of '{modes}'"))
        })?;
        let config = read_config(config)?;
        let batch = py.detach(|| guarded(|| Batch::new(num_envs, config, autoreset, threads.unwrap_or(0))))?;
        Ok(Self {
            outputs: Outputs::default(),
            shape: Shape { num_envs, observation_size: batch.observation_size(), autoreset },
            bytes: batch.bytes(),
            bytes_per_walker: batch.bytes_per_walker(),
            solver_steps: batch.solver_steps(),
            batch: Shared::new(batch),
        })
    }

    /// Memory of an environment in its block, bytes.
    #[getter]
    fn bytes_per_walker(&self) -> usize {
        self.bytes_per_walker
    }

    /// Memory of all environments with all that they may come to hold, and of what two steps give, bytes.
    #[getter]
    fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Steps of the integration per control period.
    #[getter]
    fn solver_steps(&self) -> usize {
        self.solver_steps
    }

    /// Control periods that were integrated again, since the batch was made: settled in finer steps, settled by the reference alone,
    /// and diverged by all.
    #[getter]
    fn repeated_periods(&self, py: Python<'_>) -> PyResult<(u64, u64, u64)> {
        self.with(py, |batch| {
            let Repeats { finer, reference, diverged } = batch.repeats();
            Ok((finer, reference, diverged))
        })
    }

    #[getter]
    fn num_envs(&self) -> usize {
        self.shape.num_envs
    }

    #[getter]
    fn observation_size(&self) -> usize {
        self.shape.observation_size
    }

    #[pyo3(signature = (seeds = None, mask = None))]
    fn reset<'py>(
        &self,
        py: Python<'py>,
        seeds: Option<Input1<'py, u64>>,
        mask: Option<Input1<'py, bool>>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let all = vec![true; if mask.is_none() { self.shape.num_envs } else { 0 }];
        let seeds = seeds.as_ref().map(Input1::entries).transpose()?;
        let mask = mask.as_ref().map(Input1::entries).transpose()?.unwrap_or(&all);
        self.newest(py, |batch, into| {
            batch.reset(seeds, mask)?;
            batch.observations(mask, into)
        })
    }

    /// The newest observations. Statistics learn from those in the mask `new` (N,), by default from none.
    #[pyo3(signature = (new = None))]
    fn observations<'py>(
        &self,
        py: Python<'py>,
        new: Option<Input1<'py, bool>>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let none = vec![false; if new.is_none() { self.shape.num_envs } else { 0 }];
        let new = new.as_ref().map(Input1::entries).transpose()?.unwrap_or(&none);
        self.newest(py, |batch, into| batch.observations(new, into))
    }

    /// The newest observations as they are, normalised or not.
    fn raw_observations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        self.newest(py, |batch, into| {
            batch.raw_observations(into);
            Ok(())
        })
    }

    fn step(&self, py: Python<'_>, actions: Input1<'_, f64>) -> PyResult<PyStep> {
        self.outputs.step(py, &self.batch, self.shape, actions.entries()?)
    }

    /// Normalises observations from now on by their running moments.
    #[pyo3(signature = (clip = 10.0, epsilon = 1e-8))]
    fn normalise_observations(&self, py: Python<'_>, clip: f64, epsilon: f64) -> PyResult<()> {
        above(0.0, 1e6).check("clip", clip, "")?;
        above(0.0, 1.0).check("epsilon", epsilon, "")?;
        self.with(py, |batch| {
            let moments = Moments::new(batch.observation_size());
            batch.normaliser = Some(Normaliser { moments, learns: true, clip, epsilon });
            Ok(())
        })
    }

    /// Number of observations seen, their mean and variance.
    fn moments<'py>(&self, py: Python<'py>) -> PyResult<PyMoments<'py>> {
        let moments = |batch: &mut Batch| Ok(batch.normaliser.as_ref().ok_or_else(not_normalised)?.moments.clone());
        let Moments { count, mean, variance } = self.with(py, moments)?;
        Ok((count, PyArray1::from_vec(py, mean), PyArray1::from_vec(py, variance)))
    }

    /// Replaces the moments; without `learns` they stay as they are from now on.
    fn set_moments(
        &self,
        py: Python<'_>,
        count: f64,
        mean: Input1<'_, f64>,
        variance: Input1<'_, f64>,
        learns: bool,
    ) -> PyResult<()> {
        within(0.0, MOST_SEEN).check("count", count, "")?;
        let column = |name: &str, array: &Input1<'_, f64>, least: f64| -> PyResult<Vec<f64>> {
            let (values, size) = (array.entries()?, self.shape.observation_size);
            if values.len() != size {
                let message =
                    format!("{name} has {} entries, must have one per observation entry: {size}", values.len());
                return Err(PyValueError::new_err(message));
            }
            for (i, &value) in values.iter().enumerate() {
                within(least, f64::MAX).check(&format!("{name}[{i}]"), value, "")?;
            }
            Ok(values.to_vec())
        };
        let moments =
            Moments { count, mean: column("mean", &mean, f64::MIN)?, variance: column("variance", &variance, 0.0)? };
        self.with(py, |batch| {
            let normaliser = batch.normaliser.as_mut().ok_or_else(not_normalised)?;
            (normaliser.moments, normaliser.learns) = (moments, learns);
            Ok(())
        })
    }

    /// Whether observations change the moments.
    #[getter]
    fn learns(&self, py: Python<'_>) -> PyResult<bool> {
        self.glance(py, |batch| Ok(batch.normaliser.as_ref().ok_or_else(not_normalised)?.learns))
    }

    #[setter]
    fn set_learns(&self, py: Python<'_>, learns: bool) -> PyResult<()> {
        self.glance(py, |batch| {
            batch.normaliser.as_mut().ok_or_else(not_normalised)?.learns = learns;
            Ok(())
        })
    }

    /// What was drawn for the episode that runs in each environment: one array per quantity.
    fn episodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (starts, columns) = self.with(py, |batch| Ok(episode_columns(batch)))?;
        let episodes = PyDict::new(py);
        episodes.set_item("start", PyArray1::from_vec(py, starts))?;
        for (name, column) in columns {
            episodes.set_item(name, PyArray1::from_vec(py, column))?;
        }
        Ok(episodes)
    }

    /// Share of disturbances and randomisation that episodes have from their next start on.
    #[getter]
    fn difficulty(&self, py: Python<'_>) -> PyResult<f64> {
        self.glance(py, |batch| Ok(batch.difficulty()))
    }

    #[setter]
    fn set_difficulty(&self, py: Python<'_>, difficulty: f64) -> PyResult<()> {
        self.glance(py, |batch| batch.set_difficulty(difficulty))
    }

    /// Env steps of an episode at most; `None` without a limit.
    #[getter]
    fn max_episode_steps(&self, py: Python<'_>) -> PyResult<Option<u64>> {
        self.glance(py, |batch| Ok(batch.most_steps()))
    }

    #[setter]
    fn set_max_episode_steps(&self, py: Python<'_>, steps: Option<u64>) -> PyResult<()> {
        self.glance(py, |batch| batch.set_most_steps(steps))
    }

    fn get_state<'py>(&self, py: Python<'py>, indices: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyBytes>> {
        let indices = indices_of(indices, self.shape.num_envs)?;
        Ok(PyBytes::new(py, &self.with(py, |batch| batch.save(&indices))?))
    }

    fn set_state(&self, py: Python<'_>, state: &[u8], indices: &Bound<'_, PyAny>) -> PyResult<Vec<bool>> {
        let indices = indices_of(indices, self.shape.num_envs)?;
        self.with(py, |batch| batch.restore(&indices, state))
    }

    fn record(&self, py: Python<'_>, index: usize) -> PyResult<()> {
        self.with(py, |batch| batch.record(index))
    }

    fn recording<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let recorded = self.with(py, |batch| {
            let rows = batch.recording().map_or(&[][..], |recorder| &recorder.rows);
            let mut columns = vec![Vec::with_capacity(rows.len()); Row::NAMES.len()];
            for row in rows {
                columns.iter_mut().zip(row.values()).for_each(|(column, value)| column.push(value));
            }
            Ok(columns)
        })?;
        let columns = PyDict::new(py);
        for (name, column) in Row::NAMES.iter().zip(recorded) {
            columns.set_item(name, PyArray1::from_vec(py, column))?;
        }
        Ok(columns)
    }

    /// The present state of environment `index`: one float per column of a recording, NaN for mean powers.
    fn snapshot<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyDict>> {
        let row = PyDict::new(py);
        for (name, value) in Row::NAMES.iter().zip(self.with(py, |batch| batch.snapshot(index))?.values()) {
            row.set_item(name, value)?;
        }
        Ok(row)
    }

    /// Heights (m) of the ground under environment `index` at the places `x` (N,), m.
    fn ground_height<'py>(
        &self,
        py: Python<'py>,
        index: usize,
        x: Input1<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let x = x.entries()?;
        Ok(PyArray1::from_vec(py, self.with(py, |batch| batch.ground_height(index, x))?))
    }

    fn events<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let strikes =
            self.with(py, |batch| Ok(batch.recording().map_or_else(Vec::new, |recorder| recorder.strikes.clone())))?;
        let column = |value: fn(&FootStrike) -> f64| PyArray1::from_iter(py, strikes.iter().map(value));
        let events = PyDict::new(py);
        events.set_item("time_s", column(|strike| strike.time_s))?;
        events.set_item("leg", PyArray1::from_iter(py, strikes.iter().map(|strike| i64::from(strike.intact))))?;
        events.set_item("hip_x_m", column(|strike| strike.hip_x_m))?;
        Ok(events)
    }
}

impl PyBatch {
    /// Observations (N, D) that `work` writes.
    fn newest<'py>(
        &self,
        py: Python<'py>,
        work: impl FnOnce(&mut Batch, &mut [f32]) -> Result<()> + Send,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let observations = zeros(py, [self.shape.num_envs, self.shape.observation_size])?;
        {
            let mut written = observations.readwrite();
            let into = written.as_slice_mut()?;
            self.with(py, |batch| work(batch, into))?;
        }
        Ok(observations)
    }

    /// Does `work` on the batch when it is this thread's turn.
    fn with<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut Batch) -> Result<T> + Send) -> PyResult<T> {
        Ok(py.detach(|| self.batch.with(work))?)
    }

    /// The same for work so short that to detach would take longer: only if it has to wait does it detach.
    fn glance<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut Batch) -> Result<T> + Copy + Send) -> PyResult<T> {
        match self.batch.try_with(work) {
            Some(done) => Ok(done?),
            None => self.with(py, work),
        }
    }
}

fn not_normalised() -> Error {
    Error::Invalid("observations are not normalised: call normalise_observations first".to_owned())
}

/// Starts of the episodes that run, and everything else that was drawn for them by name.
fn episode_columns(batch: &Batch) -> (Vec<u8>, Vec<(String, Vec<f64>)>) {
    let episodes: Vec<_> = batch.episodes().collect();
    let speed = |knot: Option<&Knot>| knot.map_or(f64::NAN, |knot| knot.speed_m_s);
    let mut columns = Vec::new();
    let mut column = |name: &str, value: &dyn Fn(&Episode) -> f64| {
        columns.push((name.to_owned(), episodes.iter().map(|episode| value(episode)).collect()));
    };
    column("first_speed_m_s", &|e| speed(e.profile.knots.first()));
    column("last_speed_m_s", &|e| speed(e.profile.knots.last()));
    column("push_n", &|e| e.disturbance.pushes.first().map_or(0.0, |push| push.force.x));
    column("push_s", &|e| e.disturbance.pushes.first().map_or(f64::NAN, Push::earliest_s));
    let drawn = |episode: &Episode, value: &dyn Fn(&Drawn) -> f64| episode.drawn.as_ref().map_or(f64::NAN, value);
    for (i, key) in batch.randomised().enumerate() {
        column(key, &|e| drawn(e, &|drawn| drawn.numbers[i]));
    }
    column("variant", &|e| drawn(e, &|drawn| drawn.variant.map_or(-1.0, |variant| variant as f64)));
    for (i, name) in HumanVariation::NAMES.iter().enumerate() {
        column(name, &|e| e.human.values()[i]);
    }
    (episodes.iter().map(|episode| episode.start as u8).collect(), columns)
}
