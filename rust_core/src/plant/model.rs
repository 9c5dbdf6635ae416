//! Constants of the human-prosthesis system: what no step changes.

use crate::human::geometry::{Human, HumanLanes, LegGeometry};
use crate::human::params::HumanParams;
use crate::mechanics::body::{Body, BodyLanes};
use crate::mechanics::compliant_ground::{Ground, GroundLanes};
use crate::mechanics::terrain::{self, Surface, Terrain, TerrainLanes};
use crate::mechanics::walker;
use crate::plant::contact_points::HEEL;
use crate::plant::general_model::GeneralModel;
use crate::plant::params::PlantParams;
use crate::plant::posture::touch_down_posture;
use crate::plant::state::State;
use crate::prosthesis::ankle::passive_ankle::{Ankle, AnkleLanes};
use crate::prosthesis::end_stop::{EndStop, EndStopLanes};
use crate::prosthesis::knee::unit::KneeUnit;

/// Constants of a block of walkers. Blocks of equal walkers share one.
#[derive(Clone, Debug)]
pub struct PlantModel<const L: usize> {
    pub(super) body: BodyLanes<L>,
    pub(super) ground: GroundLanes<L>,
    pub(super) terrain: TerrainLanes<L>,
    /// Whether all of the block's ground is level, as the paper's.
    pub(super) level: bool,
    pub(super) human: HumanLanes<L>,
    /// Knee unit.
    pub unit: KneeUnit<L>,
    pub(super) end_stop: EndStopLanes<L>,
    pub(super) ankle: AnkleLanes<L>,
    pub(super) human_params: [HumanParams; L],
    /// Contact points of the sole in the foot frame, heel and ball first, m.
    pub(super) sole: [Vec<[f64; 2]>; L],
    /// Top of the trunk above the hip, m.
    pub(super) trunk_top: [f64; L],
    /// Of walkers with more joints than the usual ones.
    pub(super) general: Option<Box<GeneralModel<L>>>,
}

impl<const L: usize> PlantModel<L> {
    /// Walkers with the given parameters.
    pub fn new(params: &PlantParams<'_>) -> Self {
        let body = Body::from(params.body);
        let terrain = Terrain::from(params.ground);
        Self {
            body: BodyLanes::splat(body),
            ground: GroundLanes::splat(Ground::from(params.ground)),
            terrain: TerrainLanes::splat(terrain),
            level: terrain.is_level(),
            human: HumanLanes::splat(human(&body, params.human)),
            unit: KneeUnit::new(&params.knee),
            end_stop: EndStopLanes::splat(EndStop::from(params.end_stop)),
            ankle: AnkleLanes::splat(Ankle::from(params.ankle)),
            human_params: std::array::from_fn(|_| params.human.clone()),
            sole: std::array::from_fn(|_| params.body.sole()),
            trunk_top: [params.body.trunk_top_m; L],
            general: GeneralModel::new(params, body.mass),
        }
    }

    /// Gives the walker in `lane` parameters of its own, which must make a walker of the same kind. From then on the block's
    /// ground counts as uneven, even where it is not, so that no lane's path through the code depends on its neighbours.
    pub fn set(&mut self, lane: usize, params: &PlantParams<'_>, uneven: bool) {
        let body = Body::from(params.body);
        self.body.set(lane, body);
        self.ground.set(lane, Ground::from(params.ground));
        self.terrain.set(lane, Terrain::from(params.ground));
        self.level &= !uneven;
        self.human.set(lane, human(&body, params.human));
        self.unit.set(lane, &params.knee);
        self.end_stop.set(lane, EndStop::from(params.end_stop));
        self.ankle.set(lane, Ankle::from(params.ankle));
        self.human_params[lane].clone_from(params.human);
        self.sole[lane] = params.body.sole();
        self.trunk_top[lane] = params.body.trunk_top_m;
        if let Some(general) = &mut self.general {
            general.set(lane, params, body.mass);
        }
    }

    /// Memory beside itself.
    pub fn heap_bytes(&self) -> usize {
        let soles = self.sole.iter().map(|points| size_of_val(&**points)).sum::<usize>();
        soles + self.general.as_ref().map_or(0, |general| general.bytes())
    }

    /// A state for walkers like these; [`HumanProsthesis::start`](crate::plant::system::HumanProsthesis::start) sets it.
    pub fn state(&self) -> State<L> {
        let general = self.general.as_ref().map(|general| Box::new(general.state()));
        State { general, turns: self.unit.has_rotor(), ..State::default() }
    }

    /// Mechanical constants.
    #[inline(always)]
    pub fn body(&self, lane: usize) -> Body {
        self.body.get(lane)
    }

    /// Height of the ground at `x`, m.
    #[inline(always)]
    pub fn ground_height(&self, lane: usize, x: f64) -> f64 {
        if self.level { 0.0 } else { terrain::surface(&self.terrain.get(lane), x).height }
    }

    /// The ground at `x`.
    pub(super) fn surface_at(&self, lane: usize, x: f64) -> Surface {
        if self.level { Surface::LEVEL } else { terrain::surface(&self.terrain.get(lane), x) }
    }

    #[inline(always)]
    pub(super) fn surface<const LEVEL: bool>(&self, lane: usize, x: f64) -> Surface {
        if LEVEL { Surface::LEVEL } else { terrain::surface(&self.terrain.get(lane), x) }
    }

    /// Whether the trunk is a forward joint.
    pub(super) fn trunk_forward(&self) -> bool {
        self.general.as_ref().is_some_and(|general| general.trunk_forward)
    }

    /// Heel of the sole in the foot frame, m.
    pub(super) fn heel(&self, lane: usize) -> [f64; 2] {
        self.sole[lane][HEEL]
    }
}

/// What the human controller is scheduled on.
fn human(body: &Body, params: &HumanParams) -> Human {
    let kin = walker::kinematics(body, &touch_down_posture(body, params), 0.0);
    Human::from(LegGeometry {
        mass: body.mass,
        trunk_mass: body.trunk_mass,
        leg_length: body.thigh_length + body.shank_length - body.sole_y,
        touch_down_height: -(kin.thigh_y + kin.shank_y + kin.heel_y),
        foot_length: body.ball_x - body.heel_x,
    })
}
