//! Steppers and event location against problems with known solutions.
//!
//! A fixture is a [`Problem`] (rates, Jacobian, event) together with its exact solution; [`Flow`] makes it a block of lanes.

use prosthesis_gym_core::numerics::integrator::{HybridFlow, StateVector, Stepper, Workspace, advance};

/// `N` variables of `L` lanes.
#[derive(Clone, Debug, PartialEq)]
struct Columns<const N: usize, const L: usize>([[f64; L]; N]);

impl<const N: usize, const L: usize> Columns<N, L> {
    fn lane(&self, lane: usize) -> [f64; N] {
        self.0.map(|column| column[lane])
    }

    fn set(&mut self, lane: usize, value: [f64; N]) {
        for i in 0..N {
            self.0[i][lane] = value[i];
        }
    }
}

impl<const N: usize, const L: usize> StateVector<L> for Columns<N, L> {
    fn add_scaled(&mut self, base: &Self, step: &[f64; L], rate: &Self) {
        for i in 0..N {
            for lane in 0..L {
                self.0[i][lane] = base.0[i][lane] + step[lane] * rate.0[i][lane];
            }
        }
    }

    fn interpolate(&mut self, start: &Self, end: &Self, share: &[f64; L]) {
        for i in 0..N {
            for lane in 0..L {
                self.0[i][lane] = start.0[i][lane] + share[lane] * (end.0[i][lane] - start.0[i][lane]);
            }
        }
    }
}

/// A flow of `N` variables, time being the first, and its solution.
trait Problem<const N: usize> {
    fn rates(&self, y: &[f64; N]) -> [f64; N];

    /// d rates / d y.
    fn jacobian(&self, y: &[f64; N]) -> [[f64; N]; N];

    fn fires(&self, _y: &[f64; N]) -> bool {
        false
    }

    fn event(&self, y: &[f64; N]) -> [f64; N] {
        *y
    }

    /// State at time `t` on the way from `start`, and the times of the events until then.
    fn exact(&self, start: &[f64; N], t: f64) -> ([f64; N], Vec<f64>);
}

/// A block of lanes on one problem, with the times of all events.
struct Flow<P, const N: usize, const L: usize> {
    problem: P,
    events: [Vec<f64>; L],
}

impl<const N: usize, const L: usize, P: Problem<N>> HybridFlow<L> for Flow<P, N, L> {
    type State = Columns<N, L>;

    fn sense(&mut self, _state: &Self::State) {}

    fn rates(&mut self, state: &Self::State, implicit_step: &[f64; L], rates: &mut Self::State) {
        for lane in 0..L {
            let y = state.lane(lane);
            rates.set(lane, solve(implicit_step[lane], self.problem.jacobian(&y), self.problem.rates(&y)));
        }
    }

    fn fired(&self, state: &Self::State) -> [bool; L] {
        std::array::from_fn(|lane| self.problem.fires(&state.lane(lane)))
    }

    fn transition(&mut self, state: &mut Self::State, fired: &[bool; L]) {
        for lane in (0..L).filter(|&lane| fired[lane]) {
            let y = state.lane(lane);
            self.events[lane].push(y[0]);
            state.set(lane, self.problem.event(&y));
        }
    }
}

/// `(I - step J) x = f` by elimination without pivoting: I dominates in every fixture.
fn solve<const N: usize>(step: f64, jacobian: [[f64; N]; N], mut f: [f64; N]) -> [f64; N] {
    let mut matrix = jacobian.map(|row| row.map(|entry| -step * entry));
    for i in 0..N {
        matrix[i][i] += 1.0;
    }
    for j in 0..N {
        for i in j + 1..N {
            let factor = matrix[i][j] / matrix[j][j];
            for k in j..N {
                matrix[i][k] -= factor * matrix[j][k];
            }
            f[i] -= factor * f[j];
        }
    }
    for i in (0..N).rev() {
        let known: f64 = (i + 1..N).map(|k| matrix[i][k] * f[k]).sum();
        f[i] = (f[i] - known) / matrix[i][i];
    }
    f
}

/// Runs every lane from its start; returns final states and event times.
fn run<const N: usize, const L: usize>(
    problem: impl Problem<N>,
    starts: &[[f64; N]; L],
    stepper: Stepper,
    duration: f64,
    steps: usize,
) -> ([[f64; N]; L], [Vec<f64>; L]) {
    let mut state = Columns([[0.0; L]; N]);
    for lane in 0..L {
        state.set(lane, starts[lane]);
    }
    let mut flow = Flow { problem, events: std::array::from_fn(|_| Vec::new()) };
    let mut work = Workspace::new(&state);
    flow.sense(&state);
    advance(&mut flow, &mut state, &mut work, stepper, duration, steps);
    (std::array::from_fn(|lane| state.lane(lane)), flow.events)
}

/// Largest error over lanes and variables at the end of a run.
fn error<const N: usize, const L: usize>(
    problem: impl Problem<N> + Copy,
    starts: &[[f64; N]; L],
    stepper: Stepper,
    duration: f64,
    steps: usize,
) -> f64 {
    let (ends, _) = run(problem, starts, stepper, duration, steps);
    let errors = starts.iter().zip(&ends).flat_map(|(start, end)| {
        let (exact, _) = problem.exact(start, duration);
        (0..N).map(move |i| (end[i] - exact[i]).abs())
    });
    errors.fold(0.0, worse)
}

/// The larger error; unlike [`f64::max`] it keeps a NaN.
fn worse(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() { a } else { b }
}

/// Asserts that the error falls with the order of the stepper each time that the steps are halved.
fn assert_order<const N: usize, const L: usize>(
    problem: impl Problem<N> + Copy,
    starts: &[[f64; N]; L],
    stepper: Stepper,
    duration: f64,
    coarsest: usize,
) {
    let errors: Vec<f64> =
        (0..4).map(|halving| error(problem, starts, stepper, duration, coarsest << halving)).collect();
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - f64::from(stepper.order())).abs() < 0.25, "{stepper:?}: order {order}, errors {errors:?}");
    }
}

/// Plane flow onto the unit circle (normal form of a Hopf bifurcation): nonlinear, smooth, solved in polar coordinates.
#[derive(Clone, Copy)]
struct OntoCircle;

impl Problem<3> for OntoCircle {
    fn rates(&self, &[_, x, y]: &[f64; 3]) -> [f64; 3] {
        let growth = 1.0 - x * x - y * y;
        [1.0, growth * x - y, growth * y + x]
    }

    fn jacobian(&self, &[_, x, y]: &[f64; 3]) -> [[f64; 3]; 3] {
        let growth = 1.0 - x * x - y * y;
        [[0.0; 3], [0.0, growth - 2.0 * x * x, -2.0 * x * y - 1.0], [0.0, 1.0 - 2.0 * x * y, growth - 2.0 * y * y]]
    }

    fn exact(&self, &[_, x, y]: &[f64; 3], t: f64) -> ([f64; 3], Vec<f64>) {
        let radius = (1.0 + (1.0 / (x * x + y * y) - 1.0) * (-2.0 * t).exp()).powf(-0.5);
        let angle = y.atan2(x) + t;
        ([t, radius * angle.cos(), radius * angle.sin()], vec![])
    }
}

/// `y' = -stiffness (y - cos t) - sin t`: a transient that dies at once, then y = cos t (Prothero & Robinson 1974).
#[derive(Clone, Copy)]
struct StiffToCosine {
    stiffness: f64,
}

impl Problem<2> for StiffToCosine {
    fn rates(&self, &[t, y]: &[f64; 2]) -> [f64; 2] {
        [1.0, -self.stiffness * (y - t.cos()) - t.sin()]
    }

    fn jacobian(&self, &[t, _]: &[f64; 2]) -> [[f64; 2]; 2] {
        [[0.0; 2], [-self.stiffness * t.sin() - t.cos(), -self.stiffness]]
    }

    fn exact(&self, start: &[f64; 2], t: f64) -> ([f64; 2], Vec<f64>) {
        ([t, t.cos() + (start[1] - 1.0) * (-self.stiffness * t).exp()], vec![])
    }
}

/// A mass on a spring that hits a wall at x = `WALL` and loses speed there.
#[derive(Clone, Copy)]
struct Bouncer;

impl Bouncer {
    const FREQUENCY: f64 = 2.0;
    const WALL: f64 = 0.1;
    const RESTITUTION: f64 = 0.9;
}

impl Problem<3> for Bouncer {
    fn rates(&self, &[_, x, v]: &[f64; 3]) -> [f64; 3] {
        [1.0, v, -Self::FREQUENCY * Self::FREQUENCY * x]
    }

    fn jacobian(&self, _: &[f64; 3]) -> [[f64; 3]; 3] {
        [[0.0; 3], [0.0, 0.0, 1.0], [0.0, -Self::FREQUENCY * Self::FREQUENCY, 0.0]]
    }

    fn fires(&self, &[_, x, v]: &[f64; 3]) -> bool {
        x <= Self::WALL && v < 0.0
    }

    fn event(&self, &[t, x, v]: &[f64; 3]) -> [f64; 3] {
        [t, x, -Self::RESTITUTION * v]
    }

    fn exact(&self, &[_, mut x, mut v]: &[f64; 3], t: f64) -> ([f64; 3], Vec<f64>) {
        let w = Self::FREQUENCY;
        let (mut now, mut events) = (0.0, vec![]);
        loop {
            // x = amplitude cos(w s + phase), s since the last event; falling through the wall at the first s > 0.
            let (amplitude, phase) = (x.hypot(v / w), (-v / w).atan2(x));
            let after = ((Self::WALL / amplitude).acos() - phase).rem_euclid(std::f64::consts::TAU) / w;
            let arc = |s: f64| (amplitude * (w * s + phase).cos(), -amplitude * w * (w * s + phase).sin());
            if now + after > t {
                (x, v) = arc(t - now);
                return ([t, x, v], events);
            }
            now += after;
            events.push(now);
            (x, v) = (Self::WALL, -Self::RESTITUTION * arc(after).1);
        }
    }
}

/// Different amplitudes and phases, so different event times; the last two within one step.
const BOUNCER_STARTS: [[f64; 3]; 5] =
    [[0.0, 1.0, 0.0], [0.0, 0.7, 1.3], [0.0, 0.9, -1.0], [0.0, 1.6, 0.2], [0.0, 1.601, 0.2]];
const CIRCLE_STARTS: [[f64; 3]; 4] = [[0.0, 0.3, 0.1], [0.0, -1.2, 0.4], [0.0, 0.2, -1.0], [0.0, 0.9, 0.9]];

#[test]
fn every_stepper_converges_with_its_order_on_a_smooth_nonlinear_flow() {
    assert_order(OntoCircle, &CIRCLE_STARTS, Stepper::Rk4, 2.0, 20);
    assert_order(OntoCircle, &CIRCLE_STARTS, Stepper::LinearlyImplicitEuler, 2.0, 100);
    assert_order(OntoCircle, &CIRCLE_STARTS, Stepper::TwoStageW, 2.0, 40);
}

/// The same flow with a Jacobian that has little to do with it.
#[derive(Clone, Copy)]
struct Misjudged<P>(P);

impl<const N: usize, P: Problem<N>> Problem<N> for Misjudged<P> {
    fn rates(&self, y: &[f64; N]) -> [f64; N] {
        self.0.rates(y)
    }

    fn jacobian(&self, y: &[f64; N]) -> [[f64; N]; N] {
        // Decays that are not there, in proportion to the state.
        std::array::from_fn(|i| std::array::from_fn(|j| if i == j { -1.0 - y[i] * y[i] } else { 0.3 }))
    }

    fn exact(&self, start: &[f64; N], t: f64) -> ([f64; N], Vec<f64>) {
        self.0.exact(start, t)
    }
}

#[test]
fn the_two_stage_w_method_keeps_its_order_whatever_the_jacobian() {
    assert_order(Misjudged(OntoCircle), &CIRCLE_STARTS, Stepper::TwoStageW, 2.0, 80);
}

/// `z' = rate z` in the complex plane as two real variables after time.
#[derive(Clone, Copy)]
struct Linear {
    decay: f64,
    frequency: f64,
}

impl Problem<3> for Linear {
    fn rates(&self, &[_, x, y]: &[f64; 3]) -> [f64; 3] {
        [1.0, self.decay * x - self.frequency * y, self.frequency * x + self.decay * y]
    }

    fn jacobian(&self, _: &[f64; 3]) -> [[f64; 3]; 3] {
        [[0.0; 3], [0.0, self.decay, -self.frequency], [0.0, self.frequency, self.decay]]
    }

    fn exact(&self, &[_, x, y]: &[f64; 3], t: f64) -> ([f64; 3], Vec<f64>) {
        let (size, angle) = (x.hypot(y) * (self.decay * t).exp(), y.atan2(x) + self.frequency * t);
        ([t, size * angle.cos(), size * angle.sin()], vec![])
    }
}

#[test]
fn the_implicit_steppers_let_no_linear_decay_grow_and_kill_stiff_ones_at_once() {
    for stepper in [Stepper::LinearlyImplicitEuler, Stepper::TwoStageW] {
        let growth = |decay: f64, frequency: f64| {
            let ([[_, x, y]], _) = run(Linear { decay, frequency }, &[[0.0, 1.0, 0.0]], stepper, 1.0, 1);
            x.hypot(y)
        };
        for exponent in -30..=50 {
            let frequency = 10_f64.powf(0.1 * f64::from(exponent));
            for slope in [0.0, 0.01, 0.1, 1.0, 10.0, 100.0] {
                let size = growth(-slope * frequency, frequency);
                assert!(size <= 1.0 + 1e-12, "{stepper:?}: {size} for -{slope} + i times {frequency}");
            }
        }
        assert!(growth(-1e8, 0.0) < 1e-7, "{stepper:?}");
    }
}

#[test]
fn implicit_steppers_are_stable_and_accurate_where_the_explicit_one_explodes() {
    let problem = StiffToCosine { stiffness: 1e6 }; // times the step of 0.01: 1e4
    let off_the_solution = [[0.0, 3.0]];
    for stepper in [Stepper::LinearlyImplicitEuler, Stepper::TwoStageW] {
        let stiff = error(problem, &off_the_solution, stepper, 2.0, 200);
        assert!(stiff < 1e-3, "{stepper:?} {stiff}");
    }
    let explicit = error(problem, &off_the_solution, Stepper::Rk4, 2.0, 200);
    assert!(!explicit.is_finite() || explicit > 1e6, "{explicit}");
}

#[test]
fn events_are_located_in_time_to_a_nanosecond_in_every_lane() {
    let duration = 7.0;
    let (_, events) = run(Bouncer, &BOUNCER_STARTS, Stepper::Rk4, duration, 2000);
    for (start, found) in BOUNCER_STARTS.iter().zip(&events) {
        let (_, exact) = Bouncer.exact(start, duration);
        assert!(exact.len() >= 4);
        assert_eq!(found.len(), exact.len());
        for (found, exact) in found.iter().zip(&exact) {
            assert!((found - exact).abs() < 1e-9, "{found} {exact}");
        }
    }
}

#[test]
fn the_order_of_the_locating_stepper_holds_through_events() {
    assert_order(Bouncer, &BOUNCER_STARTS, Stepper::Rk4, 7.0, 60);
}

#[test]
fn without_location_every_event_still_happens_within_a_step() {
    let (duration, steps) = (7.0, 20_000);
    let (_, events) = run(Bouncer, &BOUNCER_STARTS, Stepper::LinearlyImplicitEuler, duration, steps);
    for (start, found) in BOUNCER_STARTS.iter().zip(&events) {
        let (_, exact) = Bouncer.exact(start, duration);
        assert_eq!(found.len(), exact.len());
        for (found, exact) in found.iter().zip(&exact) {
            // One step late at most, besides the error of a first-order solution.
            assert!((found - exact).abs() < 20.0 * duration / steps as f64, "{found} {exact}");
        }
    }
}

#[test]
fn lanes_do_not_influence_each_other() {
    for stepper in [Stepper::Rk4, Stepper::LinearlyImplicitEuler, Stepper::TwoStageW] {
        let (together, events) = run(Bouncer, &BOUNCER_STARTS, stepper, 7.0, 300);
        for lane in 0..BOUNCER_STARTS.len() {
            let ([alone], [alone_events]) = run(Bouncer, &[BOUNCER_STARTS[lane]], stepper, 7.0, 300);
            assert_eq!(together[lane].map(f64::to_bits), alone.map(f64::to_bits));
            assert_eq!(events[lane], alone_events);
        }
    }
}

#[test]
fn a_duration_may_be_cut_into_calls() {
    let (whole, _) = run(Bouncer, &BOUNCER_STARTS, Stepper::Rk4, 2.0, 200);
    let (half, _) = run(Bouncer, &BOUNCER_STARTS, Stepper::Rk4, 1.0, 100);
    let (second, _) = run(Bouncer, &half, Stepper::Rk4, 1.0, 100);
    assert_eq!(whole, second);
}
