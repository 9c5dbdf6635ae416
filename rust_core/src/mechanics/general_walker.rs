//! Hybrid dynamics of walkers with more joints than the paper's, or with other ones driven, by the general chain (section 3.1).
//!
//! The walker of [`walker`](super::walker) is the usual one and much faster. This one knows any of: trunk and hip as forward
//! or inverse joints, a socket (two more joints), a tube that gives way, and any number of contact points. Its coordinates
//! are those of the usual walker, absolute angles of thigh, calf and foot, and the [`Deflection`] of what is rigid there.

use crate::mechanics::body::BodyParams;
use crate::mechanics::chain::{Chain, ExternalForce, Posture, Vector, Workspace};
use crate::mechanics::motion::{Acceleration, JointTorque, Motion, Point, PointForce, Prescribed};
use crate::mechanics::walker_chain::{HIP, TRUNK, walker_joints};
use crate::numerics::lanes::{integrable, lanes};
use crate::schema::error::Result;
use crate::signals::GRAVITY;

lanes! {
    /// Coordinates of a general walker that the usual one does not have; its rates and accelerations too.
    pub struct Deflection, DeflectionLanes {
        /// Trunk angle, rad; counts where the trunk is a forward joint.
        trunk: f64,
        /// Pistoning of the socket, m, positive where the leg moves into the stump.
        socket_shift: f64,
        /// Tilt of the socket, rad.
        socket_tilt: f64,
        /// Extension of the tube, m, positive where it shortens.
        tube_shift: f64,
        /// Bending of the tube, rad.
        tube_tilt: f64,
    }
}
integrable!(DeflectionLanes { trunk, socket_shift, socket_tilt, tube_shift, tube_tilt });

/// What sets a general walker apart from the usual one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layout {
    /// Trunk is a forward joint.
    pub trunk_forward: bool,
    /// Hip is a forward joint.
    pub hip_forward: bool,
    /// Place of a compliant socket as a share of the thigh's length.
    pub socket: Option<f64>,
    /// The tube gives way.
    pub tube_forward: bool,
}

/// Immutable model.
#[derive(Clone, Debug)]
pub struct GeneralWalker {
    chain: Chain,
    forward: Vec<bool>,
    /// Index of the socket's first joint.
    socket: Option<usize>,
    /// Index of the knee; tube and ankle follow it.
    knee: usize,
    trunk_forward: bool,
    foot_mount: f64,
    /// Contact points: body and place in its frame.
    points: Vec<(usize, Vector)>,
}

/// One walker's joint coordinates and forces, and the scratch of their evaluation.
#[derive(Clone, Debug, Default)]
pub struct WalkerWorkspace {
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
    tau: Vec<f64>,
    added: Vec<f64>,
    posture: Posture,
    jacobians: Vec<Vec<Vector>>,
    forces: Vec<ExternalForce>,
    work: Workspace,
    /// The state was finite.
    valid: bool,
}

/// Joint 6 and 7 follow the knee, then comes the ankle.
const TUBE_AFTER_KNEE: usize = 1;
const ANKLE_AFTER_KNEE: usize = 3;

/// Position and velocity of a place in a body's frame; NaN where the assumed state is not valid.
fn place_of(work: &WalkerWorkspace, body: usize, place: Vector) -> Point {
    if !work.valid {
        return Point { x: f64::NAN, y: f64::NAN, vx: f64::NAN, vy: f64::NAN };
    }
    let ([x, y], [vx, vy]) = (work.posture.position(body, place), work.posture.velocity(body, place));
    Point { x, y, vx, vy }
}

impl GeneralWalker {
    /// A walker with the given segments. Its contact points are heel, ball, knee, hip, the others of the sole and, if it
    /// can turn freely, the top of the trunk.
    pub fn new(p: &BodyParams, layout: &Layout) -> Result<Self> {
        let joints = walker_joints(p, layout.socket);
        let knee = if layout.socket.is_some() { HIP + 3 } else { HIP + 1 };
        let (tube, ankle) = (knee + TUBE_AFTER_KNEE, knee + ANKLE_AFTER_KNEE);
        let mut forward = vec![true; joints.len()];
        forward[TRUNK] = layout.trunk_forward;
        forward[HIP] = layout.hip_forward;
        forward[tube..ankle].fill(layout.tube_forward);
        let mut sole: Vec<(usize, Vector)> = p.sole().into_iter().map(|point| (ankle, point)).collect();
        let between = sole.split_off(2);
        let mut points = sole;
        points.extend([(knee, [0.0; 2]), (HIP, [0.0; 2])]);
        points.extend(between);
        if layout.trunk_forward {
            points.push((TRUNK, [0.0, p.trunk_top_m]));
        }
        Ok(Self {
            chain: Chain::new(joints, [0.0, -GRAVITY])?,
            forward,
            socket: layout.socket.map(|_| HIP + 1),
            knee,
            trunk_forward: layout.trunk_forward,
            foot_mount: p.foot_mount_deg.to_radians(),
            points,
        })
    }

    /// Number of contact points: heel, ball, knee, hip, then the others.
    pub fn points(&self) -> usize {
        self.points.len()
    }

    /// Memory of it.
    pub fn bytes(&self) -> usize {
        let lists = size_of_val(self.chain.joints()) + size_of_val(&*self.forward) + size_of_val(&*self.points);
        size_of::<Self>() + lists
    }

    fn tube(&self) -> usize {
        self.knee + TUBE_AFTER_KNEE
    }

    fn ankle(&self) -> usize {
        self.knee + ANKLE_AFTER_KNEE
    }

    /// Joint coordinates of segment angles and deflections, or their rates (with `mount` 0).
    fn to_joints(&self, [x, y]: Vector, trunk: f64, segments: [f64; 3], d: &Deflection, mount: f64, q: &mut Vec<f64>) {
        let [thigh, shank, foot] = segments;
        q.clear();
        q.extend([x, y, trunk, thigh - trunk]);
        let mut socket_tilt = 0.0;
        if self.socket.is_some() {
            q.extend([d.socket_shift, d.socket_tilt]);
            socket_tilt = d.socket_tilt;
        }
        q.extend([shank - thigh - socket_tilt, d.tube_shift, d.tube_tilt, foot - shank - d.tube_tilt - mount]);
    }

    /// Takes on a state: positions, velocities and the trunk's prescribed motion, which counts where it is an inverse joint.
    pub fn assume(
        &self,
        work: &mut WalkerWorkspace,
        motion: &Motion,
        deflection: &Deflection,
        rates: &Deflection,
        trunk: &Prescribed,
    ) {
        let m = motion;
        let (angle, rate) =
            if self.trunk_forward { (deflection.trunk, rates.trunk) } else { (trunk.angle, trunk.rate) };
        let mount = self.foot_mount;
        self.to_joints([m.hip_x, m.hip_y], angle, [m.thigh, m.shank, m.foot], deflection, mount, &mut work.q);
        let segments = [m.thigh_rate, m.shank_rate, m.foot_rate];
        self.to_joints([m.hip_vx, m.hip_vy], rate, segments, rates, 0.0, &mut work.qd);
        work.valid = self.chain.assume(&work.q, &work.qd, &mut work.posture).is_ok();
        let n = work.q.len();
        work.jacobians.resize(self.points.len(), Vec::new());
        for (&(body, point), jacobian) in self.points.iter().zip(&mut work.jacobians).filter(|_| work.valid) {
            self.chain.jacobian_in(&work.posture, body, point, jacobian);
        }
        for list in [&mut work.qdd, &mut work.tau] {
            list.resize(n, 0.0);
        }
    }

    /// Contact point `point` in the assumed state.
    pub fn point(&self, work: &WalkerWorkspace, point: usize) -> Point {
        let (body, place) = self.points[point];
        place_of(work, body, place)
    }

    /// Ankle in the assumed state.
    pub fn ankle_point(&self, work: &WalkerWorkspace) -> Point {
        place_of(work, self.ankle(), [0.0; 2])
    }

    /// Position and velocity of knee flexion, hip and ankle (rad, rad/s) in the assumed state.
    pub fn joints(&self, work: &WalkerWorkspace) -> [(f64, f64); 3] {
        let at = |joint: usize| (work.q[joint], work.qd[joint]);
        let (knee, knee_rate) = at(self.knee);
        [(-knee, -knee_rate), at(HIP), at(self.ankle())]
    }

    /// Begins an evaluation: no forces but gravity, and the accelerations of the inverse joints.
    pub fn begin(&self, work: &mut WalkerWorkspace, trunk: f64, hip: f64) {
        work.tau.fill(0.0);
        work.qdd.fill(0.0);
        work.added.clear();
        work.added.resize(work.q.len() * work.q.len(), 0.0);
        work.forces.clear();
        work.qdd[TRUNK] = trunk;
        work.qdd[HIP] = hip;
    }

    /// Adds a joint's torque with its derivatives; the stiffness acts on `error_rate`.
    fn drive(&self, work: &mut WalkerWorkspace, joint: usize, torque: &JointTorque, error_rate: f64, step: f64) {
        let n = work.q.len();
        work.tau[joint] += torque.torque - step * torque.stiffness * error_rate;
        work.added[joint * n + joint] += step * (torque.damping + step * torque.stiffness);
    }

    /// Trunk torque, relative to a reference that the trunk passes at `error_rate`.
    pub fn drive_trunk(&self, work: &mut WalkerWorkspace, torque: &JointTorque, error_rate: f64, step: f64) {
        self.drive(work, TRUNK, torque, error_rate, step);
    }

    /// Hip torque, likewise.
    pub fn drive_hip(&self, work: &mut WalkerWorkspace, torque: &JointTorque, error_rate: f64, step: f64) {
        self.drive(work, HIP, torque, error_rate, step);
    }

    /// Torques of knee and ankle.
    pub fn drive_device(&self, work: &mut WalkerWorkspace, knee: &JointTorque, ankle: &JointTorque, step: f64) {
        for (joint, torque) in [(self.knee, knee), (self.ankle(), ankle)] {
            let rate = work.qd[joint];
            self.drive(work, joint, torque, rate, step);
        }
    }

    /// Springs and dampers (stiffness, damping) of the socket's two joints.
    pub fn drive_socket(&self, work: &mut WalkerWorkspace, springs: [(f64, f64); 2], step: f64) {
        if let Some(socket) = self.socket {
            self.drive_springs(work, socket, springs, step);
        }
    }

    /// Springs and dampers (stiffness, damping) of the tube's two joints.
    pub fn drive_tube(&self, work: &mut WalkerWorkspace, springs: [(f64, f64); 2], step: f64) {
        self.drive_springs(work, self.tube(), springs, step);
    }

    fn drive_springs(&self, work: &mut WalkerWorkspace, first: usize, springs: [(f64, f64); 2], step: f64) {
        for (joint, (stiffness, damping)) in (first..).zip(springs) {
            let rate = work.qd[joint];
            let torque = -stiffness * work.q[joint] - damping * rate;
            self.drive(work, joint, &JointTorque { torque, damping, stiffness }, rate, step);
        }
    }

    /// Force on the trunk at the hip, N.
    pub fn push_trunk(&self, work: &mut WalkerWorkspace, x: f64, y: f64) {
        work.forces.push(ExternalForce { body: TRUNK, point: [0.0; 2], force: [x, y] });
    }

    /// Force on a contact point with its derivatives.
    pub fn push_point(&self, work: &mut WalkerWorkspace, point: usize, force: &PointForce, step: f64) {
        if !work.valid || (force.x == 0.0 && force.y == 0.0) {
            return;
        }
        let (body, place) = self.points[point];
        let [vx, vy] = work.posture.velocity(body, place);
        let turned = |x: f64, y: f64| (force.cos * x + force.sin * y, force.cos * y - force.sin * x);
        let (along, across) = turned(vx, vy);
        let (back_x, back_y) = (step * force.stiffness_x * along, step * force.stiffness_y * across);
        let force_end =
            [force.x - (force.cos * back_x - force.sin * back_y), force.y - (force.sin * back_x + force.cos * back_y)];
        work.forces.push(ExternalForce { body, point: place, force: force_end });
        if step > 0.0 {
            let n = work.q.len();
            let implicit_x = step * (force.damping_x + step * force.stiffness_x);
            let implicit_y = step * (force.damping_y + step * force.stiffness_y);
            for i in 0..n {
                let (ix, iy) = turned(work.jacobians[point][i][0], work.jacobians[point][i][1]);
                for j in 0..n {
                    let (jx, jy) = turned(work.jacobians[point][j][0], work.jacobians[point][j][1]);
                    work.added[i * n + j] += implicit_x * ix * jx + implicit_y * iy * jy;
                }
            }
        }
    }

    /// Solves for the accelerations of the forward joints and the forces of the others. A state that is not finite gives NaN.
    pub fn solve(&self, work: &mut WalkerWorkspace) {
        let WalkerWorkspace { q, qd, qdd, tau, added, forces, work: scratch, valid, .. } = work;
        let solved = *valid
            && self
                .chain
                .hybrid_dynamics_with_added_inertia(scratch, q, qd, qdd, tau, &self.forward, forces, Some(added))
                .is_ok();
        if !solved {
            qdd.fill(f64::NAN);
            tau.fill(f64::NAN);
        }
    }

    /// Accelerations of the usual walker's coordinates.
    pub fn acceleration(&self, work: &WalkerWorkspace) -> Acceleration {
        let turn = |joints: std::ops::RangeInclusive<usize>| -> f64 {
            joints.filter(|&i| self.turns(i)).map(|i| work.qdd[i]).sum()
        };
        Acceleration {
            hip_x: work.qdd[0],
            hip_y: work.qdd[1],
            thigh: turn(TRUNK..=HIP),
            shank: turn(TRUNK..=self.knee),
            foot: turn(TRUNK..=self.ankle()),
        }
    }

    /// Whether joint `i` (from the trunk on) turns what is below it.
    fn turns(&self, i: usize) -> bool {
        Some(i) != self.socket && i != self.tube()
    }

    /// Knee flexion's acceleration, rad/s^2.
    pub fn flexion_acceleration(&self, work: &WalkerWorkspace) -> f64 {
        -work.qdd[self.knee]
    }

    /// Accelerations of the deflections.
    pub fn deflection_acceleration(&self, work: &WalkerWorkspace) -> Deflection {
        let socket = |joint: usize| self.socket.map_or(0.0, |first| work.qdd[first + joint]);
        Deflection {
            trunk: work.qdd[TRUNK],
            socket_shift: socket(0),
            socket_tilt: socket(1),
            tube_shift: work.qdd[self.tube()],
            tube_tilt: work.qdd[self.tube() + 1],
        }
    }

    /// Velocity of a contact point at the end of a step, forward and up, m/s.
    pub fn end_velocity(&self, work: &WalkerWorkspace, point: usize, step: f64) -> Vector {
        let mut velocity = [0.0; 2];
        for (i, [x, y]) in work.jacobians[point].iter().enumerate() {
            let rate = work.qd[i] + step * work.qdd[i];
            velocity = [velocity[0] + x * rate, velocity[1] + y * rate];
        }
        velocity
    }

    /// Forces of trunk, hip, socket (shift, tilt) and tube (shift, tilt), N and N m; 0 for a socket that is rigid.
    pub fn forces(&self, work: &WalkerWorkspace) -> JointForces {
        let socket = |joint: usize| self.socket.map_or(0.0, |first| work.tau[first + joint]);
        JointForces {
            trunk: work.tau[TRUNK],
            hip: work.tau[HIP],
            socket: [socket(0), socket(1)],
            tube: [work.tau[self.tube()], work.tau[self.tube() + 1]],
        }
    }

    /// Rates of the same joints.
    pub fn rates(&self, work: &WalkerWorkspace) -> JointForces {
        let socket = |joint: usize| self.socket.map_or(0.0, |first| work.qd[first + joint]);
        JointForces {
            trunk: work.qd[TRUNK],
            hip: work.qd[HIP],
            socket: [socket(0), socket(1)],
            tube: [work.qd[self.tube()], work.qd[self.tube() + 1]],
        }
    }

    /// Specific force on thigh and shank, so far (m) below hip and knee, across and along the segment.
    pub fn specific_forces(&self, work: &WalkerWorkspace, thigh: f64, shank: f64) -> [Vector; 2] {
        // Below the socket the sensor sits on it.
        let place = self.socket.map_or(f64::INFINITY, |socket| -self.chain.joints()[socket].offset[1]);
        let (body, below) = if thigh > place { (HIP + 2, thigh - place) } else { (HIP, thigh) };
        [(body, below), (self.knee, shank)].map(|(body, below)| {
            self.chain.specific_force(&work.q, &work.qd, &work.qdd, body, [0.0, -below]).unwrap_or([f64::NAN; 2])
        })
    }

    /// Kinetic and potential energy, J.
    pub fn energy(&self, work: &WalkerWorkspace) -> [f64; 2] {
        [self.chain.kinetic_energy(&work.q, &work.qd), self.chain.potential_energy(&work.q)]
            .map(|energy| energy.unwrap_or(f64::NAN))
    }
}

/// Forces (N, N m) or rates (m/s, rad/s) of the joints that the usual walker does not drive by torques.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointForces {
    /// Trunk rotation.
    pub trunk: f64,
    /// Hip.
    pub hip: f64,
    /// Pistoning and tilt of the socket.
    pub socket: [f64; 2],
    /// Extension and bending of the tube.
    pub tube: [f64; 2],
}
