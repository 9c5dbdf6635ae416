//! Continuous state of the human-prosthesis system.

use crate::human::reference::{Reference, ReferenceLanes};
use crate::mechanics::general_walker::{Deflection, DeflectionLanes};
use crate::mechanics::motion::{Motion, MotionLanes};
use crate::numerics::integrator::StateVector;
use crate::numerics::lanes::{integrable, lanes};
use crate::prosthesis::knee::motor::geared_motor::{Rotor, RotorLanes};

/// Continuous state.
#[derive(Clone, Debug, Default)]
pub struct State<const L: usize> {
    /// Forward-dynamics coordinates.
    pub motion: MotionLanes<L>,
    /// Smooth references of trunk and hip.
    pub reference: ReferenceLanes<L>,
    /// Time and ground deformation.
    pub rest: RestLanes<L>,
    /// Rotor of the knee unit.
    pub rotor: RotorLanes<L>,
    /// Whether the knee unit has one; without, `rotor` stays zero.
    pub turns: bool,
    /// What only a general walker has.
    pub general: Option<Box<GeneralState<L>>>,
}

impl<const L: usize> State<L> {
    /// Memory beside itself.
    pub fn heap_bytes(&self) -> usize {
        self.general.as_ref().map_or(0, |general| size_of::<GeneralState<L>>() + size_of_val(&*general.deformation))
    }
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
integrable!(RestLanes { time, heel, ball, knee, hip });

/// Continuous state of one walker.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct WalkerState {
    motion: Motion,
    reference: Reference,
    rest: Rest,
    rotor: Rotor,
    /// Deflections, their rates and deformations of a general walker.
    general: Option<(Deflection, Deflection, Vec<f64>)>,
}

/// State of a general walker beyond the usual one's.
#[derive(Clone, Debug, Default)]
pub struct GeneralState<const L: usize> {
    /// Deflections of what is rigid in the usual walker.
    pub deflection: DeflectionLanes<L>,
    /// Their rates.
    pub deflection_rate: DeflectionLanes<L>,
    /// Deformation of the ground at the contact points after heel, ball, knee and hip, m.
    pub deformation: Vec<[f64; L]>,
}

impl<const L: usize> StateVector<L> for GeneralState<L> {
    fn add_scaled(&mut self, base: &Self, step: &[f64; L], rate: &Self) {
        self.deflection.add_scaled(&base.deflection, step, &rate.deflection);
        self.deflection_rate.add_scaled(&base.deflection_rate, step, &rate.deflection_rate);
        for ((sum, base), rate) in self.deformation.iter_mut().zip(&base.deformation).zip(&rate.deformation) {
            for lane in 0..L {
                sum[lane] = step[lane].mul_add(rate[lane], base[lane]);
            }
        }
    }

    fn interpolate(&mut self, start: &Self, end: &Self, share: &[f64; L]) {
        self.deflection.interpolate(&start.deflection, &end.deflection, share);
        self.deflection_rate.interpolate(&start.deflection_rate, &end.deflection_rate, share);
        for ((between, start), end) in self.deformation.iter_mut().zip(&start.deformation).zip(&end.deformation) {
            for lane in 0..L {
                between[lane] = share[lane].mul_add(end[lane] - start[lane], start[lane]);
            }
        }
    }
}

impl<const L: usize> StateVector<L> for State<L> {
    #[inline(always)]
    fn add_scaled(&mut self, base: &Self, step: &[f64; L], rate: &Self) {
        self.motion.add_scaled(&base.motion, step, &rate.motion);
        self.reference.add_scaled(&base.reference, step, &rate.reference);
        self.rest.add_scaled(&base.rest, step, &rate.rest);
        if self.turns {
            self.rotor.add_scaled(&base.rotor, step, &rate.rotor);
        }
        if let (Some(sum), Some(base), Some(rate)) = (&mut self.general, &base.general, &rate.general) {
            sum.add_scaled(base, step, rate);
        }
    }

    #[inline(always)]
    fn interpolate(&mut self, start: &Self, end: &Self, share: &[f64; L]) {
        self.motion.interpolate(&start.motion, &end.motion, share);
        self.reference.interpolate(&start.reference, &end.reference, share);
        self.rest.interpolate(&start.rest, &end.rest, share);
        if self.turns {
            self.rotor.interpolate(&start.rotor, &end.rotor, share);
        }
        if let (Some(between), Some(start), Some(end)) = (&mut self.general, &start.general, &end.general) {
            between.interpolate(start, end, share);
        }
    }
}

impl<const L: usize> State<L> {
    /// The walker in `lane`.
    pub fn get(&self, lane: usize) -> WalkerState {
        let general = self.general.as_ref().map(|general| {
            let deformation = general.deformation.iter().map(|column| column[lane]).collect();
            (general.deflection.get(lane), general.deflection_rate.get(lane), deformation)
        });
        WalkerState {
            motion: self.motion.get(lane),
            reference: self.reference.get(lane),
            rest: self.rest.get(lane),
            rotor: self.rotor.get(lane),
            general,
        }
    }

    /// Replaces the walker in `lane` by one of the same kind.
    pub fn set(&mut self, lane: usize, walker: &WalkerState) {
        self.motion.set(lane, walker.motion);
        self.reference.set(lane, walker.reference);
        self.rest.set(lane, walker.rest);
        self.rotor.set(lane, walker.rotor);
        if let (Some(general), Some((deflection, rate, deformation))) = (&mut self.general, &walker.general) {
            general.deflection.set(lane, *deflection);
            general.deflection_rate.set(lane, *rate);
            for (column, &value) in general.deformation.iter_mut().zip(deformation) {
                column[lane] = value;
            }
        }
    }

    /// Sum of all state variables of a lane: finite only if all of them are.
    #[inline(always)]
    pub fn checksum(&self, lane: usize) -> f64 {
        let m = self.motion.get(lane);
        let r = self.reference.get(lane);
        let d = self.rest.get(lane);
        let general = self.general.as_ref().map_or(0.0, |general| general.checksum(lane));
        (m.hip_x + m.hip_y + m.thigh + m.shank + m.foot)
            + (m.hip_vx + m.hip_vy + m.thigh_rate + m.shank_rate + m.foot_rate)
            + (r.trunk + r.trunk_rate + r.hip + r.hip_rate)
            + (d.heel + d.ball + d.knee + d.hip)
            + (self.rotor.angle[lane] + self.rotor.rate[lane])
            + general
    }
}

impl<const L: usize> GeneralState<L> {
    fn checksum(&self, lane: usize) -> f64 {
        let sum = [&self.deflection, &self.deflection_rate].map(|d| {
            let d = d.get(lane);
            d.trunk + d.socket_shift + d.socket_tilt + d.tube_shift + d.tube_tilt
        });
        sum[0] + sum[1] + self.deformation.iter().map(|column| column[lane]).sum::<f64>()
    }
}
