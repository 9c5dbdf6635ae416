//! Declares a block's parameters once: field, unit, default, range and documentation.
//!
//! [`params!`](crate::schema::params::params) makes of one declaration the struct, its defaults, its serde schema (unknown
//! keys are errors), its range check, and the table that help texts and documentation pages are generated from. Structs so
//! declared nest as `sections`.

use crate::schema::error::{Error, Result};

/// Allowed values of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    low: f64,
    high: f64,
    excludes_low: bool,
}

/// All values from `low` to `high`, both included.
pub const fn within(low: f64, high: f64) -> Range {
    Range { low, high, excludes_low: false }
}

/// All values above `low` (which is excluded, typically because something divides by it) up to `high`.
pub const fn above(low: f64, high: f64) -> Range {
    Range { low, high, excludes_low: true }
}

impl Range {
    /// Whether `value` is a finite number in the range.
    pub fn contains(self, value: f64) -> bool {
        value <= self.high && if self.excludes_low { value > self.low } else { value >= self.low }
    }

    /// Returns an error naming `key` unless the range contains `value`.
    pub fn check(self, key: &str, value: f64, unit: &str) -> Result<()> {
        if self.contains(value) {
            return Ok(());
        }
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        Err(Error::OutOfRange { key: key.to_owned(), value: value.to_string(), range: format!("{self}{unit}") })
    }
}

impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let open = if self.excludes_low { '(' } else { '[' };
        write!(f, "{open}{}, {}]", self.low, self.high)
    }
}

/// One line of the parameter table.
#[derive(Clone, Debug)]
pub struct ParameterDoc {
    /// Dotted path.
    pub key: String,
    /// Default as text.
    pub default: String,
    /// Unit, empty if none.
    pub unit: &'static str,
    /// Allowed range as text.
    pub range: String,
    /// Meaning and source.
    pub doc: String,
}

/// What can stand as the value of a parameter.
pub trait Parameter: Clone {
    /// The numbers that must lie in the declared range.
    fn numbers(&self) -> [f64; 2];
    /// For tables.
    fn text(&self) -> String;
    /// What may stand here, for tables: the declared range, unless the type says otherwise.
    fn allowed(declared: Range) -> String {
        declared.to_string()
    }
    /// Further conditions of the type itself.
    fn check(&self, _key: &str) -> Result<()> {
        Ok(())
    }
    /// Sets it to a number, if it is one; else false.
    fn assign(&mut self, _number: f64) -> bool {
        false
    }
    /// Its number, if it is one.
    fn number(&self) -> Option<f64> {
        None
    }
}

impl Parameter for f64 {
    fn assign(&mut self, number: f64) -> bool {
        *self = number;
        true
    }
    fn number(&self) -> Option<f64> {
        Some(*self)
    }
    fn numbers(&self) -> [f64; 2] {
        [*self; 2]
    }
    fn text(&self) -> String {
        self.to_string()
    }
}

impl Parameter for usize {
    fn assign(&mut self, number: f64) -> bool {
        *self = number.round() as usize;
        true
    }
    fn number(&self) -> Option<f64> {
        Some(*self as f64)
    }
    fn numbers(&self) -> [f64; 2] {
        [*self as f64; 2]
    }
    fn text(&self) -> String {
        self.to_string()
    }
}

impl Parameter for bool {
    fn numbers(&self) -> [f64; 2] {
        [f64::from(u8::from(*self)); 2]
    }
    fn text(&self) -> String {
        self.to_string()
    }
    fn allowed(_: Range) -> String {
        "true | false".to_owned()
    }
}

/// One of a few names: the variants of an enum, as its derives of strum spell them.
pub trait Choice: Copy + Into<&'static str> + strum::VariantNames {}

impl<T: Choice> Parameter for T {
    fn numbers(&self) -> [f64; 2] {
        [0.0; 2]
    }
    fn text(&self) -> String {
        let name: &str = (*self).into();
        name.to_owned()
    }
    fn allowed(_: Range) -> String {
        T::VARIANTS.join(" | ")
    }
}

/// Any value of its type: the range of parameters that are no numbers.
pub const ANY: Range = within(0.0, 1.0);

/// See the module's documentation.
macro_rules! params {
    ($(#[doc = $struct_doc:literal])* pub struct $Name:ident {
        $($(#[doc = $doc:literal])* $field:ident: $kind:ty = $default:expr, $unit:literal, $range:expr;)+
    } $(sections { $($section:ident: $Section:ident,)+ })?) => {
        $(#[doc = $struct_doc])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $Name {
            $($(#[doc = $doc])* #[doc = concat!("\n\nUnit: ", $unit)] pub $field: $kind,)+
            $($(#[doc = concat!("Section [`", stringify!($Section), "`].")] pub $section: $Section,)+)?
        }

        impl Default for $Name {
            fn default() -> Self { Self { $($field: $default,)+ $($($section: $Section::default(),)+)? } }
        }

        impl $Name {
            /// Checks every field against its range; `path` is the dotted path of this struct.
            pub fn validate(&self, path: &str) -> $crate::schema::error::Result<()> {
                use $crate::schema::params::Parameter;
                $({
                    let key = format!("{path}.{}", stringify!($field));
                    for number in self.$field.numbers() { $range.check(&key, number, $unit)?; }
                    self.$field.check(&key)?;
                })+
                $($(self.$section.validate(&format!("{path}.{}", stringify!($section)))?;)+)?
                Ok(())
            }

            /// Sets the number at `path`, relative to this struct; false if there is none.
            #[allow(unused_variables)]
            pub fn assign(&mut self, path: &str, number: f64) -> bool {
                use $crate::schema::params::Parameter;
                $(if path == stringify!($field) { return self.$field.assign(number); })+
                $($(
                    if let Some(path) = path.strip_prefix(concat!(stringify!($section), ".")) {
                        return self.$section.assign(path, number);
                    }
                )+)?
                false
            }

            /// The number at `path`, relative to this struct, and the range that is declared for it.
            pub fn number(&self, path: &str) -> Option<(f64, $crate::schema::params::Range)> {
                use $crate::schema::params::Parameter;
                $(if path == stringify!($field) { return Some((self.$field.number()?, $range)); })+
                $($(
                    if let Some(path) = path.strip_prefix(concat!(stringify!($section), ".")) {
                        return self.$section.number(path);
                    }
                )+)?
                None
            }

            /// The parameter table of this struct.
            pub fn table(path: &str) -> Vec<$crate::schema::params::ParameterDoc> {
                use $crate::schema::params::Parameter;
                let defaults = Self::default();
                let fields = vec![$($crate::schema::params::ParameterDoc {
                    key: format!("{path}.{}", stringify!($field)),
                    default: defaults.$field.text(),
                    unit: $unit,
                    range: <$kind as Parameter>::allowed($range),
                    doc: concat!($($doc, "\n"),*).trim().to_owned(),
                }),+];
                [fields $(, $($Section::table(&format!("{path}.{}", stringify!($section)))),+)?].concat()
            }
        }
    };
}
pub(crate) use params;
