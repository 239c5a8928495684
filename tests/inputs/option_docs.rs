//! Keywords of Python and their tables in docs/python.md are those of the tables of options. `BEAMLET_WRITE_DOCS=1`
//! writes them.

use beamlet::IdealOptions;
use beamlet::cli_support::options::{
    Need, OptionValue, Options, ReconstructArguments, RetrieveArguments, form_rows, keywords,
    literals, page_rows, typed_dict,
};

const PAGE: &str = "docs/python.md";
const MODULE: &str = "engine/python/python/beamlet/_keywords.py";
const HEAD: &str = r#""""Types of the keywords of verbs, from the tables of options: BEAMLET_WRITE_DOCS=1 cargo test --test inputs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

Lengths = Sequence[str | float] | NDArray[np.floating[Any]]
Span = tuple[int, int]
#: Columns, or columns and rows, each from a first to an end that is excluded.
EmptyBeam = Span | tuple[Span, Span]
"#;

fn module() -> String {
    let retrieve = keywords::<RetrieveArguments>();
    let reconstruct = keywords::<ReconstructArguments>();
    HEAD.to_owned()
        + &literals::<RetrieveArguments>()
        + &literals::<ReconstructArguments>()
        + &typed_dict("RunKeywords", "TypedDict", &retrieve, |it| !it.is_measured)
        + &typed_dict("MeasuredKeywords", "RunKeywords", &retrieve, |it| it.is_measured)
        + &typed_dict("ReconstructKeywords", "TypedDict", &reconstruct, |_| true)
        + &typed_dict("IdealKeywords", "TypedDict", &keywords::<IdealOptions>(), |_| true)
}

/// The page with the table of the keywords of each verb, which follows the mark of the verb.
fn page(page: &str) -> String {
    let mut out = page.to_owned();
    for (verb, table) in [
        ("retrieve", form_rows(&keywords::<RetrieveArguments>())),
        ("reconstruct", form_rows(&keywords::<ReconstructArguments>())),
        ("ideal", page_rows(&keywords::<IdealOptions>())),
    ] {
        let mark = format!("<!-- keywords of {verb} -->\n");
        let start = out.find(&mark).unwrap_or_else(|| panic!("{PAGE} has no {mark}")) + mark.len();
        let end = out[start..].find("\n\n").map_or(out.len(), |at| start + at + 1);
        out.replace_range(start..end, &table);
    }
    out
}

#[test]
fn keywords_of_python_are_those_of_the_tables() {
    let found = std::fs::read_to_string(PAGE).unwrap();
    for (path, made) in [(PAGE, page(&found)), (MODULE, module())] {
        if std::env::var_os("BEAMLET_WRITE_DOCS").is_some() {
            std::fs::write(path, made).unwrap();
        } else {
            let found = std::fs::read_to_string(path).unwrap();
            let differing = found.lines().zip(made.lines()).find(|(found, made)| found != made);
            assert!(found == made, "{path}: write it with BEAMLET_WRITE_DOCS=1\n{differing:#?}");
        }
    }
}

/// Number of defaults, each of which its option reads.
fn read_defaults<T: Options>() -> usize {
    let mut count = 0;
    for row in T::ROWS {
        for name in row.needs() {
            assert!(T::ROWS.iter().any(|other| other.name == *name), "{} needs {name}", row.name);
        }
        if let Need::Default(text) = row.need {
            T::default().set(row, &OptionValue::Argument(text.into()), text.into()).unwrap();
            count += 1;
        }
    }
    count
}

#[test]
fn defaults_are_values_of_their_options() {
    assert!(read_defaults::<RetrieveArguments>() > 0);
    assert!(read_defaults::<ReconstructArguments>() > 0);
    assert!(read_defaults::<IdealOptions>() > 0);
}
