//! Motor and strain-wave gear: current-limited motor, load-dependent friction with true stiction, elastic transmission (section 5.3).
//!
//! Motor-side quantities, positive where they flex the knee. The friction opposes the rotor's direction, a discrete state:
//! a rotor at rest (direction 0) stays exactly at rest until the load breaks it away, so it cannot drift.

use crate::numerics::lanes::{integrable, lanes};
use crate::numerics::math::{FusedSum, clamp, min, select};
use crate::prosthesis::knee::command::Command;
use crate::prosthesis::knee::joint::{JointMotion, UnitTorque};
use crate::schema::params::{ANY, above, params, within};

/// Command of the unit: a current, flexing positive.
pub const COMMAND: Command = Command { quantity: "current", unit: "A", signed: true };

params! {
    /// Powered knee (section 5.3; friction and inertias of the supplementary material).
    pub struct GearedMotorParams {
        /// Torque constant (section 5.3, in mN m/A).
        torque_constant_nm_a: f64 = 0.0369, "N m/A", above(0.0, 10.0);
        /// Terminal resistance (section 5.3).
        resistance_ohm: f64 = 0.608, "ohm", above(0.0, 1e3);
        /// Largest current (section 5.3).
        current_limit_a: f64 = 6.4, "A", above(0.0, 1e3);
        /// Supply voltage, either sign (section 5.3).
        voltage_limit_v: f64 = 24.0, "V", above(0.0, 1e4);
        /// Gear ratio (section 5.3).
        gear_ratio: f64 = 100.0, "1", above(0.0, 1e4);
        /// Inertia of the motor's rotor.
        rotor_inertia_kg_m2: f64 = 1.81e-5, "kg m^2", above(0.0, 1.0);
        /// Inertia of the gear at the motor's shaft.
        gear_inertia_kg_m2: f64 = 0.39e-5, "kg m^2", within(0.0, 1.0);
        /// Efficiency of the gear when driving, from load-dependent friction alone.
        gear_efficiency: f64 = 0.8, "1", above(0.0, 1.0);
        /// No-load friction at rest, at the motor's shaft.
        rest_friction_nm: f64 = 0.023, "N m", within(0.0, 10.0);
        /// No-load friction from the running speed on.
        running_friction_nm: f64 = 0.035, "N m", within(0.0, 10.0);
        /// Speed at which the no-load friction has grown to its running value.
        running_speed_rpm: f64 = 500.0, "rpm", above(0.0, 1e5);
        /// Stiffness between gear and knee (section 5.3).
        spring_nm_rad: f64 = 1000.0, "N m/rad", above(0.0, 1e6);
        /// Damping between gear and knee (section 5.3).
        damper_nms_rad: f64 = 30.0, "N m s/rad", within(0.0, 1e5);
        /// Reverses the sign of the output torque in the load-dependent friction, as the published run probably had it.
        as_published: bool = false, "", ANY;
    }
}

impl GearedMotorParams {
    /// Knee torque per ampere of an ideal drive train, N m/A.
    pub fn torque_per_ampere(&self) -> f64 {
        self.torque_constant_nm_a * self.gear_ratio
    }
}

lanes! {
    /// Motor constants of one walker, SI.
    pub struct GearedMotor, GearedMotorLanes {
        /// k_tau, N m/A.
        torque_constant: f64,
        /// R, ohm.
        resistance: f64,
        /// A.
        current_limit: f64,
        /// V.
        voltage_limit: f64,
        /// 1 / gear ratio.
        inverse_ratio: f64,
        /// Rotor and gear, kg m^2.
        inertia: f64,
        /// Friction per motor torque: mu_g / sqrt 3.
        motor_friction: f64,
        /// Friction per output torque at the motor's shaft: +-sqrt 3 mu_g.
        load_friction: f64,
        /// No-load friction at rest, N m, minus the part of it that the load-dependent friction already contains.
        rest_friction: f64,
        /// Its growth with speed, N m s/rad.
        friction_slope: f64,
        /// Speed where the growth ends, rad/s.
        friction_speed: f64,
        /// N m/rad.
        spring: f64,
        /// N m s/rad.
        damper: f64,
    }
}

impl From<&GearedMotorParams> for GearedMotor {
    fn from(p: &GearedMotorParams) -> Self {
        let root3 = 3.0_f64.sqrt();
        let mu = root3 * (1.0 - p.gear_efficiency) / (3.0 * p.gear_efficiency + 1.0);
        let no_load = 1.0 - mu / root3;
        let speed = p.running_speed_rpm * std::f64::consts::TAU / 60.0;
        Self {
            torque_constant: p.torque_constant_nm_a,
            resistance: p.resistance_ohm,
            current_limit: p.current_limit_a,
            voltage_limit: p.voltage_limit_v,
            inverse_ratio: 1.0 / p.gear_ratio,
            inertia: p.rotor_inertia_kg_m2 + p.gear_inertia_kg_m2,
            motor_friction: mu / root3,
            load_friction: if p.as_published { -root3 * mu } else { root3 * mu },
            rest_friction: p.rest_friction_nm * no_load,
            friction_slope: (p.running_friction_nm - p.rest_friction_nm) * no_load / speed,
            friction_speed: speed,
            spring: p.spring_nm_rad,
            damper: p.damper_nms_rad,
        }
    }
}

lanes! {
    /// Rotor state, motor side, and the energy that has flowed since the start of the trial.
    pub struct Rotor, RotorLanes {
        /// Angle, rad.
        angle: f64,
        /// Speed omega, rad/s.
        rate: f64,
        /// Work of the motor's torque on the rotor, J.
        rotor_work: f64,
        /// Heat in the windings, J.
        joule_heat: f64,
        /// Work of the gear on the knee, J.
        knee_work: f64,
    }
}
integrable!(RotorLanes { angle, rate, rotor_work, joule_heat, knee_work });

lanes! {
    /// What flows through motor and gear.
    pub struct MotorSignals, MotorSignalsLanes {
        /// Motor current after its limits, A.
        current: f64,
        /// Motor torque k_tau I, N m.
        torque: f64,
        /// Torque of the gear on the knee, N m, flexing.
        gear_torque: f64,
        /// Friction torque at the motor's shaft while it turns, N m, never negative.
        friction: f64,
        /// Friction that holds it at rest, N m.
        holding: f64,
    }
}

/// Current that motor and supply allow, A: limited, and by what the supply voltage drives against the counter-electromotive force.
#[inline(always)]
pub fn current(motor: &GearedMotor, commanded: f64, rate: f64) -> f64 {
    let limited = clamp(commanded, -motor.current_limit, motor.current_limit);
    let emf = motor.torque_constant * rate;
    clamp(limited, (-motor.voltage_limit - emf) / motor.resistance, (motor.voltage_limit - emf) / motor.resistance)
}

/// Torques at the given joint motion, rotor state and commanded current (A).
#[inline(always)]
pub fn signals(motor: &GearedMotor, joint: &JointMotion, rotor: &Rotor, commanded: f64) -> MotorSignals {
    let current = current(motor, commanded, rotor.rate);
    let torque = motor.torque_constant * current;
    let gear_torque = (motor.spring * (-joint.flexion).plus(rotor.angle, motor.inverse_ratio))
        .plus(motor.damper, (-joint.flexion_rate).plus(rotor.rate, motor.inverse_ratio));
    let load_part = (motor.motor_friction * torque).plus(motor.load_friction * gear_torque, motor.inverse_ratio).abs();
    let no_load = motor.rest_friction.plus(motor.friction_slope, min(rotor.rate.abs(), motor.friction_speed));
    MotorSignals {
        current,
        torque,
        gear_torque,
        friction: load_part + no_load,
        holding: load_part + motor.rest_friction,
    }
}

/// Direction (-1, 0, 1) that a rotor at rest moves off in: 0 while friction holds it.
#[inline(always)]
pub fn break_away(motor: &GearedMotor, signals: &MotorSignals) -> f64 {
    let net = signals.torque.minus(signals.gear_torque, motor.inverse_ratio);
    select(net.abs() > signals.holding, 1.0_f64.copysign(net), 0.0)
}

/// Whether the rotor's direction must change: a moving one has stopped, or one at rest breaks away.
#[inline(always)]
pub fn changes_direction(motor: &GearedMotor, signals: &MotorSignals, rotor: &Rotor, direction: f64) -> bool {
    let stops = rotor.rate * direction < 0.0;
    let breaks = (direction == 0.0) & (break_away(motor, signals) != 0.0);
    stops | breaks
}

/// Rotor inertia with the implicit share of the transmission, and the net torque on it before the knee's acceleration.
#[inline(always)]
fn rotor_balance(
    motor: &GearedMotor,
    s: &MotorSignals,
    joint: &JointMotion,
    rotor: &Rotor,
    direction: f64,
    step: f64,
) -> (f64, f64, f64) {
    let implicit = motor.damper.plus(step, motor.spring);
    let stretch_rate = (-joint.flexion_rate).plus(rotor.rate, motor.inverse_ratio);
    let gear_torque = s.gear_torque.plus(step * motor.spring, stretch_rate);
    let inertia = motor.inertia.plus(step * implicit, motor.inverse_ratio * motor.inverse_ratio);
    let net = s.torque.minus(gear_torque, motor.inverse_ratio).minus(direction, s.friction);
    (inertia, select(direction == 0.0, 0.0, net), gear_torque)
}

/// Torque of the gear on the knee with its implicit response: the rotor is eliminated from the step's equations.
#[inline(always)]
pub fn motor_torque(
    motor: &GearedMotor,
    s: &MotorSignals,
    joint: &JointMotion,
    rotor: &Rotor,
    direction: f64,
    step: f64,
) -> UnitTorque {
    let implicit = motor.damper.plus(step, motor.spring);
    let (inertia, net, gear_torque) = rotor_balance(motor, s, joint, rotor, direction, step);
    let turns = direction.abs();
    // Over the step the rotor gains step (net + implicit/N knee gain) / inertia.
    let rotor_gain = step * net / inertia * motor.inverse_ratio;
    let yielding = turns * step * implicit * motor.inverse_ratio * motor.inverse_ratio / inertia;
    UnitTorque {
        damper: 0.0,
        torque: -gear_torque.plus(implicit, rotor_gain),
        damping: implicit * (1.0 - yielding),
        stiffness: 0.0,
    }
}

/// Rates of the rotor once the knee's acceleration (rad/s^2, flexing) over the step is known.
#[inline(always)]
pub fn rotor_rates(
    motor: &GearedMotor,
    s: &MotorSignals,
    joint: &JointMotion,
    rotor: &Rotor,
    direction: f64,
    flexion_acceleration: f64,
    step: f64,
) -> Rotor {
    let implicit = motor.damper.plus(step, motor.spring);
    let (inertia, net, _) = rotor_balance(motor, s, joint, rotor, direction, step);
    let pull = implicit * motor.inverse_ratio * step * flexion_acceleration;
    let acceleration = select(direction == 0.0, 0.0, (net + pull) / inertia);
    Rotor {
        angle: rotor.rate + step * acceleration,
        rate: acceleration,
        rotor_work: s.torque * rotor.rate,
        joule_heat: s.current * s.current * motor.resistance,
        knee_work: s.gear_torque * joint.flexion_rate,
    }
}

/// Power (W) of the motor's torque, of the transmission spring, and of friction and transmission damping; their sum is the rate of
/// rotor energy plus the work on the knee.
pub fn powers(motor: &GearedMotor, s: &MotorSignals, joint: &JointMotion, rotor: &Rotor, direction: f64) -> [f64; 3] {
    let stretch = rotor.angle * motor.inverse_ratio - joint.flexion;
    let stretch_rate = (-joint.flexion_rate).plus(rotor.rate, motor.inverse_ratio);
    [
        s.torque * rotor.rate,
        -motor.spring * stretch * stretch_rate,
        -direction * s.friction * rotor.rate - motor.damper * stretch_rate * stretch_rate,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motor() -> GearedMotor {
        GearedMotor::from(&GearedMotorParams::default())
    }

    /// Rotor held against a knee that is `stretch` rad behind it.
    fn at(stretch: f64, rate: f64, current: f64) -> (GearedMotor, MotorSignals) {
        let motor = motor();
        let joint = JointMotion { flexion: 0.0, flexion_rate: rate * motor.inverse_ratio };
        let rotor = Rotor { angle: stretch / motor.inverse_ratio, rate, ..Rotor::default() };
        (motor, signals(&motor, &joint, &rotor, current))
    }

    #[test]
    fn driving_a_load_through_the_gear_has_the_stated_efficiency() {
        let frictionless = GearedMotorParams { rest_friction_nm: 0.0, running_friction_nm: 0.0, ..Default::default() };
        let motor = GearedMotor::from(&frictionless);
        let (torque, load) = (0.1, 0.8 * 0.1 / motor.inverse_ratio);
        let friction = (motor.motor_friction * torque + motor.load_friction * load * motor.inverse_ratio).abs();
        assert!((torque - load * motor.inverse_ratio - friction).abs() < 1e-15);
    }

    #[test]
    fn current_keeps_within_its_limit_and_the_supply_voltage() {
        let motor = motor();
        assert_eq!(current(&motor, 99.0, 0.0), 6.4);
        assert_eq!(current(&motor, -99.0, 0.0), -6.4);
        let no_load_speed = 24.0 / 0.0369;
        assert!(current(&motor, 6.4, no_load_speed).abs() < 1e-12);
        assert!(current(&motor, 6.4, 0.95 * no_load_speed) < 2.0);
        assert_eq!(current(&motor, -6.4, 0.95 * no_load_speed), -6.4);
    }

    #[test]
    fn friction_holds_a_loaded_rotor_and_lets_go_beyond_its_cone() {
        // 1 N m on the knee is 0.01 N m at the shaft: less than the friction at rest.
        let (motor, held) = at(1.0 / 1000.0, 0.0, 0.0);
        assert_eq!(break_away(&motor, &held), 0.0);
        let (motor, pushed) = at(10.0 / 1000.0, 0.0, 0.0);
        assert_eq!(break_away(&motor, &pushed), -1.0);
        let (motor, driven) = at(0.0, 0.0, 2.0);
        assert_eq!(break_away(&motor, &driven), 1.0);
    }

    #[test]
    fn powers_balance_the_rotor_and_the_knee() {
        let motor = motor();
        let joint = JointMotion { flexion: 0.3, flexion_rate: -1.7 };
        let rotor = Rotor { angle: 31.0, rate: -120.0, ..Rotor::default() };
        let s = signals(&motor, &joint, &rotor, 1.5);
        let rates = rotor_rates(&motor, &s, &joint, &rotor, -1.0, 0.0, 0.0);
        let stored = motor.inertia * rotor.rate * rates.rate;
        let on_knee = s.gear_torque * joint.flexion_rate;
        let sum: f64 = powers(&motor, &s, &joint, &rotor, -1.0).iter().sum();
        assert!((sum - stored - on_knee).abs() < 1e-9 * sum.abs());
    }

    #[test]
    fn the_implicit_step_solves_rotor_and_knee_together() {
        // The knee's torque after the step must be that of the transmission at the end of the step.
        let (motor, step, knee_gain) = (motor(), 1e-3, 0.4);
        let joint = JointMotion { flexion: 0.3, flexion_rate: -1.7 };
        let rotor = Rotor { angle: 30.9, rate: -150.0, ..Rotor::default() };
        let s = signals(&motor, &joint, &rotor, 1.5);
        let unit = motor_torque(&motor, &s, &joint, &rotor, -1.0, step);
        let end_rate = rotor.rate + step * rotor_rates(&motor, &s, &joint, &rotor, -1.0, knee_gain / step, step).rate;
        let stretch_rate = end_rate * motor.inverse_ratio - (joint.flexion_rate + knee_gain);
        let stretch = rotor.angle * motor.inverse_ratio - joint.flexion + step * stretch_rate;
        let expected = motor.spring * stretch + motor.damper * stretch_rate;
        // Joint coordinate q5 = -flexion, so a gain of flexion speed is a loss there.
        assert!((-(unit.torque + unit.damping * knee_gain) - expected).abs() < 1e-9 * expected.abs());
    }
}
