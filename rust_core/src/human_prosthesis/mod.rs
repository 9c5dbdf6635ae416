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
mod general;
mod outputs;
mod start;
mod state;
mod torques;

pub use outputs::{POWERS, SpecificForce};
pub use start::Start;
pub use state::{GeneralState, Rest, RestLanes, State};
pub use torques::{DeviceTorque, DeviceTorqueLanes};

use crate::compliant_ground::{ContactLanes, Ground, GroundLanes};
use crate::config::Config;
use crate::human_controller::gait_fsm::{self, GuardLanes, Memory, Percept};
use crate::human_controller::impedance::ImpedanceTorqueLanes;
use crate::human_controller::intent::Profile;
use crate::human_controller::reference::{self, Reference};
use crate::human_controller::slip_leg::{self, TrunkForceLanes};
use crate::human_controller::{DriveLanes, Human, HumanLanes, HumanParams, Individual, LegGeometry};
use crate::hybrid_dynamics::body::{Body, BodyLanes};
use crate::hybrid_dynamics::walker::{
    self, AccelerationLanes, JointTorque, KinematicsLanes, Loads, Motion, Point, Prescribed, PrescribedLanes,
};
use crate::integrator::HybridFlow;
use crate::math::max;
use crate::prosthesis_device::end_stop::{EndStop, EndStopLanes, extension_stop};
use crate::prosthesis_device::passive_ankle::{Ankle, AnkleLanes};
use crate::prosthesis_device::{JointMotion, JointMotionLanes, KneeUnit, UnitTorqueLanes};
use crate::terrain::{Surface, SurfaceLanes, Terrain, TerrainLanes};
use general::General;
use torques::{EndJoints, EndJointsLanes, device_torque, hip_torque};

/// Contact points, in the order of every array over them.
pub const CONTACT_POINTS: usize = 4;
const HEEL: usize = 0;
const BALL: usize = 1;
/// Knee and hip touch the ground only in a fall.
const KNEE: usize = 2;
const HIP: usize = 3;

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
    /// Contact points of the sole in the foot frame, heel and ball first, m.
    sole: Vec<[f64; 2]>,
    /// Walkers with more joints than the usual ones.
    general: Option<Box<General<L>>>,
    individual: [Individual; L],
    // Inputs, constant over a control period.
    /// Command to the knee unit, in its own unit.
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
    /// Normal force on the rear half of the sole, N.
    heel_force: [f64; L],
    prescribed: PrescribedLanes<L>,
    hip_torque: ImpedanceTorqueLanes<L>,
    joint: JointMotionLanes<L>,
    joints: EndJointsLanes<L>,
    unit_torque: UnitTorqueLanes<L>,
    device: DeviceTorqueLanes<L>,
    acceleration: AccelerationLanes<L>,
    flexion_acceleration: [f64; L],
    /// Largest extension-stop torque at the end of any step since it was last cleared, N m.
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
            unit: KneeUnit::new(params),
            end_stop: EndStopLanes::splat(EndStop::from(&params.end_stop)),
            ankle: AnkleLanes::splat(Ankle::from(&params.ankle)),
            human_params: params.human.clone(),
            sole: params.body.sole(),
            general: General::new(params, body.mass),
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
            heel_force: [0.0; L],
            prescribed: PrescribedLanes::default(),
            hip_torque: ImpedanceTorqueLanes::default(),
            joint: JointMotionLanes::default(),
            joints: EndJointsLanes::default(),
            unit_torque: UnitTorqueLanes::default(),
            device: DeviceTorqueLanes::default(),
            acceleration: AccelerationLanes::default(),
            flexion_acceleration: [0.0; L],
            extension_stop_peak: [0.0; L],
        }
    }

    /// A state for walkers like these; [`start`](Self::start) sets it.
    pub fn state(&self) -> State<L> {
        let general = self.general.as_ref().map(|general| Box::new(general.state()));
        State { general, turns: self.unit.has_rotor(), ..State::default() }
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

    /// Kinematics, contacts and joints of usual walkers.
    #[inline(always)]
    fn sense_walker<const LEVEL: bool>(&mut self, state: &State<L>) {
        for lane in 0..L {
            let motion = state.motion.get(lane);
            let kin = walker::kinematics(&self.body.get(lane), &motion, state.reference.trunk[lane]);
            self.kinematics.set(lane, kin);
        }
        self.sense_feet::<LEVEL>(state);
        self.sense_fall::<LEVEL>(state);
        for lane in 0..L {
            let m = state.motion.get(lane);
            let (flexion, flexion_rate) = (m.thigh - m.shank, m.thigh_rate - m.shank_rate);
            self.joint.set(lane, JointMotion { flexion, flexion_rate });
            let joints = EndJoints {
                hip: m.thigh - state.reference.trunk[lane],
                hip_rate: m.thigh_rate - state.reference.trunk_rate[lane],
                ankle: m.foot - m.shank - self.body.foot_mount[lane],
                ankle_rate: m.foot_rate - m.shank_rate,
            };
            self.joints.set(lane, joints);
        }
    }

    /// Hybrid dynamics of usual walkers, and the rates of the state that follow from it.
    #[inline(always)]
    fn move_walker<const LEVEL: bool>(&mut self, state: &State<L>, implicit_step: &[f64; L], rates: &mut State<L>) {
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
            self.flexion_acceleration[lane] = acceleration.thigh - acceleration.shank;
        }
        let falls = self.falls(state);
        for lane in 0..L {
            let step = implicit_step[lane];
            let motion_rates = self.acceleration.get(lane).rates(&state.motion.get(lane), step);
            rates.motion.set(lane, motion_rates);
            rates.rest.set(lane, self.deformation_rates::<LEVEL>(state, lane, &motion_rates, step, falls));
        }
    }

    /// Torques of knee and ankle; `FLEXED` if any knee may touch its flexion stop.
    #[inline(always)]
    fn load_device<const FLEXED: bool>(&mut self) {
        for lane in 0..L {
            let torque = device_torque::<FLEXED>(
                &self.unit_torque.get(lane),
                &self.joint.get(lane),
                &self.end_stop.get(lane),
                &self.ankle.get(lane),
                &self.joints.get(lane),
            );
            self.device.set(lane, torque);
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

    /// Senses the force of the intact leg: all that changes of a sensed state when only its time does.
    #[inline(always)]
    pub fn sense_trunk_forces(&mut self, state: &State<L>) {
        for lane in 0..L {
            self.sense_trunk_force(state, lane);
        }
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
            heel_force: self.heel_force[lane],
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
        if let Some(mut general) = self.general.take() {
            self.sense_general(&mut general, state);
            self.general = Some(general);
        } else if self.level {
            self.sense_walker::<true>(state);
        } else {
            self.sense_walker::<false>(state);
        }
        self.sense_trunk_forces(state);
        self.sense_command(state);
    }

    #[inline(always)]
    fn rates(&mut self, state: &State<L>, implicit_step: &[f64; L], rates: &mut State<L>) {
        // Human controller: references and hip.
        for lane in 0..L {
            let drive = self.drive.get(lane);
            let smooth = state.reference.get(lane);
            let step = implicit_step[lane];
            let thigh = reference::rough_thigh(&drive, state.rest.time[lane]);
            let filter = reference::Filter::new(&drive, step);
            let trunk_acceleration = filter.acceleration(drive.trunk, smooth.trunk, smooth.trunk_rate);
            let hip_acceleration = filter.acceleration(thigh - drive.trunk, smooth.hip, smooth.hip_rate);
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
            self.hip_torque.set(lane, hip_torque(&drive, &self.joints.get(lane), &smooth));
        }
        // Prosthesis device.
        self.unit.torques(&self.joint, &state.rotor, &self.command, implicit_step, &mut self.unit_torque);
        // A knee that is nowhere near its flexion stop needs no torque of it.
        if (0..L).all(|lane| self.joint.flexion[lane] < self.end_stop.flexion[lane]) {
            self.load_device::<false>();
        } else {
            self.load_device::<true>();
        }
        if let Some(mut general) = self.general.take() {
            self.move_general(&mut general, state, implicit_step, rates);
            self.general = Some(general);
        } else if self.level {
            self.move_walker::<true>(state, implicit_step, rates);
        } else {
            self.move_walker::<false>(state, implicit_step, rates);
        }
        self.unit.rates(&self.joint, &state.rotor, &self.flexion_acceleration, implicit_step, &mut rates.rotor);
    }

    #[inline(always)]
    fn fired(&self, state: &State<L>) -> [bool; L] {
        let unit = self.unit.fired(&state.rotor);
        std::array::from_fn(|lane| unit[lane] | self.steps(state, lane))
    }

    /// The human's; a rotor that stops or breaks away within a step of a millisecond may do so at its end.
    #[inline(always)]
    fn urgent(&self, state: &State<L>, fired: &[bool; L]) -> [bool; L] {
        std::array::from_fn(|lane| fired[lane] & self.steps(state, lane))
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

    #[inline(always)]
    fn accept(&mut self, _state: &State<L>) {
        for lane in 0..L {
            let joint = self.joint.get(lane);
            let stop = extension_stop(&self.end_stop.get(lane), joint.flexion, joint.flexion_rate);
            self.extension_stop_peak[lane] = max(stop.torque, self.extension_stop_peak[lane]);
        }
    }
}

#[inline(always)]
fn hip_point(motion: &Motion) -> Point {
    Point { x: motion.hip_x, y: motion.hip_y, vx: motion.hip_vx, vy: motion.hip_vy }
}
