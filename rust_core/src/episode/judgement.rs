//! What a control period was worth, and whether it ended the episode: reward and termination of a sampled walker.

use crate::closed_loop::simulation::Sampled;
use crate::episode::reward::{self, Outcome, TermsLanes};
use crate::episode::termination::{Posture, PostureLanes, Reason, TerminationParams};
use crate::numerics::math::{max, select};
use crate::signals::GRAVITY;

/// Terms of the control period that has just passed, and which of the lanes it has ended and why.
///
/// A hip below `fall_height` (m) counts as a fall, `last_sample` is the episode's end, `changes` are those of the commands over
/// that of a full action.
#[inline(always)]
pub fn judge<const L: usize>(
    sampled: &Sampled<'_, L>,
    limits: &TerminationParams,
    fall_height: &[f64; L],
    last_sample: u64,
    changes: &[f64; L],
) -> (TermsLanes<L>, [Reason; L]) {
    let mut postures = PostureLanes::<L>::default();
    for lane in 0..L {
        postures.set(lane, posture(sampled, fall_height[lane], lane));
    }
    let mut failed = [false; L];
    for lane in 0..L {
        failed[lane] = limits.ends(&postures.get(lane));
    }
    let mut terms = TermsLanes::default();
    for lane in 0..L {
        let outcome = outcome(sampled, lane, changes[lane]);
        terms.set(lane, reward::terms(&outcome, failed[lane], postures.diverged[lane]));
    }
    let mut reasons = [Reason::None; L];
    for lane in 0..L {
        if failed[lane] {
            reasons[lane] = limits.reason(&postures.get(lane));
        } else if sampled.simulation.sample[lane] >= last_sample {
            reasons[lane] = Reason::TimeLimit;
        }
    }
    (terms, reasons)
}

#[inline(always)]
fn posture<const L: usize>(sampled: &Sampled<'_, L>, fall_height: f64, lane: usize) -> Posture {
    let plant = sampled.plant();
    Posture {
        hip_clearance: plant.hip_height(lane) - fall_height,
        knee_flexion: plant.knee_flexion(lane),
        ankle: plant.joints(lane).ankle,
        diverged: sampled.simulation.diverged[lane],
    }
}

#[inline(always)]
fn outcome<const L: usize>(sampled: &Sampled<'_, L>, lane: usize, command_change: f64) -> Outcome {
    let plant = sampled.plant();
    let mass = plant.body(lane).mass;
    let [rear, front] = plant.sole_load(lane);
    let heel_speed = select(plant.contact_force(0, lane) > 0.0, plant.foot_point(0, lane).vx, 0.0);
    let ball_speed = select(plant.contact_force(1, lane) > 0.0, plant.foot_point(1, lane).vx, 0.0);
    Outcome {
        extension_stop_peak: sampled.simulation.walkers.extension_stop_peak[lane],
        mass,
        hip_power: plant.hip_torque(lane) * plant.joints(lane).hip_rate,
        electrical_power: plant.electrical_powers(lane)[0],
        knee_angle: plant.knee_flexion(lane),
        tube_force_bw: sampled.scratch.truth.tube_force_bw[lane],
        ground_force_bw: (rear + front) / (mass * GRAVITY),
        sole_speed: max(max(heel_speed, ball_speed), 0.0),
        command_change,
    }
}
