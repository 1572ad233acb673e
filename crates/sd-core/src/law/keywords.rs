//! Choices with keywords.

/// A keyword with its meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Keyword {
    /// The keyword in files, tables and JSON.
    pub word: &'static str,
    /// A short description.
    pub meaning: &'static str,
}

/// A closed list of choices, each declared once with its keyword.
///
/// ```
/// use sd_core::NormalLaw;
/// use sd_core::model::Keywords;
///
/// assert_eq!(NormalLaw::of_word("hertz"), Some(NormalLaw::Hertz));
/// assert_eq!(NormalLaw::Hertz.word(), "hertz");
/// assert_eq!(NormalLaw::Hertz.to_string(), "hertz");
/// ```
pub trait Keywords: Copy + PartialEq + 'static {
    /// All choices, in the order of their declaration.
    const ALL: &'static [Self];
    /// Their keywords, in the same order.
    const KEYWORDS: &'static [Keyword];

    /// Its index in [`Keywords::ALL`].
    ///
    /// # Panics
    /// If an implementation lists no choice that is equal to it.
    fn index(self) -> usize {
        Self::ALL
            .iter()
            .position(|choice| *choice == self)
            .expect("`ALL` has every variant, as one macro writes both")
    }

    /// The keyword of this choice.
    fn word(self) -> &'static str {
        Self::KEYWORDS[self.index()].word
    }

    /// The choice with this keyword.
    fn of_word(word: &str) -> Option<Self> {
        let index = Self::KEYWORDS.iter().position(|known| known.word == word)?;
        Some(Self::ALL[index])
    }
}

/// Declares an enum with keywords: its list, its keywords, and text and serde with the same
/// keywords.
macro_rules! words {
    ($(#[$about:meta])* $name:ident { $($variant:ident = $word:literal, $meaning:literal;)+ }) => {
        $crate::law::words! {
            $(#[$about])* $name { $(#[doc = $meaning] $variant = $word, $meaning;)+ }
        }
    };
    ($(#[$about:meta])* $name:ident { $(#[$note:meta] $variant:ident = $word:expr, $meaning:expr;)+ }) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum $name {
            $(#[$note] $variant,)+
        }

        impl $crate::law::Keywords for $name {
            const ALL: &'static [Self] = &[$(Self::$variant),+];
            const KEYWORDS: &'static [$crate::law::Keyword] =
                &[$($crate::law::Keyword { word: $word, meaning: $meaning }),+];
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad($crate::law::Keywords::word(*self))
            }
        }

        impl serde::Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str($crate::law::Keywords::word(*self))
            }
        }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                const NAMES: &[&str] = &[$($word),+];
                let text = <String as serde::Deserialize>::deserialize(deserializer)?;
                <Self as $crate::law::Keywords>::of_word(&text)
                    .ok_or_else(|| serde::de::Error::unknown_variant(&text, NAMES))
            }
        }
    };
}
pub(crate) use words;
