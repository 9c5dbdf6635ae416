//! Equations of the human on inputs from a steady walk.

use criterion::Criterion;

use prosthesis_gym_core::human::drive::{Drive, DriveLanes};
use prosthesis_gym_core::human::gait_fsm::Memory;
use prosthesis_gym_core::human::geometry::{Human, HumanLanes, LegGeometry};
use prosthesis_gym_core::human::impedance::{ImpedanceTorqueLanes, impedance};
use prosthesis_gym_core::human::params::HumanParams;
use prosthesis_gym_core::human::reference::{Filter, Reference, ReferenceLanes, rough_thigh};
use prosthesis_gym_core::human::slip_leg::{TrunkForceLanes, trunk_force};
use prosthesis_gym_core::human::variation::{HumanVariation, Individual};
use prosthesis_gym_core::mechanics::motion::{Motion, MotionLanes};
use prosthesis_gym_core::prosthesis::knee::kind::DeviceKind;

use crate::walk::{Block, LANES, Moment, STEP_S, blocks, columns, compare, stride};

/// References and intact leg.
pub fn all(criterion: &mut Criterion) {
    let walk = stride(DeviceKind::Damper);
    compare(criterion, "human references", References::<1>::new(&walk), References::<LANES>::new(&walk));
    compare(criterion, "intact leg", IntactLegs::<1>::new(&walk), IntactLegs::<LANES>::new(&walk));
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
    time: [f64; L],
    hip: [f64; L],
    hip_rate: [f64; L],
    smooth: ReferenceLanes<L>,
    rates: ReferenceLanes<L>,
    torque: ImpedanceTorqueLanes<L>,
}

impl<const L: usize> References<L> {
    fn new(walk: &[Moment]) -> (DriveLanes<L>, Vec<Self>) {
        let block = |moments: [&Moment; L]| Self {
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
        (DriveLanes::splat(human().1), blocks(walk, block))
    }
}

impl<const L: usize> Block for References<L> {
    type Constants = DriveLanes<L>;

    #[inline(always)]
    fn run(&mut self, drive: &DriveLanes<L>) {
        for lane in 0..L {
            let (drive, smooth) = (drive.get(lane), self.smooth.get(lane));
            let thigh = rough_thigh(&drive, self.time[lane]);
            let filter = Filter::new(&drive, STEP_S);
            let trunk_rate = filter.acceleration(drive.trunk, smooth.trunk, smooth.trunk_rate);
            let hip_rate = filter.acceleration(thigh - drive.trunk, smooth.hip, smooth.hip_rate);
            let rates = Reference {
                trunk: smooth.trunk_rate + STEP_S * trunk_rate,
                trunk_rate,
                hip: smooth.hip_rate + STEP_S * hip_rate,
                hip_rate,
            };
            self.rates.set(lane, rates);
            let (error, error_rate) = (smooth.hip - self.hip[lane], smooth.hip_rate - self.hip_rate[lane]);
            let torque = impedance(drive.hip_stiffness, drive.hip_damping, drive.hip_limit, error, error_rate);
            self.torque.set(lane, torque);
        }
    }
}

/// Pendulum, thrust and lift of the intact leg.
struct IntactLegs<const L: usize> {
    time: [f64; L],
    motion: MotionLanes<L>,
    force: TrunkForceLanes<L>,
}

impl<const L: usize> IntactLegs<L> {
    fn new(walk: &[Moment]) -> ((HumanLanes<L>, DriveLanes<L>), Vec<Self>) {
        let (human, drive) = human();
        let start_x = walk[0].motion.hip_x;
        let block = |moments: [&Moment; L]| Self {
            time: moments.map(|moment| moment.time_s - walk[0].time_s),
            motion: columns!(MotionLanes, moments, |moment| Motion {
                hip_x: moment.motion.hip_x - start_x,
                ..moment.motion
            }),
            force: TrunkForceLanes::default(),
        };
        ((HumanLanes::splat(human), DriveLanes::splat(drive)), blocks(walk, block))
    }
}

impl<const L: usize> Block for IntactLegs<L> {
    type Constants = (HumanLanes<L>, DriveLanes<L>);

    #[inline(always)]
    fn run(&mut self, (human, drive): &(HumanLanes<L>, DriveLanes<L>)) {
        for lane in 0..L {
            let Motion { hip_x, hip_y, hip_vx, hip_vy, .. } = self.motion.get(lane);
            let force = trunk_force(&human.get(lane), &drive.get(lane), hip_x, hip_y, hip_vx, hip_vy, self.time[lane]);
            self.force.set(lane, force);
        }
    }
}
