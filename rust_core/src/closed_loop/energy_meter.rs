//! Energy meter: the work of every force, integrated beside the state by the same stepper.
//!
//! Kinetic plus potential energy must change by exactly the sum of all work: a check that the derivation of the dynamics
//! did not use.

use crate::numerics::integrator::{self, HybridFlow, StateVector, Workspace};
use crate::plant::powers::Powers;
use crate::plant::solver::SolverParams;
use crate::plant::state::State;
use crate::plant::system::HumanProsthesis;
use crate::signals::CONTROL_PERIOD_S;

const POWERS: usize = Powers::NAMES.len();

/// Work of each of the [`Powers`] and the energy exchanged, J.
#[derive(Clone, Debug)]
pub struct EnergyMeter<const L: usize> {
    /// Net work.
    pub work: [[f64; L]; POWERS],
    /// Time integral of the absolute power.
    pub exchanged: [[f64; L]; POWERS],
}

impl<const L: usize> EnergyMeter<L> {
    /// Advances the plant by one control period and adds up the work that is done in it.
    #[inline(always)]
    pub fn advance(&mut self, plant: &mut HumanProsthesis<'_, L>, state: &mut State<L>, solver: &SolverParams) {
        let mut metered = MeteredState { state: state.clone(), meter: self.clone() };
        let mut work = Workspace::new(&metered);
        integrator::advance(
            &mut Metered { plant },
            &mut metered,
            &mut work,
            solver.stepper,
            CONTROL_PERIOD_S,
            solver.steps,
        );
        *state = metered.state;
        *self = metered.meter;
    }
}

impl<const L: usize> Default for EnergyMeter<L> {
    fn default() -> Self {
        Self { work: [[0.0; L]; POWERS], exchanged: [[0.0; L]; POWERS] }
    }
}

#[derive(Clone, Debug)]
struct MeteredState<const L: usize> {
    state: State<L>,
    meter: EnergyMeter<L>,
}

impl<const L: usize> StateVector<L> for MeteredState<L> {
    #[inline(always)]
    fn add_scaled(&mut self, base: &Self, step: &[f64; L], rate: &Self) {
        self.state.add_scaled(&base.state, step, &rate.state);
        for power in 0..POWERS {
            for lane in 0..L {
                self.meter.work[power][lane] = base.meter.work[power][lane] + step[lane] * rate.meter.work[power][lane];
                self.meter.exchanged[power][lane] =
                    base.meter.exchanged[power][lane] + step[lane] * rate.meter.exchanged[power][lane];
            }
        }
    }

    #[inline(always)]
    fn interpolate(&mut self, start: &Self, end: &Self, share: &[f64; L]) {
        // Events look at the state alone.
        self.state.interpolate(&start.state, &end.state, share);
    }
}

/// The plant with its work integrated beside its state, by the same quadrature.
struct Metered<'a, 'b, const L: usize> {
    plant: &'a mut HumanProsthesis<'b, L>,
}

impl<const L: usize> HybridFlow<L> for Metered<'_, '_, L> {
    type State = MeteredState<L>;

    #[inline(always)]
    fn sense(&mut self, state: &Self::State) {
        self.plant.sense(&state.state);
    }

    #[inline(always)]
    fn rates(&mut self, state: &Self::State, implicit_step: &[f64; L], rates: &mut Self::State) {
        self.plant.rates(&state.state, implicit_step, &mut rates.state);
        for lane in 0..L {
            let powers = self.plant.at(&state.state).powers(lane).values();
            for (power, &watts) in powers.iter().enumerate() {
                rates.meter.work[power][lane] = watts;
                rates.meter.exchanged[power][lane] = watts.abs();
            }
        }
    }

    #[inline(always)]
    fn fired(&self, state: &Self::State) -> [bool; L] {
        self.plant.fired(&state.state)
    }

    #[inline(always)]
    fn splits(&self, state: &Self::State) -> [bool; L] {
        self.plant.splits(&state.state)
    }

    #[inline(always)]
    fn transition(&mut self, state: &mut Self::State, fired: &[bool; L]) {
        self.plant.transition(&mut state.state, fired);
    }

    #[inline(always)]
    fn accept(&mut self, state: &Self::State) {
        self.plant.accept(&state.state);
    }
}
