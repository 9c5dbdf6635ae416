//! Inertia, inverse dynamics and hybrid dynamics of a chain.

use faer::{Mat, Side, prelude::Solve};

use crate::mechanics::chain::model::{Chain, ExternalForce, finite};
use crate::mechanics::chain::planar::{Frame, Inertia, Twist, Wrench};
use crate::schema::error::{Error, Result};

/// Scratch of the recursions, owned by the caller. Fits itself to any chain.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    frames: Vec<Frame>,
    wrenches: Vec<Wrench>,
    composites: Vec<Inertia>,
    accelerations: Vec<f64>,
    forces: Vec<f64>,
    mass_matrix: Vec<f64>,
}

impl Workspace {
    fn fit(&mut self, joints: usize) {
        self.frames.resize(joints, Frame::IDENTITY);
        self.wrenches.resize(joints, Wrench::ZERO);
        self.composites.resize(joints, Inertia::NONE);
        self.accelerations.resize(joints, 0.0);
        self.forces.resize(joints, 0.0);
        self.mass_matrix.resize(joints * joints, 0.0);
    }
}

impl Chain {
    /// Joint-space inertia H: n x n, row by row.
    pub fn mass_matrix(&self, work: &mut Workspace, q: &[f64], matrix: &mut [f64]) -> Result<()> {
        self.check("q", q)?;
        self.check_length("matrix", matrix.len(), self.joints.len().pow(2))?;
        work.fit(self.joints.len());
        self.composite_rigid_bodies(work, q);
        matrix.copy_from_slice(&work.mass_matrix);
        Ok(())
    }

    /// Joint forces C that leave the joints unaccelerated: gravity and velocity products.
    pub fn bias(&self, work: &mut Workspace, q: &[f64], qd: &[f64], bias: &mut [f64]) -> Result<()> {
        self.check("q", q)?;
        self.check("qd", qd)?;
        self.check_length("bias", bias.len(), self.joints.len())?;
        work.fit(self.joints.len());
        work.accelerations.fill(0.0);
        self.newton_euler(work, q, qd, &[]);
        bias.copy_from_slice(&work.forces);
        Ok(())
    }

    /// Joint forces `tau` that cause the accelerations `qdd` under the external forces.
    pub fn inverse_dynamics(
        &self,
        work: &mut Workspace,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
        external_forces: &[ExternalForce],
        tau: &mut [f64],
    ) -> Result<()> {
        for (name, values) in [("q", q), ("qd", qd), ("qdd", qdd)] {
            self.check(name, values)?;
        }
        self.check_length("tau", tau.len(), self.joints.len())?;
        self.check_external_forces(external_forces)?;
        work.fit(self.joints.len());
        work.accelerations.copy_from_slice(qdd);
        self.newton_euler(work, q, qd, external_forces);
        tau.copy_from_slice(&work.forces);
        Ok(())
    }

    /// Fills `qdd` of the joints in `forward` and `tau` of the others, given the rest of both (section 9.1).
    ///
    /// Entries to be filled may hold anything; an error leaves them as they are.
    #[expect(clippy::too_many_arguments, reason = "the quantities of the equation of motion, under their own names")]
    pub fn hybrid_dynamics(
        &self,
        work: &mut Workspace,
        q: &[f64],
        qd: &[f64],
        qdd: &mut [f64],
        tau: &mut [f64],
        forward: &[bool],
        external_forces: &[ExternalForce],
    ) -> Result<()> {
        self.hybrid_dynamics_with_added_inertia(work, q, qd, qdd, tau, forward, external_forces, None)
    }

    /// The same with a symmetric matrix (n x n, row by row) added to the inertia that the forward joints feel.
    ///
    /// A linearly implicit step of length h adds `h D + h^2 K` of stiff forces; `tau` of the inverse joints stays the one
    /// of the chain's own inertia.
    #[expect(clippy::too_many_arguments, reason = "as above")]
    pub fn hybrid_dynamics_with_added_inertia(
        &self,
        work: &mut Workspace,
        q: &[f64],
        qd: &[f64],
        qdd: &mut [f64],
        tau: &mut [f64],
        forward: &[bool],
        external_forces: &[ExternalForce],
        added: Option<&[f64]>,
    ) -> Result<()> {
        let n = self.joints.len();
        self.check("q", q)?;
        self.check("qd", qd)?;
        for (name, length) in [("qdd", qdd.len()), ("tau", tau.len()), ("forward", forward.len())] {
            self.check_length(name, length, n)?;
        }
        self.check_external_forces(external_forces)?;
        if let Some(added) = added {
            self.check_length("added", added.len(), n * n)?;
        }
        work.fit(n);

        // C': the forces that would leave the forward joints unaccelerated.
        for i in 0..n {
            let (name, given) = if forward[i] { ("tau", tau[i]) } else { ("qdd", qdd[i]) };
            finite(|| format!("{name}[{i}]"), given)?;
            work.accelerations[i] = if forward[i] { 0.0 } else { given };
        }
        self.newton_euler(work, q, qd, external_forces);
        self.composite_rigid_bodies(work, q);

        // H_11 qdd_1 = tau_1 - C'_1 of the forward joints, then tau_2 = C'_2 + H_21 qdd_1 of the others.
        let free: Vec<usize> = (0..n).filter(|&i| forward[i]).collect();
        let added = |i: usize, j: usize| added.map_or(0.0, |added| added[i * n + j]);
        let inertia = Mat::from_fn(free.len(), free.len(), |i, j| {
            work.mass_matrix[free[i] * n + free[j]] + added(free[i], free[j])
        });
        let mut solution = Mat::from_fn(free.len(), 1, |i, _| {
            let given: f64 = (0..n).filter(|&j| !forward[j]).map(|j| added(free[i], j) * qdd[j]).sum();
            tau[free[i]] - work.forces[free[i]] - given
        });
        self.solve(&inertia, &mut solution, &free)?;
        for (i, &joint) in free.iter().enumerate() {
            qdd[joint] = solution[(i, 0)];
        }
        for i in (0..n).filter(|&i| !forward[i]) {
            tau[i] = work.forces[i] + free.iter().map(|&j| work.mass_matrix[i * n + j] * qdd[j]).sum::<f64>();
        }
        Ok(())
    }

    /// Recursive Newton-Euler (Table 5.1): the joint forces that cause `work.accelerations`, into `work.forces`.
    fn newton_euler(&self, work: &mut Workspace, q: &[f64], qd: &[f64], external_forces: &[ExternalForce]) {
        // Gravity is an acceleration of the ground the other way.
        let mut acceleration = Twist { angular: 0.0, linear: self.gravity.map(|g| -g) };
        for (i, body) in self.outwards(q, Some(qd)).enumerate() {
            let (axis, velocity, inertia) = (body.joint.axis(), body.velocity, body.joint.inertia());
            acceleration =
                body.frame.local_twist(acceleration) + axis * work.accelerations[i] + velocity.cross(axis * qd[i]);
            let mut wrench = inertia.momentum(acceleration) + velocity.cross_wrench(inertia.momentum(velocity));
            for load in external_forces.iter().filter(|load| load.body == i) {
                wrench = wrench - Wrench::of_force(load.point, body.world.unrotate(load.force));
            }
            (work.frames[i], work.wrenches[i]) = (body.frame, wrench);
        }
        let mut passed_on = Wrench::ZERO;
        for i in (0..self.joints.len()).rev() {
            let wrench = work.wrenches[i] + passed_on;
            work.forces[i] = wrench.dot(self.joints[i].axis());
            passed_on = work.frames[i].wrench(wrench);
        }
    }

    /// Composite rigid bodies (Table 6.2): H, into `work.mass_matrix`.
    fn composite_rigid_bodies(&self, work: &mut Workspace, q: &[f64]) {
        let n = self.joints.len();
        let mut outer = Inertia::NONE;
        for i in (0..n).rev() {
            work.frames[i] = self.joints[i].frame(q[i]);
            work.composites[i] = self.joints[i].inertia() + outer;
            outer = work.frames[i].inertia(work.composites[i]);
        }
        for i in 0..n {
            let mut wrench = work.composites[i].momentum(self.joints[i].axis());
            for j in (0..=i).rev() {
                let entry = wrench.dot(self.joints[j].axis());
                (work.mass_matrix[i * n + j], work.mass_matrix[j * n + i]) = (entry, entry);
                wrench = work.frames[j].wrench(wrench);
            }
        }
    }

    /// Solves for the joints in `free` by Cholesky's decomposition of their inertia.
    fn solve(&self, inertia: &Mat<f64>, solution: &mut Mat<f64>, free: &[usize]) -> Result<()> {
        /// Smallest share of a joint's inertia that must remain when the free joints before it give way.
        const SMALLEST_SHARE: f64 = 1e-12;
        let remains = |i: usize, pivot: f64| pivot * pivot > SMALLEST_SHARE * inertia[(i, i)];
        if (0..free.len()).any(|i| (0..=i).any(|j| !inertia[(i, j)].is_finite())) {
            return Err(Error::Invalid("q and joints: the chain's inertia exceeds the largest number".to_owned()));
        }
        match inertia.llt(Side::Lower) {
            Ok(cholesky) if (0..free.len()).all(|i| remains(i, cholesky.L()[(i, i)])) => {
                cholesky.solve_in_place(solution);
                Ok(())
            }
            _ => Err(self.singular(inertia, free)),
        }
    }

    /// Names the joints of the motion without inertia: the null vector, each joint in units of its own inertia.
    fn singular(&self, inertia: &Mat<f64>, free: &[usize]) -> Error {
        let unit = |i: usize| if inertia[(i, i)] > 0.0 { inertia[(i, i)].sqrt() } else { 1.0 };
        let scaled = Mat::from_fn(free.len(), free.len(), |i, j| inertia[(i, j)] / (unit(i) * unit(j)));
        let smallest = scaled.self_adjoint_eigen(Side::Lower).ok(); // eigenvalues ascend
        let moves = |i: usize| smallest.as_ref().is_none_or(|eigen| eigen.U()[(i, 0)].abs() > 1e-6);
        let names: Vec<String> = (0..free.len())
            .filter(|&i| moves(i))
            .map(|i| format!("joints[{}] ({:?})", free[i], self.joints[free[i]].kind))
            .collect();
        Error::Invalid(format!(
            "forward: {} can accelerate without moving any mass, so no force determines by how much; \
             make one of them an inverse-dynamics joint, or give a body that they move mass",
            names.join(" with ")
        ))
    }
}
