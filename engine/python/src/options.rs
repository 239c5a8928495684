//! Options of verbs from keywords of Python, by their tables.

use crate::errors::raised;
use beamlet::cli_support::options::{
    Keyword, Need, OptionValue, Options, ReconstructArguments, Relation, RetrieveArguments, Row,
    keywords as keywords_of,
};
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice, PyString};

/// Most characters of a value in an error.
const LONGEST: usize = 100;
/// Most values of a list.
const MOST: usize = 1 << 20;

/// Name, type, default and meaning of a keyword; true if functions declare it, and if it belongs to measured stacks.
type Described = (&'static str, String, String, String, bool, bool);

/// The keywords of a verb.
#[pyfunction]
pub(crate) fn keywords(verb: &str) -> Vec<Described> {
    let found = match verb {
        "retrieve" => keywords_of::<RetrieveArguments>(),
        "reconstruct" => keywords_of::<ReconstructArguments>(),
        "ideal" => keywords_of::<beamlet::IdealOptions>(),
        _ => Vec::new(),
    };
    let described =
        |it: Keyword| (it.name, it.python, it.default, it.doc, it.is_declared, it.is_measured);
    found.into_iter().map(described).collect()
}

/// Arguments of a verb from the keywords of a call; `has` selects the rows that the function has.
pub(crate) fn arguments<T: Options>(
    verb: &str,
    options: &Bound<'_, PyDict>,
    has: impl Fn(&Row<T>) -> bool,
) -> PyResult<T> {
    let mut arguments = T::default();
    for (name, value) in options {
        let name: String = name.extract()?;
        let row = T::ROWS.iter().find(|row| row.name == name && !row.is(Relation::Program));
        let Some(row) = row.filter(|row| has(row)) else {
            let problem = format!("{verb}() got an unexpected keyword argument '{name}'");
            return Err(PyTypeError::new_err(problem));
        };
        if value.is_none() && matches!(row.need, Need::Without(_)) && !row.form.is_switch() {
            continue;
        }
        if value.cast::<PyUntypedArray>().is_ok_and(|array| array.ndim() == 3) {
            // The function has it as an array.
            arguments.given_mut().insert(name, "an array".into());
            continue;
        }
        let shown = shown(&value);
        arguments
            .set(row, &given(&value), shown.clone())
            .map_err(|refusal| raised(options.py(), &refusal.error(&name, &shown, &row.form)))?;
    }
    Ok(arguments)
}

/// A value in an error or a record.
fn shown(value: &Bound<'_, PyAny>) -> String {
    let text = value.repr().map_or_else(|_| "?".to_owned(), |text| text.to_string());
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

/// A value as the tables read it.
fn given(value: &Bound<'_, PyAny>) -> OptionValue {
    if let Ok(text) = value.cast::<PyString>() {
        return text.to_str().map_or(OptionValue::Other, |text| OptionValue::Text(text.to_owned()));
    }
    if let Ok(flag) = value.extract::<bool>() {
        return OptionValue::Flag(flag);
    }
    if let Ok(number) = value.extract::<i64>() {
        return OptionValue::Whole(number);
    }
    if value.is_instance_of::<PySlice>() {
        return slice(value).unwrap_or(OptionValue::Other);
    }
    if let Ok(items) = value.try_iter() {
        let items: PyResult<Vec<_>> = items.take(MOST).map(|item| Ok(given(&item?))).collect();
        return items.map_or(OptionValue::Other, OptionValue::List);
    }
    value.extract::<f64>().map_or(OptionValue::Other, OptionValue::Number)
}

fn slice(value: &Bound<'_, PyAny>) -> PyResult<OptionValue> {
    let index = |name: &str| value.getattr(name)?.extract::<Option<i64>>();
    Ok(OptionValue::Slice { start: index("start")?, end: index("stop")?, step: index("step")? })
}
