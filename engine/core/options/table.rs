//! Tables of options: rows, relations, and the struct that a table declares.

use super::kinds::{Form, OptionValue, Refusal};
use std::collections::BTreeMap;
use std::fmt;

/// A row of a table: an option of a verb whose arguments are a `T`.
#[derive(Debug)]
pub struct Row<T: 'static> {
    /// Its name in Python; on the command line it has hyphens.
    pub name: &'static str,
    /// Form of its values.
    pub form: Form,
    /// Value without it.
    pub need: Need,
    /// Relations to other options, and where it exists.
    pub relations: &'static [Relation],
    /// Its meaning, without a full stop.
    pub doc: &'static str,
    /// Reads a value into its field.
    pub read: fn(&mut T, &OptionValue) -> Result<(), Refusal>,
}

/// Value of an option that is not given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// The option must be given.
    Required,
    /// This value, as the command line reads it.
    Default(&'static str),
    /// No value: its consequence in words, empty where the meaning says it.
    Without(&'static str),
}

/// A relation of an option, or the place where it exists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Relation {
    /// On the command line alone.
    Program,
    /// An argument by position: of the program without a name, of functions of Python as a parameter that they declare.
    Position,
    /// A parameter that functions of Python declare.
    Declared,
    /// May be repeated.
    Repeated,
    /// Several values with commas between them.
    Listed,
    /// A name of one letter.
    Short(char),
    /// Requires all of these.
    Needs(&'static [&'static str]),
    /// Excludes these.
    Excludes(&'static [&'static str]),
    /// Required without this.
    Unless(&'static str),
    /// For these values of `method` alone, and the reason.
    Methods(&'static [&'static str], &'static str),
}

/// Arguments of a verb, which a table describes.
pub trait Options: Sized + Default + Clone + fmt::Debug + Send + Sync + 'static {
    /// Its rows, in the order of help and documents.
    const ROWS: &'static [Row<Self>];

    /// Text of each given option by its name.
    fn given(&self) -> &BTreeMap<String, String>;

    /// The same, to be added to.
    fn given_mut(&mut self) -> &mut BTreeMap<String, String>;

    /// Reads an option.
    ///
    /// # Errors
    /// The reason why the option does not take the value.
    fn set(&mut self, row: &Row<Self>, value: &OptionValue, shown: String) -> Result<(), Refusal> {
        (row.read)(self, value)?;
        if *value != OptionValue::Flag(false) {
            self.given_mut().insert(row.name.to_owned(), shown);
        }
        Ok(())
    }

    /// True if an option is given.
    fn has(&self, name: &str) -> bool {
        self.given().contains_key(name)
    }

    /// The value before any option is read: every default of the table.
    #[must_use]
    fn with_defaults(mut self) -> Self {
        for row in Self::ROWS {
            if let Need::Default(text) = row.need {
                // A test reads every default.
                let _ = (row.read)(&mut self, &OptionValue::Argument(text.to_owned()));
            }
        }
        self
    }

    /// Refuses a given option that the method has no use for.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] with the option, the methods that have it, and the reason.
    fn check_method(&self, method: &str) -> crate::Result<()> {
        for row in Self::ROWS.iter().filter(|row| self.has(row.name)) {
            for relation in row.relations {
                if let Relation::Methods(methods, reason) = relation
                    && !methods.contains(&method)
                {
                    let flag = format!("--{}", row.long());
                    let found = format!("{flag} with --method {method}");
                    let allowed = format!("{}: {reason}", list(methods));
                    return Err(crate::Error::argument(row.name, found, allowed));
                }
            }
        }
        Ok(())
    }
}

/// Words with commas and "and" between them.
fn list(words: &[&str]) -> String {
    match words {
        [all @ .., last] if !all.is_empty() => format!("{} and {last}", all.join(", ")),
        _ => words.concat(),
    }
}

impl<T> Row<T> {
    /// Its name on the command line.
    #[must_use]
    pub fn long(&self) -> String {
        self.name.replace('_', "-")
    }

    /// True if it has this relation.
    #[must_use]
    pub fn is(&self, relation: Relation) -> bool {
        self.relations.contains(&relation)
    }

    /// True if a value is several texts.
    #[must_use]
    pub fn is_list(&self) -> bool {
        self.is(Relation::Repeated) || self.is(Relation::Listed)
    }

    /// Options that it requires.
    #[must_use]
    pub fn needs(&self) -> &'static [&'static str] {
        let needs = |relation: &Relation| match relation {
            Relation::Needs(names) => Some(*names),
            _ => None,
        };
        self.relations.iter().find_map(needs).unwrap_or_default()
    }

    /// Value without it in words; `None` where there is nothing to say.
    #[must_use]
    pub fn default_words(&self) -> Option<&'static str> {
        match self.need {
            Need::Default(words) | Need::Without(words) if !words.is_empty() => Some(words),
            _ => None,
        }
    }
}

/// Declares the arguments of a verb with their table: `name: Type = kind, need, [relations], "meaning";`. The kind
/// reads a value that becomes the type of the field by `Into`.
#[macro_export]
macro_rules! options {
    ($(#[$attribute:meta])* $table:ident;
     $($name:ident: $type:ty = $kind:expr, $need:expr, [$($relation:expr),*], $doc:literal;)*) => {
        $(#[$attribute])*
        #[derive(Debug, Clone)]
        pub struct $table {
            $(#[doc = $doc] pub $name: $type,)*
            /// Text of each given option by its name.
            pub given: std::collections::BTreeMap<String, String>,
        }

        impl Default for $table {
            fn default() -> Self {
                let empty = Self { $($name: Default::default(),)* given: Default::default() };
                $crate::options::Options::with_defaults(empty)
            }
        }

        impl $crate::options::Options for $table {
            const ROWS: &'static [$crate::options::Row<Self>] = &[$($crate::options::Row {
                name: stringify!($name),
                form: $kind.form,
                need: $need,
                relations: &[$($relation),*],
                doc: $doc,
                read: |it, given| {
                    it.$name = ($kind.read)(given)?.into();
                    Ok(())
                },
            }),*];

            fn given(&self) -> &std::collections::BTreeMap<String, String> {
                &self.given
            }

            fn given_mut(&mut self) -> &mut std::collections::BTreeMap<String, String> {
                &mut self.given
            }
        }
    };
}
