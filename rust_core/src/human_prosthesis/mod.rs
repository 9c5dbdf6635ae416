//! The human-prosthesis system of Figure 1: everything that runs in continuous time, wired together.
//!
//! ```text
//!  intent ─> human controller ──────── hip torque, trunk motion and force ──┐
//!               ^ heel force, hip                                           v
//!               └──────────────── compliant ground <── points ── hybrid dynamics ──> loads, motion
//!                                        └── forces ───────────────────^    ^
//!  command ─> prosthesis device ────────────── knee and ankle torque ───────┘
//! ```

mod footing;
mod outputs;
mod start;

pub use outputs::{POWERS, SpecificForce};
pub use start::Start;

use crate::compliant_ground::{ContactLanes, Ground, GroundLanes};
use crate::config::Config;
use crate::human_controller::gait_fsm::{self, GuardLanes, Memory, Percept};
use crate::human_controller::intent::Profile;
use crate::human_controller::reference::{self, Reference, ReferenceLanes};
use crate::human_controller::slip_leg::{self, TrunkForceLanes};
use crate::human_controller::{Drive, DriveLanes, Human, HumanLanes, HumanParams, Individual, LegGeometry};
use crate::hybrid_dynamics::body::{Body, BodyLanes};
use crate::hybrid_dynamics::walker::{
    self, AccelerationLanes, JointTorque, KinematicsLanes, Loads, Motion, MotionLanes, Point, Prescribed,
    PrescribedLanes,
};
use crate::integrator::{HybridFlow, StateVector};
use crate::lanes::lanes;
use crate::math::clamp;
use crate::prosthesis_device::end_stop::{EndStop, EndStopLanes, extension_stop, flexion_stop};
use crate::prosthesis_device::geared_motor::RotorLanes;
use crate::prosthesis_device::passive_ankle::{Ankle, AnkleLanes, ankle_torque};
use crate::prosthesis_device::{JointMotion, JointMotionLanes, KneeUnit, UnitTorque, UnitTorqueLanes};
use crate::terrain::{Surface, SurfaceLanes, Terrain, TerrainLanes};

/// Contact points, in the order of every array over them.
pub const CONTACT_POINTS: usize = 4;
const HEEL: usize = 0;
const BALL: usize = 1;
/// Knee and hip touch the ground only in a fall.
const KNEE: usize = 2;
const HIP: usize = 3;

/// Continuous state.
#[derive(Clone, Debug, Default)]
pub struct State<const L: usize> {
    /// Forward-dynamics coordinates.
    pub motion: MotionLanes<L>,
    /// Smooth references of trunk and hip.
    pub reference: ReferenceLanes<L>,
    /// Time and ground deformation.
    pub rest: RestLanes<L>,
    /// Rotor of the knee unit; stays zero in a unit without one.
    pub rotor: RotorLanes<L>,
}

lanes! {
    /// Time and tangential deformation of the ground at each contact point.
    pub struct Rest, RestLanes {
        /// Time since the start of the trial, s.
        time: f64,
        /// Deformation at the heel, m.
        heel: f64,
        /// Deformation at the ball, m.
        ball: f64,
        /// Deformation at the knee, m.
        knee: f64,
        /// Deformation at the hip, m.
        hip: f64,
    }
}
crate::lanes::integrable!(RestLanes { time, heel, ball, knee, hip });

impl<const L: usize> StateVector<L> for State<L> {
    #[inline(always)]
    fn add_scaled(&mut self, base: &Self, step: &[f64; L], rate: &Self) {
        self.motion.add_scaled(&base.motion, step, &rate.motion);
        self.reference.add_scaled(&base.reference, step, &rate.reference);
        self.rest.add_scaled(&base.rest, step, &rate.rest);
        self.rotor.add_scaled(&base.rotor, step, &rate.rotor);
    }
}

lanes! {
    /// Torques at the knee and ankle by origin, N m (joint signs: q5 extension positive).
    pub struct DeviceTorque, DeviceTorqueLanes {
        /// Knee flexion, rad.
        knee_angle: f64,
        /// Knee torque of the unit, end stops apart.
        unit: f64,
        /// T_D, the part of a damper's command.
        damper: f64,
        /// Extension stop, resisting, never negative.
        extension_stop: f64,
        /// Flexion stop, resisting, never negative.
        flexion_stop: f64,
        /// Knee torque tau_5.
        knee: f64,
        /// -d tau_5 / d q5'.
        knee_damping: f64,
        /// -d tau_5 / d q5.
        knee_stiffness: f64,
        /// Ankle torque tau_8.
        ankle: f64,
    }
}

lanes! {
    /// Torque of the hip's impedance.
    pub struct HipTorque, HipTorqueLanes {
        /// tau_4, N m.
        torque: f64,
        /// Damping; 0 where the torque is at its limit.
        damping: f64,
        /// Stiffness; 0 where the torque is at its limit.
        stiffness: f64,
        /// Hip velocity relative to its reference, rad/s.
        error_rate: f64,
    }
}

/// Human, mechanism, ground and device of a block of walkers.
#[derive(Clone, Debug)]
pub struct HumanProsthesis<const L: usize> {
    // Constants.
    body: BodyLanes<L>,
    ground: GroundLanes<L>,
    terrain: TerrainLanes<L>,
    /// Whether all of the block's ground is level, as the paper's.
    level: bool,
    human: HumanLanes<L>,
    /// Knee unit.
    pub unit: KneeUnit<L>,
    end_stop: EndStopLanes<L>,
    ankle: AnkleLanes<L>,
    human_params: HumanParams,
    individual: [Individual; L],
    // Inputs, constant over a control period.
    /// Command to the knee unit: damping coefficient, N m s^2/rad^2, or motor current, A.
    pub command: [f64; L],
    /// Disturbance on the trunk, forward, N.
    pub push_x: [f64; L],
    /// Disturbance on the trunk, up, N.
    pub push_y: [f64; L],
    /// Intent, 0 stand or 1 walk.
    pub intent: [f64; L],
    /// Intent and intended speed over time.
    pub profile: [Profile; L],
    // Discrete state of the human, and what follows from it.
    memory: [Memory; L],
    drive: DriveLanes<L>,
    guard: GuardLanes<L>,
    // Signals of the last evaluation.
    kinematics: KinematicsLanes<L>,
    contacts: [ContactLanes<L>; CONTACT_POINTS],
    /// Ground below each contact point; never touched on level ground.
    surfaces: [SurfaceLanes<L>; CONTACT_POINTS],
    /// Height of the ground where the intact leg would touch down, m.
    ground_ahead: [f64; L],
    fall_contact: bool,
    trunk_force: TrunkForceLanes<L>,
    midfoot: [f64; L],
    prescribed: PrescribedLanes<L>,
    hip_torque: HipTorqueLanes<L>,
    joint: JointMotionLanes<L>,
    unit_torque: UnitTorqueLanes<L>,
    device: DeviceTorqueLanes<L>,
    acceleration: AccelerationLanes<L>,
    /// Largest extension-stop torque at any evaluation since it was last cleared, N m.
    pub extension_stop_peak: [f64; L],
}

impl<const L: usize> HumanProsthesis<L> {
    /// Walkers with the given parameters, all standing; call [`start`](Self::start) for each.
    pub fn new(params: &Config) -> Self {
        let body = Body::from(&params.body);
        let touch_down = start::touch_down_posture(&body, &params.human);
        let kin = walker::kinematics(&body, &touch_down, 0.0);
        let human = Human::from(LegGeometry {
            mass: body.mass,
            trunk_mass: body.trunk_mass,
            leg_length: body.thigh_length + body.shank_length - body.sole_y,
            touch_down_height: -(kin.thigh_y + kin.shank_y + kin.heel_y),
            foot_length: body.ball_x - body.heel_x,
        });
        let terrain = Terrain::from(&params.ground);
        Self {
            body: BodyLanes::splat(body),
            ground: GroundLanes::splat(Ground::from(&params.ground)),
            terrain: TerrainLanes::splat(terrain),
            level: terrain.is_level(),
            human: HumanLanes::splat(human),
            unit: KneeUnit::new(&params.device, &params.knee, &params.motor),
            end_stop: EndStopLanes::splat(EndStop::from(&params.end_stop)),
            ankle: AnkleLanes::splat(Ankle::from(&params.ankle)),
            human_params: params.human.clone(),
            individual: std::array::from_fn(|_| Individual::default()),
            command: [0.0; L],
            push_x: [0.0; L],
            push_y: [0.0; L],
            intent: [0.0; L],
            profile: std::array::from_fn(|_| Profile::default()),
            memory: [Memory::default(); L],
            drive: DriveLanes::default(),
            guard: GuardLanes::default(),
            kinematics: KinematicsLanes::default(),
            contacts: std::array::from_fn(|_| ContactLanes::default()),
            surfaces: std::array::from_fn(|_| SurfaceLanes::splat(Surface::LEVEL)),
            ground_ahead: [0.0; L],
            fall_contact: false,
            trunk_force: TrunkForceLanes::default(),
            midfoot: [0.0; L],
            prescribed: PrescribedLanes::default(),
            hip_torque: HipTorqueLanes::default(),
            joint: JointMotionLanes::default(),
            unit_torque: UnitTorqueLanes::default(),
            device: DeviceTorqueLanes::default(),
            acceleration: AccelerationLanes::default(),
            extension_stop_peak: [0.0; L],
        }
    }

    fn refresh_drive(&mut self, lane: usize) {
        let human = self.human.get(lane);
        let individual = &self.individual[lane];
        self.drive.set(lane, self.memory[lane].drive(&human, individual));
        self.guard.set(lane, self.memory[lane].guard(&human, &individual.params));
    }

    #[inline(always)]
    fn loads<const LEVEL: bool>(&self, lane: usize) -> Loads {
        let device = self.device.get(lane);
        let hip = self.hip_torque.get(lane);
        let trunk = self.trunk_force.get(lane);
        let ankle = self.ankle.get(lane);
        let [heel, ball, knee, hip_contact] = self.ground_forces::<LEVEL>(lane);
        Loads {
            trunk_x: trunk.x + self.push_x[lane] + hip_contact.x,
            trunk_y: trunk.y + self.push_y[lane] + hip_contact.y,
            knee_x: knee.x,
            knee_y: knee.y,
            hip: JointTorque { torque: hip.torque, damping: hip.damping, stiffness: hip.stiffness },
            hip_error_rate: hip.error_rate,
            knee: JointTorque { torque: device.knee, damping: device.knee_damping, stiffness: device.knee_stiffness },
            ankle: JointTorque { torque: device.ankle, damping: ankle.damping, stiffness: ankle.stiffness },
            heel,
            ball,
        }
    }

    /// Hybrid dynamics, and the rates of the state that follow from it.
    #[inline(always)]
    fn move_on<const LEVEL: bool>(&mut self, state: &State<L>, implicit_step: &[f64; L], rates: &mut State<L>) {
        for lane in 0..L {
            let acceleration = walker::acceleration::<LEVEL>(
                &self.body.get(lane),
                &self.kinematics.get(lane),
                &state.motion.get(lane),
                &self.prescribed.get(lane),
                &self.loads::<LEVEL>(lane),
                implicit_step[lane],
            );
            self.acceleration.set(lane, acceleration);
        }
        let flexion_acceleration =
            std::array::from_fn(|lane| self.acceleration.thigh[lane] - self.acceleration.shank[lane]);
        self.unit.rates(&self.joint, &state.rotor, &flexion_acceleration, implicit_step, &mut rates.rotor);
        // Rates of the state; an implicit step moves with the velocity at its end.
        for lane in 0..L {
            let step = implicit_step[lane];
            let motion = state.motion.get(lane);
            let acceleration = self.acceleration.get(lane);
            let end = Motion {
                hip_vx: motion.hip_vx + step * acceleration.hip_x,
                hip_vy: motion.hip_vy + step * acceleration.hip_y,
                thigh_rate: motion.thigh_rate + step * acceleration.thigh,
                shank_rate: motion.shank_rate + step * acceleration.shank,
                foot_rate: motion.foot_rate + step * acceleration.foot,
                ..motion
            };
            rates.motion.set(
                lane,
                Motion {
                    hip_x: end.hip_vx,
                    hip_y: end.hip_vy,
                    thigh: end.thigh_rate,
                    shank: end.shank_rate,
                    foot: end.foot_rate,
                    hip_vx: acceleration.hip_x,
                    hip_vy: acceleration.hip_y,
                    thigh_rate: acceleration.thigh,
                    shank_rate: acceleration.shank,
                    foot_rate: acceleration.foot,
                },
            );
            rates.rest.set(lane, self.deformation_rates::<LEVEL>(state, lane, &end, step));
        }
    }

    /// Lets the knee unit see the present command: all that changes of a sensed state when a new command arrives.
    #[inline(always)]
    pub fn sense_command(&mut self, state: &State<L>) {
        self.unit.sense(&self.joint, &state.rotor, &self.command);
    }

    /// Whether the human's state machine has a transition to make.
    #[inline(always)]
    fn steps(&self, state: &State<L>, lane: usize) -> bool {
        gait_fsm::holds(&self.guard.get(lane), &self.percept(state, lane))
    }

    fn step_transition(&mut self, state: &State<L>, lane: usize) {
        let time = state.rest.time[lane];
        let motion = state.motion.get(lane);
        let human = self.human.get(lane);
        let speed = self.profile[lane].speed(time);
        let walks = self.intent[lane] > 0.5;
        self.memory[lane].transition(&human, &self.individual[lane], time, motion.hip_x, speed, walks);
        self.memory[lane].slip_foot_y = self.ground_height(lane, self.memory[lane].slip_foot_x);
        self.refresh_drive(lane);
        // The pendulum force follows from the new drive; kinematics and contacts stay as sensed.
        self.sense_trunk_force(state, lane);
    }

    #[inline(always)]
    fn sense_trunk_force(&mut self, state: &State<L>, lane: usize) {
        let motion = state.motion.get(lane);
        let force = slip_leg::trunk_force(
            &self.human.get(lane),
            &self.drive.get(lane),
            motion.hip_x,
            motion.hip_y,
            motion.hip_vx,
            motion.hip_vy,
            state.rest.time[lane],
        );
        self.trunk_force.set(lane, force);
    }

    #[inline(always)]
    fn percept(&self, state: &State<L>, lane: usize) -> Percept {
        Percept {
            time: state.rest.time[lane],
            hip_y: state.motion.hip_y[lane] - self.ground_ahead[lane],
            heel_force: self.contacts[HEEL].normal[lane],
            pendulum: self.trunk_force.pendulum[lane],
            midfoot: self.midfoot[lane],
            intent: self.intent[lane],
        }
    }
}

impl<const L: usize> HybridFlow<L> for HumanProsthesis<L> {
    type State = State<L>;

    #[inline(always)]
    fn sense(&mut self, state: &State<L>) {
        for lane in 0..L {
            let motion = state.motion.get(lane);
            let kin = walker::kinematics(&self.body.get(lane), &motion, state.reference.trunk[lane]);
            self.kinematics.set(lane, kin);
        }
        if self.level {
            self.sense_feet::<true>(state);
            self.sense_fall::<true>(state);
        } else {
            self.sense_feet::<false>(state);
            self.sense_fall::<false>(state);
        }
        for lane in 0..L {
            self.sense_trunk_force(state, lane);
        }
        for lane in 0..L {
            let motion = state.motion.get(lane);
            let flexion = motion.thigh - motion.shank;
            let flexion_rate = motion.thigh_rate - motion.shank_rate;
            self.joint.set(lane, JointMotion { flexion, flexion_rate });
        }
        self.sense_command(state);
    }

    #[inline(always)]
    fn rates(&mut self, state: &State<L>, implicit_step: &[f64; L], rates: &mut State<L>) {
        // Human controller: references and hip.
        for lane in 0..L {
            let drive = self.drive.get(lane);
            let smooth = state.reference.get(lane);
            let motion = state.motion.get(lane);
            let step = implicit_step[lane];
            let thigh = reference::rough_thigh(&drive, state.rest.time[lane]);
            let filter = |rough: f64, value: f64, rate: f64| {
                reference::filter_acceleration(rough, value, rate, drive.filter_delay, step)
            };
            let trunk_acceleration = filter(drive.trunk, smooth.trunk, smooth.trunk_rate);
            let hip_acceleration = filter(thigh - drive.trunk, smooth.hip, smooth.hip_rate);
            self.prescribed.set(
                lane,
                Prescribed { angle: smooth.trunk, rate: smooth.trunk_rate, acceleration: trunk_acceleration },
            );
            rates.reference.set(
                lane,
                Reference {
                    trunk: smooth.trunk_rate + step * trunk_acceleration,
                    trunk_rate: trunk_acceleration,
                    hip: smooth.hip_rate + step * hip_acceleration,
                    hip_rate: hip_acceleration,
                },
            );
            self.hip_torque.set(lane, hip_torque(&drive, &motion, &smooth));
        }
        // Prosthesis device.
        self.unit.torques(&self.joint, &state.rotor, &self.command, implicit_step, &mut self.unit_torque);
        for lane in 0..L {
            let torque = device_torque(
                &self.unit_torque.get(lane),
                &self.joint.get(lane),
                &self.end_stop.get(lane),
                &self.ankle.get(lane),
                self.body.foot_mount[lane],
                &state.motion.get(lane),
            );
            self.device.set(lane, torque);
            self.extension_stop_peak[lane] = crate::math::max(torque.extension_stop, self.extension_stop_peak[lane]);
        }
        if self.level {
            self.move_on::<true>(state, implicit_step, rates);
        } else {
            self.move_on::<false>(state, implicit_step, rates);
        }
    }

    #[inline(always)]
    fn fired(&self, state: &State<L>) -> [bool; L] {
        let unit = self.unit.fired(&state.rotor);
        std::array::from_fn(|lane| unit[lane] | self.steps(state, lane))
    }

    fn transition(&mut self, state: &mut State<L>, fired: &[bool; L]) {
        let unit = self.unit.fired(&state.rotor);
        for lane in (0..L).filter(|&lane| fired[lane]) {
            if self.steps(state, lane) {
                self.step_transition(state, lane);
            }
            if unit[lane] {
                let rotor = state.rotor.get(lane);
                let rotor = self.unit.transition(lane, &self.joint.get(lane), rotor, self.command[lane]);
                state.rotor.set(lane, rotor);
            }
        }
    }
}

#[inline(always)]
fn hip_point(motion: &Motion) -> Point {
    Point { x: motion.hip_x, y: motion.hip_y, vx: motion.hip_vx, vy: motion.hip_vy }
}

/// Impedance of the hip about its smooth reference, limited (section 4.1; sign so that it attracts).
#[inline(always)]
fn hip_torque(drive: &Drive, motion: &Motion, smooth: &Reference) -> HipTorque {
    let error = smooth.hip - (motion.thigh - smooth.trunk);
    let error_rate = smooth.hip_rate - (motion.thigh_rate - smooth.trunk_rate);
    let free = drive.hip_stiffness * error + drive.hip_damping * error_rate;
    let acts = free.abs() < drive.hip_limit;
    HipTorque {
        torque: clamp(free, -drive.hip_limit, drive.hip_limit),
        damping: crate::math::select(acts, drive.hip_damping, 0.0),
        stiffness: crate::math::select(acts, drive.hip_stiffness, 0.0),
        error_rate: -error_rate,
    }
}

/// Knee torque of unit and end stops, and ankle torque (section 5.2.1).
#[inline(always)]
fn device_torque(
    unit: &UnitTorque,
    joint: &JointMotion,
    stop: &EndStop,
    ankle: &Ankle,
    foot_mount: f64,
    motion: &Motion,
) -> DeviceTorque {
    let extension = extension_stop(stop, joint.flexion, joint.flexion_rate);
    let flexion = flexion_stop(stop, joint.flexion, joint.flexion_rate);
    DeviceTorque {
        knee_angle: joint.flexion,
        unit: unit.torque,
        damper: unit.damper,
        extension_stop: extension.torque,
        flexion_stop: flexion.torque,
        knee: unit.torque - extension.torque + flexion.torque,
        knee_damping: unit.damping + extension.damping + flexion.damping,
        knee_stiffness: unit.stiffness + extension.stiffness + flexion.stiffness,
        ankle: ankle_torque(ankle, motion.foot - motion.shank - foot_mount, motion.foot_rate - motion.shank_rate),
    }
}
