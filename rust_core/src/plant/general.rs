//! The system with a general walker: the same blocks, wired to the general chain walker by walker instead of lane by lane.

use crate::human::impedance::ImpedanceTorque;
use crate::mechanics::compliant_ground::{self, ContactLanes};
use crate::mechanics::general_walker::Deflection;
use crate::mechanics::motion::{JointTorque, Prescribed};
use crate::mechanics::terrain::SurfaceLanes;
use crate::plant::contact_force::{point_force, touch};
use crate::plant::contact_points::{BALL, CONTACT_POINTS, HEEL, HIP, KNEE};
use crate::plant::general_model::GeneralSignals;
use crate::plant::state::{Rest, State};
use crate::plant::system::HumanProsthesis;
use crate::plant::torques::{EndJoints, trunk_torque};
use crate::prosthesis::knee::joint::JointMotion;
use crate::prosthesis::spring_damper::SpringDamper;

fn springs([first, second]: [SpringDamper; 2]) -> [(f64, f64); 2] {
    [(first.stiffness, first.damping), (second.stiffness, second.damping)]
}

fn joint_torque(impedance: &ImpedanceTorque) -> JointTorque {
    JointTorque { torque: impedance.torque, damping: impedance.damping, stiffness: impedance.stiffness }
}

impl<const L: usize> HumanProsthesis<'_, L> {
    /// Contacts and joints of general walkers.
    pub(super) fn sense_general(&mut self, general: &mut GeneralSignals<L>, state: &State<L>) {
        let (Some(model), Some(extra)) = (&self.model.general, &state.general) else { return };
        for lane in 0..L {
            let (walker, work) = (&model.walkers[lane], &mut general.evaluations[lane]);
            let smooth = state.reference.get(lane);
            let trunk = Prescribed { angle: smooth.trunk, rate: smooth.trunk_rate, acceleration: 0.0 };
            let motion = state.motion.get(lane);
            let (deflection, rates) = (extra.deflection.get(lane), extra.deflection_rate.get(lane));
            walker.assume(work, &motion, &deflection, &rates, &trunk);

            let [(flexion, flexion_rate), (hip, hip_rate), (ankle, ankle_rate)] = walker.joints(work);
            self.signals.joint.set(lane, JointMotion { flexion, flexion_rate });
            self.signals.joints.set(lane, EndJoints { hip, hip_rate, ankle, ankle_rate });

            let ground = self.model.ground.get(lane);
            let rest = state.rest.get(lane);
            let usual = [rest.heel, rest.ball, rest.knee, rest.hip];
            for index in 0..walker.points() {
                let point = walker.point(&general.evaluations[lane], index);
                let surface = self.model.surface_at(lane, point.x);
                let more = index.checked_sub(CONTACT_POINTS);
                let deformation = more.map_or_else(|| usual[index], |more| extra.deformation[more][lane]);
                let contact = touch::<false>(&model.ground_at(&ground, index), &surface, &point, deformation);
                let (contacts, surfaces) = match more {
                    None => (&mut self.signals.contacts[index], &mut self.signals.surfaces[index]),
                    Some(more) => (&mut general.contacts[more], &mut general.surfaces[more]),
                };
                contacts.set(lane, contact);
                surfaces.set(lane, surface);
            }
            let heel = walker.point(&general.evaluations[lane], HEEL);
            self.signals.midfoot[lane] = heel.x + 0.5 * self.model.human.foot_length[lane] - motion.hip_x;
            self.signals.heel_force[lane] =
                self.signals.contacts[HEEL].normal[lane] + model.sole_load(general, lane)[0];
            let reach = self.model.human.leg_length[lane] * self.model.human.touch_down_sin[lane];
            self.signals.ground_ahead[lane] = self.model.ground_height(lane, motion.hip_x + reach);
        }
    }

    /// Hybrid dynamics of general walkers, and the rates of the state that follow from it.
    pub(super) fn move_general(
        &mut self,
        general: &mut GeneralSignals<L>,
        state: &State<L>,
        implicit_step: &[f64; L],
        rates: &mut State<L>,
    ) {
        let Some(model) = &self.model.general else { return };
        let (Some(extra), Some(extra_rates)) = (&state.general, &mut rates.general) else { return };
        for lane in 0..L {
            let step = implicit_step[lane];
            let smooth = state.reference.get(lane);
            let (walker, work) = (&model.walkers[lane], &mut general.evaluations[lane]);
            let (deflection, deflection_rate) = (extra.deflection.get(lane), extra.deflection_rate.get(lane));

            walker.begin(work, self.signals.prescribed.acceleration[lane], rates.reference.hip_rate[lane]);
            if model.trunk_forward {
                let torque =
                    trunk_torque(&self.walkers.drive.get(lane), deflection.trunk, deflection_rate.trunk, &smooth);
                walker.drive_trunk(work, &joint_torque(&torque), torque.error_rate, step);
            }
            if model.hip_forward {
                let torque = self.signals.hip_torque.get(lane);
                walker.drive_hip(work, &joint_torque(&torque), torque.error_rate, step);
            }
            let (device, ankle) = (self.signals.device.get(lane), self.model.ankle.get(lane));
            let knee =
                JointTorque { torque: device.knee, damping: device.knee_damping, stiffness: device.knee_stiffness };
            let ankle = JointTorque { torque: device.ankle, damping: ankle.damping, stiffness: ankle.stiffness };
            walker.drive_device(work, &knee, &ankle, step);
            walker.drive_socket(work, springs(model.socket[lane]), step);
            if let Some(tube) = model.tube[lane] {
                walker.drive_tube(work, springs(tube), step);
            }
            let trunk = self.signals.trunk_force.get(lane);
            walker.push_trunk(work, trunk.x + self.walkers.push_x[lane], trunk.y + self.walkers.push_y[lane]);
            let usual = self.signals.contacts.iter().zip(&self.signals.surfaces);
            let more = general.contacts.iter().zip(&general.surfaces);
            for (index, (contact, surface)) in usual.chain(more).enumerate() {
                walker.push_point(work, index, &point_force(&contact.get(lane), &surface.get(lane)), step);
            }
            walker.solve(work);

            let work = &general.evaluations[lane];
            let acceleration = walker.acceleration(work);
            self.signals.acceleration.set(lane, acceleration);
            self.signals.flexion_acceleration[lane] = walker.flexion_acceleration(work);
            if !model.hip_forward {
                self.signals.hip_torque.torque[lane] = walker.forces(work).hip;
            }
            rates.motion.set(lane, acceleration.rates(&state.motion.get(lane), step));
            let second = walker.deflection_acceleration(work);
            extra_rates.deflection_rate.set(lane, second);
            extra_rates.deflection.set(
                lane,
                Deflection {
                    trunk: deflection_rate.trunk + step * second.trunk,
                    socket_shift: deflection_rate.socket_shift + step * second.socket_shift,
                    socket_tilt: deflection_rate.socket_tilt + step * second.socket_tilt,
                    tube_shift: deflection_rate.tube_shift + step * second.tube_shift,
                    tube_tilt: deflection_rate.tube_tilt + step * second.tube_tilt,
                },
            );

            let ground = self.model.ground.get(lane);
            let follow = |index: usize, contact: &ContactLanes<L>, surface: &SurfaceLanes<L>, deformation: f64| {
                let [vx, vy] = walker.end_velocity(work, index, step);
                let (along, _) = surface.get(lane).along_and_across(vx, vy);
                let ground = model.ground_at(&ground, index);
                compliant_ground::deformation_rate(&ground, &contact.get(lane), deformation, along, step)
            };
            let rest = state.rest.get(lane);
            let usual = |index: usize, deformation: f64| {
                follow(index, &self.signals.contacts[index], &self.signals.surfaces[index], deformation)
            };
            let deformation_rates = Rest {
                time: 1.0,
                heel: usual(HEEL, rest.heel),
                ball: usual(BALL, rest.ball),
                knee: usual(KNEE, rest.knee),
                hip: usual(HIP, rest.hip),
            };
            rates.rest.set(lane, deformation_rates);
            for more in 0..general.contacts.len() {
                let deformation = extra.deformation[more][lane];
                extra_rates.deformation[more][lane] =
                    follow(CONTACT_POINTS + more, &general.contacts[more], &general.surfaces[more], deformation);
            }
        }
    }

    /// Puts the general part of a walker in `lane` at rest with its trunk at `trunk` (rad).
    pub(super) fn start_general(state: &mut State<L>, lane: usize, trunk: f64) {
        if let Some(extra) = &mut state.general {
            extra.deflection.set(lane, Deflection { trunk, ..Deflection::default() });
            extra.deflection_rate.set(lane, Deflection::default());
            extra.deformation.iter_mut().for_each(|column| column[lane] = 0.0);
        }
    }
}
