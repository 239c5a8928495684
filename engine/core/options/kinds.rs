//! Kinds of values of options: their forms on the command line and in Python, and how they are read.

use crate::Error;
use crate::units::{self, Dimension, QuantityError};
use std::path::PathBuf;

/// Value of an option as it is given.
#[derive(Debug, Clone, PartialEq)]
pub enum OptionValue {
    /// Text on the command line.
    Argument(String),
    /// Text in Python.
    Text(String),
    /// A number that is not whole.
    Number(f64),
    /// A whole number.
    Whole(i64),
    /// True or false.
    Flag(bool),
    /// Several values.
    List(Vec<Self>),
    /// A slice of Python.
    Slice {
        /// First index.
        start: Option<i64>,
        /// Index behind the last.
        end: Option<i64>,
        /// From index to index.
        step: Option<i64>,
    },
    /// Any other value.
    Other,
}

/// Reason why an option does not take a value.
#[derive(Debug)]
pub enum Refusal {
    /// It has another form.
    Form,
    /// A quantity without a unit, or with an unknown one.
    Quantity(QuantityError),
    /// An error that names the option.
    Value(Error),
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Self::Value(error)
    }
}

impl From<QuantityError> for Refusal {
    fn from(error: QuantityError) -> Self {
        Self::Quantity(error)
    }
}

impl Refusal {
    /// The reason without the name of the option, for the command line.
    #[must_use]
    pub fn words(&self, form: &Form) -> String {
        match self {
            Self::Form => format!("allowed: {}", form.allowed()),
            Self::Quantity(error) => error.to_string(),
            Self::Value(error) => error.to_string(),
        }
    }

    /// The error with the name of the option, for Python. `found`: the value as it is shown.
    #[must_use]
    pub fn error(self, name: &str, found: &str, form: &Form) -> Error {
        match self {
            Self::Form => Error::argument(name, found, form.allowed_in_python()),
            Self::Quantity(error) => Error::argument(name, error.found, error.allowed),
            Self::Value(error) => error,
        }
    }
}

/// Values that may begin with a hyphen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hyphens {
    /// None.
    No,
    /// Numbers below 0.
    Numbers,
    /// Any text.
    Texts,
}

/// Form of the values of an option.
#[derive(Debug, Clone, Copy)]
pub struct Form {
    /// Name of the value in help; empty of a switch.
    pub value: &'static str,
    /// Type in Python.
    pub python: &'static str,
    /// Allowed values on the command line in words; empty of choices.
    allowed: &'static str,
    /// Allowed values in Python in words; empty: as on the command line.
    in_python: &'static str,
    /// Words to choose from; empty of other values.
    pub words: fn() -> Vec<Word>,
    /// Values that may begin with a hyphen.
    pub hyphens: Hyphens,
}

impl Form {
    /// Allowed values on the command line in words.
    #[must_use]
    pub fn allowed(&self) -> String {
        let words = (self.words)();
        match words.is_empty() {
            true => self.allowed.to_owned(),
            false => words.iter().map(|word| word.name).collect::<Vec<_>>().join(", "),
        }
    }

    /// Allowed values in Python in words.
    #[must_use]
    pub fn allowed_in_python(&self) -> String {
        if self.in_python.is_empty() { self.allowed() } else { self.in_python.to_owned() }
    }

    /// Allowed values in Python in words, where they differ.
    #[must_use]
    pub fn python_form(&self) -> Option<&'static str> {
        Some(self.in_python).filter(|words| !words.is_empty())
    }

    /// True if it has no value: given, or not.
    #[must_use]
    pub const fn is_switch(&self) -> bool {
        self.value.is_empty()
    }
}

/// A kind of values: their form, and the function that reads them.
#[derive(Debug, Clone, Copy)]
pub struct Kind<V: 'static> {
    /// Their form.
    pub form: Form,
    /// Reads a value.
    pub read: fn(&OptionValue) -> Result<V, Refusal>,
}

impl<V> Kind<V> {
    /// A kind by the name of its values in help, their type in Python, the allowed ones in words, and the function that
    /// reads them.
    #[must_use]
    pub const fn new(
        value: &'static str,
        python: &'static str,
        allowed: &'static str,
        read: fn(&OptionValue) -> Result<V, Refusal>,
    ) -> Self {
        let (in_python, hyphens) = ("", Hyphens::No);
        Self { form: Form { value, python, allowed, in_python, words: Vec::new, hyphens }, read }
    }

    /// The same with another name of its values in help.
    #[must_use]
    pub const fn named(mut self, value: &'static str) -> Self {
        self.form.value = value;
        self
    }

    /// The same with another type and other allowed values in Python.
    #[must_use]
    pub const fn in_python(mut self, python: &'static str, allowed: &'static str) -> Self {
        self.form.python = python;
        self.form.in_python = allowed;
        self
    }

    /// The same with values that may begin with a hyphen.
    #[must_use]
    pub const fn with_hyphens(mut self, hyphens: Hyphens) -> Self {
        self.form.hyphens = hyphens;
        self
    }
}

impl OptionValue {
    /// A text.
    #[must_use]
    pub fn text(&self) -> Option<&str> {
        match self {
            Self::Argument(text) | Self::Text(text) => Some(text),
            _ => None,
        }
    }

    /// A number, of the command line as text; NaN is none.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        let number = match self {
            Self::Argument(text) => units::number(text)?,
            Self::Number(number) => *number,
            Self::Whole(number) => *number as f64,
            _ => return None,
        };
        Some(number).filter(|number| !number.is_nan())
    }

    /// A whole number.
    #[must_use]
    pub fn whole<N: TryFrom<i64>>(&self) -> Option<N> {
        let number = match self {
            Self::Argument(text) => text.trim().parse().ok()?,
            Self::Whole(number) => *number,
            _ => return None,
        };
        N::try_from(number).ok()
    }

    /// Several values; texts of the command line are parted at commas.
    #[must_use]
    pub fn items(&self) -> Option<Vec<Self>> {
        match self {
            Self::Argument(text) => {
                Some(text.split(',').map(|word| Self::Argument(word.trim().to_owned())).collect())
            }
            Self::List(items) => Some(items.clone()),
            _ => None,
        }
    }

    /// Several values, or one.
    fn one_or_more(&self) -> Vec<Self> {
        match self {
            Self::List(items) => items.clone(),
            one => vec![one.clone()],
        }
    }
}

/// A finite number of a range.
fn number(given: &OptionValue, is_allowed: fn(f64) -> bool) -> Result<f64, Refusal> {
    given.number().filter(|it| it.is_finite() && is_allowed(*it)).ok_or(Refusal::Form)
}

/// A finite number.
pub const FINITE: Kind<f64> =
    Kind::new("NUMBER", "float", "a finite number", |given| number(given, |_| true))
        .with_hyphens(Hyphens::Numbers);
/// A finite number above 0.
pub const ABOVE_ZERO: Kind<f64> =
    Kind::new("NUMBER", "float", "a finite number above 0", |given| number(given, |it| it > 0.0))
        .with_hyphens(Hyphens::Numbers);
/// A finite number of 0 or more.
pub const FROM_ZERO: Kind<f64> =
    Kind::new("NUMBER", "float", "a finite number of 0 or more", |given| {
        number(given, |it| it >= 0.0)
    })
    .with_hyphens(Hyphens::Numbers);
/// A whole number of 0 or more.
pub const WHOLE: Kind<usize> = Kind::new("COUNT", "int", "a whole number of 0 or more", |given| {
    given.whole().ok_or(Refusal::Form)
});
/// A whole number of 1 or more.
pub const POSITIVE_COUNT: Kind<u32> =
    Kind::new("N", "int", "a whole number of 1 or more", |given| {
        given.whole().filter(|it| *it > 0).ok_or(Refusal::Form)
    });
/// On or off.
pub const SWITCH: Kind<bool> = Kind::new("", "bool", "True or False", |given| match given {
    OptionValue::Flag(flag) => Ok(*flag),
    other => other.number().map(|number| number != 0.0).ok_or(Refusal::Form),
});
/// Path of a file.
pub const FILE: Kind<PathBuf> = Kind::new("FILE", "str | os.PathLike[str]", "a path", |given| {
    given.text().map(PathBuf::from).ok_or(Refusal::Form)
});
/// Several paths.
pub const PATHS: Kind<Vec<PathBuf>> = Kind::new("PATH", "Sequence[str]", "paths", |given| {
    given.one_or_more().iter().map(FILE.read).collect()
});
/// Changes of a scene.
pub const TEXTS: Kind<Vec<String>> = Kind::new(
    "KEY=VALUE",
    "Sequence[str]",
    "key.path=value, as in 'source.energy=40 keV'",
    |given| {
        let change = |given: &OptionValue| match given.text().and_then(|text| text.split_once('='))
        {
            Some((key, value)) if !key.trim().is_empty() => Ok(format!("{key}={value}")),
            _ => Err(Refusal::Form),
        };
        given.one_or_more().iter().map(change).collect()
    },
);
/// A size of memory, bytes.
pub const MEMORY: Kind<u64> = Kind::new("SIZE", "str", "a size as \"2 GiB\"", |given| {
    units::memory_size(given.text().ok_or(Refusal::Form)?).map_err(Refusal::Quantity)
});
/// A length above 0, m.
pub const LENGTH: Kind<f64> =
    Kind::new("LENGTH", "str | float", "a length above 0", |given| match any_length(given)? {
        length if length > 0.0 => Ok(length),
        _ => Err(Refusal::Form),
    })
    .in_python("str | float", "a length above 0: a number in m, or text with a unit as \"20 um\"")
    .with_hyphens(Hyphens::Texts);

/// A length with its unit, or of Python a number in m.
///
/// # Errors
/// [`Refusal`] with the reason.
pub fn any_length(given: &OptionValue) -> Result<f64, Refusal> {
    match given {
        OptionValue::Argument(text) | OptionValue::Text(text) => Ok(Dimension::Length.parse(text)?),
        other => other.number().filter(|it| it.is_finite()).ok_or(Refusal::Form),
    }
}

/// `N` whole numbers of at least `least`.
///
/// # Errors
/// [`Refusal::Form`] for anything else.
pub fn numbers_of<const N: usize>(
    given: &OptionValue,
    least: usize,
) -> Result<[usize; N], Refusal> {
    let items = given.items().ok_or(Refusal::Form)?;
    let numbers: Option<Vec<usize>> = items.iter().map(OptionValue::whole).collect();
    let numbers: [usize; N] =
        numbers.and_then(|numbers| numbers.try_into().ok()).ok_or(Refusal::Form)?;
    if numbers.iter().all(|number| *number >= least) { Ok(numbers) } else { Err(Refusal::Form) }
}

/// Texts of several values, or of one.
///
/// # Errors
/// [`Refusal::Form`] for values that are no text.
pub fn words_of(given: &OptionValue) -> Result<Vec<String>, Refusal> {
    let words = given.one_or_more();
    words.iter().map(|word| word.text().map(str::to_owned).ok_or(Refusal::Form)).collect()
}

/// A word that an option takes, and its meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Word {
    /// The word.
    pub name: &'static str,
    /// Its meaning, without a full stop; empty where the word says it.
    pub help: &'static str,
}

/// Alternatives that have words.
pub trait Choice: Copy + 'static {
    /// All of them.
    const CHOICES: &'static [Self];

    /// Its word.
    fn word(self) -> Word;
}

/// One of some alternatives; `python` is the name of their type.
#[must_use]
pub const fn choice<V: Choice>(value: &'static str, python: &'static str) -> Kind<V> {
    let mut kind = Kind::new(value, python, "", |given| {
        let name = given.text().ok_or(Refusal::Form)?;
        let found = V::CHOICES.iter().find(|it| it.word().name == name);
        found.copied().ok_or(Refusal::Form)
    });
    kind.form.words = || V::CHOICES.iter().map(|it| it.word()).collect();
    kind
}

/// Words that functions of their own read.
#[must_use]
pub const fn choices<V>(kind: Kind<V>, words: fn() -> Vec<Word>) -> Kind<V> {
    let Kind { mut form, read } = kind;
    form.words = words;
    Kind { form, read }
}
