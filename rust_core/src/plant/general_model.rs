//! Constants of general walkers, and what their evaluation leaves behind.

use crate::mechanics::compliant_ground::{ContactLanes, Ground};
use crate::mechanics::general_walker::{GeneralWalker, Layout, WalkerWorkspace};
use crate::mechanics::joint_drives::JointDrive;
use crate::mechanics::terrain::{Surface, SurfaceLanes};
use crate::plant::contact_force::point_force;
use crate::plant::contact_points::{CONTACT_POINTS, KNEE};
use crate::plant::params::PlantParams;
use crate::plant::state::GeneralState;
use crate::prosthesis::socket::socket;
use crate::prosthesis::spring_damper::{Connection, SpringDamper};
use crate::prosthesis::tube::tube;

/// Constants of a block of general walkers.
#[derive(Clone, Debug)]
pub(super) struct GeneralModel<const L: usize> {
    pub walkers: Vec<GeneralWalker>,
    pub socket: [[SpringDamper; 2]; L],
    pub tube: [Option<[SpringDamper; 2]>; L],
    pub trunk_forward: bool,
    pub hip_forward: bool,
    /// How many contacts after heel, ball, knee and hip there are, how many of them belong to the sole, and to its rear half.
    more: usize,
    sole: usize,
    rear: usize,
    /// Share of the paper's stiffness and damping that a point of the sole has: together they are as stiff as its two.
    sole_share: f64,
}

/// What an evaluation of general walkers leaves behind.
#[derive(Clone, Debug)]
pub(super) struct GeneralSignals<const L: usize> {
    pub evaluations: Vec<WalkerWorkspace>,
    /// Contacts after heel, ball, knee and hip, and the surfaces below them.
    pub contacts: Vec<ContactLanes<L>>,
    pub surfaces: Vec<SurfaceLanes<L>>,
}

impl<const L: usize> GeneralSignals<L> {
    /// Storage for evaluations of walkers like these.
    pub fn new(model: &GeneralModel<L>) -> Self {
        Self {
            evaluations: vec![WalkerWorkspace::default(); L],
            contacts: vec![ContactLanes::default(); model.more],
            surfaces: vec![SurfaceLanes::splat(Surface::LEVEL); model.more],
        }
    }
}

impl<const L: usize> GeneralModel<L> {
    /// The general walkers that the configuration asks for; `None` if they are the usual ones.
    pub fn new(params: &PlantParams<'_>, mass: f64) -> Option<Box<Self>> {
        let (layout, sole) = (layout(params), params.body.sole_points - 2);
        let usual = Layout { trunk_forward: false, hip_forward: true, socket: None, tube_forward: false };
        if layout == usual && sole == 0 {
            return None;
        }
        let walker = walker(params, &layout);
        Some(Box::new(Self {
            more: walker.points() - CONTACT_POINTS,
            walkers: vec![walker; L],
            socket: [socket(params.socket, mass); L],
            tube: [tube_of(params, &layout); L],
            trunk_forward: layout.trunk_forward,
            hip_forward: layout.hip_forward,
            sole,
            rear: sole / 2,
            sole_share: 2.0 / params.body.sole_points as f64,
        }))
    }

    /// Gives the walker in `lane` parameters of its own, with the same joints and contact points.
    pub fn set(&mut self, lane: usize, params: &PlantParams<'_>, mass: f64) {
        let layout = layout(params);
        self.walkers[lane] = walker(params, &layout);
        self.socket[lane] = socket(params.socket, mass);
        self.tube[lane] = tube_of(params, &layout);
    }

    /// Memory of them.
    pub fn bytes(&self) -> usize {
        size_of::<Self>() + self.walkers.iter().map(GeneralWalker::bytes).sum::<usize>()
    }

    /// State of walkers like these, at rest.
    pub fn state(&self) -> GeneralState<L> {
        GeneralState { deformation: vec![[0.0; L]; self.more], ..GeneralState::default() }
    }

    /// The ground as contact point `index` feels it.
    pub fn ground_at(&self, ground: &Ground, index: usize) -> Ground {
        let sole = index < KNEE || (CONTACT_POINTS..CONTACT_POINTS + self.sole).contains(&index);
        let share = if sole { self.sole_share } else { 1.0 };
        Ground { stiffness: share * ground.stiffness, damping: share * ground.damping, ..*ground }
    }

    /// Normal force on the points of the sole between heel and ball, N: of its rear half, of its front half.
    pub fn sole_load(&self, signals: &GeneralSignals<L>, lane: usize) -> [f64; 2] {
        let sum = |contacts: &[ContactLanes<L>]| contacts.iter().map(|contact| contact.normal[lane]).sum();
        [sum(&signals.contacts[..self.rear]), sum(&signals.contacts[self.rear..self.sole])]
    }

    /// The same with direction: forward and up, N.
    pub fn sole_force(&self, signals: &GeneralSignals<L>, lane: usize) -> [[f64; 2]; 2] {
        [0..self.rear, self.rear..self.sole].map(|half| {
            let points = signals.contacts[half.clone()].iter().zip(&signals.surfaces[half]);
            points
                .map(|(contact, surface)| point_force(&contact.get(lane), &surface.get(lane)))
                .fold([0.0; 2], |sum, force| [sum[0] + force.x, sum[1] + force.y])
        })
    }
}

fn layout(params: &PlantParams<'_>) -> Layout {
    Layout {
        trunk_forward: params.mechanism.trunk == JointDrive::Forward,
        hip_forward: params.mechanism.hip == JointDrive::Forward,
        socket: (params.socket.connection == Connection::Compliant).then_some(params.socket.place),
        tube_forward: params.tube.connection == Connection::Compliant,
    }
}

fn walker(params: &PlantParams<'_>, layout: &Layout) -> GeneralWalker {
    GeneralWalker::new(params.body, layout).expect("segments within their ranges make a chain")
}

fn tube_of(params: &PlantParams<'_>, layout: &Layout) -> Option<[SpringDamper; 2]> {
    let body = params.body;
    layout.tube_forward.then(|| tube(params.tube, body.foot_mass_kg, body.foot_inertia_about_tube()))
}
