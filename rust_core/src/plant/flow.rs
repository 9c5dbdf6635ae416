//! The equations of Figure 1 as a hybrid flow: what the integrator asks of the human-prosthesis system.

use crate::human::guard::{self, Percept};
use crate::human::reference::{self, Reference};
use crate::human::slip_leg;
use crate::mechanics::motion::Prescribed;
use crate::mechanics::walker;
use crate::numerics::integrator::HybridFlow;
use crate::numerics::math::max;
use crate::plant::contact_points::{BALL, HEEL};
use crate::plant::signals::Touch;
use crate::plant::state::State;
use crate::plant::system::HumanProsthesis;
use crate::plant::torques::{EndJoints, device_torque, hip_torque};
use crate::prosthesis::end_stop::extension_stop;
use crate::prosthesis::knee::joint::{JointMotion, UnitTorqueLanes};
use crate::prosthesis::knee::unit::UnitInputs;

impl<const L: usize> HumanProsthesis<'_, L> {
    #[inline(always)]
    fn unit_inputs<'b>(&'b self, state: &'b State<L>) -> UnitInputs<'b, L> {
        self.at(state).unit_inputs()
    }

    /// Kinematics, contacts and joints of usual walkers.
    #[inline(always)]
    fn sense_walker<const LEVEL: bool>(&mut self, state: &State<L>) {
        for lane in 0..L {
            let motion = state.motion.get(lane);
            let kin = walker::kinematics(&self.model.body.get(lane), &motion, state.reference.trunk[lane]);
            self.signals.kinematics.set(lane, kin);
        }
        self.sense_feet::<LEVEL>(state);
        self.sense_fall::<LEVEL>(state);
        for lane in 0..L {
            let m = state.motion.get(lane);
            let (flexion, flexion_rate) = (m.thigh - m.shank, m.thigh_rate - m.shank_rate);
            self.signals.joint.set(lane, JointMotion { flexion, flexion_rate });
            let joints = EndJoints {
                hip: m.thigh - state.reference.trunk[lane],
                hip_rate: m.thigh_rate - state.reference.trunk_rate[lane],
                ankle: m.foot - m.shank - self.model.body.foot_mount[lane],
                ankle_rate: m.foot_rate - m.shank_rate,
            };
            self.signals.joints.set(lane, joints);
        }
    }

    /// Hybrid dynamics of usual walkers, and the rates of the state that follow from it.
    #[inline(always)]
    fn move_walker<const LEVEL: bool>(&mut self, state: &State<L>, implicit_step: &[f64; L], rates: &mut State<L>) {
        for lane in 0..L {
            let acceleration = walker::acceleration::<LEVEL>(
                &self.model.body.get(lane),
                &self.signals.kinematics.get(lane),
                &state.motion.get(lane),
                &self.signals.prescribed.get(lane),
                &self.at(state).loads::<LEVEL>(lane),
                implicit_step[lane],
            );
            self.signals.acceleration.set(lane, acceleration);
            self.signals.flexion_acceleration[lane] = acceleration.thigh - acceleration.shank;
        }
        let falls = self.falls(state);
        for lane in 0..L {
            let step = implicit_step[lane];
            let motion_rates = self.signals.acceleration.get(lane).rates(&state.motion.get(lane), step);
            rates.motion.set(lane, motion_rates);
            rates.rest.set(lane, self.deformation_rates::<LEVEL>(state, lane, &motion_rates, step, falls));
        }
    }

    /// Torques of knee and ankle; `FLEXED` if any knee may touch its flexion stop.
    #[inline(always)]
    fn load_device<const FLEXED: bool>(&mut self) {
        for lane in 0..L {
            let torque = device_torque::<FLEXED>(
                &self.signals.unit_torque.get(lane),
                &self.signals.joint.get(lane),
                &self.model.end_stop.get(lane),
                &self.model.ankle.get(lane),
                &self.signals.joints.get(lane),
            );
            self.signals.device.set(lane, torque);
        }
    }

    /// Human controller: smooth references of trunk and hip, and the torque that pulls the hip to its own.
    #[inline(always)]
    fn follow_references(&mut self, state: &State<L>, implicit_step: &[f64; L], rates: &mut State<L>) {
        for lane in 0..L {
            let drive = self.walkers.drive.get(lane);
            let smooth = state.reference.get(lane);
            let step = implicit_step[lane];
            let thigh = reference::rough_thigh(&drive, state.rest.time[lane]);
            let filter = reference::Filter::new(&drive, step);
            let trunk_acceleration = filter.acceleration(drive.trunk, smooth.trunk, smooth.trunk_rate);
            let hip_acceleration = filter.acceleration(thigh - drive.trunk, smooth.hip, smooth.hip_rate);
            self.signals.prescribed.set(
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
            self.signals.hip_torque.set(lane, hip_torque(&drive, &self.signals.joints.get(lane), &smooth));
        }
    }

    /// Prosthesis: torques of knee unit, end stops and ankle.
    #[inline(always)]
    fn drive_knee(&mut self, state: &State<L>, implicit_step: &[f64; L]) {
        let mut unit_torque = UnitTorqueLanes::default();
        self.model.unit.torques(&self.unit_inputs(state), implicit_step, &mut unit_torque);
        self.signals.unit_torque = unit_torque;
        // A knee that is nowhere near its flexion stop needs no torque of it.
        if (0..L).all(|lane| self.signals.joint.flexion[lane] < self.model.end_stop.flexion[lane]) {
            self.load_device::<false>();
        } else {
            self.load_device::<true>();
        }
    }

    /// Hybrid dynamics: accelerations under all torques and contacts, and the rates of motion and ground that follow.
    #[inline(always)]
    fn move_mechanism(&mut self, state: &State<L>, implicit_step: &[f64; L], rates: &mut State<L>) {
        if let Some(mut general) = self.signals.general.take() {
            self.lend().move_general(&mut general, state, implicit_step, rates);
            self.signals.general = Some(general);
        } else if self.model.level {
            self.move_walker::<true>(state, implicit_step, rates);
        } else {
            self.move_walker::<false>(state, implicit_step, rates);
        }
    }

    /// Rates of the knee unit's rotor, which the knee's acceleration carries along.
    #[inline(always)]
    fn turn_rotor(&mut self, state: &State<L>, implicit_step: &[f64; L], rates: &mut State<L>) {
        let flexion_acceleration = &self.signals.flexion_acceleration;
        self.model.unit.rates(&self.unit_inputs(state), flexion_acceleration, implicit_step, &mut rates.rotor);
    }

    /// Lets the knee unit see the present command: all that changes of a sensed state when a new command arrives.
    #[inline(always)]
    pub fn sense_command(&mut self, state: &State<L>) {
        let signals = &mut *self.signals;
        self.model.unit.sense(&signals.joint, &state.rotor, &self.walkers.command, &mut signals.motor);
    }

    /// Whether the human's state machine has a transition to make.
    #[inline(always)]
    fn steps(&self, state: &State<L>, lane: usize) -> bool {
        guard::holds(&self.walkers.guard.get(lane), &self.percept(state, lane))
    }

    /// Carries out the transitions of human and knee unit in the lanes of `fired`.
    fn change(&mut self, state: &mut State<L>, fired: &[bool; L]) {
        let unit = self.model.unit.fired(&self.unit_inputs(state));
        for lane in (0..L).filter(|&lane| fired[lane]) {
            if self.steps(state, lane) {
                self.step_transition(state, lane);
            }
            if unit[lane] {
                let (rotor, direction, signals) = self.model.unit.transition(lane, &self.unit_inputs(state));
                state.rotor.set(lane, rotor);
                self.walkers.direction[lane] = direction;
                self.signals.motor.set(lane, signals);
            }
        }
    }

    #[inline(always)]
    fn touch(&self, lane: usize) -> Touch {
        Touch {
            stop_gap: self.signals.joint.flexion[lane] - self.model.end_stop.extension[lane],
            heel: self.signals.contacts[HEEL].normal[lane],
            ball: self.signals.contacts[BALL].normal[lane],
        }
    }

    /// Takes note of what touches what in the sensed state: a step begins here.
    #[inline(always)]
    pub fn note_touch(&mut self) {
        for lane in 0..L {
            self.signals.touch.set(lane, self.touch(lane));
        }
    }

    fn step_transition(&mut self, state: &State<L>, lane: usize) {
        let time = state.rest.time[lane];
        let motion = state.motion.get(lane);
        let human = self.model.human.get(lane);
        let speed = self.walkers.profile[lane].speed(time);
        let walks = self.walkers.intent[lane] > 0.5;
        self.walkers.memory[lane].transition(&human, &self.walkers.individual[lane], time, motion.hip_x, speed, walks);
        self.walkers.memory[lane].slip_foot_y = self.model.ground_height(lane, self.walkers.memory[lane].slip_foot_x);
        self.walkers.refresh_drive(self.model, lane);
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
            &self.model.human.get(lane),
            &self.walkers.drive.get(lane),
            motion.hip_x,
            motion.hip_y,
            motion.hip_vx,
            motion.hip_vy,
            state.rest.time[lane],
        );
        self.signals.trunk_force.set(lane, force);
    }

    #[inline(always)]
    fn percept(&self, state: &State<L>, lane: usize) -> Percept {
        Percept {
            time: state.rest.time[lane],
            hip_y: state.motion.hip_y[lane] - self.signals.ground_ahead[lane],
            heel_force: self.signals.heel_force[lane],
            pendulum: self.signals.trunk_force.pendulum[lane],
            midfoot: self.signals.midfoot[lane],
            intent: self.walkers.intent[lane],
        }
    }
}

impl<const L: usize> HybridFlow<L> for HumanProsthesis<'_, L> {
    type State = State<L>;

    #[inline(always)]
    fn sense(&mut self, state: &State<L>) {
        self.sense_trunk_forces(state);
        if let Some(mut general) = self.signals.general.take() {
            self.lend().sense_general(&mut general, state);
            self.signals.general = Some(general);
        } else if self.model.level {
            self.sense_walker::<true>(state);
        } else {
            self.sense_walker::<false>(state);
        }
        self.sense_command(state);
    }

    #[inline(always)]
    fn rates(&mut self, state: &State<L>, implicit_step: &[f64; L], rates: &mut State<L>) {
        self.follow_references(state, implicit_step, rates);
        self.drive_knee(state, implicit_step);
        self.move_mechanism(state, implicit_step, rates);
        self.turn_rotor(state, implicit_step, rates);
    }

    #[inline(always)]
    fn fired(&self, state: &State<L>) -> [bool; L] {
        let mut fired = self.model.unit.fired(&self.unit_inputs(state));
        for lane in 0..L {
            fired[lane] |= self.steps(state, lane);
        }
        fired
    }

    /// Steps of the human; impacts on the extension stop, whose damper makes the torque jump; and the ground letting go of heel or
    /// ball, beyond which an implicit step would hold on to them. A rotor may stop or break away at a step's end.
    #[inline(always)]
    fn splits(&self, state: &State<L>) -> [bool; L] {
        let mut splits = [false; L];
        for lane in 0..L {
            splits[lane] = self.steps(state, lane) | self.touch(lane).jumps(&self.signals.touch.get(lane));
        }
        splits
    }

    #[inline(always)]
    fn transition(&mut self, state: &mut State<L>, fired: &[bool; L]) {
        self.lend().change(state, fired);
    }

    #[inline(always)]
    fn accept(&mut self, _state: &State<L>) {
        for lane in 0..L {
            let joint = self.signals.joint.get(lane);
            let stop = extension_stop(&self.model.end_stop.get(lane), joint.flexion, joint.flexion_rate);
            self.walkers.extension_stop_peak[lane] = max(stop.torque, self.walkers.extension_stop_peak[lane]);
        }
        self.note_touch();
    }
}
