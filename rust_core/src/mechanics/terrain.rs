//! Terrain: height and slope of the ground over the distance walked. The paper's ground is level (section 3.3).

use rand::RngExt;
use rand_pcg::Pcg64;

use crate::mechanics::compliant_ground::GroundParams;
use crate::numerics::lanes::lanes;
use crate::numerics::math::{clamp, floor, sin_cos};

/// Wave numbers of the roughness's sinusoids over the lowest: powers of the golden ratio, so that nothing repeats.
const OVERTONES: [f64; 4] = [1.0, 1.618_033_988_749_895, 2.618_033_988_749_895, 4.236_067_977_499_79];

lanes! {
    /// Profile of the ground under one walker, SI.
    pub struct Terrain, TerrainLanes {
        /// Rise per distance of the whole ground, which passes through the origin.
        slope: f64,
        /// Height of the single step, m.
        step_height: f64,
        /// Its place, m.
        step_x: f64,
        /// 1 / width of the edge over which a step rises, 1/m.
        inverse_edge: f64,
        /// Height of each stair, m.
        stair_rise: f64,
        /// Place of the first riser, m.
        stair_start: f64,
        /// 1 / distance between risers, 1/m.
        inverse_run: f64,
        /// Distance between risers over width of an edge; at least 1.
        run_per_edge: f64,
        /// Number of stairs.
        stair_count: f64,
        /// Amplitude of the longest of the roughness's sinusoids, m; the others' are smaller by their [`OVERTONES`].
        roughness: f64,
        /// Its wave number, rad/m.
        wave_number: f64,
        /// Phases of the sinusoids, rad.
        phase_0: f64,
        /// Second phase.
        phase_1: f64,
        /// Third phase.
        phase_2: f64,
        /// Fourth phase.
        phase_3: f64,
    }
}

impl From<&GroundParams> for Terrain {
    fn from(p: &GroundParams) -> Self {
        let mut random = Pcg64::new(p.roughness_seed as u128, 0x7e44_a1e5);
        let mut phase = || 2.0 * std::f64::consts::PI * random.random::<f64>();
        Self {
            slope: p.slope_deg.to_radians().tan(),
            step_height: p.step_height_m,
            step_x: p.step_x_m,
            inverse_edge: 1.0 / p.edge_m,
            stair_rise: p.stair_rise_m,
            stair_start: p.stair_start_x_m,
            inverse_run: 1.0 / p.stair_run_m,
            run_per_edge: p.stair_run_m / p.edge_m,
            stair_count: p.stair_count as f64,
            // All sinusoids at their peak make up the amplitude asked for.
            roughness: p.roughness_m / OVERTONES.iter().map(|overtone| 1.0 / overtone).sum::<f64>(),
            wave_number: 2.0 * std::f64::consts::PI / p.roughness_length_m,
            phase_0: phase(),
            phase_1: phase(),
            phase_2: phase(),
            phase_3: phase(),
        }
    }
}

impl Terrain {
    /// Whether the ground is y = 0 everywhere.
    pub fn is_level(&self) -> bool {
        [self.slope, self.step_height, self.stair_rise, self.roughness].iter().all(|&size| size == 0.0)
    }
}

lanes! {
    /// The ground at one place.
    pub struct Surface, SurfaceLanes {
        /// Height, m.
        height: f64,
        /// Sine of the slope's angle, positive uphill.
        sin: f64,
        /// Its cosine.
        cos: f64,
    }
}

impl Surface {
    /// Level ground at height 0.
    pub const LEVEL: Self = Self { height: 0.0, sin: 0.0, cos: 1.0 };

    /// The vector (x, y) as (uphill along the surface, out of the surface).
    #[inline(always)]
    pub fn along_and_across(&self, x: f64, y: f64) -> (f64, f64) {
        (self.cos * x + self.sin * y, self.cos * y - self.sin * x)
    }

    /// The vector (uphill along the surface, out of the surface) as (forward, up).
    #[inline(always)]
    pub fn forward_and_up(&self, along: f64, across: f64) -> (f64, f64) {
        (self.cos * along - self.sin * across, self.sin * along + self.cos * across)
    }
}

/// 0 to 1 as `x` goes from 0 to 1, without a kink, and its derivative.
#[inline(always)]
fn smooth_step(x: f64) -> (f64, f64) {
    let x = clamp(x, 0.0, 1.0);
    (x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x))
}

/// Height (m) and slope of the ground at `x`: slope + step + stairs + roughness, each continuous with a continuous slope.
#[inline(always)]
pub fn profile(terrain: &Terrain, x: f64) -> (f64, f64) {
    let (step, step_slope) = smooth_step((x - terrain.step_x) * terrain.inverse_edge);
    let stairs = clamp((x - terrain.stair_start) * terrain.inverse_run, 0.0, terrain.stair_count);
    let climbed = floor(stairs);
    let (riser, riser_slope) = smooth_step((stairs - climbed) * terrain.run_per_edge);
    let mut height = terrain.slope * x + terrain.step_height * step + terrain.stair_rise * (climbed + riser);
    let mut slope =
        terrain.slope + (terrain.step_height * step_slope + terrain.stair_rise * riser_slope) * terrain.inverse_edge;
    let phases = [terrain.phase_0, terrain.phase_1, terrain.phase_2, terrain.phase_3];
    for (overtone, phase) in OVERTONES.into_iter().zip(phases) {
        // Amplitudes fall with the wave number, so all sinusoids are equally steep.
        let (sine, cosine) = sin_cos(terrain.wave_number * overtone * x + phase);
        height += terrain.roughness / overtone * sine;
        slope += terrain.roughness * terrain.wave_number * cosine;
    }
    (height, slope)
}

/// The ground at `x`.
#[inline(always)]
pub fn surface(terrain: &Terrain, x: f64) -> Surface {
    let (height, slope) = profile(terrain, x);
    let cos = 1.0 / (1.0 + slope * slope).sqrt();
    Surface { height, sin: slope * cos, cos }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn terrain(change: impl Fn(&mut GroundParams)) -> Terrain {
        let mut params = GroundParams::default();
        change(&mut params);
        Terrain::from(&params)
    }

    fn everything() -> Terrain {
        terrain(|p| {
            (p.slope_deg, p.step_height_m, p.step_x_m, p.edge_m) = (-4.0, 0.1, 2.0, 0.05);
            (p.stair_rise_m, p.stair_run_m, p.stair_start_x_m, p.stair_count) = (0.15, 0.3, 4.0, 6);
            (p.roughness_m, p.roughness_length_m, p.roughness_seed) = (0.02, 0.8, 3);
        })
    }

    fn height(terrain: &Terrain, x: f64) -> f64 {
        surface(terrain, x).height
    }

    #[test]
    fn ground_is_level_by_default_and_only_then() {
        let level = Terrain::from(&GroundParams::default());
        assert!(level.is_level() && !everything().is_level());
        for x in [-5.0, 0.0, 3.01, 1e3] {
            assert_eq!(surface(&level, x), Surface::LEVEL);
        }
    }

    #[test]
    fn a_slope_of_given_angle_passes_through_the_origin() {
        let slope = terrain(|p| p.slope_deg = 5.0);
        for x in [-3.0, 0.0, 7.5] {
            let found = surface(&slope, x);
            assert!((found.height - x * 5.0_f64.to_radians().tan()).abs() < 1e-14);
            assert!((found.sin - 5.0_f64.to_radians().sin()).abs() < 1e-15);
            assert!((found.cos - 5.0_f64.to_radians().cos()).abs() < 1e-15);
        }
    }

    #[test]
    fn a_step_rises_over_its_edge_alone() {
        let step = terrain(|p| (p.step_height_m, p.step_x_m, p.edge_m) = (0.12, 2.0, 0.04));
        for (x, expected) in [(0.0, 0.0), (2.0, 0.0), (2.01, 0.12 * 0.156_25), (2.02, 0.06), (2.04, 0.12), (9.0, 0.12)]
        {
            assert!((height(&step, x) - expected).abs() < 1e-14, "{x}");
        }
        assert_eq!(profile(&step, 1.999).1, 0.0);
        assert!((profile(&step, 2.02).1 - 1.5 * 0.12 / 0.04).abs() < 1e-12);
    }

    #[test]
    fn stairs_rise_once_per_run_and_end_after_their_number() {
        for rise in [0.17, -0.17] {
            let stairs = terrain(|p| {
                (p.stair_rise_m, p.stair_run_m, p.stair_start_x_m, p.stair_count) = (rise, 0.3, 1.0, 4);
            });
            assert_eq!(height(&stairs, 0.99), 0.0);
            for stair in 0..4 {
                // In the middle of the tread that follows this riser.
                let x = 1.0 + 0.3 * f64::from(stair) + 0.15;
                assert!((height(&stairs, x) - rise * f64::from(stair + 1)).abs() < 1e-14, "{x}");
                assert_eq!(surface(&stairs, x).sin, 0.0);
            }
            assert!((height(&stairs, 50.0) - 4.0 * rise).abs() < 1e-14);
        }
    }

    #[test]
    fn height_is_continuous_and_the_slope_is_its_derivative() {
        let terrain = everything();
        let (e, steepest) = (1e-6, 1.5 * 0.15 / 0.05 + 1.0);
        for i in 0..200_000 {
            let x = -1.0 + 9.0 * f64::from(i) / 200_000.0;
            let (before, after) = (height(&terrain, x - e), height(&terrain, x + e));
            assert!((after - before).abs() < 2.0 * e * steepest, "{x}");
            let (_, slope) = profile(&terrain, x);
            assert!(((after - before) / (2.0 * e) - slope).abs() < 1e-3, "{x}");
        }
    }

    #[test]
    fn roughness_is_reproducible_bounded_and_of_its_seed() {
        let rough = |seed: usize| terrain(|p| (p.roughness_m, p.roughness_seed) = (0.02, seed));
        let heights =
            |terrain: &Terrain| -> Vec<f64> { (0..20_000).map(|i| height(terrain, 0.005 * f64::from(i))).collect() };
        let (first, again, other) = (heights(&rough(1)), heights(&rough(1)), heights(&rough(2)));
        assert_eq!(first, again);
        assert_ne!(first, other);
        let largest = first.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
        assert!((0.018..=0.02).contains(&largest), "{largest}");
        let mean = first.iter().sum::<f64>() / first.len() as f64;
        assert!(mean.abs() < 1e-3, "{mean}");
    }

    #[test]
    fn turning_a_vector_into_the_surface_and_back_changes_nothing() {
        let surface = surface(&everything(), 4.02);
        let (along, across) = surface.along_and_across(0.3, -1.7);
        let (x, y) = surface.forward_and_up(along, across);
        assert!((x - 0.3).abs() < 1e-15 && (y + 1.7).abs() < 1e-15);
        assert!(surface.sin > 0.5);
    }
}
