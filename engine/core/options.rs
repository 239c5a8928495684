//! Options of verbs by tables. A row gives the argument of the command line, the keyword of Python, their checks and
//! messages, the field of the struct that a verb reads, and the lines of help and documents.
//!
//! A new option is a row, and the code that uses its field.

mod kinds;
mod python;
mod table;

pub use kinds::{
    ABOVE_ZERO, Choice, FILE, FINITE, FROM_ZERO, Form, Hyphens, Kind, LENGTH, MEMORY, OptionValue,
    PATHS, POSITIVE_COUNT, Refusal, SWITCH, TEXTS, WHOLE, Word, any_length, choice, choices,
    numbers_of, words_of,
};
pub use python::{Keyword, form_rows, keywords, literals, page_rows, python_words, typed_dict};
pub use table::{Need, Options, Relation, Row};
