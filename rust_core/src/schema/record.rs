//! Numbers that are handed on by name: a struct of them knows its names and their order, so no list is kept in step with another.

/// Declares a struct of `f64`, whose names say what they are and in which unit.
macro_rules! record {
    ($(#[$meta:meta])* pub struct $Name:ident { $($field:ident,)+ }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[allow(missing_docs)]
        pub struct $Name { $(pub $field: f64,)+ }

        impl $Name {
            /// Names, in order.
            pub const NAMES: &[&str] = &[$(stringify!($field)),+];

            /// The numbers, in the order of their names.
            pub fn values(&self) -> [f64; Self::NAMES.len()] { [$(self.$field),+] }
        }
    };
}
pub(crate) use record;
