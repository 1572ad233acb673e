//! Choices of an output: enums whose values have keywords.

/// Declares an enum with its keywords, each with its meaning; the first value is the default.
macro_rules! choices {
    ($(#[$about:meta])* $name:ident { $($variant:ident = $word:literal, $meaning:literal;)+ }) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum $name {
            $(#[doc = $meaning] $variant,)+
        }

        impl sd_core::model::Keywords for $name {
            const ALL: &'static [Self] = &[$(Self::$variant),+];
            const KEYWORDS: &'static [sd_core::model::Keyword] =
                &[$(sd_core::model::Keyword { word: $word, meaning: $meaning }),+];
        }

        impl Default for $name {
            fn default() -> Self {
                <Self as sd_core::model::Keywords>::ALL[0]
            }
        }
    };
}
pub(crate) use choices;
