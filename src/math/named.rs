//! Names of closed choices: one table per enum gives the variants, their names and a word on each,
//! for scene files, options of the command line and attributes of images.

/// A closed choice whose variants have names.
pub trait Named: Copy + Sized + 'static {
    /// Every variant, in the order of the table.
    const ALL: &'static [Self];

    /// Name of the variant.
    fn as_str(self) -> &'static str;

    /// A few words on the variant.
    fn help(self) -> &'static str;

    /// The variant of that name.
    #[must_use]
    fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|v| v.as_str() == name)
    }
}

/// Defines an enum with a name and a few words for each variant, and implements [`Named`] and
/// `Display` for it.
macro_rules! named {
    ($(#[$meta:meta])* $vis:vis enum $enum:ident {
        $($(#[$variant_meta:meta])* $variant:ident = $name:literal: $help:literal,)+
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        $vis enum $enum {
            $($(#[$variant_meta])* $variant,)+
        }

        impl $crate::math::named::Named for $enum {
            const ALL: &'static [Self] = &[$(Self::$variant,)+];

            fn as_str(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)+
                }
            }

            fn help(self) -> &'static str {
                match self {
                    $(Self::$variant => $help,)+
                }
            }
        }

        impl std::fmt::Display for $enum {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad($crate::math::named::Named::as_str(*self))
            }
        }
    };
}
pub(crate) use named;

#[cfg(test)]
mod tests {
    use super::Named;

    named! {
        /// Sides of a thing.
        pub enum Side {
            /// The one that is seen.
            Front = "front": "What is seen",
            Back = "back": "What is not",
        }
    }

    #[test]
    fn names_go_both_ways() {
        assert_eq!(Side::ALL, [Side::Front, Side::Back]);
        for &side in Side::ALL {
            assert_eq!(Side::named(side.as_str()), Some(side));
        }
        assert_eq!(Side::named("Front"), None);
        assert_eq!(Side::Back.help(), "What is not");
        assert_eq!(format!("{:>6}", Side::Front), " front");
    }
}
