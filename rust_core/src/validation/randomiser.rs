//! Domain randomisation: parameters of walker, ground, knee unit and sensors that every episode draws anew.
//!
//! `scenario.randomise` draws single numbers, each for itself; `scenario.variants` draws one of several sets of parameters that
//! belong together, such as the segments of a body. Difficulty eases both towards the configured, nominal walker.

use rand::{Rng, RngExt};
use serde_json::Value;

use crate::closed_loop::episode::Drawn;
use crate::config::Config;
use crate::episode::randomisation::{Randomised, Variants};
use crate::mechanics::terrain::Terrain;
use crate::schema::distribution::{Distribution, eased};
use crate::schema::error::{Error, Result};
use crate::schema::params::{Parameter, Range};
use crate::validation::span::Span;
use crate::validation::{idle, nominal};

/// The sections that may differ between episodes, and how to reach a number in them.
macro_rules! sections {
    ($($section:ident),+) => {
        const SECTIONS: &[&str] = &[$(stringify!($section)),+];

        fn assign(config: &mut Config, key: &str, number: f64) -> bool {
            $(if let Some(path) = key.strip_prefix(concat!(stringify!($section), ".")) {
                return config.$section.assign(path, number);
            })+
            false
        }

        fn number(config: &Config, key: &str) -> Option<(f64, Range)> {
            $(if let Some(path) = key.strip_prefix(concat!(stringify!($section), ".")) {
                return config.$section.number(path);
            })+
            None
        }
    };
}
sections!(body, ground, human, knee, motor, friction_knee, end_stop, ankle, socket, tube, sensors, termination);

/// Numbers that say what the walker is made of, not how large it is.
const STRUCTURAL: &[&str] = &["body.sole_points"];
/// The rest of the termination limits is the same for all.
const TERMINATION: &str = "termination.hip_height_m";

/// Draws the parameters of episodes.
#[derive(Clone, Debug)]
pub struct Randomiser {
    nominal: Config,
    variants: Vec<Config>,
    numbers: Vec<(String, Distribution)>,
}

/// The walkers that may be drawn around one base, the nominal walker or a variant: all between these two.
#[derive(Clone, Debug)]
pub struct DrawnSpan {
    low: Config,
    high: Config,
}

impl DrawnSpan {
    /// To be checked.
    pub fn as_span(&self) -> Span<'_> {
        Span { low: &self.low, high: &self.high }
    }
}

impl Randomiser {
    /// What the configuration's scenario asks for; `None` if all episodes have the nominal walker. An error if any walker that
    /// may be drawn is impossible, or a parameter would change nothing.
    pub fn new(config: &Config) -> Result<Option<Self>> {
        let (Randomised(numbers), Variants(variants)) = (&config.scenario.randomise, &config.scenario.variants);
        if numbers.is_empty() && variants.is_empty() {
            return Ok(None);
        }
        let mut nominal = config.clone();
        nominal.scenario.randomise = Randomised::default();
        nominal.scenario.variants = Variants::default();
        let numbers = numbers.iter().map(|(key, distribution)| checked(&nominal, key, distribution));
        let variants = variants.iter().enumerate().map(|(index, variant)| varied(&nominal, index, variant));
        let numbers = numbers.collect::<Result<Vec<_>>>()?;
        let randomiser = Self { variants: variants.collect::<Result<_>>()?, numbers, nominal };
        randomiser.check(&config.scenario.variants)?;
        Ok(Some(randomiser))
    }

    /// Checks all walkers that may be drawn.
    fn check(&self, Variants(variants): &Variants) -> Result<()> {
        let drawn: Vec<DrawnSpan> = self.spans().collect();
        let spans: Vec<Span<'_>> = drawn.iter().map(DrawnSpan::as_span).collect();
        for (index, (variant, span)) in variants.iter().zip(&spans[1..]).enumerate() {
            for key in leaves(variant) {
                let same = key.starts_with("termination.") && key != TERMINATION;
                let reason = match idle::drawn(span, &key) {
                    _ if same => "it is the same for all walkers".to_owned(),
                    // A body is described whole, whatever of it moves a leg.
                    Some(idle) if !key.starts_with("body.") => format!("it needs {}", idle.needs),
                    _ => continue,
                };
                let key = format!("scenario.variants[{index}].{key}");
                return Err(Error::Schema { key, reason: format!("would change nothing: {reason}") });
            }
        }
        for key in self.keys() {
            let idle: Option<Vec<_>> = spans.iter().map(|span| idle::drawn(span, key)).collect();
            if let Some(idle) = idle.as_ref().and_then(|reasons| reasons.first()) {
                let reason = format!("would change nothing: it needs {}", idle.needs);
                return Err(Error::Schema { key: randomised_path(key), reason });
            }
        }
        for (index, span) in spans.iter().enumerate() {
            span.check().map_err(|error| {
                let base = index
                    .checked_sub(1)
                    .map_or_else(String::new, |variant| format!(" with scenario.variants[{variant}]"));
                let drawn: Vec<&str> = self.keys().collect();
                Error::Invalid(format!(
                    "scenario.randomise of {}{base}, between the configured values and the drawn ones: {error}",
                    drawn.join(", ")
                ))
            })?;
        }
        Ok(())
    }

    /// What may be drawn around the nominal walker and around each variant: any number that the distributions hold, and as
    /// difficulty eases them, any between that and the base's own.
    pub fn spans(&self) -> impl Iterator<Item = DrawnSpan> {
        std::iter::once(&self.nominal).chain(&self.variants).map(|base| {
            let end = |end: usize, outer: fn(f64, f64) -> f64| {
                let mut config = base.clone();
                for (key, distribution) in &self.numbers {
                    let bound = distribution.bounds()[end];
                    assign(&mut config, key, number(base, key).map_or(bound, |(nominal, _)| outer(nominal, bound)));
                }
                config
            };
            DrawnSpan { low: end(0, f64::min), high: end(1, f64::max) }
        })
    }

    /// Keys of the randomised parameters.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.numbers.iter().map(|(key, _)| key.as_str())
    }

    /// Draws an episode. `difficulty` in [0, 1]: at 0 the nominal walker, at 1 the distributions as they are; between, numbers
    /// lie that share of the way from their nominal values, and so many episodes have a variant.
    pub fn draw(&self, random: &mut impl Rng, difficulty: f64) -> Drawn {
        let (odds, choice) = (random.random::<f64>(), random.random::<f64>());
        let varies = odds < difficulty && !self.variants.is_empty();
        let variant = varies.then(|| ((choice * self.variants.len() as f64) as usize).min(self.variants.len() - 1));
        let base = variant.map_or(&self.nominal, |variant| &self.variants[variant]);
        let draw = |(key, distribution): &(String, Distribution)| {
            let nominal = number(base, key).map_or(0.0, |(nominal, _)| nominal);
            let [low, high] = distribution.bounds();
            // Rounding must not leave the span that has been checked.
            let value = distribution.at(random.random::<f64>()).clamp(low, high);
            eased(nominal, value, difficulty).clamp(nominal.min(low), nominal.max(high))
        };
        let drawn = Drawn { variant, numbers: self.numbers.iter().map(draw).collect() };
        // Read back what the walker makes of them: a count or a seed is a whole number.
        let config = self.config(&drawn);
        Drawn { numbers: self.keys().filter_map(|key| Some(number(&config, key)?.0)).collect(), ..drawn }
    }

    /// The walker that has been drawn.
    pub fn config(&self, drawn: &Drawn) -> Config {
        let mut config = drawn.variant.map_or(&self.nominal, |variant| &self.variants[variant]).clone();
        for ((key, _), &number) in self.numbers.iter().zip(&drawn.numbers) {
            assign(&mut config, key, number);
        }
        config
    }

    /// Whether any walker may meet ground that is not level.
    pub fn is_uneven(&self) -> bool {
        let uneven = |config: &Config| !Terrain::from(&config.ground).is_level();
        self.spans().any(|span| uneven(&span.low) || uneven(&span.high))
    }
}

fn randomised_path(key: &str) -> String {
    format!("scenario.randomise.\"{key}\"")
}

/// A randomised parameter, if it is one whose whole distribution is allowed.
fn checked(nominal: &Config, key: &str, distribution: &Distribution) -> Result<(String, Distribution)> {
    let path = randomised_path(key);
    let known = !STRUCTURAL.contains(&key) && (!key.starts_with("termination.") || key == TERMINATION);
    let Some((_, range)) = number(nominal, key).filter(|_| known) else {
        let sections = SECTIONS[..SECTIONS.len() - 1].join(", ");
        return Err(Error::Schema {
            key: path,
            reason: format!("must be a number in one of the sections {sections}, or {TERMINATION}"),
        });
    };
    distribution.check(&path)?;
    for number in distribution.numbers() {
        range.check(&path, number, "")?;
    }
    Ok((key.to_owned(), distribution.clone()))
}

/// The nominal configuration with the changes of a variant, if they make a walker of the same kind.
fn varied(nominal: &Config, index: usize, variant: &Value) -> Result<Config> {
    let path = format!("scenario.variants[{index}]");
    let wrong = |reason: String| Error::Schema { key: path.clone(), reason };
    let Value::Object(sections) = variant else { return Err(wrong("must be a table of sections".into())) };
    if let Some(unknown) = sections.keys().find(|section| !SECTIONS.contains(&section.as_str())) {
        return Err(wrong(format!("section {unknown:?} must be one of {}", SECTIONS.join(", "))));
    }
    let mut merged = serde_json::to_value(nominal).map_err(|error| wrong(error.to_string()))?;
    merge(&mut merged, variant);
    let config = Config::parse(merged).map_err(|error| wrong(error.to_string()))?;
    nominal::check(&config).map_err(|error| wrong(error.to_string()))?;
    let same = config.body.sole_points == nominal.body.sole_points
        && config.socket.connection == nominal.socket.connection
        && config.socket.place == nominal.socket.place
        && config.tube.connection == nominal.tube.connection;
    if !same {
        return Err(wrong("must not change the walker's joints or contact points".into()));
    }
    Ok(config)
}

/// Dotted paths of all values.
fn leaves(value: &Value) -> Vec<String> {
    let Value::Object(entries) = value else { return vec![String::new()] };
    let below = |(key, value): (&String, &Value)| {
        let join = |rest: String| if rest.is_empty() { key.clone() } else { format!("{key}.{rest}") };
        leaves(value).into_iter().map(join).collect::<Vec<_>>()
    };
    entries.iter().flat_map(below).collect()
}

fn merge(base: &mut Value, changes: &Value) {
    match (base, changes) {
        (Value::Object(base), Value::Object(changes)) => {
            for (key, change) in changes {
                merge(base.entry(key.clone()).or_insert(Value::Null), change);
            }
        }
        (base, change) => *base = change.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_pcg::Pcg64;
    use serde_json::json;

    fn config(randomise: Value, variants: Value) -> Result<Config> {
        Config::from_deserializer(json!({"scenario": {"randomise": randomise, "variants": variants}}))
    }

    fn randomiser(randomise: Value, variants: Value) -> Randomiser {
        Randomiser::new(&config(randomise, variants).unwrap()).unwrap().unwrap()
    }

    #[test]
    fn every_episode_draws_its_own_numbers_and_variant() {
        let bodies = json!([{"body": {"trunk_mass_kg": 40.0}}, {"body": {"trunk_mass_kg": 60.0}}]);
        let randomiser = randomiser(json!({"knee.spring_nm_rad": [1.0, 3.0], "ground.friction": 0.7}), bodies);
        let configs: Vec<_> =
            (0..200).map(|stream| randomiser.config(&randomiser.draw(&mut Pcg64::new(1, stream), 1.0))).collect();
        assert!(configs.iter().all(|config| config.ground.friction == 0.7));
        assert!(configs.iter().all(|config| (1.0..3.0).contains(&config.knee.spring_nm_rad)));
        assert!(configs.windows(2).all(|pair| pair[0].knee.spring_nm_rad != pair[1].knee.spring_nm_rad));
        let heavy = configs.iter().filter(|config| config.body.trunk_mass_kg == 60.0).count();
        assert!((70..130).contains(&heavy), "{heavy}");
        assert!(configs.iter().all(|config| [40.0, 60.0].contains(&config.body.trunk_mass_kg)));
    }

    #[test]
    fn difficulty_leads_from_the_nominal_walker_to_the_whole_distribution() {
        let variants = json!([{"ankle": {"stiffness_nm_rad": 300.0}}]);
        let randomiser = randomiser(json!({"knee.spring_nm_rad": [4.0, 6.0]}), variants);
        let nominal = Config::default();
        let spring = |difficulty: f64| {
            let drawn = randomiser.draw(&mut Pcg64::new(1, 5), difficulty);
            randomiser.config(&drawn).knee.spring_nm_rad
        };
        assert_eq!(spring(0.0), nominal.knee.spring_nm_rad);
        let halfway = 0.5 * (spring(1.0) + nominal.knee.spring_nm_rad);
        assert!((spring(0.5) - halfway).abs() < 1e-12);
        let varied = |difficulty: f64| {
            (0..1000).filter(|&i| randomiser.draw(&mut Pcg64::new(2, i), difficulty).variant.is_some()).count()
        };
        assert_eq!((varied(0.0), varied(1.0)), (0, 1000));
        assert!((230..370).contains(&varied(0.3)), "{}", varied(0.3));
    }

    #[test]
    fn ground_is_uneven_if_any_episode_may_be() {
        let none = || json!([]);
        assert!(!randomiser(json!({"ground.friction": [0.3, 0.6]}), none()).is_uneven());
        assert!(randomiser(json!({"ground.slope_deg": [-1.0, 1.0]}), none()).is_uneven());
        assert!(randomiser(json!({}), json!([{"ground": {"roughness_m": 0.01}}])).is_uneven());
    }

    #[test]
    fn what_cannot_be_randomised_is_refused_by_name() {
        for (randomise, variants, named) in [
            (json!({"solver.steps": [3, 8]}), json!([]), "solver.steps"),
            (json!({"body.sole_points": [2, 4]}), json!([]), "body.sole_points"),
            (json!({"knee.spring": 1.0}), json!([]), "knee.spring"),
            (json!({"ground.friction": [-1.0, 0.5]}), json!([]), "ground.friction"),
            (json!({"ground.friction": {"normal": [0.5, 0.5]}}), json!([]), "ground.friction"),
            (json!({}), json!([{"reward": {"fall": 1.0}}]), "variants[0]"),
            (json!({}), json!([{}, {"knee": {"spring_nm_rad": -1.0}}]), "knee.spring_nm_rad"),
            (json!({}), json!([{"body": {"sole_points": 5}}]), "contact points"),
        ] {
            let error = config(randomise, variants).unwrap_err().to_string();
            assert!(error.contains(named), "{error}");
        }
    }
}
