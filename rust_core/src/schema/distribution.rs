//! Distributions that episodes are drawn from.

use serde::{Deserialize, Serialize};

use crate::numerics::math::{exp, ln, scramble};
use crate::numerics::noise;
use crate::schema::error::{Error, Result};
use crate::schema::params::{Parameter, Range};

/// Distribution of a number that every episode draws anew: a number is fixed, `[low, high]` is uniform, and tables name the others.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "Written")]
pub enum Distribution {
    /// Always this value.
    Fixed(f64),
    /// Uniform between the two.
    Uniform([f64; 2]),
    /// Uniform in the logarithm between the two, which are positive.
    LogUniform([f64; 2]),
    /// Normal with mean and standard deviation, cut off at three of them.
    Normal([f64; 2]),
    /// One of these with equal odds.
    Choice(Vec<f64>),
}

/// A normal distribution is cut off this many standard deviations from its mean.
const CUT_OFF: f64 = 3.0;

/// How a distribution stands in a file.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number, [low, high], or one of {uniform = [low, high]}, {log_uniform = [low, high]}, {normal = [mean, deviation]}, {choice = [..]}"
)]
enum Written {
    Number(f64),
    Pair([f64; 2]),
    Named(Named),
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Named {
    Uniform(Vec<f64>),
    LogUniform(Vec<f64>),
    Normal(Vec<f64>),
    Choice(Vec<f64>),
}

impl TryFrom<Written> for Distribution {
    type Error = String;

    fn try_from(written: Written) -> std::result::Result<Self, String> {
        let pair = |values: Vec<f64>| values.try_into().map_err(|values| format!("{values:?} must be two numbers"));
        Ok(match written {
            Written::Number(value) => Self::Fixed(value),
            Written::Pair(bounds) => Self::Uniform(bounds),
            Written::Named(Named::Uniform(values)) => Self::Uniform(pair(values)?),
            Written::Named(Named::LogUniform(values)) => Self::LogUniform(pair(values)?),
            Written::Named(Named::Normal(values)) => Self::Normal(pair(values)?),
            Written::Named(Named::Choice(values)) if values.is_empty() => return Err("choice must not be empty".into()),
            Written::Named(Named::Choice(values)) => Self::Choice(values),
        })
    }
}

impl Serialize for Distribution {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        match self {
            Self::Fixed(value) => value.serialize(serializer),
            // As a sequence: an array would become a tuple in Python.
            Self::Uniform(bounds) => bounds.as_slice().serialize(serializer),
            Self::LogUniform(bounds) => Named::LogUniform(bounds.to_vec()).serialize(serializer),
            Self::Normal(moments) => Named::Normal(moments.to_vec()).serialize(serializer),
            Self::Choice(values) => Named::Choice(values.clone()).serialize(serializer),
        }
    }
}

impl Distribution {
    /// Smallest and largest value.
    pub fn bounds(&self) -> [f64; 2] {
        match self {
            Self::Fixed(value) => [*value; 2],
            Self::Uniform(bounds) | Self::LogUniform(bounds) => *bounds,
            Self::Normal([mean, deviation]) => [mean - CUT_OFF * deviation, mean + CUT_OFF * deviation],
            Self::Choice(values) => {
                values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &x| [low.min(x), high.max(x)])
            }
        }
    }

    /// Turns a random number `fraction`, uniform in [0, 1), into a value of the distribution. For a uniform distribution that is
    /// the value this fraction of the way from its lowest to its highest.
    pub fn at(&self, fraction: f64) -> f64 {
        match self {
            Self::Fixed(value) => *value,
            Self::Uniform([low, high]) => low + (high - low) * fraction,
            Self::LogUniform([low, high]) => (low * exp(ln(high / low) * fraction)).clamp(*low, *high),
            Self::Normal([mean, deviation]) => {
                mean + deviation * noise::normal(scramble(fraction.to_bits())).clamp(-CUT_OFF, CUT_OFF)
            }
            Self::Choice(values) => values[((fraction * values.len() as f64) as usize).min(values.len() - 1)],
        }
    }
}

impl Parameter for Distribution {
    fn numbers(&self) -> [f64; 2] {
        // NaN in a choice would be lost among its bounds.
        if let Self::Choice(values) = self
            && let Some(&wrong) = values.iter().find(|value| !value.is_finite())
        {
            return [wrong; 2];
        }
        self.bounds()
    }
    fn text(&self) -> String {
        match self {
            Self::Fixed(value) => value.to_string(),
            Self::Uniform([low, high]) => format!("[{low}, {high}]"),
            Self::LogUniform([low, high]) => format!("{{log_uniform = [{low}, {high}]}}"),
            Self::Normal([mean, deviation]) => format!("{{normal = [{mean}, {deviation}]}}"),
            Self::Choice(values) => format!("{{choice = {values:?}}}"),
        }
    }
    fn allowed(declared: Range) -> String {
        format!("distribution in {declared}")
    }
    fn check(&self, key: &str) -> Result<()> {
        let wrong = match self {
            Self::Fixed(_) | Self::Choice(_) => None,
            Self::Uniform([low, high]) => (low > high).then_some("[low, high] with low <= high"),
            Self::LogUniform([low, high]) => (*low <= 0.0 || low > high || !(high / low).is_finite())
                .then_some("[low, high] with 0 < low <= high and a finite high / low"),
            Self::Normal([_, deviation]) => (*deviation < 0.0).then_some("[mean, deviation] with deviation >= 0"),
        };
        let error =
            |range: &str| Error::OutOfRange { key: key.to_owned(), value: self.text(), range: range.to_owned() };
        wrong.map_or(Ok(()), |range| Err(error(range)))
    }
}

/// A value `difficulty` of the way from the nominal one.
pub fn eased(nominal: f64, value: f64, difficulty: f64) -> f64 {
    // Exactly the value at difficulty 1, where the sum would round.
    if difficulty >= 1.0 { value } else { nominal + difficulty * (value - nominal) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draws(distribution: &Distribution) -> Vec<f64> {
        (0..20_000).map(|i| distribution.at((f64::from(i) + 0.5) / 20_000.0)).collect()
    }

    fn moments(values: &[f64]) -> (f64, f64) {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (mean, (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt())
    }

    #[test]
    fn draws_have_the_moments_of_their_distributions_and_stay_within_the_bounds() {
        let log_mean = (100.0 - 1.0) / 100.0_f64.ln();
        let log_square = (100.0_f64.powi(2) - 1.0) / (2.0 * 100.0_f64.ln());
        for (distribution, mean, deviation) in [
            (Distribution::Fixed(2.0), 2.0, 0.0),
            (Distribution::Uniform([1.0, 3.0]), 2.0, 1.0 / 3.0_f64.sqrt()),
            (Distribution::LogUniform([1.0, 100.0]), log_mean, (log_square - log_mean.powi(2)).sqrt()),
            (Distribution::Normal([5.0, 2.0]), 5.0, 2.0),
            (Distribution::Choice(vec![1.0, 2.0, 6.0]), 3.0, (14.0_f64 / 3.0).sqrt()),
        ] {
            let values = draws(&distribution);
            let (drawn_mean, drawn_deviation) = moments(&values);
            assert!((drawn_mean - mean).abs() < 0.02 * mean, "{distribution:?}: mean {drawn_mean}");
            assert!(
                (drawn_deviation - deviation).abs() < 0.02 * deviation + 1e-9,
                "{distribution:?}: {drawn_deviation}"
            );
            let [low, high] = distribution.bounds();
            assert!(values.iter().all(|value| (low..=high).contains(value)), "{distribution:?}");
        }
    }

    #[test]
    fn what_is_written_reads_back_and_what_is_wrong_is_named() {
        for text in
            ["2.5", "[1.0,2.0]", r#"{"log_uniform":[1.0,2.0]}"#, r#"{"normal":[1.0,0.5]}"#, r#"{"choice":[3.0]}"#]
        {
            let distribution: Distribution = serde_json::from_str(text).unwrap();
            assert_eq!(serde_json::to_string(&distribution).unwrap(), text);
        }
        let uniform: Distribution = serde_json::from_str(r#"{"uniform":[1.0,2.0]}"#).unwrap();
        assert_eq!(uniform, Distribution::Uniform([1.0, 2.0]));
        for text in [r#"{"choice":[]}"#, r#"{"normal":[1.0]}"#, r#"{"triangular":[0,1]}"#, r#""much""#] {
            assert!(serde_json::from_str::<Distribution>(text).is_err(), "{text}");
        }
        for wrong in
            [Distribution::Uniform([2.0, 1.0]), Distribution::LogUniform([0.0, 1.0]), Distribution::Normal([0.0, -1.0])]
        {
            assert!(wrong.check("scenario.push_n").unwrap_err().to_string().contains("scenario.push_n"));
        }
        assert!(Distribution::Choice(vec![1.0, f64::NAN]).numbers()[0].is_nan());
    }
}
