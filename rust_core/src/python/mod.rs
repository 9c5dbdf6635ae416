//! The Python module `prosthesis_gym._core`: the only folder that names pyo3 and numpy.
//!
//! Nothing that a caller gives may end the process: arguments are read with limits, sizes are checked before room is made, and
//! a panic, which no input should cause, becomes an exception of its own.

mod arguments;
mod batch;
mod dynamics;
mod recycled;
mod step;

use std::collections::HashMap;

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::agent::action::{ActionMap, ActionParams, CommandScale};
use crate::agent::observation::ObservationMap;
use crate::config::Config;
use crate::episode::reward::TERMS;
use crate::human::gait_fsm::{IntactState, ResidualState};
use crate::prosthesis::gait::Phase;
use crate::prosthesis::knee::kind::DeviceKind;
use strum::{IntoEnumIterator, VariantNames};

use crate::episode::termination::Reason;
use crate::schema::error::Error;
use crate::signals::CONTROL_PERIOD_S;
use crate::vector::batch::MOST_ENVIRONMENTS;
use crate::vector::shared;
use arguments::read_config;
use batch::PyBatch;
use step::PyStep;

pyo3::create_exception!(
    prosthesis_gym._core,
    InternalError,
    PyRuntimeError,
    "A fault of prosthesis_gym itself, which no input should cause: please report it."
);

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        let text = error.to_string();
        match error {
            Error::OutOfRange { .. } | Error::Schema { .. } | Error::Invalid(_) => PyValueError::new_err(text),
            Error::Unusable(_) => PyRuntimeError::new_err(text),
            Error::Internal(_) => InternalError::new_err(text),
        }
    }
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

/// Settings that change nothing for any walker of a configuration, by their dotted keys: what each needs, and the key that
/// turns it on and off, if there is one.
#[pyfunction]
fn idle(config: &Bound<'_, PyAny>) -> PyResult<HashMap<String, (&'static str, Option<&'static str>)>> {
    let settings = read_config(config)?.idle()?;
    Ok(settings.into_iter().map(|(key, idle)| (key, (idle.needs, idle.switch))).collect())
}

/// Observation frame of the configured knee unit: (name, low, high, meaning) in order.
#[pyfunction]
fn channels(config: &Bound<'_, PyAny>) -> PyResult<Vec<(&'static str, f32, f32, &'static str)>> {
    let config = read_config(config)?;
    let map = ObservationMap::new(&config.observation, config.device.kind);
    Ok(map.channels().iter().map(|c| (c.name, c.bounds[0], c.bounds[1], c.doc)).collect())
}

/// Group of each channel of an observation frame, in the order of `channels`.
#[pyfunction]
fn channel_groups(config: &Bound<'_, PyAny>) -> PyResult<Vec<&'static str>> {
    let config = read_config(config)?;
    let map = ObservationMap::new(&config.observation, config.device.kind);
    Ok(map.channels().iter().map(|channel| channel.group.into()).collect())
}

/// The knee units by `device.kind`: what each is, and the keys of its parameters in section `action`.
#[pyfunction]
fn devices(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let devices = PyDict::new(py);
    for kind in DeviceKind::iter() {
        let (command, (constant, full)) = (kind.command(), ActionParams::keys(kind));
        let device = PyDict::new(py);
        device.set_item("env_id", kind.env_id())?;
        device.set_item("command_name", command.quantity)?;
        device.set_item("command_unit", command.unit)?;
        device.set_item("signed", command.signed)?;
        device.set_item("has_phases", kind.has_phases())?;
        device.set_item("constant_key", constant)?;
        device.set_item("full_key", full)?;
        devices.set_item(<&str>::from(kind), device)?;
    }
    Ok(devices)
}

/// Largest command that the configured knee unit carries out, and the command of action +1, in the unit's own unit.
#[pyfunction]
fn command_limits(config: &Bound<'_, PyAny>) -> PyResult<(f64, f64)> {
    let config = read_config(config)?;
    let scale = CommandScale::new(&config.action, &config.knee_params());
    Ok((scale.most, scale.full))
}

/// How many numbers an action has.
#[pyfunction]
fn action_size(config: &Bound<'_, PyAny>) -> PyResult<usize> {
    let config = read_config(config)?;
    Ok(ActionMap::new(&config.action, config.device.kind).size())
}

/// To be called in every process that has been forked off.
#[pyfunction]
fn forked() {
    shared::forked();
}

/// Has Python call [`forked`], where it can fork.
fn register_forks(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let os = module.py().import("os")?;
    if os.hasattr("register_at_fork")? {
        let hooks = PyDict::new(module.py());
        hooks.set_item("after_in_child", wrap_pyfunction!(forked, module)?)?;
        os.call_method("register_at_fork", (), Some(&hooks))?;
    }
    Ok(())
}

#[pymodule(gil_used = false)]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    register_forks(module)?;
    module.add("InternalError", module.py().get_type::<InternalError>())?;
    module.add_class::<PyBatch>()?;
    module.add_class::<PyStep>()?;
    module.add_class::<dynamics::PyChain>()?;
    module.add_function(wrap_pyfunction!(parameters, module)?)?;
    module.add_function(wrap_pyfunction!(resolve, module)?)?;
    module.add_function(wrap_pyfunction!(idle, module)?)?;
    module.add_function(wrap_pyfunction!(channels, module)?)?;
    module.add_function(wrap_pyfunction!(channel_groups, module)?)?;
    module.add_function(wrap_pyfunction!(devices, module)?)?;
    module.add_function(wrap_pyfunction!(command_limits, module)?)?;
    module.add_function(wrap_pyfunction!(action_size, module)?)?;
    module.add_function(wrap_pyfunction!(dynamics::walker_joints_of, module)?)?;
    module.add("TERMS", TERMS.to_vec())?;
    module.add("MOST_ENVIRONMENTS", MOST_ENVIRONMENTS)?;
    module.add("CONTROL_PERIOD_S", CONTROL_PERIOD_S)?;
    module.add("RESIDUAL_STATES", ResidualState::VARIANTS.to_vec())?;
    module.add("INTACT_STATES", IntactState::VARIANTS.to_vec())?;
    module.add("PHASES", Phase::VARIANTS.to_vec())?;
    module.add("REASONS", Reason::VARIANTS.to_vec())?;
    Ok(())
}
