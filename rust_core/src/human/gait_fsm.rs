//! State machine of the human (Figure 3): guards as thresholds, resets as one function per walker.

use crate::human::drive::Drive;
use crate::human::geometry::Human;
use crate::human::guard::Guard;
use crate::human::params::HumanParams;
use crate::human::variation::Individual;
use crate::human::{reference, slip_leg};
use crate::signals::GRAVITY;

/// What the residual leg is doing (ReStand, ReStepStart, ...).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, strum::VariantNames)]
#[strum(serialize_all = "snake_case")]
#[repr(u8)]
pub enum ResidualState {
    /// Standing on both legs.
    #[default]
    Stand,
    /// First step from standing.
    StepStart,
    /// Cyclic step.
    StepCycle,
    /// Last step.
    StepStop,
}

/// What the intact leg is doing (HeSwing, HeStance, ...).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, strum::VariantNames)]
#[strum(serialize_all = "snake_case")]
#[repr(u8)]
pub enum IntactState {
    /// Standing on both legs.
    #[default]
    Both,
    /// In the air: no force on the trunk.
    Swing,
    /// On the ground, before the residual heel strike.
    Stance,
    /// On the ground, after the residual heel strike.
    Double,
}

/// Memory of the human between steps (section 4; symbols of section 4.1 to 4.3).
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Memory {
    /// State of the residual leg.
    pub residual: ResidualState,
    /// State of the intact leg.
    pub intact: IntactState,
    /// Start of the current residual step, s.
    pub step_start: f64,
    /// Start of the current intact state, s.
    pub state_start: f64,
    /// When the human will react to an event that has already happened, s.
    pub reaction: Option<f64>,
    /// Hip at the start of the current residual step, m.
    pub step_start_x: f64,
    /// Last touch-down of the intact leg, s.
    pub touch_down: f64,
    /// Hip at the last touch-down of the intact leg, m.
    pub touch_down_x: f64,
    /// Expected stride length, m.
    pub stride: f64,
    /// Expected cycle time of the residual step, s.
    pub cycle: f64,
    /// Intended speed registered at the residual heel strike, m/s.
    pub target_speed: f64,
    /// Measured speed over the last intact step v_he, m/s.
    pub intact_speed: f64,
    /// v_he,target, m/s.
    pub intact_target: f64,
    /// v_he,prev, m/s.
    pub intact_previous: f64,
    /// K_thrust, N s^2/m^2.
    pub thrust_gain: f64,
    /// Pendulum stiffness, N/m.
    pub slip_stiffness: f64,
    /// Pendulum damping, N s/m.
    pub slip_damping: f64,
    /// Pendulum foot, m.
    pub slip_foot_x: f64,
    /// Height of the ground under the pendulum foot, m.
    pub slip_foot_y: f64,
    /// Speed over the last full cycle, updated at either heel strike, m/s.
    pub ambulation_speed: f64,
    /// Residual heel strikes so far.
    pub heel_strikes: u32,
}

impl Memory {
    /// Standing still at the origin with the given intended speed.
    pub fn standing(params: &HumanParams, speed: f64) -> Self {
        Self {
            stride: params.first_stride_m,
            cycle: params.first_stride_m / speed,
            target_speed: speed,
            intact_target: speed,
            intact_previous: speed,
            thrust_gain: params.thrust_gain_ns2_m2,
            ..Self::default()
        }
    }

    /// At the heel strike of a cyclic step (section 5.1).
    pub fn cyclic(params: &HumanParams, speed: f64) -> Self {
        Self { residual: ResidualState::StepCycle, intact: IntactState::Swing, ..Self::standing(params, speed) }
    }

    /// When the current residual step reaches `phase` of its expected cycle, s; never while standing.
    pub fn time_at(&self, phase: f64) -> f64 {
        if self.residual == ResidualState::Stand { f64::INFINITY } else { self.step_start + phase * self.cycle }
    }

    /// Guard of the next transition.
    pub fn guard(&self, human: &Human, params: &HumanParams) -> Guard {
        const NEVER: f64 = f64::INFINITY;
        let always = Guard {
            after: -NEVER,
            hip_below: NEVER,
            heel_force_above: -NEVER,
            pendulum_below: NEVER,
            midfoot_below: NEVER,
            intent_above: -NEVER,
        };
        if let Some(reaction) = self.reaction {
            return Guard { after: reaction, ..always };
        }
        let earliest = self.state_start + params.shortest_state_s;
        match self.intact {
            IntactState::Both => Guard { intent_above: 0.5, ..always },
            IntactState::Swing => Guard { after: earliest, hip_below: human.touch_down_height, ..always },
            IntactState::Stance => Guard {
                after: earliest.max(self.step_start + params.shortest_step_share * self.cycle),
                heel_force_above: params.heel_strike_force_n,
                midfoot_below: if self.residual == ResidualState::StepStop { params.stop_distance_m } else { NEVER },
                ..always
            },
            IntactState::Double => Guard { pendulum_below: 0.0, ..always },
        }
    }

    /// Delay of the human's reaction to the event whose guard holds, s.
    fn delay(&self, individual: &Individual) -> f64 {
        match self.intact {
            IntactState::Swing => individual.variation.touch_down_delay_s,
            IntactState::Stance if self.residual != ResidualState::StepStop => individual.variation.step_delay_s,
            IntactState::Both | IntactState::Stance | IntactState::Double => 0.0,
        }
    }

    /// The transition whose guard holds, or its delay, for a hip at `hip_x` and the human's wishes at that time (Figure 3).
    pub fn transition(
        &mut self,
        human: &Human,
        individual: &Individual,
        time: f64,
        hip_x: f64,
        speed: f64,
        walks: bool,
    ) {
        let delay = self.delay(individual);
        if delay > 0.0 && self.reaction.is_none() {
            self.reaction = Some(time + delay);
            return;
        }
        self.reaction = None;
        match self.intact {
            IntactState::Both => {
                self.start_residual_step(ResidualState::StepStart, &individual.params, time, hip_x, speed);
                // The first intact step is measured from the moment that walking starts.
                (self.touch_down, self.touch_down_x) = (time, hip_x);
                self.intact = IntactState::Swing;
            }
            IntactState::Swing => {
                self.start_intact_step(human, individual, time, hip_x);
                self.intact = IntactState::Stance;
            }
            IntactState::Stance if self.residual == ResidualState::StepStop => {
                self.residual = ResidualState::Stand;
                self.intact = IntactState::Both;
            }
            IntactState::Stance => {
                let next = if walks || self.residual == ResidualState::StepStart {
                    ResidualState::StepCycle
                } else {
                    ResidualState::StepStop
                };
                self.start_residual_step(next, &individual.params, time, hip_x, speed);
                self.heel_strikes += 1;
                self.intact = IntactState::Double;
            }
            IntactState::Double => self.intact = IntactState::Swing,
        }
        self.state_start = time;
    }

    fn start_residual_step(&mut self, next: ResidualState, params: &HumanParams, time: f64, hip_x: f64, speed: f64) {
        let travel = hip_x - self.step_start_x;
        if self.residual == ResidualState::StepCycle {
            // Who has been pushed back expects to get on all the same: no cycle lasts no time, or less.
            self.stride = travel.max(params.shortest_stride_m);
        }
        if self.residual != ResidualState::Stand {
            self.ambulation_speed = travel / (time - self.step_start);
        }
        self.residual = next;
        self.step_start = time;
        self.step_start_x = hip_x;
        self.cycle = self.stride / speed;
        self.target_speed = speed;
    }

    fn start_intact_step(&mut self, human: &Human, individual: &Individual, time: f64, hip_x: f64) {
        let Individual { params, variation } = individual;
        self.intact_speed = (hip_x - self.touch_down_x) / (time - self.touch_down);
        self.ambulation_speed = self.intact_speed;
        self.intact_previous = self.intact_target;
        self.intact_target = self.target_speed;
        if self.residual != ResidualState::StepStart {
            // Equation 2, updated at the start of the intact leg's stance.
            let mean = 0.5 * (self.intact_previous + self.target_speed);
            let deficit = 0.5 * human.mass * (mean * mean - self.intact_speed * self.intact_speed);
            self.thrust_gain += variation.thrust_adaptation_factor * (deficit / (0.5 * self.stride * mean * mean));
        }
        self.touch_down = time;
        self.touch_down_x = hip_x;
        (self.slip_stiffness, self.slip_damping) = slip_leg::stiffness_and_damping(
            human.slip_mass,
            self.stride / self.intact_target,
            params.slip_damping_ratio,
            variation.pendulum_stiffness_factor,
        );
        self.slip_foot_x = hip_x + human.leg_length * human.touch_down_sin;
    }

    /// What the continuous equations run on until the next transition.
    pub fn drive(&self, human: &Human, individual: &Individual) -> Drive {
        let Individual { params, variation } = individual;
        let flexion = params.thigh_flexion_deg.to_radians();
        let extension = params.thigh_extension_deg.to_radians();
        let push_off = params.start_extension_deg.to_radians();
        let standing = self.residual == ResidualState::Stand;
        let steps = matches!(self.residual, ResidualState::StepStart | ResidualState::StepCycle);
        let ([thigh_0, thigh_1, thigh_2, thigh_3, thigh_4], last_knot) = match self.residual {
            ResidualState::Stand => ([0.0; 5], 1.0),
            ResidualState::StepStart => ([0.0, push_off, push_off, flexion, flexion], 1.0),
            ResidualState::StepCycle => ([flexion, extension, extension, flexion, flexion], 1.0),
            ResidualState::StepStop => ([flexion, extension, extension, flexion, 0.0], 0.75),
        };
        let stance = 1.0 - variation.stance_asymmetry;
        let mut drive = Drive {
            step_start: self.step_start,
            inverse_cycle: 1.0 / self.cycle,
            thigh_0,
            thigh_1,
            thigh_2,
            thigh_3,
            thigh_4,
            swing_flexion: if steps { variation.swing_flexion_deg.to_radians() } else { 0.0 },
            trunk: if standing { 0.0 } else { params.trunk_lean_deg.to_radians() },
            hip_stiffness: if standing { params.standing_hip_stiffness_nm_rad } else { params.hip_stiffness_nm_rad },
            hip_damping: params.hip_damping_nms_rad,
            hip_limit: human.mass * if standing { params.standing_hip_limit_nm_kg } else { params.hip_limit_nm_kg },
            trunk_stiffness: if standing {
                params.standing_trunk_stiffness_nm_rad
            } else {
                params.trunk_stiffness_nm_rad
            },
            trunk_damping: if standing { params.standing_trunk_damping_nms_rad } else { params.trunk_damping_nms_rad },
            trunk_limit: human.mass
                * if standing { params.standing_trunk_limit_nm_kg } else { params.trunk_limit_nm_kg },
            touch_down: self.touch_down,
            slip_foot_x: self.slip_foot_x,
            slip_foot_y: self.slip_foot_y,
            ..Drive::default()
        };
        drive.set_knots(
            reference::EXTENSION_END * stance,
            reference::SWING_START * stance + variation.swing_start_change,
            last_knot,
        );
        drive.set_filter_delay(if standing {
            params.standing_filter_delay_s
        } else {
            params.filter_delay_share * self.cycle
        });
        match self.intact {
            IntactState::Both => {
                drive.support = 0.5 * human.mass * GRAVITY;
                drive.brake = params.standing_damping_ns_m;
            }
            IntactState::Swing => {}
            IntactState::Stance | IntactState::Double => self.drive_intact_stance(human, individual, &mut drive),
        }
        drive
    }

    /// Pendulum, thrust and lift (sections 4.2 and 4.3); the lift of slow walking and the user's own add up.
    fn drive_intact_stance(&self, human: &Human, individual: &Individual, drive: &mut Drive) {
        let Individual { params, variation } = individual;
        let stance_travel = human.leg_length * human.touch_down_sin;
        drive.slip_stiffness = self.slip_stiffness;
        drive.slip_damping = self.slip_damping;
        drive.lift = params.lift_scale
            * params.lift_gain_m_per_m_s
            * self.slip_stiffness
            * (params.lift_speed_m_s - self.target_speed).max(0.0)
            + variation.hip_lift_m * self.slip_stiffness;
        if self.residual == ResidualState::StepStop {
            drive.brake = human.mass * self.intact_speed / stance_travel;
            drive.stop_lift = params.lift_scale * params.stop_lift_m * self.slip_stiffness;
            drive.fade_rate = 4.0 * self.intact_target / self.stride;
        } else {
            let (target, previous) = (self.intact_target, self.intact_previous);
            drive.thrust = params.thrust_scale
                * (self.thrust_gain * target * target
                    + 0.25 * human.mass * (target * target - previous * previous) / (2.0 * stance_travel));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::human::guard::{Percept, holds};
    use crate::human::variation::HumanVariation;

    #[test]
    fn delayed_reactions_come_their_delay_after_the_event_whatever_happens_meanwhile() {
        let variation = HumanVariation { touch_down_delay_s: 0.02, step_delay_s: 0.05, ..HumanVariation::default() };
        let human = Individual::new(&HumanParams::default(), variation);
        for (from, to, delay) in
            [(IntactState::Swing, IntactState::Stance, 0.02), (IntactState::Stance, IntactState::Double, 0.05)]
        {
            let mut memory = Memory { intact: from, ..Memory::cyclic(&human.params, 1.1) };
            let before = memory;
            memory.transition(&Human::default(), &human, 3.0, 2.0, 1.1, true);
            assert_eq!(memory, Memory { reaction: Some(3.0 + delay), ..before });
            let guard = memory.guard(&Human::default(), &human.params);
            let percept = Percept { time: 3.0 + delay, hip_y: 2.0, pendulum: 1e4, ..Percept::default() };
            assert!(!holds(&guard, &percept));
            assert!(holds(&guard, &Percept { time: 3.001 + delay, ..percept }));
            memory.transition(&Human::default(), &human, 3.0 + delay, 2.1, 1.1, true);
            assert_eq!((memory.intact, memory.reaction, memory.state_start), (to, None, 3.0 + delay));
        }
    }

    #[test]
    fn a_step_reaches_its_phases_in_expected_cycles_and_standing_never_does() {
        let memory = Memory { step_start: 3.0, cycle: 1.2, ..Memory::cyclic(&HumanParams::default(), 1.1) };
        assert_eq!(memory.time_at(0.5), 3.6);
        assert_eq!(Memory::standing(&HumanParams::default(), 1.1).time_at(0.5), f64::INFINITY);
    }

    #[test]
    fn a_step_that_leads_nowhere_or_back_does_not_make_the_next_ones_cycle_vanish() {
        let human = Individual::new(&HumanParams::default(), HumanVariation::default());
        for (hip_x, expected) in [(1.3, 1.3), (0.25, 0.25), (0.01, 0.2), (0.0, 0.2), (-0.6, 0.2)] {
            let mut memory = Memory { intact: IntactState::Stance, ..Memory::cyclic(&human.params, 1.0) };
            memory.transition(&Human::default(), &human, 1.5, hip_x, 1.25, true);
            assert_eq!((memory.stride, memory.cycle), (expected, expected / 1.25));
            // The speed is what it was.
            assert_eq!(memory.ambulation_speed, hip_x / 1.5);
        }
    }

    #[test]
    fn the_thrust_gain_adapts_by_its_factor() {
        let geometry = Human { mass: 75.0, slip_mass: 50.0, leg_length: 0.92, ..Human::default() };
        let change = |factor: f64| {
            let variation = HumanVariation { thrust_adaptation_factor: factor, ..HumanVariation::default() };
            let human = Individual::new(&HumanParams::default(), variation);
            let mut memory = Memory::cyclic(&human.params, 1.1);
            memory.transition(&geometry, &human, 1.0, 0.9, 1.1, true);
            memory.thrust_gain - human.params.thrust_gain_ns2_m2
        };
        // Half the kinetic energy that 0.9 m/s lacks to 1.1 m/s, over the thrust's work of one step per gain.
        let full = 0.5 * 75.0 * (1.21 - 0.81) / (0.5 * 4.0 / 3.0 * 1.21);
        for factor in [0.0, 0.5, 1.0, 2.0] {
            assert!((change(factor) - factor * full).abs() < 1e-9, "{factor}: {}", change(factor));
        }
    }
}
