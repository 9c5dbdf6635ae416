//! Structure-of-arrays storage for blocks of `L` walkers.
//!
//! Physics is written on plain structs of `f64`. [`lanes!`](crate::numerics::lanes::lanes) derives from such a struct a
//! second one whose every field is a column `[f64; L]`, with `get` and `set` that move one walker in and out. Inlined into
//! `for lane in 0..L`, `get`, a branch-free function and `set` are what LLVM turns into vector code; with `L = 1` the same
//! lines are the scalar reference.

/// Declares a struct of scalars and its columns.
macro_rules! lanes {
    ($(#[$meta:meta])* pub struct $Scalar:ident, $Lanes:ident {
        $($(#[$field_meta:meta])* $field:ident: $kind:ty,)+
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        pub struct $Scalar { $($(#[$field_meta])* pub $field: $kind,)+ }

        #[doc = concat!("Columns of [`", stringify!($Scalar), "`], one entry per lane.")]
        #[derive(Clone, Debug)]
        #[repr(align(64))]
        pub struct $Lanes<const L: usize> { $($(#[$field_meta])* pub $field: [$kind; L],)+ }

        #[allow(dead_code)]
        impl<const L: usize> $Lanes<L> {
            /// The walker in `lane`.
            #[inline(always)]
            pub fn get(&self, lane: usize) -> $Scalar { $Scalar { $($field: self.$field[lane],)+ } }
            /// Replaces the walker in `lane`.
            #[inline(always)]
            pub fn set(&mut self, lane: usize, value: $Scalar) { $(self.$field[lane] = value.$field;)+ }
            /// The same walker in every lane.
            pub fn splat(value: $Scalar) -> Self { Self { $($field: [value.$field; L],)+ } }
        }

        impl<const L: usize> Default for $Lanes<L> {
            fn default() -> Self { Self::splat($Scalar::default()) }
        }
    };
}

/// Makes columns of `f64` a vector that the steppers can add up.
macro_rules! integrable {
    ($Lanes:ident { $($field:ident),+ $(,)? }) => {
        impl<const L: usize> $crate::numerics::integrator::StateVector<L> for $Lanes<L> {
            #[inline(always)]
            fn add_scaled(&mut self, base: &Self, step: &[f64; L], rate: &Self) {
                $(for lane in 0..L { self.$field[lane] = step[lane].mul_add(rate.$field[lane], base.$field[lane]); })+
            }
            #[inline(always)]
            fn interpolate(&mut self, start: &Self, end: &Self, share: &[f64; L]) {
                $(for lane in 0..L {
                    self.$field[lane] = share[lane].mul_add(end.$field[lane] - start.$field[lane], start.$field[lane]);
                })+
            }
        }
    };
}

/// Compiles a function and all that it inlines for each vector unit, and chooses at run time. Physics fuses multiplication and
/// addition, which processors without such an instruction (before 2013) compute in software, slowly and to the same bits.
macro_rules! vectorised {
    ($function:item) => {
        #[multiversion::multiversion(targets(
            "x86_64+avx512f+avx512vl+avx512dq+avx512bw+avx512cd+fma+bmi1+bmi2",
            "x86_64+avx2+fma+bmi1+bmi2"
        ))]
        $function
    };
}

pub(crate) use {integrable, lanes, vectorised};
