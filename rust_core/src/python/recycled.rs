//! Arrays that are filled again once nobody in Python holds them any longer.

use numpy::ndarray::Dimension;
use numpy::npyffi::PyArrayObject;
use numpy::npyffi::flags::NPY_ARRAY_CARRAY;
use numpy::{Element, PyArray, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::python::arguments::new_zeros;

/// An array of which others may hold references for a while.
pub(super) struct Recycled<T, D> {
    array: Py<PyArray<T, D>>,
    dimensions: D,
}

impl<T: Element, D: Dimension> Recycled<T, D> {
    /// An array of zeros.
    pub fn zeros(py: Python<'_>, dimensions: D) -> PyResult<Self> {
        Ok(Self { array: new_zeros(py, dimensions.clone())?.unbind(), dimensions })
    }

    /// Hands it out.
    pub fn share(&self, py: Python<'_>) -> Py<PyArray<T, D>> {
        self.array.clone_ref(py)
    }

    /// Whether nobody else holds it or can get hold of it, and nobody who did has changed its shape, type or flags.
    pub fn is_free(&self, py: Python<'_>) -> bool {
        let array = self.array.bind(py);
        self.references(py) == 1
            && array.dtype().is(T::get_dtype(py))
            && array.shape() == self.dimensions.slice()
            && is_as_made(array)
    }

    /// Its entries, to be written; an error if somebody holds it.
    pub fn entries<'a>(&'a mut self, py: Python<'a>) -> PyResult<&'a mut [T]> {
        if !self.is_free(py) {
            return Err(PyRuntimeError::new_err("an array of the step is still in use"));
        }
        // SAFETY: the only reference, strong or weak, is ours, and borrowed for as long as the slice lives.
        #[allow(unsafe_code)]
        Ok(unsafe { self.array.bind(py).as_slice_mut() }?)
    }

    /// How many references to it there are.
    #[allow(unsafe_code)]
    fn references(&self, _py: Python<'_>) -> isize {
        // SAFETY: the array is alive and the interpreter attached.
        unsafe { pyo3::ffi::Py_REFCNT(self.array.as_ptr()) }
    }
}

/// Whether an array can be written in C order, and no weak reference to it can become a strong one.
#[allow(unsafe_code)]
fn is_as_made<T, D>(array: &Bound<'_, PyArray<T, D>>) -> bool {
    // SAFETY: the array is alive and the interpreter attached.
    let PyArrayObject { flags, weakreflist, .. } = unsafe { &*array.as_array_ptr() };
    flags & NPY_ARRAY_CARRAY == NPY_ARRAY_CARRAY && weakreflist.is_null()
}
