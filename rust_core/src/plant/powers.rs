//! Energy of the human-prosthesis system, and the power of everything that does work on it.

use crate::mechanics::compliant_ground::Contact;
use crate::mechanics::motion::Point;
use crate::mechanics::terrain::Surface;
use crate::mechanics::walker;
use crate::plant::contact_points::hip_point;
use crate::plant::outputs::PlantOutputs;
use crate::schema::record::record;

record! {
    /// Power of everything that does work on the segments, W.
    pub struct Powers {
        hip,
        trunk_rotation,
        trunk_force,
        push,
        knee_command,
        knee_spring,
        knee_friction,
        extension_stop,
        flexion_stop,
        ankle,
        contact_normal,
        contact_tangential,
        socket,
        tube,
    }
}

impl<const L: usize> PlantOutputs<'_, L> {
    /// Kinetic and potential energy of segments and knee unit's rotor.
    pub fn energy(&self, lane: usize) -> walker::Energy {
        let (_, rotor) = self.model.unit.powers(lane, &self.unit_inputs(), &self.signals.unit_torque.get(lane));
        let segments = if let Some((walker, work)) = self.general(lane) {
            let [kinetic, potential] = walker.energy(work);
            walker::Energy { kinetic, potential }
        } else {
            walker::energy(
                &self.model.body.get(lane),
                &self.signals.kinematics.get(lane),
                &self.state.motion.get(lane),
                &self.signals.prescribed.get(lane),
            )
        };
        walker::Energy { kinetic: segments.kinetic + rotor, ..segments }
    }

    /// Powers at the last evaluation, W; their sum is the rate of kinetic plus potential energy.
    pub fn powers(&self, lane: usize) -> Powers {
        let motion = self.state.motion.get(lane);
        let knee_rate = -self.signals.joint.flexion_rate[lane];
        let device = self.signals.device.get(lane);
        let (unit, _) = self.model.unit.powers(lane, &self.unit_inputs(), &self.signals.unit_torque.get(lane));
        let trunk = self.signals.trunk_force.get(lane);
        let joints = self.signals.joints.get(lane);
        let [contact_normal, contact_tangential] = self.contact_powers(lane);
        let ([socket, tube], trunk_rate) = self.general(lane).map_or_else(
            || ([0.0; 2], self.signals.prescribed.rate[lane]),
            |(walker, work)| {
                let (forces, rates) = (walker.forces(work), walker.rates(work));
                let power = |force: [f64; 2], rate: [f64; 2]| force[0] * rate[0] + force[1] * rate[1];
                ([power(forces.socket, rates.socket), power(forces.tube, rates.tube)], rates.trunk)
            },
        );
        Powers {
            hip: self.signals.hip_torque.torque[lane] * joints.hip_rate,
            trunk_rotation: self.reactions(lane).trunk_torque * trunk_rate,
            trunk_force: trunk.x * motion.hip_vx + trunk.y * motion.hip_vy,
            push: self.walkers.push_x[lane] * motion.hip_vx + self.walkers.push_y[lane] * motion.hip_vy,
            knee_command: unit[0],
            knee_spring: unit[1],
            knee_friction: unit[2],
            extension_stop: -device.extension_stop * knee_rate,
            flexion_stop: device.flexion_stop * knee_rate,
            ankle: device.ankle * joints.ankle_rate,
            contact_normal,
            contact_tangential,
            socket,
            tube,
        }
    }

    /// Power of the ground's normal and tangential forces, W.
    fn contact_powers(&self, lane: usize) -> [f64; 2] {
        let motion = self.state.motion.get(lane);
        let power = |contact: Contact, surface: Surface, point: Point| {
            let (along, across) = surface.along_and_across(point.vx, point.vy);
            [contact.normal * across, contact.tangential * along]
        };
        let usual = self.signals.contacts.iter().zip(&self.signals.surfaces).map(|(c, s)| (c.get(lane), s.get(lane)));
        let powers: Vec<[f64; 2]> = if let Some((walker, work)) = self.general(lane) {
            let more = self.signals.general.iter().flat_map(|general| general.contacts.iter().zip(&general.surfaces));
            let more = more.map(|(c, s)| (c.get(lane), s.get(lane)));
            let point = |index| walker.point(work, index);
            usual.chain(more).enumerate().map(|(i, (contact, surface))| power(contact, surface, point(i))).collect()
        } else {
            let kin = self.signals.kinematics.get(lane);
            let points = [
                walker::foot_point(&motion, &kin, kin.heel_x, kin.heel_y),
                walker::foot_point(&motion, &kin, kin.ball_x, kin.ball_y),
                walker::knee_point(&motion, &kin),
                hip_point(&motion),
            ];
            usual.zip(points).map(|((contact, surface), point)| power(contact, surface, point)).collect()
        };
        powers.iter().fold([0.0; 2], |sum, power| [sum[0] + power[0], sum[1] + power[1]])
    }
}
