//! Equations of mechanism, prosthesis and sensors on inputs from a steady walk.

use criterion::Criterion;
use serde_json::{Value, json};

use prosthesis_gym_core::config::Config;
use prosthesis_gym_core::mechanics::body::{Body, BodyLanes, BodyParams};
use prosthesis_gym_core::mechanics::compliant_ground::{
    ContactLanes, Ground, GroundLanes, GroundParams, contact, deformation_rate,
};
use prosthesis_gym_core::mechanics::motion::{
    AccelerationLanes, JointTorque, Kinematics, KinematicsLanes, Loads, MotionLanes, PointForce, PointForceLanes,
    PointLanes, PrescribedLanes,
};
use prosthesis_gym_core::mechanics::walker;
use prosthesis_gym_core::plant::contact_force::level_force;
use prosthesis_gym_core::prosthesis::end_stop::{EndStop, EndStopLanes, EndStopParams, extension_stop, flexion_stop};
use prosthesis_gym_core::prosthesis::knee::joint::{JointMotionLanes, UnitTorqueLanes};
use prosthesis_gym_core::prosthesis::knee::kind::DeviceKind;
use prosthesis_gym_core::prosthesis::knee::motor::geared_motor::{MotorSignalsLanes, RotorLanes};
use prosthesis_gym_core::prosthesis::knee::unit::{KneeUnit, UnitInputs};
use prosthesis_gym_core::sensors::params::SensorParams;
use prosthesis_gym_core::sensors::{self, Sensors};
use prosthesis_gym_core::signals::{MeasurandLanes, ReadingsLanes};

use crate::walk::{Block, LANES, Moment, STEP_S, blocks, columns, compare, config, stride};

/// Every block of mechanism, prosthesis and sensors.
pub fn all(criterion: &mut Criterion) {
    let walk = stride(DeviceKind::Damper);
    compare(criterion, "hybrid dynamics", Dynamics::<1>::new(&walk), Dynamics::<LANES>::new(&walk));
    compare(criterion, "ground contact", Contacts::<1>::new(&walk), Contacts::<LANES>::new(&walk));
    compare(criterion, "end stops", EndStops::<1>::new(&walk), EndStops::<LANES>::new(&walk));
    for kind in [DeviceKind::Damper, DeviceKind::Motor, DeviceKind::Friction] {
        let walk = stride(kind);
        let name = format!("knee unit/{kind:?}").to_lowercase();
        compare(criterion, &name, Units::<1>::new(kind, &walk), Units::<LANES>::new(kind, &walk));
    }
    for (name, params) in [("sensors/default", SensorParams::default()), ("sensors/imperfect", imperfect())] {
        compare(criterion, name, Sampling::<1>::new(&params, &walk), Sampling::<LANES>::new(&params, &walk));
    }
}

/// Kinematics and one linearly implicit solution of the equations of motion.
struct Dynamics<const L: usize> {
    motion: MotionLanes<L>,
    trunk: PrescribedLanes<L>,
    heel: PointForceLanes<L>,
    ball: PointForceLanes<L>,
    kinematics: KinematicsLanes<L>,
    acceleration: AccelerationLanes<L>,
}

impl<const L: usize> Dynamics<L> {
    fn new(walk: &[Moment]) -> (BodyLanes<L>, Vec<Self>) {
        let block = |moments: [&Moment; L]| Self {
            motion: columns!(MotionLanes, moments, |moment| moment.motion),
            trunk: columns!(PrescribedLanes, moments, |moment| moment.trunk),
            heel: columns!(PointForceLanes, moments, |moment| level_force(&moment.contacts[0])),
            ball: columns!(PointForceLanes, moments, |moment| level_force(&moment.contacts[1])),
            kinematics: KinematicsLanes::default(),
            acceleration: AccelerationLanes::default(),
        };
        (BodyLanes::splat(Body::from(&BodyParams::default())), blocks(walk, block))
    }

    /// Loads of usual size beside those of the ground.
    #[inline(always)]
    fn loads(heel: PointForce, ball: PointForce) -> Loads {
        Loads {
            trunk_x: 20.0,
            trunk_y: 300.0,
            knee_x: 0.0,
            knee_y: 0.0,
            hip: JointTorque { torque: 50.0, damping: 100.0, stiffness: 2000.0 },
            hip_error_rate: 0.1,
            knee: JointTorque { torque: 10.0, damping: 20.0, stiffness: 2.0 },
            ankle: JointTorque { torque: -40.0, damping: 1.0, stiffness: 450.0 },
            heel,
            ball,
        }
    }
}

impl<const L: usize> Block for Dynamics<L> {
    type Constants = BodyLanes<L>;

    #[inline(always)]
    fn run(&mut self, body: &BodyLanes<L>) {
        for lane in 0..L {
            let kinematics: Kinematics =
                walker::kinematics(&body.get(lane), &self.motion.get(lane), self.trunk.angle[lane]);
            self.kinematics.set(lane, kinematics);
        }
        for lane in 0..L {
            let acceleration = walker::acceleration::<true>(
                &body.get(lane),
                &self.kinematics.get(lane),
                &self.motion.get(lane),
                &self.trunk.get(lane),
                &Self::loads(self.heel.get(lane), self.ball.get(lane)),
                STEP_S,
            );
            self.acceleration.set(lane, acceleration);
        }
    }
}

/// Heel and ball on the ground, and the rate of its deformation.
struct Contacts<const L: usize> {
    /// Heel, then ball.
    points: [PointLanes<L>; 2],
    deformations: [[f64; L]; 2],
    contacts: [ContactLanes<L>; 2],
    deformation_rates: [[f64; L]; 2],
}

impl<const L: usize> Contacts<L> {
    fn new(walk: &[Moment]) -> (GroundLanes<L>, Vec<Self>) {
        let point = |moments: [&Moment; L], index: usize| columns!(PointLanes, moments, |moment| moment.points[index]);
        let block = |moments: [&Moment; L]| Self {
            points: [point(moments, 0), point(moments, 1)],
            deformations: [0, 1].map(|index| moments.map(|moment| moment.deformations[index])),
            contacts: [ContactLanes::default(), ContactLanes::default()],
            deformation_rates: [[0.0; L]; 2],
        };
        (GroundLanes::splat(Ground::from(&GroundParams::default())), blocks(walk, block))
    }
}

impl<const L: usize> Block for Contacts<L> {
    type Constants = GroundLanes<L>;

    #[inline(always)]
    fn run(&mut self, ground: &GroundLanes<L>) {
        for index in 0..2 {
            for lane in 0..L {
                let (point, deformation) = (self.points[index].get(lane), self.deformations[index][lane]);
                let contact = contact(&ground.get(lane), point.y, point.vx, point.vy, deformation);
                self.contacts[index].set(lane, contact);
            }
            for lane in 0..L {
                let (contact, vx) = (self.contacts[index].get(lane), self.points[index].vx[lane]);
                let deformation = self.deformations[index][lane];
                self.deformation_rates[index][lane] =
                    deformation_rate(&ground.get(lane), &contact, deformation, vx, STEP_S);
            }
        }
    }
}

/// Both end stops of the knee.
struct EndStops<const L: usize> {
    knee: JointMotionLanes<L>,
    torque: UnitTorqueLanes<L>,
}

impl<const L: usize> EndStops<L> {
    fn new(walk: &[Moment]) -> (EndStopLanes<L>, Vec<Self>) {
        let block = |moments: [&Moment; L]| Self {
            knee: columns!(JointMotionLanes, moments, |moment| moment.knee),
            torque: UnitTorqueLanes::default(),
        };
        (EndStopLanes::splat(EndStop::from(&EndStopParams::default())), blocks(walk, block))
    }
}

impl<const L: usize> Block for EndStops<L> {
    type Constants = EndStopLanes<L>;

    #[inline(always)]
    fn run(&mut self, stop: &EndStopLanes<L>) {
        for lane in 0..L {
            let (stop, knee) = (stop.get(lane), self.knee.get(lane));
            let extension = extension_stop(&stop, knee.flexion, knee.flexion_rate);
            let flexion = flexion_stop(&stop, knee.flexion, knee.flexion_rate);
            self.torque.torque[lane] = flexion.torque - extension.torque;
            self.torque.damping[lane] = extension.damping + flexion.damping;
            self.torque.stiffness[lane] = extension.stiffness + flexion.stiffness;
        }
    }
}

/// A knee unit: its signals, guards, torques and rates.
struct Units<const L: usize> {
    knee: JointMotionLanes<L>,
    rotor: RotorLanes<L>,
    direction: [f64; L],
    command: [f64; L],
    signals: MotorSignalsLanes<L>,
    torques: UnitTorqueLanes<L>,
    rates: RotorLanes<L>,
    fired: [bool; L],
}

impl<const L: usize> Units<L> {
    fn new(kind: DeviceKind, walk: &[Moment]) -> (KneeUnit<L>, Vec<Self>) {
        let block = |moments: [&Moment; L]| Self {
            knee: columns!(JointMotionLanes, moments, |moment| moment.knee),
            rotor: columns!(RotorLanes, moments, |moment| moment.rotor),
            direction: moments.map(|moment| moment.rotor.rate.signum()),
            command: moments.map(|moment| moment.command),
            signals: MotorSignalsLanes::default(),
            torques: UnitTorqueLanes::default(),
            rates: RotorLanes::default(),
            fired: [false; L],
        };
        (KneeUnit::new(&config(kind).knee_params()), blocks(walk, block))
    }
}

impl<const L: usize> Block for Units<L> {
    type Constants = KneeUnit<L>;

    #[inline(always)]
    fn run(&mut self, unit: &KneeUnit<L>) {
        const FLEXION_ACCELERATION_RAD_S2: f64 = 10.0;
        unit.sense(&self.knee, &self.rotor, &self.command, &mut self.signals);
        let at = UnitInputs {
            joint: &self.knee,
            rotor: &self.rotor,
            direction: &self.direction,
            motor: &self.signals,
            command: &self.command,
        };
        unit.torques(&at, &[STEP_S; L], &mut self.torques);
        unit.rates(&at, &[FLEXION_ACCELERATION_RAD_S2; L], &[STEP_S; L], &mut self.rates);
        self.fired = unit.fired(&at);
    }
}

/// A sample of all sensors.
struct Sampling<const L: usize> {
    sensors: Sensors<L>,
    truth: MeasurandLanes<L>,
    readings: ReadingsLanes<L>,
}

impl<const L: usize> Sampling<L> {
    fn new(params: &SensorParams, walk: &[Moment]) -> (sensors::SensorModel<L>, Vec<Self>) {
        let model = sensors::SensorModel::new(params);
        let block = |moments: [&Moment; L]| {
            let mut sampling = Self {
                sensors: Sensors::default(),
                truth: columns!(MeasurandLanes, moments, |moment| moment.truth),
                readings: ReadingsLanes::default(),
            };
            sampling.sensors.seed = std::array::from_fn(|lane| lane as u64);
            sampling.sensors.start(&model, &[true; L], &sampling.truth, &mut sampling.readings);
            sampling
        };
        let blocks = blocks(walk, block);
        (model, blocks)
    }
}

impl<const L: usize> Block for Sampling<L> {
    type Constants = sensors::SensorModel<L>;

    #[inline(always)]
    fn run(&mut self, model: &sensors::SensorModel<L>) {
        self.sensors.sample(model, &self.truth, &mut self.readings);
    }
}

/// Every sensor with every imperfection.
fn imperfect() -> SensorParams {
    let imperfections = json!({
        "resolution": 1e-3, "noise": 1e-2, "bias": 1e-2, "delay_samples": 2, "drop_out": 0.01, "saturation": 10.0,
    });
    let sensors = [
        "knee_encoder",
        "tube_force",
        "tube_moment",
        "ankle_moment",
        "shank_inclination",
        "shank_rate",
        "shank_specific_force",
        "thigh_rate",
        "thigh_specific_force",
        "motor_position",
        "motor_speed",
        "motor_current",
    ];
    let sensors: Value = sensors.into_iter().map(|sensor| (sensor.to_owned(), imperfections.clone())).collect();
    Config::from_deserializer(json!({"sensors": sensors})).expect("imperfections lie in their ranges").sensors
}
