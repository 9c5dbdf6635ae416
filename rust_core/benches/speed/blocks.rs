//! Equations of single blocks on inputs from a steady walk.

use criterion::Criterion;
use serde_json::{Value, json};

use prosthesis_gym_core::compliant_ground::{self, ContactLanes, Ground, GroundParams};
use prosthesis_gym_core::config::Config;
use prosthesis_gym_core::human_controller::gait_fsm::Memory;
use prosthesis_gym_core::human_controller::impedance::{ImpedanceTorqueLanes, impedance};
use prosthesis_gym_core::human_controller::reference::{Filter, Reference, ReferenceLanes, rough_thigh};
use prosthesis_gym_core::human_controller::slip_leg::{TrunkForceLanes, trunk_force};
use prosthesis_gym_core::human_controller::variation::HumanVariation;
use prosthesis_gym_core::human_controller::{Drive, Human, HumanParams, Individual, LegGeometry};
use prosthesis_gym_core::hybrid_dynamics::body::{Body, BodyLanes, BodyParams};
use prosthesis_gym_core::hybrid_dynamics::walker::{
    self, AccelerationLanes, JointTorque, Kinematics, KinematicsLanes, Loads, Motion, MotionLanes, PointForce,
    PointForceLanes, PointLanes, PrescribedLanes,
};
use prosthesis_gym_core::prosthesis_device::end_stop::{EndStop, EndStopParams, extension_stop, flexion_stop};
use prosthesis_gym_core::prosthesis_device::geared_motor::{MotorSignalsLanes, RotorLanes};
use prosthesis_gym_core::prosthesis_device::{DeviceKind, JointMotionLanes, KneeUnit, UnitInputs, UnitTorqueLanes};
use prosthesis_gym_core::sensors::{self, SensorParams, Sensors};
use prosthesis_gym_core::signals::{MeasurandLanes, ReadingsLanes};

use crate::walk::{Kernel, LANES, Moment, blocks, compare, config, stride};

/// Length of an implicit stage, s.
const STEP_S: f64 = 1e-3;

/// Every block of the walker.
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
    compare(criterion, "human references", References::<1>::new(&walk), References::<LANES>::new(&walk));
    compare(criterion, "intact leg", IntactLegs::<1>::new(&walk), IntactLegs::<LANES>::new(&walk));
    for (name, params) in [("sensors/default", SensorParams::default()), ("sensors/imperfect", imperfect())] {
        compare(criterion, name, Sampling::<1>::new(&params, &walk), Sampling::<LANES>::new(&params, &walk));
    }
}

/// Columns of what moments have, made by their `set`.
macro_rules! columns {
    ($Columns:ident, $moments:expr, |$moment:ident| $value:expr) => {{
        let mut columns = $Columns::<L>::default();
        for (lane, $moment) in $moments.into_iter().enumerate() {
            columns.set(lane, $value);
        }
        columns
    }};
}

/// Kinematics and one linearly implicit solution of the equations of motion.
struct Dynamics<const L: usize> {
    body: BodyLanes<L>,
    blocks: Vec<DynamicsBlock<L>>,
}

struct DynamicsBlock<const L: usize> {
    motion: MotionLanes<L>,
    trunk: PrescribedLanes<L>,
    heel: PointForceLanes<L>,
    ball: PointForceLanes<L>,
    kinematics: KinematicsLanes<L>,
    acceleration: AccelerationLanes<L>,
}

impl<const L: usize> Dynamics<L> {
    fn new(walk: &[Moment]) -> Self {
        let force = |moment: &Moment, point: usize| {
            let contact = moment.contacts[point];
            PointForce {
                x: contact.tangential,
                y: contact.normal,
                damping_x: contact.tangential_damping,
                damping_y: contact.normal_damping,
                stiffness_x: contact.tangential_stiffness,
                stiffness_y: contact.normal_stiffness,
                sin: 0.0,
                cos: 1.0,
            }
        };
        let block = |moments: [&Moment; L]| DynamicsBlock {
            motion: columns!(MotionLanes, moments, |moment| moment.motion),
            trunk: columns!(PrescribedLanes, moments, |moment| moment.trunk),
            heel: columns!(PointForceLanes, moments, |moment| force(moment, 0)),
            ball: columns!(PointForceLanes, moments, |moment| force(moment, 1)),
            kinematics: KinematicsLanes::default(),
            acceleration: AccelerationLanes::default(),
        };
        Self { body: BodyLanes::splat(Body::from(&BodyParams::default())), blocks: blocks(walk, block) }
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

impl<const L: usize> Kernel for Dynamics<L> {
    #[inline(always)]
    fn run(&mut self) {
        for block in &mut self.blocks {
            for lane in 0..L {
                let kinematics: Kinematics =
                    walker::kinematics(&self.body.get(lane), &block.motion.get(lane), block.trunk.angle[lane]);
                block.kinematics.set(lane, kinematics);
            }
            for lane in 0..L {
                let acceleration = walker::acceleration::<true>(
                    &self.body.get(lane),
                    &block.kinematics.get(lane),
                    &block.motion.get(lane),
                    &block.trunk.get(lane),
                    &Self::loads(block.heel.get(lane), block.ball.get(lane)),
                    STEP_S,
                );
                block.acceleration.set(lane, acceleration);
            }
        }
    }
}

/// Heel and ball on the ground, and the rate of its deformation.
struct Contacts<const L: usize> {
    ground: Ground,
    /// Heel, then ball.
    blocks: [Vec<ContactBlock<L>>; 2],
}

struct ContactBlock<const L: usize> {
    point: PointLanes<L>,
    deformation: [f64; L],
    contact: ContactLanes<L>,
    deformation_rate: [f64; L],
}

impl<const L: usize> Contacts<L> {
    fn new(walk: &[Moment]) -> Self {
        let points = |index: usize| {
            blocks(walk, |moments: [&Moment; L]| ContactBlock {
                point: columns!(PointLanes, moments, |moment| moment.points[index]),
                deformation: moments.map(|moment| moment.deformations[index]),
                contact: ContactLanes::default(),
                deformation_rate: [0.0; L],
            })
        };
        Self { ground: Ground::from(&GroundParams::default()), blocks: [points(0), points(1)] }
    }
}

impl<const L: usize> Kernel for Contacts<L> {
    #[inline(always)]
    fn run(&mut self) {
        for block in self.blocks.iter_mut().flatten() {
            for lane in 0..L {
                let point = block.point.get(lane);
                let contact =
                    compliant_ground::contact(&self.ground, point.y, point.vx, point.vy, block.deformation[lane]);
                block.contact.set(lane, contact);
            }
            for lane in 0..L {
                let (contact, vx) = (block.contact.get(lane), block.point.vx[lane]);
                block.deformation_rate[lane] =
                    compliant_ground::deformation_rate(&self.ground, &contact, block.deformation[lane], vx, STEP_S);
            }
        }
    }
}

/// Both end stops of the knee.
struct EndStops<const L: usize> {
    stop: EndStop,
    blocks: Vec<EndStopBlock<L>>,
}

struct EndStopBlock<const L: usize> {
    knee: JointMotionLanes<L>,
    torque: UnitTorqueLanes<L>,
}

impl<const L: usize> EndStops<L> {
    fn new(walk: &[Moment]) -> Self {
        let block = |moments: [&Moment; L]| EndStopBlock {
            knee: columns!(JointMotionLanes, moments, |moment| moment.knee),
            torque: UnitTorqueLanes::default(),
        };
        Self { stop: EndStop::from(&EndStopParams::default()), blocks: blocks(walk, block) }
    }
}

impl<const L: usize> Kernel for EndStops<L> {
    #[inline(always)]
    fn run(&mut self) {
        for block in &mut self.blocks {
            for lane in 0..L {
                let knee = block.knee.get(lane);
                let extension = extension_stop(&self.stop, knee.flexion, knee.flexion_rate);
                let flexion = flexion_stop(&self.stop, knee.flexion, knee.flexion_rate);
                block.torque.torque[lane] = flexion.torque - extension.torque;
                block.torque.damping[lane] = extension.damping + flexion.damping;
                block.torque.stiffness[lane] = extension.stiffness + flexion.stiffness;
            }
        }
    }
}

/// A knee unit: its signals, guards, torques and rates.
struct Units<const L: usize> {
    unit: KneeUnit<L>,
    blocks: Vec<UnitBlock<L>>,
}

struct UnitBlock<const L: usize> {
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
    fn new(kind: DeviceKind, walk: &[Moment]) -> Self {
        let block = |moments: [&Moment; L]| UnitBlock {
            knee: columns!(JointMotionLanes, moments, |moment| moment.knee),
            rotor: columns!(RotorLanes, moments, |moment| moment.rotor),
            direction: moments.map(|moment| moment.rotor.rate.signum()),
            command: moments.map(|moment| moment.command),
            signals: MotorSignalsLanes::default(),
            torques: UnitTorqueLanes::default(),
            rates: RotorLanes::default(),
            fired: [false; L],
        };
        Self { unit: KneeUnit::new(&config(kind)), blocks: blocks(walk, block) }
    }
}

impl<const L: usize> Kernel for Units<L> {
    #[inline(always)]
    fn run(&mut self) {
        const FLEXION_ACCELERATION_RAD_S2: f64 = 10.0;
        for block in &mut self.blocks {
            self.unit.sense(&block.knee, &block.rotor, &block.command, &mut block.signals);
            let at = UnitInputs {
                joint: &block.knee,
                rotor: &block.rotor,
                direction: &block.direction,
                motor: &block.signals,
                command: &block.command,
            };
            self.unit.torques(&at, &[STEP_S; L], &mut block.torques);
            self.unit.rates(&at, &[FLEXION_ACCELERATION_RAD_S2; L], &[STEP_S; L], &mut block.rates);
            block.fired = self.unit.fired(&at);
        }
    }
}

/// The paper's human in a cyclic step at 1.1 m/s.
fn human() -> (Human, Drive) {
    let leg =
        LegGeometry { mass: 75.0, trunk_mass: 62.5, leg_length: 0.92, touch_down_height: 0.86, foot_length: 0.175 };
    let (human, params) = (Human::from(leg), HumanParams::default());
    let drive = Memory::cyclic(&params, 1.1).drive(&human, &Individual::new(&params, HumanVariation::default()));
    (human, drive)
}

/// Templates of thigh and trunk, their filters, and the hip's impedance about what comes out.
struct References<const L: usize> {
    drive: Drive,
    blocks: Vec<ReferenceBlock<L>>,
}

struct ReferenceBlock<const L: usize> {
    time: [f64; L],
    hip: [f64; L],
    hip_rate: [f64; L],
    smooth: ReferenceLanes<L>,
    rates: ReferenceLanes<L>,
    torque: ImpedanceTorqueLanes<L>,
}

impl<const L: usize> References<L> {
    fn new(walk: &[Moment]) -> Self {
        let block = |moments: [&Moment; L]| ReferenceBlock {
            time: moments.map(|moment| moment.time_s - walk[0].time_s),
            hip: moments.map(|moment| moment.hip[0]),
            hip_rate: moments.map(|moment| moment.hip[1]),
            smooth: columns!(ReferenceLanes, moments, |moment| Reference {
                trunk: moment.trunk.angle,
                trunk_rate: moment.trunk.rate,
                hip: moment.hip[0],
                hip_rate: moment.hip[1],
            }),
            rates: ReferenceLanes::default(),
            torque: ImpedanceTorqueLanes::default(),
        };
        Self { drive: human().1, blocks: blocks(walk, block) }
    }
}

impl<const L: usize> Kernel for References<L> {
    #[inline(always)]
    fn run(&mut self) {
        let drive = &self.drive;
        for block in &mut self.blocks {
            for lane in 0..L {
                let smooth = block.smooth.get(lane);
                let thigh = rough_thigh(drive, block.time[lane]);
                let filter = Filter::new(drive, STEP_S);
                let trunk_rate = filter.acceleration(drive.trunk, smooth.trunk, smooth.trunk_rate);
                let hip_rate = filter.acceleration(thigh - drive.trunk, smooth.hip, smooth.hip_rate);
                let rates = Reference {
                    trunk: smooth.trunk_rate + STEP_S * trunk_rate,
                    trunk_rate,
                    hip: smooth.hip_rate + STEP_S * hip_rate,
                    hip_rate,
                };
                block.rates.set(lane, rates);
                let (error, error_rate) = (smooth.hip - block.hip[lane], smooth.hip_rate - block.hip_rate[lane]);
                let torque = impedance(drive.hip_stiffness, drive.hip_damping, drive.hip_limit, error, error_rate);
                block.torque.set(lane, torque);
            }
        }
    }
}

/// Pendulum, thrust and lift of the intact leg.
struct IntactLegs<const L: usize> {
    human: Human,
    drive: Drive,
    blocks: Vec<IntactLegBlock<L>>,
}

struct IntactLegBlock<const L: usize> {
    time: [f64; L],
    motion: MotionLanes<L>,
    force: TrunkForceLanes<L>,
}

impl<const L: usize> IntactLegs<L> {
    fn new(walk: &[Moment]) -> Self {
        let (human, drive) = human();
        let start_x = walk[0].motion.hip_x;
        let block = |moments: [&Moment; L]| IntactLegBlock {
            time: moments.map(|moment| moment.time_s - walk[0].time_s),
            motion: columns!(MotionLanes, moments, |moment| Motion {
                hip_x: moment.motion.hip_x - start_x,
                ..moment.motion
            }),
            force: TrunkForceLanes::default(),
        };
        Self { human, drive, blocks: blocks(walk, block) }
    }
}

impl<const L: usize> Kernel for IntactLegs<L> {
    #[inline(always)]
    fn run(&mut self) {
        for block in &mut self.blocks {
            for lane in 0..L {
                let Motion { hip_x, hip_y, hip_vx, hip_vy, .. } = block.motion.get(lane);
                let force = trunk_force(&self.human, &self.drive, hip_x, hip_y, hip_vx, hip_vy, block.time[lane]);
                block.force.set(lane, force);
            }
        }
    }
}

/// Samples of all sensors.
struct Sampling<const L: usize> {
    model: sensors::Model<L>,
    sensors: Sensors<L>,
    truths: Vec<MeasurandLanes<L>>,
    readings: ReadingsLanes<L>,
}

impl<const L: usize> Sampling<L> {
    fn new(params: &SensorParams, walk: &[Moment]) -> Self {
        let truths = blocks(walk, |moments: [&Moment; L]| columns!(MeasurandLanes, moments, |moment| moment.truth));
        let mut sampling = Self {
            model: sensors::Model::new(params),
            sensors: Sensors::default(),
            readings: ReadingsLanes::default(),
            truths,
        };
        sampling.sensors.seed = std::array::from_fn(|lane| lane as u64);
        sampling.sensors.start(&sampling.model, &[true; L], &sampling.truths[0], &mut sampling.readings);
        sampling
    }
}

impl<const L: usize> Kernel for Sampling<L> {
    #[inline(always)]
    fn run(&mut self) {
        for truth in &self.truths {
            self.sensors.sample(&self.model, truth, &mut self.readings);
        }
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
