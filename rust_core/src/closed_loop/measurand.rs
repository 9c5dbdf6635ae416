//! What there is to measure at the places of the sensors.

use crate::plant::outputs::PlantOutputs;
use crate::sensors;
use crate::signals::{GRAVITY, Measurand};

/// True quantities at the places of the sensors.
#[inline(always)]
pub(super) fn measurand<const L: usize>(
    plant: &PlantOutputs<'_, L>,
    sensors: &sensors::SensorModel<L>,
    lane: usize,
) -> Measurand {
    let motion = plant.motion(lane);
    let reactions = plant.reactions(lane);
    let mass = plant.body(lane).mass;
    let [thigh_imu, shank_imu] = sensors.imu(lane);
    let [thigh_force, shank_force] = plant.specific_forces(lane, thigh_imu, shank_imu);
    let rotor = plant.rotor(lane);
    Measurand {
        knee_angle: plant.knee_flexion(lane),
        tube_force_bw: -reactions.tube_force / (mass * GRAVITY),
        tube_moment_nm_kg: -reactions.tube_torque / mass,
        shank_angle: motion.shank,
        shank_rate: motion.shank_rate,
        shank_force_x: shank_force.forward,
        shank_force_y: shank_force.up,
        thigh_rate: motion.thigh_rate,
        thigh_force_x: thigh_force.forward,
        thigh_force_y: thigh_force.up,
        ankle_moment_nm_kg: -plant.device(lane).ankle / mass,
        motor_position: rotor.angle,
        motor_speed: rotor.rate,
        motor_current: plant.motor_signals(lane).current,
    }
}
