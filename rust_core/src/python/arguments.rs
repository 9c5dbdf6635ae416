//! Arguments from Python, read with limits: what is too deep, too long, in use elsewhere or in another order is an error.

use numpy::ndarray::{Dimension, Ix1, Ix2};
use numpy::{
    BorrowError, Element, PyArray, PyArray2, PyArrayMethods, PyReadonlyArray, PyReadwriteArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyDict, PyFrozenSet, PyMapping, PySequence, PySet, PyString, PyTuple};
use serde::de::DeserializeOwned;

use crate::config::Config;
use crate::schema::error::{Error, Result};
use crate::vector::memory;
use crate::vector::shared::guarded;

/// Nesting of a configuration, at most. Its own is 4 deep.
const DEEPEST: usize = 32;
/// Values in it, at most.
const MOST_VALUES: usize = 1_000_000;

/// A C-contiguous array, borrowed to be read.
pub(super) struct Input<'py, T: Element, D: Dimension>(PyReadonlyArray<'py, T, D>);
pub(super) type Input1<'py, T = f64> = Input<'py, T, Ix1>;
pub(super) type Input2<'py, T = f64> = Input<'py, T, Ix2>;

impl<'a, 'py, T: Element + 'a, D: Dimension + 'a> FromPyObject<'a, 'py> for Input<'py, T, D> {
    type Error = PyErr;

    fn extract(object: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        let array = object.cast::<PyArray<T, D>>()?.to_owned();
        check_order(&array)?;
        let read = array.try_readonly();
        read.map(Self).map_err(|_| PyValueError::new_err("an array is being written to by another argument or call"))
    }
}

impl<T: Element, D: Dimension> Input<'_, T, D> {
    /// Its entries, row by row.
    pub fn entries(&self) -> PyResult<&[T]> {
        Ok(self.0.as_slice()?)
    }

    pub fn shape(&self) -> &[usize] {
        self.0.shape()
    }
}

/// A C-contiguous array, borrowed to be filled.
pub(super) struct Output<'py, T: Element, D: Dimension>(PyReadwriteArray<'py, T, D>);

impl<'a, 'py, T: Element + 'a, D: Dimension + 'a> FromPyObject<'a, 'py> for Output<'py, T, D> {
    type Error = PyErr;

    fn extract(object: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        let array = object.cast::<PyArray<T, D>>()?.to_owned();
        check_order(&array)?;
        let refused = |error: BorrowError| PyValueError::new_err(format!("an array cannot be filled: {error}"));
        array.try_readwrite().map(Self).map_err(refused)
    }
}

impl<T: Element, D: Dimension> Output<'_, T, D> {
    /// Its entries, row by row.
    pub fn entries(&mut self) -> PyResult<&mut [T]> {
        Ok(self.0.as_slice_mut()?)
    }

    pub fn shape(&self) -> &[usize] {
        self.0.shape()
    }
}

fn check_order<T: Element, D: Dimension>(array: &Bound<'_, PyArray<T, D>>) -> PyResult<()> {
    // An empty array is in any order.
    if array.is_c_contiguous() || array.is_empty() {
        return Ok(());
    }
    Err(PyTypeError::new_err("an array must be C-contiguous: see numpy.ascontiguousarray"))
}

/// A new array of zeros, if there is memory for it.
pub(super) fn zeros<T: Element>(py: Python<'_>, [rows, width]: [usize; 2]) -> PyResult<Bound<'_, PyArray2<T>>> {
    let bytes = (rows as u64).saturating_mul(width as u64).saturating_mul(size_of::<T>() as u64);
    memory::check(&format!("an array of {rows} x {width} numbers"), bytes)?;
    new_zeros(py, Ix2(rows, width))
}

/// A new array of zeros; a MemoryError where NumPy has none, of which its C interface would make a panic.
pub(super) fn new_zeros<T: Element, D: Dimension>(py: Python<'_>, dimensions: D) -> PyResult<Bound<'_, PyArray<T, D>>> {
    let shape = PyTuple::new(py, dimensions.slice())?;
    let array = py.import("numpy")?.call_method1("zeros", (shape, T::get_dtype(py)))?;
    Ok(array.cast_into::<PyArray<T, D>>()?)
}

/// Indices, as many as there are environments at most.
pub(super) fn indices_of(indices: &Bound<'_, PyAny>, num_envs: usize) -> PyResult<Vec<usize>> {
    let mut found = Vec::new();
    for index in indices.try_iter()? {
        if found.len() == num_envs {
            let message = format!("indices must not be more than there are environments: {num_envs}");
            return Err(PyValueError::new_err(message));
        }
        found.push(index?.extract()?);
    }
    Ok(found)
}

/// Reads a configuration; an error names the key.
pub(super) fn read_config(config: &Bound<'_, PyAny>) -> PyResult<Config> {
    check_size(config)?;
    let read = || Config::from_deserializer(&mut pythonize::Depythonizer::from_object(config));
    Ok(guarded(read)?)
}

/// Reads what is not a configuration; an error names the entry.
pub(super) fn depythonize<T: DeserializeOwned>(object: &Bound<'_, PyAny>) -> PyResult<T> {
    check_size(object)?;
    let read = || -> Result<T> {
        let read = serde_path_to_error::deserialize(&mut pythonize::Depythonizer::from_object(object));
        read.map_err(|error| Error::Schema { key: error.path().to_string(), reason: error.inner().to_string() })
    };
    Ok(guarded(read)?)
}

/// An error if an object is nested deeper than any configuration, as one that holds itself is, or much larger.
fn check_size(object: &Bound<'_, PyAny>) -> PyResult<()> {
    let mut values = 0;
    let mut open = vec![(object.clone(), 0)];
    while let Some((object, depth)) = open.pop() {
        let parts = parts(&object)?;
        let Some((parts, count)) = parts else { continue };
        values += count;
        if values > MOST_VALUES {
            return Err(PyValueError::new_err(format!("a configuration must not have more than {MOST_VALUES} values")));
        }
        if depth == DEEPEST {
            return Err(PyValueError::new_err(format!(
                "a configuration must not be nested deeper than {DEEPEST} levels"
            )));
        }
        for part in parts.try_iter()?.take(count) {
            open.push((part?, depth + 1));
        }
    }
    Ok(())
}

/// What a container holds, and how many; None for what is none.
fn parts<'py>(object: &Bound<'py, PyAny>) -> PyResult<Option<(Bound<'py, PyAny>, usize)>> {
    let is_text = object.is_instance_of::<PyString>()
        || object.is_instance_of::<PyBytes>()
        || object.is_instance_of::<PyByteArray>();
    if is_text {
        return Ok(None);
    }
    if let Ok(dict) = object.cast::<PyDict>() {
        return Ok(Some((dict.values().into_any(), dict.len())));
    }
    if let Ok(mapping) = object.cast::<PyMapping>() {
        return Ok(Some((mapping.values()?.into_any(), mapping.len()?)));
    }
    if object.is_instance_of::<PySet>() || object.is_instance_of::<PyFrozenSet>() {
        return Ok(Some((object.clone(), object.len()?)));
    }
    if let Ok(sequence) = object.cast::<PySequence>() {
        return Ok(Some((object.clone(), sequence.len()?)));
    }
    Ok(None)
}
