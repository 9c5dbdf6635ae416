//! From actions in [-1, 1] to commands of the knee unit, by way of what lies between an agent and a valve or an amplifier.
//!
//! ```text
//! action ─> held for `hold` periods or until the gait phase changes ─> mode ─> delay ─> rate limit ─> low-pass ─> command
//! ```

use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantNames};

use crate::agent::actuation::{Actuation, ActuationLanes, Actuations, Lag};
use crate::numerics::lanes::lanes;
use crate::numerics::math::{clamp, max, min};
use crate::prosthesis::knee::kind::DeviceKind;
use crate::prosthesis::knee::unit::KneeParams;
use crate::schema::params::{ANY, Choice, above, params, within};
use crate::signals::ReadingsLanes;

/// What the action means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, IntoStaticStr, VariantNames)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum ActionMode {
    /// The command itself.
    #[default]
    Direct,
    /// A correction, added to the state machine's command.
    Residual,
    /// Stiffness, damping and rest angle that the motor imitates.
    Impedance,
    /// None: the state machine alone drives the knee.
    StateMachine,
    /// None: the command is constant.
    Constant,
}

impl Choice for ActionMode {}

/// When a new action takes effect.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, IntoStaticStr, VariantNames)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Latch {
    /// At once.
    #[default]
    Step,
    /// When the state machine enters its next gait phase; until then the last one holds.
    Phase,
}

impl Choice for Latch {}

params! {
    /// How actions become commands.
    pub struct ActionParams {
        /// What the action means: the command itself (direct), a correction added to the state machine's (residual), stiffness, damping and rest angle of a motor knee (impedance), nothing (state_machine, constant).
        mode: ActionMode = ActionMode::Direct, "", ANY;
        /// When a new action takes effect: at once (step), or when the state machine enters its next gait phase (phase), so that parameters are held per phase.
        latch: Latch = Latch::Step, "", ANY;
        /// Damper knee: coefficient at action +1 in mode `direct`, and upper limit in mode `residual`.
        max_command_nms2_rad2: f64 = 20.0, "N m s^2/rad^2", above(0.0, 1e4);
        /// Damper knee: correction at action +1 in mode `residual`.
        residual_nms2_rad2: f64 = 10.0, "N m s^2/rad^2", above(0.0, 1e4);
        /// Damper knee: coefficient of mode `constant`.
        constant_nms2_rad2: f64 = 0.0, "N m s^2/rad^2", within(0.0, 1e4);
        /// Motor knee: correction at action +1 in mode `residual`.
        residual_a: f64 = 2.0, "A", above(0.0, 1e3);
        /// Motor knee: current of mode `constant`, flexing positive.
        constant_a: f64 = 0.0, "A", within(-1e3, 1e3);
        /// Motor knee: stiffness at action +1 in mode `impedance`, quadratic from 0 at -1.
        max_stiffness_nm_rad: f64 = 200.0, "N m/rad", above(0.0, 1e4);
        /// Motor knee: damping at action +1 in mode `impedance`, quadratic from 0 at -1.
        max_damping_nms_rad: f64 = 10.0, "N m s/rad", above(0.0, 1e3);
        /// Motor knee: rest angle of knee flexion at action +1 in mode `impedance`; 0 at -1.
        max_rest_angle_deg: f64 = 70.0, "deg", above(0.0, 120.0);
        /// Friction knee: correction at action +1 in mode `residual`.
        residual_nm: f64 = 5.0, "N m", above(0.0, 1e3);
        /// Friction knee: friction torque of mode `constant`.
        constant_nm: f64 = 0.0, "N m", within(0.0, 1e3);
        /// Control periods of 5 ms that one action holds for; one env step advances that many.
        hold: usize = 1, "samples", within(1.0, 200.0);
        /// Control periods of 5 ms by which commands come late.
        delay_samples: usize = 0, "samples", within(0.0, 200.0);
        /// Fastest change of the command, in commands of a full action per second; 0 for no limit.
        rate_limit_per_s: f64 = 0.0, "1/s", within(0.0, 1e6);
        /// Time constant of a first-order low-pass on the command; 0 for none.
        filter_s: f64 = 0.0, "s", within(0.0, 10.0);
    }
}

impl ActionParams {
    /// Keys of the parameters with the command of mode `constant`, and with that of action +1 in mode `direct` if it is one of
    /// these; else it is the largest that the unit carries out.
    pub fn keys(kind: DeviceKind) -> (&'static str, Option<&'static str>) {
        match kind {
            DeviceKind::Damper => ("constant_nms2_rad2", Some("max_command_nms2_rad2")),
            DeviceKind::Motor => ("constant_a", None),
            DeviceKind::Friction => ("constant_nm", None),
        }
    }
}

/// From actions in [-1, 1] to commands of a knee unit: what is the same for all walkers.
#[derive(Clone, Copy, Debug)]
pub struct ActionMap {
    mode: ActionMode,
    latch: Latch,
    /// Whether commands have a sign (current) or none (damping, friction).
    signed: bool,
    residual: f64,
    constant: f64,
    impedance: Impedance,
    lag: Lag,
}

/// Scale of an impedance action.
#[derive(Clone, Copy, Debug, Default)]
struct Impedance {
    /// N m/rad.
    stiffness: f64,
    /// N m s/rad.
    damping: f64,
    /// rad.
    rest_angle: f64,
}

lanes! {
    /// What one walker's knee unit makes of an action: episodes may draw other units.
    pub struct CommandScale, CommandScaleLanes {
        /// Command at action +1.
        full: f64,
        /// What the unit can do at least: as much backwards, or nothing.
        least: f64,
        /// What it can do at most.
        most: f64,
        /// Current per knee torque of an ideal drive train, A/(N m).
        current_per_torque: f64,
    }
}

impl CommandScale {
    /// Of an agent on one of the knee units.
    pub fn new(action: &ActionParams, knee: &KneeParams<'_>) -> Self {
        let most = knee.most_command();
        let full = if knee.kind == DeviceKind::Damper { action.max_command_nms2_rad2 } else { most };
        let least = if knee.kind.command().signed { -most } else { 0.0 };
        Self { full, least, most, current_per_torque: 1.0 / knee.motor.torque_per_ampere() }
    }
}

impl<const L: usize> CommandScaleLanes<L> {
    /// A command over that of a full action, for observations and rewards.
    #[inline(always)]
    pub fn relative(&self, lane: usize, command: f64) -> f64 {
        command / self.full[lane]
    }
}

impl ActionMap {
    /// The map of the configured knee unit.
    pub fn new(action: &ActionParams, kind: DeviceKind) -> Self {
        let (residual, constant) = match kind {
            DeviceKind::Damper => (action.residual_nms2_rad2, action.constant_nms2_rad2),
            DeviceKind::Motor => (action.residual_a, action.constant_a),
            DeviceKind::Friction => (action.residual_nm, action.constant_nm),
        };
        Self {
            mode: action.mode,
            latch: action.latch,
            signed: kind.command().signed,
            residual,
            constant,
            impedance: Impedance {
                stiffness: action.max_stiffness_nm_rad,
                damping: action.max_damping_nms_rad,
                rest_angle: action.max_rest_angle_deg.to_radians(),
            },
            lag: Lag::new(action.delay_samples, action.rate_limit_per_s, action.filter_s),
        }
    }

    /// How many numbers an action has.
    pub fn size(&self) -> usize {
        if self.mode == ActionMode::Impedance { 3 } else { 1 }
    }

    /// Commands of the next control period for actions (n, action size) of the first n lanes. `phases` and `state_machine` are
    /// phases and commands of the state machines.
    #[inline(always)]
    pub fn commands<const L: usize>(
        &self,
        scale: &CommandScaleLanes<L>,
        memory: &mut Actuations<L>,
        actions: &[f64],
        readings: &ReadingsLanes<L>,
        phases: &[u8; L],
        state_machine: &[f64; L],
    ) -> [f64; L] {
        let now = &mut memory.now;
        for (lane, action) in actions.chunks_exact(self.size()).enumerate() {
            if self.latch == Latch::Step || phases[lane] != now.phase[lane] {
                now.action_0[lane] = clamp(action[0], -1.0, 1.0);
                if let [_, second, third] = action {
                    now.action_1[lane] = clamp(*second, -1.0, 1.0);
                    now.action_2[lane] = clamp(*third, -1.0, 1.0);
                }
                now.phase[lane] = phases[lane];
            }
        }
        let requested = self.requests(scale, now, readings, state_machine);
        self.lag.through(memory, &scale.full, requested)
    }

    /// What the actions ask for. A current is proportional to its action, damping and friction are quadratic from 0 at -1.
    #[inline(always)]
    fn requests<const L: usize>(
        &self,
        scale: &CommandScaleLanes<L>,
        now: &ActuationLanes<L>,
        readings: &ReadingsLanes<L>,
        state_machine: &[f64; L],
    ) -> [f64; L] {
        let limited = |lane: usize, request: f64| clamp(request, scale.least[lane], scale.most[lane]);
        match self.mode {
            ActionMode::Direct if self.signed => lanewise(|lane| limited(lane, scale.full[lane] * now.action_0[lane])),
            ActionMode::Direct => lanewise(|lane| limited(lane, scale.full[lane] * quadratic(now.action_0[lane]))),
            ActionMode::Residual => lanewise(|lane| {
                // The state machine may exceed the agent's range; the agent must not cut it.
                let limit = max(state_machine[lane], scale.full[lane]);
                limited(lane, min(state_machine[lane] + self.residual * now.action_0[lane], limit))
            }),
            ActionMode::Impedance => lanewise(|lane| {
                let (angle, speed) = (readings.knee_angle[lane], readings.knee_speed[lane]);
                let torque = self.impedance.torque(&now.get(lane), angle, speed);
                limited(lane, torque * scale.current_per_torque[lane])
            }),
            ActionMode::StateMachine => lanewise(|lane| limited(lane, state_machine[lane])),
            ActionMode::Constant => lanewise(|lane| limited(lane, self.constant)),
        }
    }
}

/// A number of each lane.
#[inline(always)]
fn lanewise<const L: usize>(number: impl Fn(usize) -> f64) -> [f64; L] {
    let mut numbers = [0.0; L];
    for lane in 0..L {
        numbers[lane] = number(lane);
    }
    numbers
}

impl Impedance {
    /// Torque of the spring and damper that the action asks for, at a knee flexion (rad) and its speed (rad/s), N m.
    #[inline(always)]
    fn torque(&self, action: &Actuation, angle: f64, speed: f64) -> f64 {
        let rest_angle = self.rest_angle * 0.5 * (action.action_2 + 1.0);
        let spring = self.stiffness * quadratic(action.action_0) * (rest_angle - angle);
        spring - self.damping * quadratic(action.action_1) * speed
    }
}

/// From 0 at -1 to 1 at +1, finest near 0.
#[inline(always)]
fn quadratic(action: f64) -> f64 {
    0.25 * (action + 1.0) * (action + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prosthesis::knee::motor::geared_motor::GearedMotorParams;
    use crate::signals::Readings;

    struct Leg {
        map: ActionMap,
        scale: CommandScaleLanes<1>,
    }

    fn leg(kind: DeviceKind, action: &ActionParams) -> Leg {
        let (damper, motor, friction) = Default::default();
        let knee = KneeParams { kind, damper: &damper, motor: &motor, friction: &friction };
        Leg { map: ActionMap::new(action, kind), scale: CommandScaleLanes::splat(CommandScale::new(action, &knee)) }
    }

    /// Command of one walker, no state machine.
    fn command(leg: &Leg, memory: &mut Actuations<1>, action: &[f64], readings: Readings, phase: u8) -> f64 {
        leg.map.commands(&leg.scale, memory, action, &ReadingsLanes::splat(readings), &[phase], &[0.0])[0]
    }

    #[test]
    fn a_latched_action_holds_until_the_gait_phase_changes() {
        let leg = leg(DeviceKind::Damper, &ActionParams { latch: Latch::Phase, ..ActionParams::default() });
        let mut memory = Actuations::default();
        let mut at = |action: f64, phase: u8| command(&leg, &mut memory, &[action], Readings::default(), phase);
        assert_eq!(at(1.0, 1), 20.0);
        assert_eq!(at(-1.0, 1), 20.0);
        assert_eq!(at(-1.0, 2), 0.0);
        assert_eq!(at(1.0, 2), 0.0);
    }

    #[test]
    fn an_impedance_pulls_to_its_rest_angle_and_against_motion() {
        let leg = leg(DeviceKind::Motor, &ActionParams { mode: ActionMode::Impedance, ..ActionParams::default() });
        assert_eq!(leg.map.size(), 3);
        let current = |action: [f64; 3], knee_angle: f64, knee_speed: f64| {
            let readings = Readings { knee_angle, knee_speed, ..Readings::default() };
            command(&leg, &mut Actuations::default(), &action, readings, 1)
        };
        let rest = 35.0_f64.to_radians();
        assert!(current([0.0, -1.0, 0.0], rest, 3.0).abs() < 1e-12);
        assert!(current([0.0, -1.0, 0.0], rest - 0.01, 0.0) > 0.0 && current([0.0, -1.0, 0.0], rest + 0.01, 0.0) < 0.0);
        assert!(current([-1.0, 0.0, 0.0], 1.0, 0.2) < 0.0 && current([-1.0, 0.0, 0.0], 1.0, -0.2) > 0.0);
        let torque = current([0.0, -1.0, 0.0], rest - 0.01, 0.0) * GearedMotorParams::default().torque_per_ampere();
        assert!((torque - 0.01 * 200.0 / 4.0).abs() < 1e-9, "{torque}");
    }
}
