//! The Python module `prosthesis_gym._core`: the only folder that names pyo3 and numpy.

mod dynamics;
mod recycled;
mod step;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use serde::de::DeserializeOwned;

use crate::batch::{Batch, MOST_ENVIRONMENTS};
use crate::config::Config;
use crate::disturbance::Push;
use crate::environment::Autoreset;
use crate::error::Error;
use crate::human_controller::intent::Knot;
use crate::human_controller::variation::HumanVariation;
use crate::params::{above, within};
use crate::prosthesis_controller::agent::{ActionMap, Channel, ObservationMap};
use crate::randomisation::Drawn;
use crate::recorder::COLUMNS;
use crate::repetition::Repeats;
use crate::reward::TERMS;
use crate::scenario::Episode;
use crate::statistics::{Moments, Normaliser};
use crate::termination::REASONS;
use step::{Outputs, PyStep};

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        PyValueError::new_err(error.to_string())
    }
}

fn read_config(config: &Bound<'_, PyAny>) -> PyResult<Config> {
    Ok(Config::from_deserializer(&mut pythonize::Depythonizer::from_object(config))?)
}

/// Reads what is not a configuration; an error names the entry.
fn depythonize<T: DeserializeOwned>(object: &Bound<'_, PyAny>) -> PyResult<T> {
    let read = serde_path_to_error::deserialize(&mut pythonize::Depythonizer::from_object(object));
    Ok(read.map_err(|error| Error::Schema { key: error.path().to_string(), reason: error.inner().to_string() })?)
}

/// Count, mean and variance.
type PyMoments<'py> = (f64, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

#[pyclass(name = "Batch", module = "prosthesis_gym._core")]
struct PyBatch {
    batch: Batch,
    outputs: Outputs,
}

#[pymethods]
impl PyBatch {
    #[new]
    #[pyo3(signature = (num_envs, config, autoreset = "next_step", threads = None))]
    fn new(num_envs: usize, config: &Bound<'_, PyAny>, autoreset: &str, threads: Option<usize>) -> PyResult<Self> {
        let autoreset = match autoreset {
            "next_step" => Autoreset::NextStep,
            "same_step" => Autoreset::SameStep,
            "disabled" => Autoreset::Disabled,
            other => {
                let message = format!("autoreset = {other:?} must be one of 'next_step', 'same_step', 'disabled'");
                return Err(PyValueError::new_err(message));
            }
        };
        let config = read_config(config)?;
        let batch = Batch::new(num_envs, config, autoreset, threads.unwrap_or(0))?;
        Ok(Self { batch, outputs: Outputs::default() })
    }

    /// Memory of an environment in its block, bytes.
    #[getter]
    fn bytes_per_walker(&self) -> usize {
        self.batch.bytes_per_walker()
    }

    /// Steps of the integration per control period.
    #[getter]
    fn solver_steps(&self) -> usize {
        self.batch.solver_steps()
    }

    /// Control periods that were integrated again, since the batch was made: settled in finer steps, settled by the reference alone,
    /// and diverged by all.
    #[getter]
    fn repeated_periods(&self) -> (u64, u64, u64) {
        let Repeats { finer, reference, diverged } = self.batch.repeats();
        (finer, reference, diverged)
    }

    #[getter]
    fn num_envs(&self) -> usize {
        self.batch.num_envs()
    }

    #[getter]
    fn observation_size(&self) -> usize {
        self.batch.observation_size()
    }

    #[pyo3(signature = (seeds = None, mask = None))]
    fn reset<'py>(
        &mut self,
        py: Python<'py>,
        seeds: Option<PyReadonlyArray1<'py, u64>>,
        mask: Option<PyReadonlyArray1<'py, bool>>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let all = vec![true; self.batch.num_envs()];
        let mask = mask.as_ref().map(|mask| mask.as_slice()).transpose()?.unwrap_or(&all);
        let seeds = seeds.as_ref().map(|seeds| seeds.as_slice()).transpose()?;
        self.batch.reset(seeds, mask)?;
        self.newest(py, mask)
    }

    /// The newest observations. Statistics learn from those in the mask `new` (N,), by default from none.
    #[pyo3(signature = (new = None))]
    fn observations<'py>(
        &mut self,
        py: Python<'py>,
        new: Option<PyReadonlyArray1<'py, bool>>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let none = vec![false; self.batch.num_envs()];
        let new = new.as_ref().map(|new| new.as_slice()).transpose()?.unwrap_or(&none);
        self.newest(py, new)
    }

    /// The newest observations as they are, normalised or not.
    fn raw_observations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let observations = PyArray2::zeros(py, [self.batch.num_envs(), self.batch.observation_size()], false);
        self.batch.raw_observations(observations.readwrite().as_slice_mut()?);
        Ok(observations)
    }

    fn step(&mut self, py: Python<'_>, actions: PyReadonlyArray1<'_, f64>) -> PyResult<PyStep> {
        self.outputs.step(py, &mut self.batch, actions.as_slice()?)
    }

    /// Normalises observations from now on by their running moments.
    #[pyo3(signature = (clip = 10.0, epsilon = 1e-8))]
    fn normalise_observations(&mut self, clip: f64, epsilon: f64) -> PyResult<()> {
        above(0.0, 1e6).check("clip", clip, "")?;
        within(0.0, 1.0).check("epsilon", epsilon, "")?;
        let moments = Moments::new(self.batch.observation_size());
        self.batch.normaliser = Some(Normaliser { moments, learns: true, clip, epsilon });
        Ok(())
    }

    /// Number of observations seen, their mean and variance.
    fn moments<'py>(&self, py: Python<'py>) -> PyResult<PyMoments<'py>> {
        let Moments { count, mean, variance } = &self.normaliser()?.moments;
        Ok((*count, PyArray1::from_slice(py, mean), PyArray1::from_slice(py, variance)))
    }

    /// Replaces the moments; without `learns` they stay as they are from now on.
    fn set_moments(
        &mut self,
        count: f64,
        mean: PyReadonlyArray1<'_, f64>,
        variance: PyReadonlyArray1<'_, f64>,
        learns: bool,
    ) -> PyResult<()> {
        let size = self.batch.observation_size();
        within(0.0, f64::MAX).check("count", count, "")?;
        let (mean, variance) = (mean.as_slice()?, variance.as_slice()?);
        for (name, values, least) in [("mean", mean, f64::MIN), ("variance", variance, 0.0)] {
            if values.len() != size {
                let message =
                    format!("{name} has {} entries, must have one per observation entry: {size}", values.len());
                return Err(PyValueError::new_err(message));
            }
            for (i, &value) in values.iter().enumerate() {
                within(least, f64::MAX).check(&format!("{name}[{i}]"), value, "")?;
            }
        }
        let moments = Moments { count, mean: mean.to_vec(), variance: variance.to_vec() };
        let normaliser = self.batch.normaliser.as_mut().ok_or_else(not_normalised)?;
        (normaliser.moments, normaliser.learns) = (moments, learns);
        Ok(())
    }

    /// Whether observations change the moments.
    #[getter]
    fn learns(&self) -> PyResult<bool> {
        Ok(self.normaliser()?.learns)
    }

    #[setter]
    fn set_learns(&mut self, learns: bool) -> PyResult<()> {
        self.batch.normaliser.as_mut().ok_or_else(not_normalised)?.learns = learns;
        Ok(())
    }

    /// What was drawn for the episode that runs in each environment: one array per quantity.
    fn episodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let episodes: Vec<_> = self.batch.episodes().collect();
        let speed = |knot: Option<&Knot>| knot.map_or(f64::NAN, |knot| knot.speed_m_s);
        let column = |value: &dyn Fn(&Episode) -> f64| PyArray1::from_iter(py, episodes.iter().map(|e| value(e)));
        let columns = PyDict::new(py);
        let starts = episodes.iter().map(|episode| episode.start as u8);
        columns.set_item("start", PyArray1::from_iter(py, starts))?;
        columns.set_item("first_speed_m_s", column(&|e| speed(e.profile.knots.first())))?;
        columns.set_item("last_speed_m_s", column(&|e| speed(e.profile.knots.last())))?;
        columns.set_item("push_n", column(&|e| e.disturbance.pushes.first().map_or(0.0, |push| push.force.x)))?;
        columns.set_item("push_s", column(&|e| e.disturbance.pushes.first().map_or(f64::NAN, Push::earliest_s)))?;
        let drawn = |value: &dyn Fn(&Drawn) -> f64| column(&|e| e.drawn.as_ref().map_or(f64::NAN, value));
        for (i, key) in self.batch.randomised().enumerate() {
            columns.set_item(key, drawn(&|drawn| drawn.numbers[i]))?;
        }
        columns.set_item("variant", drawn(&|drawn| drawn.variant.map_or(-1.0, |variant| variant as f64)))?;
        for (i, name) in HumanVariation::NAMES.iter().enumerate() {
            columns.set_item(name, column(&|e| e.human.values()[i]))?;
        }
        Ok(columns)
    }

    /// Share of disturbances and randomisation that episodes have from their next start on.
    #[getter]
    fn difficulty(&self) -> f64 {
        self.batch.difficulty()
    }

    #[setter]
    fn set_difficulty(&mut self, difficulty: f64) -> PyResult<()> {
        Ok(self.batch.set_difficulty(difficulty)?)
    }

    /// Env steps of an episode at most; None without a limit.
    #[getter]
    fn max_episode_steps(&self) -> Option<u64> {
        self.batch.most_steps()
    }

    #[setter]
    fn set_max_episode_steps(&mut self, steps: Option<u64>) -> PyResult<()> {
        Ok(self.batch.set_most_steps(steps)?)
    }

    fn get_state<'py>(&self, py: Python<'py>, indices: Vec<usize>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &self.batch.save(&indices)?))
    }

    fn set_state(&mut self, state: &[u8], indices: Vec<usize>) -> PyResult<Vec<bool>> {
        Ok(self.batch.restore(&indices, state)?)
    }

    fn record(&mut self, index: usize) -> PyResult<()> {
        Ok(self.batch.record(index)?)
    }

    fn recording<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(py);
        let rows = self.batch.recording().map_or(&[][..], |recorder| &recorder.rows);
        for (i, name) in COLUMNS.iter().enumerate() {
            columns.set_item(name, PyArray1::from_iter(py, rows.iter().map(|row| row[i])))?;
        }
        Ok(columns)
    }

    /// The present state of environment `index`: one float per column of a recording, NaN for mean powers.
    fn snapshot<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyDict>> {
        let row = PyDict::new(py);
        for (name, value) in COLUMNS.iter().zip(self.batch.snapshot(index)?) {
            row.set_item(name, value)?;
        }
        Ok(row)
    }

    /// Heights (m) of the ground under environment `index` at the places `x` (N,), m.
    fn ground_height<'py>(
        &self,
        py: Python<'py>,
        index: usize,
        x: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_vec(py, self.batch.ground_height(index, x.as_slice()?)?))
    }

    fn events<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let events = PyDict::new(py);
        let strikes = self.batch.recording().map_or(&[][..], |recorder| &recorder.strikes);
        events.set_item("time_s", PyArray1::from_iter(py, strikes.iter().map(|strike| strike.time_s)))?;
        events.set_item("leg", PyArray1::from_iter(py, strikes.iter().map(|strike| i64::from(strike.intact))))?;
        events.set_item("hip_x_m", PyArray1::from_iter(py, strikes.iter().map(|strike| strike.hip_x_m)))?;
        Ok(events)
    }
}

impl PyBatch {
    fn newest<'py>(&mut self, py: Python<'py>, new: &[bool]) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let observations = PyArray2::zeros(py, [self.batch.num_envs(), self.batch.observation_size()], false);
        self.batch.observations(new, observations.readwrite().as_slice_mut()?)?;
        Ok(observations)
    }

    fn normaliser(&self) -> PyResult<&Normaliser> {
        self.batch.normaliser.as_ref().ok_or_else(not_normalised)
    }
}

fn not_normalised() -> PyErr {
    PyValueError::new_err("observations are not normalised: call normalise_observations first")
}

/// Every configuration key with default, unit, range and meaning.
#[pyfunction]
fn parameters<'py>(py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
    Config::table()
        .into_iter()
        .map(|row| {
            let entry = PyDict::new(py);
            entry.set_item("key", row.key)?;
            entry.set_item("default", row.default)?;
            entry.set_item("unit", row.unit)?;
            entry.set_item("range", row.range)?;
            entry.set_item("doc", row.doc)?;
            Ok(entry)
        })
        .collect()
}

/// The complete, validated configuration that a partial one stands for.
#[pyfunction]
fn resolve<'py>(py: Python<'py>, config: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let config = read_config(config)?;
    pythonize::pythonize(py, &config).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Observation frame of the configured knee unit: (name, low, high, meaning) in order.
#[pyfunction]
fn channels(config: &Bound<'_, PyAny>) -> PyResult<Vec<(&'static str, f32, f32, &'static str)>> {
    let map = ObservationMap::new(&read_config(config)?);
    Ok(map.channels().iter().map(|c| (c.name, c.bounds[0], c.bounds[1], c.doc)).collect())
}

/// Group of each channel of an observation frame, in the order of `channels`.
#[pyfunction]
fn channel_groups(config: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    let map = ObservationMap::new(&read_config(config)?);
    let name = |channel: &Channel| serde_json::to_value(channel.group).map(|group| group.as_str().map(str::to_owned));
    Ok(map.channels().iter().filter_map(|channel| name(channel).ok().flatten()).collect())
}

/// How many numbers an action has.
#[pyfunction]
fn action_size(config: &Bound<'_, PyAny>) -> PyResult<usize> {
    Ok(ActionMap::new(&read_config(config)?).size())
}

#[pymodule(gil_used = false)]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyBatch>()?;
    module.add_class::<PyStep>()?;
    module.add_class::<dynamics::PyChain>()?;
    module.add_function(wrap_pyfunction!(parameters, module)?)?;
    module.add_function(wrap_pyfunction!(resolve, module)?)?;
    module.add_function(wrap_pyfunction!(channels, module)?)?;
    module.add_function(wrap_pyfunction!(channel_groups, module)?)?;
    module.add_function(wrap_pyfunction!(action_size, module)?)?;
    module.add_function(wrap_pyfunction!(dynamics::walker_joints_of, module)?)?;
    module.add("TERMS", TERMS.to_vec())?;
    module.add("MOST_ENVIRONMENTS", MOST_ENVIRONMENTS)?;
    module.add("REASONS", REASONS.to_vec())?;
    Ok(())
}
