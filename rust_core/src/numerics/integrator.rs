//! Steppers and event location over blocks of lanes. Knows no physics: a [`HybridFlow`] tells it rates and events.

/// A vector of columns; every lane has its own step size.
pub trait StateVector<const L: usize>: Clone {
    /// `self = base + step * rate`, lane by lane.
    fn add_scaled(&mut self, base: &Self, step: &[f64; L], rate: &Self);

    /// `self = start + share * (end - start)`, lane by lane.
    fn interpolate(&mut self, start: &Self, end: &Self, share: &[f64; L]);
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

    /// In which lanes something has happened since the step began that a long step has to be split at. Short ones are split at
    /// the events of `fired`.
    fn splits(&self, state: &Self::State) -> [bool; L] {
        self.fired(state)
    }

    /// Carries out the event of every lane in `fired`, and senses anew what that changes.
    fn transition(&mut self, state: &mut Self::State, fired: &[bool; L]);

    /// Takes note of the sensed state that a step has ended with: unlike stages and trial steps it happens.
    fn accept(&mut self, _state: &Self::State) {}
}

/// One-step method.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, strum::IntoStaticStr, strum::VariantNames,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Stepper {
    /// Classical explicit Runge-Kutta, order 4. The reference.
    Rk4,
    /// Linearly implicit (Rosenbrock) Euler, order 1, L-stable; events at step ends.
    LinearlyImplicitEuler,
    /// Two linearly implicit stages, order 2 whatever the Jacobian leaves out (a W-method), L-stable. The fast one.
    TwoStageW,
}

/// One stage of a method: `rate = R(y + reach h (last rate), implicit h)` with R(y, g) = (I - g J)^-1 f(y), and the step adds
/// `weight h rate`. Every method here reaches each stage from the rate before it alone.
#[derive(Clone, Copy, Debug)]
struct Stage {
    reach: f64,
    implicit: f64,
    weight: f64,
}

const fn stage(reach: f64, implicit: f64, weight: f64) -> Stage {
    Stage { reach, implicit, weight }
}

const RK4: [Stage; 4] =
    [stage(0.0, 0.0, 1.0 / 6.0), stage(0.5, 0.0, 1.0 / 3.0), stage(0.5, 0.0, 1.0 / 3.0), stage(1.0, 0.0, 1.0 / 6.0)];

const LINEARLY_IMPLICIT_EULER: [Stage; 1] = [stage(0.0, 1.0, 1.0)];

/// For any J: the weights -1 and 2 add up to 1, 2 times 1/4 is 1/2, and -1 times 2 GOLDEN plus 2 times GOLDEN is 0, so what J
/// holds cancels to second order. The stability function then tends to 1 - 3/(2 g) + 1/(4 g^2) for stiff decays, which is 0
/// at g = (3 - sqrt 5) / 4: A-stable (checked in tests), and stiff decays die at once.
const TWO_STAGE_W: [Stage; 2] = [stage(0.0, 2.0 * GOLDEN, -1.0), stage(0.25, GOLDEN, 2.0)];
const GOLDEN: f64 = 0.190_983_005_625_052_57;

impl Stepper {
    const fn stages(self) -> &'static [Stage] {
        match self {
            Self::Rk4 => &RK4,
            Self::LinearlyImplicitEuler => &LINEARLY_IMPLICIT_EULER,
            Self::TwoStageW => &TWO_STAGE_W,
        }
    }

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
    /// 30 narrow a step of 0.1 ms down to 1e-13 s; for the fast stepper 1/16 of a step is less than its own error.
    pub const fn bisections(self) -> usize {
        match self {
            Self::Rk4 => 30,
            Self::LinearlyImplicitEuler => 0,
            Self::TwoStageW => 4,
        }
    }

    /// Whether its steps are long: it chooses what to split them at, and looks for that on the straight line between a step's ends,
    /// which spares steps of every length tried.
    const fn takes_long_steps(self) -> bool {
        matches!(self, Self::TwoStageW)
    }
}

/// Stage storage, owned by the caller so that stepping allocates nothing.
#[derive(Clone, Debug)]
pub struct Workspace<S> {
    start: S,
    end: S,
    /// Start and the weighted rates of the stages so far, and of those before the last.
    sum: S,
    last_sum: S,
    rate: S,
}

impl<S: Clone> Workspace<S> {
    /// Storage for states shaped like `state`.
    pub fn new(state: &S) -> Self {
        Self {
            start: state.clone(),
            end: state.clone(),
            sum: state.clone(),
            last_sum: state.clone(),
            rate: state.clone(),
        }
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
    for _ in 0..steps {
        advance_step(flow, state, work, stepper, [duration / steps as f64; L]);
    }
}

/// Advances every lane by its `remaining` time, splitting the step of a lane at each event that has to be located.
///
/// One loop around a single call of [`step`]: what a step evaluates is a large part of an instruction cache.
#[inline(always)]
fn advance_step<const L: usize, F: HybridFlow<L>>(
    flow: &mut F,
    state: &mut F::State,
    work: &mut Workspace<F::State>,
    stepper: Stepper,
    mut remaining: [f64; L],
) {
    let bisections = stepper.bisections();
    for piece in 0..=MOST_EVENTS {
        work.start.clone_from(state);
        let (mut before, mut after, mut trial) = ([0.0; L], remaining, remaining);
        let mut located = [false; L];
        // The whole step; where that passes an event, bisections, and then the step up to the event's far side.
        for attempt in 0..=bisections + 1 {
            let looks = attempt > 0 && attempt <= bisections && stepper.takes_long_steps();
            if attempt > 0 {
                if looks {
                    let share = std::array::from_fn(|lane| trial[lane] / remaining[lane].max(f64::MIN_POSITIVE));
                    state.interpolate(&work.start, &work.end, &share);
                } else {
                    state.clone_from(&work.start);
                }
                flow.sense(state);
            }
            if !looks {
                step(flow, state, work, stepper.stages(), &trial);
            }
            let happened =
                if bisections == 0 || piece == MOST_EVENTS { [false; L] } else { to_locate(flow, state, stepper) };
            if attempt == 0 {
                located = happened;
            }
            if !located.contains(&true) || attempt > bisections {
                break;
            }
            if attempt == 0 {
                work.end.clone_from(state);
            }
            for lane in (0..L).filter(|&lane| located[lane] && attempt > 0) {
                let bound = if happened[lane] { &mut after } else { &mut before };
                bound[lane] = trial[lane];
            }
            // A lane without an event repeats its whole step, so that nothing it evaluates depends on its neighbours.
            for lane in 0..L {
                let between = located[lane] && attempt < bisections;
                trial[lane] = if between { 0.5 * (before[lane] + after[lane]) } else { after[lane] };
            }
        }
        let fired = flow.fired(state);
        if piece < MOST_EVENTS && fired.contains(&true) {
            flow.transition(state, &fired);
        }
        flow.accept(state);
        if !located.contains(&true) {
            return;
        }
        for lane in 0..L {
            remaining[lane] -= after[lane];
        }
    }
}

/// In which lanes the stepper has to split its step.
#[inline(always)]
fn to_locate<const L: usize, F: HybridFlow<L>>(flow: &F, state: &F::State, stepper: Stepper) -> [bool; L] {
    if stepper.takes_long_steps() { flow.splits(state) } else { flow.fired(state) }
}

/// One step of size `step` per lane from the sensed `state`, which is also in `work.start`. The state is sensed on return.
#[inline(always)]
fn step<const L: usize, F: HybridFlow<L>>(
    flow: &mut F,
    state: &mut F::State,
    work: &mut Workspace<F::State>,
    stages: &[Stage],
    step: &[f64; L],
) {
    let Workspace { start, sum, last_sum, rate, .. } = work;
    for (i, stage) in stages.iter().enumerate() {
        flow.rates(state, &step.map(|h| stage.implicit * h), rate);
        let gain = step.map(|h| stage.weight * h);
        if let Some(next) = stages.get(i + 1) {
            if i == 0 {
                sum.add_scaled(start, &gain, rate);
            } else {
                std::mem::swap(sum, last_sum);
                sum.add_scaled(last_sum, &gain, rate);
            }
            state.add_scaled(start, &step.map(|h| next.reach * h), rate);
        } else {
            state.add_scaled(if i == 0 { start } else { sum }, &gain, rate);
        }
        flow.sense(state);
    }
}
