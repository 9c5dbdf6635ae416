//! Steppers and event location over blocks of lanes. Knows no physics: a [`HybridFlow`] tells it rates and events.

/// A vector of columns; every lane has its own step size.
pub trait StateVector<const L: usize>: Clone {
    /// `self = base + step * rate`, lane by lane.
    fn add_scaled(&mut self, base: &Self, step: &[f64; L], rate: &Self);
}

/// A continuous flow `dy/dt = f(y)`, interrupted by events that change it.
pub trait HybridFlow<const L: usize> {
    /// Continuous state.
    type State: StateVector<L>;

    /// Evaluates what both rates and events depend on. Called before [`rates`](Self::rates) and [`fired`](Self::fired).
    fn sense(&mut self, state: &Self::State);

    /// Writes `(I - implicit_step J)^-1 f(y)`, J an approximate Jacobian that holds at least the stiff terms.
    /// With `implicit_step = 0` this is `f(y)`.
    fn rates(&mut self, state: &Self::State, implicit_step: &[f64; L], rates: &mut Self::State);

    /// In which lanes the guard of an event holds at the sensed state.
    fn fired(&self, state: &Self::State) -> [bool; L];

    /// In which lanes something has happened that a stepper other than the reference has to split its step at; the reference does
    /// so at every event of `fired`.
    fn urgent(&self, _state: &Self::State, fired: &[bool; L]) -> [bool; L] {
        *fired
    }

    /// Carries out the event of every lane in `fired`.
    fn transition(&mut self, state: &mut Self::State, fired: &[bool; L]);

    /// Takes note of the sensed state that a step has ended with: unlike stages and trial steps it happens.
    fn accept(&mut self, _state: &Self::State) {}
}

/// One-step method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stepper {
    /// Classical explicit Runge-Kutta, order 4. The reference.
    Rk4,
    /// Linearly implicit (Rosenbrock) Euler, order 1, L-stable; events at step ends.
    LinearlyImplicitEuler,
    /// Two linearly implicit stages, order 2 whatever the Jacobian leaves out (a W-method), L-stable. The fast one.
    TwoStageW,
}

/// With R(y, g) = (I - g J)^-1 f(y) the step is `y - h R(y, 2 GOLDEN h) + 2 h R(y + h/4 R(y, 2 GOLDEN h), GOLDEN h)`.
///
/// For any J: the weights -1 and 2 add up to 1, 2 times 1/4 is 1/2, and -1 times 2 GOLDEN plus 2 times GOLDEN is 0, so what J
/// holds cancels to second order. The stability function then tends to 1 - 3/(2 g) + 1/(4 g^2) for stiff decays, which is 0
/// at g = (3 - sqrt 5) / 4: A-stable (checked in tests), and stiff decays die at once.
const GOLDEN: f64 = 0.190_983_005_625_052_57;

impl Stepper {
    /// Order of convergence for a smooth flow; that of the linearly implicit Euler needs the full Jacobian.
    pub const fn order(self) -> u32 {
        match self {
            Self::Rk4 => 4,
            Self::LinearlyImplicitEuler => 1,
            Self::TwoStageW => 2,
        }
    }

    /// Bisections that locate an event in a step; without any, events wait for the step's end.
    ///
    /// 30 narrow a step of 0.1 ms down to 1e-13 s; for the fast stepper an eighth of a step is less than its own error.
    pub const fn bisections(self) -> usize {
        match self {
            Self::Rk4 => 30,
            Self::LinearlyImplicitEuler => 0,
            Self::TwoStageW => 3,
        }
    }
}

/// Stage storage, owned by the caller so that stepping allocates nothing.
#[derive(Clone, Debug)]
pub struct Workspace<S> {
    start: S,
    stage: S,
    rates: [S; 4],
}

impl<S: Clone> Workspace<S> {
    /// Storage for states shaped like `state`.
    pub fn new(state: &S) -> Self {
        Self { start: state.clone(), stage: state.clone(), rates: std::array::from_fn(|_| state.clone()) }
    }
}

/// Events that are located within one step; the rest of the step ignores further ones, lest a guard that stays true stop time.
const MOST_EVENTS: usize = 8;

/// Advances `state` by `duration` seconds in `steps` equal steps. The state must have been sensed; it is again on return.
#[inline(always)]
pub fn advance<const L: usize, F: HybridFlow<L>>(
    flow: &mut F,
    state: &mut F::State,
    work: &mut Workspace<F::State>,
    stepper: Stepper,
    duration: f64,
    steps: usize,
) {
    let full_step = [duration / steps as f64; L];
    for _ in 0..steps {
        if stepper.bisections() > 0 {
            advance_locating(flow, state, work, stepper, full_step);
        } else {
            step(flow, state, work, stepper, &full_step);
            flow.sense(state);
            let fired = flow.fired(state);
            if fired.contains(&true) {
                flow.transition(state, &fired);
            }
            flow.accept(state);
        }
    }
}

/// Advances every lane by its `remaining` time, splitting the step of a lane at each of its events.
#[inline(always)]
fn advance_locating<const L: usize, F: HybridFlow<L>>(
    flow: &mut F,
    state: &mut F::State,
    work: &mut Workspace<F::State>,
    stepper: Stepper,
    mut remaining: [f64; L],
) {
    for _ in 0..MOST_EVENTS {
        work.start = state.clone();
        step(flow, state, work, stepper, &remaining);
        flow.sense(state);
        let fired = flow.fired(state);
        let located = to_locate(flow, state, stepper, &fired);
        if !located.contains(&true) {
            // Events that the stepper need not locate happen at the step's end.
            if fired.contains(&true) {
                flow.transition(state, &fired);
            }
            flow.accept(state);
            return;
        }
        // A lane without an event repeats its whole step, so that nothing it evaluates depends on its neighbours.
        let (mut before, mut after) = ([0.0; L], remaining);
        for _ in 0..stepper.bisections() {
            let middle =
                std::array::from_fn(
                    |lane| if located[lane] { 0.5 * (before[lane] + after[lane]) } else { after[lane] },
                );
            *state = work.start.clone();
            flow.sense(state);
            step(flow, state, work, stepper, &middle);
            flow.sense(state);
            let happened = to_locate(flow, state, stepper, &flow.fired(state));
            for lane in (0..L).filter(|&lane| located[lane]) {
                let bound = if happened[lane] { &mut after } else { &mut before };
                bound[lane] = middle[lane];
            }
        }
        *state = work.start.clone();
        flow.sense(state);
        step(flow, state, work, stepper, &after);
        flow.sense(state);
        let fired = flow.fired(state);
        if fired.contains(&true) {
            flow.transition(state, &fired);
            flow.sense(state);
        }
        flow.accept(state);
        for lane in 0..L {
            remaining[lane] -= after[lane];
        }
    }
    step(flow, state, work, stepper, &remaining);
    flow.sense(state);
    flow.accept(state);
}

/// In which lanes the stepper has to split its step.
#[inline(always)]
fn to_locate<const L: usize, F: HybridFlow<L>>(
    flow: &F,
    state: &F::State,
    stepper: Stepper,
    fired: &[bool; L],
) -> [bool; L] {
    if stepper == Stepper::Rk4 { *fired } else { flow.urgent(state, fired) }
}

/// One step of size `step` per lane from the sensed `state`.
#[inline(always)]
fn step<const L: usize, F: HybridFlow<L>>(
    flow: &mut F,
    state: &mut F::State,
    work: &mut Workspace<F::State>,
    stepper: Stepper,
    step: &[f64; L],
) {
    match stepper {
        Stepper::LinearlyImplicitEuler => {
            flow.rates(state, step, &mut work.rates[0]);
            work.stage.add_scaled(state, step, &work.rates[0]);
            std::mem::swap(state, &mut work.stage);
        }
        Stepper::TwoStageW => {
            let scaled = |factor: f64| step.map(|h| factor * h);
            let (first, second) = work.rates.split_at_mut(1);
            flow.rates(state, &scaled(2.0 * GOLDEN), &mut first[0]);
            work.stage.add_scaled(state, &scaled(0.25), &first[0]);
            flow.sense(&work.stage);
            flow.rates(&work.stage, &scaled(GOLDEN), &mut second[0]);
            work.stage.add_scaled(state, &scaled(-1.0), &first[0]);
            state.add_scaled(&work.stage, &scaled(2.0), &second[0]);
        }
        Stepper::Rk4 => {
            const EXPLICIT: f64 = 0.0;
            let explicit = [EXPLICIT; L];
            let scaled = |factor: f64| step.map(|h| factor * h);
            flow.rates(state, &explicit, &mut work.rates[0]);
            for (stage, fraction) in [(1, 0.5), (2, 0.5), (3, 1.0)] {
                let (done, todo) = work.rates.split_at_mut(stage);
                work.stage.add_scaled(state, &scaled(fraction), &done[stage - 1]);
                flow.sense(&work.stage);
                flow.rates(&work.stage, &explicit, &mut todo[0]);
            }
            for (rates, weight) in work.rates.iter().zip([1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0]) {
                work.stage.add_scaled(state, &scaled(weight), rates);
                std::mem::swap(state, &mut work.stage);
            }
        }
    }
}
