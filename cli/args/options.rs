//! Arguments of a verb from its table of options.

use super::shared::{DeviceArguments, Messages, ProfileArguments};
use beamlet::cli_support::options::{Choice, Hyphens, Need, OptionValue, Options, Relation, Row};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};

/// Arguments of a verb with a table: the options of the table, and the options that all such verbs share.
#[derive(Debug, Args)]
pub(crate) struct TableArguments<T: Options> {
    #[command(flatten)]
    pub(crate) table: Table<T>,
    #[command(flatten)]
    pub(crate) device: DeviceArguments,
    #[command(flatten)]
    pub(crate) profile: ProfileArguments,
    #[command(flatten)]
    pub(crate) messages: Messages,
}

/// The options of a table.
#[derive(Debug)]
pub(crate) struct Table<T>(pub(crate) T);

impl<T: Options> Args for Table<T> {
    fn augment_args(command: Command) -> Command {
        command.args(T::ROWS.iter().map(argument))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<T: Options> FromArgMatches for Table<T> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut table = T::default();
        for row in T::ROWS {
            if matches.value_source(row.name) != Some(ValueSource::CommandLine) {
                continue;
            }
            let (given, shown) = if row.form.is_switch() {
                (OptionValue::Flag(true), "true".to_owned())
            } else {
                let words: Vec<_> =
                    matches.get_many::<String>(row.name).unwrap_or_default().cloned().collect();
                let shown = words.join(",");
                let mut values: Vec<_> = words.into_iter().map(OptionValue::Argument).collect();
                match values.pop() {
                    Some(last) if !row.is_list() => (last, shown),
                    last => (OptionValue::List(values.into_iter().chain(last).collect()), shown),
                }
            };
            let done = table.set(row, &given, shown);
            done.map_err(|refusal| {
                let problem = format!("--{}: {}\n", row.long(), refusal.words(&row.form));
                clap::Error::raw(clap::error::ErrorKind::ValueValidation, problem)
            })?;
        }
        Ok(Self(table))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// The argument of a row.
fn argument<T: Options>(row: &'static Row<T>) -> Arg {
    let mut help = row.doc.to_owned();
    if let Some(default) = row.default_words() {
        help += &format!(" [default: {default}]");
    }
    let mut argument = Arg::new(row.name).help(help).required(row.need == Need::Required);
    if !row.is(Relation::Position) {
        argument = argument.long(row.long());
    }
    argument = match row.form.is_switch() {
        true => argument.action(ArgAction::SetTrue),
        false => with_value(argument, row),
    };
    for relation in row.relations {
        argument = match *relation {
            Relation::Short(letter) => argument.short(letter),
            Relation::Needs(names) => argument.requires_all(names),
            Relation::Excludes(names) => argument.conflicts_with_all(names),
            Relation::Unless(name) => argument.required_unless_present(name),
            Relation::Listed => argument.value_delimiter(','),
            Relation::Program
            | Relation::Position
            | Relation::Declared
            | Relation::Repeated
            | Relation::Methods(..) => argument,
        };
    }
    argument
}

/// The argument with its values and their check.
fn with_value<T: Options>(argument: Arg, row: &'static Row<T>) -> Arg {
    let argument = argument
        .value_name(row.form.value)
        .allow_negative_numbers(row.form.hyphens == Hyphens::Numbers)
        .allow_hyphen_values(row.form.hyphens == Hyphens::Texts);
    let argument = match (row.is_list(), row.is(Relation::Position)) {
        (true, true) => argument.num_args(1..),
        (true, false) => argument.action(ArgAction::Append),
        (false, _) => argument,
    };
    let words = (row.form.words)();
    if !words.is_empty() {
        return argument.value_parser(PossibleValuesParser::new(words.into_iter().map(possible)));
    }
    argument.value_parser(|text: &str| {
        let given = OptionValue::Argument(text.to_owned());
        let read = (row.read)(&mut T::default(), &given);
        read.map(|()| text.to_owned()).map_err(|refusal| refusal.words(&row.form))
    })
}

fn possible(word: beamlet::cli_support::options::Word) -> PossibleValue {
    let value = PossibleValue::new(word.name);
    if word.help.is_empty() { value } else { value.help(word.help) }
}

/// One of some alternatives.
pub(super) fn choice<V: Choice + Default + Send + Sync>() -> impl TypedValueParser<Value = V> {
    let named = |name: String| {
        V::CHOICES.iter().copied().find(|it| it.word().name == name).unwrap_or_default()
    };
    PossibleValuesParser::new(V::CHOICES.iter().map(|it| possible(it.word()))).map(named)
}
