//! What the lane loops need and std cannot vectorise: selects and branch-free elementary functions.
//!
//! Everything here uses only `+ - * /`, fused multiplication and addition, `sqrt` and bit operations. Each is rounded as IEEE 754
//! says, and none is fused or reordered by the compiler, so a result does not depend on the width of the vector unit.

/// `a` where `condition` holds, else `b`, both evaluated.
#[inline(always)]
pub fn select(condition: bool, a: f64, b: f64) -> f64 {
    if condition { a } else { b }
}

/// The larger argument; unlike [`f64::max`] one compare and blend, and NaN in `a` gives `b`.
#[inline(always)]
pub fn max(a: f64, b: f64) -> f64 {
    select(a > b, a, b)
}

/// The smaller argument; NaN in `a` gives `b`.
#[inline(always)]
pub fn min(a: f64, b: f64) -> f64 {
    select(a < b, a, b)
}

/// `x` limited to `[low, high]`.
#[inline(always)]
pub fn clamp(x: f64, low: f64, high: f64) -> f64 {
    min(max(x, low), high)
}

/// Sums of products rounded once per product: a multiplication and an addition in one instruction of every vector unit.
pub trait FusedSum {
    /// `self + a b`.
    #[must_use]
    fn plus(self, a: f64, b: f64) -> f64;

    /// `self - a b`.
    #[must_use]
    fn minus(self, a: f64, b: f64) -> f64;

    /// `self + a . b`.
    #[must_use]
    fn plus_dot(self, a: [f64; 2], b: [f64; 2]) -> f64;
}

impl FusedSum for f64 {
    #[inline(always)]
    fn plus(self, a: f64, b: f64) -> f64 {
        a.mul_add(b, self)
    }

    #[inline(always)]
    fn minus(self, a: f64, b: f64) -> f64 {
        (-a).mul_add(b, self)
    }

    #[inline(always)]
    fn plus_dot(self, a: [f64; 2], b: [f64; 2]) -> f64 {
        self.plus(a[0], b[0]).plus(a[1], b[1])
    }
}

/// Golden-ratio increment of SplitMix64.
pub const SPLITMIX_STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// Output function of SplitMix64 (Steele, Lea & Flood 2014): neighbouring arguments give unrelated bits.
#[inline(always)]
pub fn scramble(bits: u64) -> u64 {
    let z = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Adding and subtracting it rounds |x| < 2^51 to the nearest integer, which then stands in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52

/// The largest integer below or at `x` for |x| < 2^50, or below it by 1 where `x` is an integer itself.
#[inline(always)]
pub fn floor(x: f64) -> f64 {
    (x - 0.5 + ROUND) - ROUND
}

/// (sin x, cos x) for |x| < 1e5, to 1 ulp or so: Cody-Waite reduction by pi/2 and the polynomials of fdlibm.
#[inline(always)]
pub fn sin_cos(x: f64) -> (f64, f64) {
    const HALF_PI_HIGH: f64 = f64::from_bits(0x3FF9_21FB_5440_0000); // 33 bits, so n * HIGH is exact
    const HALF_PI_LOW: f64 = 6.077_100_506_506_192e-11;
    let shifted = ROUND.plus(x, std::f64::consts::FRAC_2_PI);
    let quadrant = shifted.to_bits();
    let n = shifted - ROUND;
    let r = x.minus(n, HALF_PI_HIGH).minus(n, HALF_PI_LOW);

    // Estrin's scheme: pairs of terms wait for each other less than Horner's chain does.
    let z = r * r;
    let (z2, pair) = (z * z, |low: f64, high: f64| low.plus(z, high));
    let sine = r.plus(
        r * z,
        pair(-1.666_666_666_666_663_2e-1, 8.333_333_333_322_49e-3).plus(
            z2,
            pair(-1.984_126_982_985_795e-4, 2.755_731_370_707_006_8e-6)
                .plus(z2, pair(-2.505_076_025_340_686_3e-8, 1.589_690_995_211_55e-10)),
        ),
    );
    let cosine = 1.0_f64.minus(0.5, z).plus(
        z2,
        pair(4.166_666_666_666_66e-2, -1.388_888_888_887_411e-3).plus(
            z2,
            pair(2.480_158_728_947_673e-5, -2.755_731_435_139_066_3e-7)
                .plus(z2, pair(2.087_572_321_298_175e-9, -1.135_964_755_778_819_5e-11)),
        ),
    );

    let swap = quadrant & 1 != 0;
    let sine_sign = (quadrant & 2) << 62;
    let cosine_sign = (quadrant.wrapping_add(1) & 2) << 62;
    (
        f64::from_bits(select(swap, cosine, sine).to_bits() ^ sine_sign),
        f64::from_bits(select(swap, sine, cosine).to_bits() ^ cosine_sign),
    )
}

/// cos x for |x| <= pi/2, to 3e-16: its Taylor series by Estrin's scheme.
#[inline(always)]
pub fn cos_up_to_quarter_turn(x: f64) -> f64 {
    let z = x * x;
    let (z2, pair) = (z * z, |low: f64, high: f64| low.plus(z, high));
    let z4 = z2 * z2;
    let first = pair(1.0, -0.5).plus(z2, pair(1.0 / 24.0, -1.0 / 720.0));
    let middle = pair(1.0 / 40_320.0, -1.0 / 3_628_800.0).plus(z2, pair(1.0 / 479_001_600.0, -1.0 / 87_178_291_200.0));
    let last =
        pair(1.0 / 20_922_789_888_000.0, -1.0 / 6_402_373_705_728_000.0).plus(z2, 1.0 / 2_432_902_008_176_640_000.0);
    first.plus(z4, middle.plus(z4, last))
}

/// e^x for x in [-700, 700], to 1 ulp or so.
#[inline(always)]
pub fn exp(x: f64) -> f64 {
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let shifted = ROUND.plus(x, std::f64::consts::LOG2_E);
    let n = shifted - ROUND;
    let r = x.minus(n, LN2_HIGH).minus(n, LN2_LOW);
    // Taylor series by Estrin's scheme; |r| < 0.35, so the first term left out is below 2e-16.
    let (r2, pair) = (r * r, |low: f64, high: f64| low.plus(r, high));
    let r4 = r2 * r2;
    let first = pair(1.0, 1.0).plus(r2, pair(0.5, 1.0 / 6.0));
    let second = pair(1.0 / 24.0, 1.0 / 120.0).plus(r2, pair(1.0 / 720.0, 1.0 / 5_040.0));
    let third = pair(1.0 / 40_320.0, 1.0 / 362_880.0).plus(r2, pair(1.0 / 3_628_800.0, 1.0 / 39_916_800.0));
    let last = pair(1.0 / 479_001_600.0, 1.0 / 6_227_020_800.0);
    let sum = first.plus(r4, second).plus(r4 * r4, third.plus(r4, last));
    let power_of_two = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    sum * power_of_two
}

/// Natural logarithm of a normal positive number, to 2 ulp or so.
#[inline(always)]
pub fn ln(x: f64) -> f64 {
    const MANTISSA: u64 = (1 << 52) - 1;
    // x = 2^exponent (1 + s) / (1 - s) with the second factor between sqrt(1/2) and sqrt 2.
    let mantissa = f64::from_bits(x.to_bits() & MANTISSA | 1.0_f64.to_bits());
    let halve = mantissa > std::f64::consts::SQRT_2;
    let m = select(halve, 0.5 * mantissa, mantissa);
    let exponent = (x.to_bits() >> 52) as i64 as f64 - select(halve, 1022.0, 1023.0);
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let mut sum = 0.0;
    for odd in [21.0, 19.0, 17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0] {
        sum = (1.0 / odd).plus(sum, z);
    }
    exponent * std::f64::consts::LN_2 + 2.0 * s * sum
}

/// Hyperbolic tangent, absolute error below 3e-16.
#[inline(always)]
pub fn tanh(x: f64) -> f64 {
    let decay = exp(-2.0 * min(x.abs(), 20.0));
    ((1.0 - decay) / (1.0 + decay)).copysign(x)
}

/// 2 atan `t`: the angle whose half has this tangent, to 2 ulp or so for |t| <= 0.6 (62 degrees); beyond, that of +-0.6.
///
/// Chebyshev's interpolation of atan(t)/t over t^2 in [0, 0.36], by Estrin's scheme.
#[inline(always)]
pub fn angle_of_half_tangent(t: f64) -> f64 {
    let t = clamp(t, -0.6, 0.6);
    let z = t * t;
    let (z2, pair) = (z * z, |low: f64, high: f64| low.plus(z, high));
    let z4 = z2 * z2;
    let first = pair(1.0, -0.333_333_333_333_312_2).plus(z2, pair(0.199_999_999_996_168_6, -0.142_857_142_582_528_5));
    let second = pair(0.111_111_100_799_224_07, -0.090_908_857_852_459_22)
        .plus(z2, pair(0.076_919_643_827_201_86, -0.066_632_059_180_462_08));
    let third = pair(0.058_577_572_912_225_17, -0.051_378_362_858_457_43)
        .plus(z2, pair(0.043_009_210_993_509_98, -0.031_239_873_677_731_165));
    let last = pair(0.016_613_375_505_873_307, -0.004_598_336_356_933_231);
    2.0 * t * first.plus(z4, second).plus(z4 * z4, third.plus(z4, last))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep(low: f64, high: f64) -> impl Iterator<Item = f64> {
        (0..=100_000).map(move |i| low + (high - low) * f64::from(i) / 100_000.0)
    }

    #[test]
    fn floor_agrees_with_std_but_for_integers() {
        for x in sweep(-50.3, 950.1) {
            assert!(floor(x) == x.floor() || x == x.floor() && floor(x) == x - 1.0, "{x}");
        }
        assert!((0..1000).map(f64::from).all(|x| floor(x) == x || floor(x) == x - 1.0));
    }

    #[test]
    fn sin_cos_agrees_with_std_to_two_ulp_over_many_turns() {
        for x in sweep(-50.0, 50.0).chain(sweep(-1e-3, 1e-3)) {
            let (s, c) = sin_cos(x);
            assert!((s - x.sin()).abs() < 4e-16, "sin {x}");
            assert!((c - x.cos()).abs() < 4e-16, "cos {x}");
        }
    }

    #[test]
    fn cos_up_to_quarter_turn_agrees_with_std() {
        for x in sweep(-std::f64::consts::FRAC_PI_2, std::f64::consts::FRAC_PI_2) {
            assert!((cos_up_to_quarter_turn(x) - x.cos()).abs() < 4e-16, "{x}");
        }
    }

    #[test]
    fn exp_and_tanh_agree_with_std() {
        for x in sweep(-40.0, 40.0) {
            assert!((exp(x) / x.exp() - 1.0).abs() < 8e-16, "exp {x}");
            assert!((tanh(x) - x.tanh()).abs() < 4e-16, "tanh {x}");
        }
    }

    #[test]
    fn ln_agrees_with_std() {
        for x in sweep(1e-6, 4.0).chain(sweep(1e-300, 1e-299)).chain(sweep(1e299, 1e300)) {
            assert!((ln(x) - x.ln()).abs() < 3e-16 * x.ln().abs().max(1.0), "ln {x}");
        }
    }

    #[test]
    fn angle_of_half_tangent_agrees_with_std_and_keeps_its_sign_beyond() {
        for t in sweep(-0.6, 0.6) {
            assert!((angle_of_half_tangent(t) - 2.0 * t.atan()).abs() < 7e-16, "{t}");
        }
        assert!(angle_of_half_tangent(1.7) > 1.08 && angle_of_half_tangent(-9.0) < -1.08);
    }
}
