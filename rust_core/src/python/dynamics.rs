//! General chains for Python: every method takes the rows of a batch, one state each, and returns as many rows.

use numpy::ndarray::Ix2;
use numpy::{Element, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use serde::Deserialize;

use crate::mechanics::chain::{Chain, ExternalForce, Frame, Joint, Vector, Workspace};
use crate::mechanics::walker_chain::walker_joints;
use crate::prosthesis::spring_damper::Connection;
use crate::python::arguments::{Input2, Output, depythonize, read_config, zeros};
use crate::schema::error::{Error, Result};
use crate::vector::shared::guarded;

type Results<'py> = PyResult<Bound<'py, PyArray2<f64>>>;

/// A borrowed array, row by row.
struct Table<'a, T> {
    values: &'a [T],
    width: usize,
}

impl<'a, T: Element + Copy> Table<'a, T> {
    /// Rows of `width` values each.
    fn new(name: &str, array: &'a Input2<'_, T>, rows: usize, width: usize) -> PyResult<Self> {
        let found = array.shape();
        if found[0] != rows {
            return Err(PyValueError::new_err(format!("{name} has {} rows, the batch has {rows}", found[0])));
        }
        if found[1] != width {
            return Err(PyValueError::new_err(format!("{name} has {} values per row, must have {width}", found[1])));
        }
        Ok(Self { values: array.entries()?, width })
    }

    fn row(&self, i: usize) -> &'a [T] {
        &self.values[i * self.width..][..self.width]
    }
}

impl Table<'_, f64> {
    fn vector(&self, name: &str, i: usize) -> Result<Vector> {
        let row = self.row(i);
        row.try_into().map_err(|_| Error::Invalid(format!("{name} has {} values, needs x and y", row.len())))
    }
}

/// Body, points on it (m, its frame) and forces there (N, world axes).
type Load<'py> = (usize, Input2<'py>, Input2<'py>);

/// External forces, at most.
const MOST_LOADS: usize = 100_000;

/// Loads, one after the other: a list that claims any length gets no room in advance.
fn loads_of<'py>(loads: &Bound<'py, PyAny>) -> PyResult<Vec<Load<'py>>> {
    let mut found = Vec::new();
    for load in loads.try_iter()? {
        if found.len() == MOST_LOADS {
            return Err(PyValueError::new_err(format!("external_forces: at most {MOST_LOADS}")));
        }
        found.push(load?.extract()?);
    }
    Ok(found)
}

struct Loads<'a>(Vec<(usize, Table<'a, f64>, Table<'a, f64>)>);

impl<'a> Loads<'a> {
    fn new(loads: &'a [Load<'_>], rows: usize) -> PyResult<Self> {
        let table = |name, array| Table::new(name, array, rows, 2);
        let read = |(body, points, forces): &'a Load<'_>| Ok((*body, table("point", points)?, table("force", forces)?));
        Ok(Self(loads.iter().map(read).collect::<PyResult<_>>()?))
    }

    fn row(&self, i: usize) -> Result<Vec<ExternalForce>> {
        let read = |(body, points, forces): &(usize, Table<f64>, Table<f64>)| {
            Ok(ExternalForce { body: *body, point: points.vector("point", i)?, force: forces.vector("force", i)? })
        };
        self.0.iter().map(read).collect()
    }
}

/// Calls `state` for every row of the batch, without the GIL; an error says in which row.
fn for_each_row(py: Python<'_>, rows: usize, mut state: impl FnMut(usize) -> Result<()> + Send) -> PyResult<()> {
    let located = |i: usize, error: Error| match rows {
        1 => error,
        _ => Error::Invalid(format!("{error} (state {i} of the batch, counted from 0)")),
    };
    Ok(py.detach(|| guarded(|| (0..rows).try_for_each(|i| state(i).map_err(|error| located(i, error)))))?)
}

/// A new array of `width` numbers per row, which `state` fills.
fn fill_rows<'py>(
    py: Python<'py>,
    rows: usize,
    width: usize,
    mut state: impl FnMut(usize, &mut [f64]) -> Result<()> + Send,
) -> Results<'py> {
    let output = zeros(py, [rows, width])?;
    {
        let mut output = output.readwrite();
        let values = output.as_slice_mut()?;
        for_each_row(py, rows, |i| state(i, &mut values[i * width..][..width]))?;
    }
    Ok(output)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Definition {
    joints: Vec<Joint>,
    gravity: Vector,
}

#[pyclass(name = "Chain", module = "prosthesis_gym._core", frozen)]
pub struct PyChain {
    chain: Chain,
}

impl PyChain {
    fn joints(&self) -> usize {
        self.chain.joints().len()
    }
}

#[pymethods]
impl PyChain {
    #[new]
    fn new(definition: &Bound<'_, PyAny>) -> PyResult<Self> {
        let Definition { joints, gravity } = depythonize(definition)?;
        Ok(Self { chain: Chain::new(joints, gravity)? })
    }

    fn frames<'py>(&self, py: Python<'py>, q: Input2<'py>) -> Results<'py> {
        let rows = q.shape()[0];
        let q = Table::new("q", &q, rows, self.joints())?;
        let mut frames = vec![Frame::IDENTITY; self.joints()];
        fill_rows(py, rows, 3 * self.joints(), |i, output| {
            self.chain.frames(q.row(i), &mut frames)?;
            for (output, frame) in output.chunks_exact_mut(3).zip(&frames) {
                output.copy_from_slice(&[frame.origin[0], frame.origin[1], frame.angle()]);
            }
            Ok(())
        })
    }

    fn point_position<'py>(&self, py: Python<'py>, q: Input2<'py>, body: usize, point: Input2<'py>) -> Results<'py> {
        let rows = q.shape()[0];
        let (q, point) = (Table::new("q", &q, rows, self.joints())?, Table::new("point", &point, rows, 2)?);
        fill_rows(py, rows, 2, |i, output| {
            let position = self.chain.point_position(q.row(i), body, point.vector("point", i)?)?;
            output.copy_from_slice(&position);
            Ok(())
        })
    }

    fn point_velocity<'py>(
        &self,
        py: Python<'py>,
        q: Input2<'py>,
        qd: Input2<'py>,
        body: usize,
        point: Input2<'py>,
    ) -> Results<'py> {
        let rows = q.shape()[0];
        let (q, qd) = (Table::new("q", &q, rows, self.joints())?, Table::new("qd", &qd, rows, self.joints())?);
        let point = Table::new("point", &point, rows, 2)?;
        fill_rows(py, rows, 2, |i, output| {
            let velocity = self.chain.point_velocity(q.row(i), qd.row(i), body, point.vector("point", i)?)?;
            output.copy_from_slice(&velocity);
            Ok(())
        })
    }

    fn mass_matrix<'py>(&self, py: Python<'py>, q: Input2<'py>) -> Results<'py> {
        let rows = q.shape()[0];
        let q = Table::new("q", &q, rows, self.joints())?;
        let mut work = Workspace::default();
        fill_rows(py, rows, self.joints().pow(2), |i, output| self.chain.mass_matrix(&mut work, q.row(i), output))
    }

    fn bias<'py>(&self, py: Python<'py>, q: Input2<'py>, qd: Input2<'py>) -> Results<'py> {
        let rows = q.shape()[0];
        let (q, qd) = (Table::new("q", &q, rows, self.joints())?, Table::new("qd", &qd, rows, self.joints())?);
        let mut work = Workspace::default();
        fill_rows(py, rows, self.joints(), |i, output| self.chain.bias(&mut work, q.row(i), qd.row(i), output))
    }

    fn inverse_dynamics<'py>(
        &self,
        py: Python<'py>,
        q: Input2<'py>,
        qd: Input2<'py>,
        qdd: Input2<'py>,
        external_forces: &Bound<'py, PyAny>,
    ) -> Results<'py> {
        let rows = q.shape()[0];
        let (q, qd) = (Table::new("q", &q, rows, self.joints())?, Table::new("qd", &qd, rows, self.joints())?);
        let external_forces = loads_of(external_forces)?;
        let (qdd, loads) = (Table::new("qdd", &qdd, rows, self.joints())?, Loads::new(&external_forces, rows)?);
        let mut work = Workspace::default();
        fill_rows(py, rows, self.joints(), |i, tau| {
            self.chain.inverse_dynamics(&mut work, q.row(i), qd.row(i), qdd.row(i), &loads.row(i)?, tau)
        })
    }

    /// Fills the wanted entries of `qdd` and `tau` in place.
    #[expect(clippy::too_many_arguments, reason = "the quantities of the equation of motion, under their own names")]
    fn hybrid_dynamics<'py>(
        &self,
        py: Python<'py>,
        q: Input2<'py>,
        qd: Input2<'py>,
        mut qdd: Output<'py, f64, Ix2>,
        mut tau: Output<'py, f64, Ix2>,
        forward: Input2<'py, bool>,
        external_forces: &Bound<'py, PyAny>,
    ) -> PyResult<()> {
        let (rows, n) = (q.shape()[0], self.joints());
        for (name, shape) in [("qdd", qdd.shape()), ("tau", tau.shape())] {
            if shape != [rows, n] {
                return Err(PyValueError::new_err(format!("{name} has shape {shape:?}, must have [{rows}, {n}]")));
            }
        }
        let (q, qd) = (Table::new("q", &q, rows, self.joints())?, Table::new("qd", &qd, rows, self.joints())?);
        let external_forces = loads_of(external_forces)?;
        let (forward, loads) =
            (Table::new("forward", &forward, rows, self.joints())?, Loads::new(&external_forces, rows)?);
        let (qdd, tau) = (qdd.entries()?, tau.entries()?);
        let mut work = Workspace::default();
        for_each_row(py, rows, |i| {
            let (qdd, tau) = (&mut qdd[i * n..][..n], &mut tau[i * n..][..n]);
            let loads = loads.row(i)?;
            self.chain.hybrid_dynamics(&mut work, q.row(i), qd.row(i), qdd, tau, forward.row(i), &loads)
        })
    }

    fn kinetic_energy<'py>(&self, py: Python<'py>, q: Input2<'py>, qd: Input2<'py>) -> Results<'py> {
        let rows = q.shape()[0];
        let (q, qd) = (Table::new("q", &q, rows, self.joints())?, Table::new("qd", &qd, rows, self.joints())?);
        fill_rows(py, rows, 1, |i, output| {
            output[0] = self.chain.kinetic_energy(q.row(i), qd.row(i))?;
            Ok(())
        })
    }

    fn potential_energy<'py>(&self, py: Python<'py>, q: Input2<'py>) -> Results<'py> {
        let rows = q.shape()[0];
        let q = Table::new("q", &q, rows, self.joints())?;
        fill_rows(py, rows, 1, |i, output| {
            output[0] = self.chain.potential_energy(q.row(i))?;
            Ok(())
        })
    }
}

/// The walker's joints of Table 1 for a configuration, as `Chain` takes them.
#[pyfunction(name = "walker_joints")]
pub fn walker_joints_of<'py>(py: Python<'py>, config: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let config = read_config(config)?;
    let socket = (config.socket.connection == Connection::Compliant).then_some(config.socket.place);
    let joints = walker_joints(&config.body, socket);
    pythonize::pythonize(py, &joints).map_err(|error| PyValueError::new_err(error.to_string()))
}
