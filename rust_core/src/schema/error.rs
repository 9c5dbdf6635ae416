//! The one error type of the crate.

/// What went wrong: mostly what a caller did, in words that name the key, the value and what is allowed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A parameter lies outside its range, or is not a number.
    #[error("{key} = {value} is outside its allowed range {range}")]
    OutOfRange {
        /// Dotted path of the parameter.
        key: String,
        /// The offending value as given.
        value: String,
        /// Allowed range, with its unit.
        range: String,
    },
    /// The configuration does not fit the schema: unknown key, wrong type, missing field.
    #[error("{key}: {reason}")]
    Schema {
        /// Dotted path of the offending key.
        key: String,
        /// What is wrong with it.
        reason: String,
    },
    /// Parameters that are fine one by one but impossible together, or an argument that does not fit the batch.
    #[error("{0}")]
    Invalid(String),
    /// Something that can no longer be used, through nobody's input.
    #[error("{0}")]
    Unusable(String),
    /// A panic: not the caller's fault.
    #[error(
        "internal error, a bug of prosthesis_gym that no input should cause; please report it with what led to it: {0}"
    )]
    Internal(String),
}

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;
