//! Rows of the table of keys: name, kind, range, default, exclusions and documentation of each key.

use beamlet_core::units::Dimension;

/// A table of the scene file.
#[derive(Debug)]
pub(crate) struct Spec {
    /// Its heading in docs/scene.md; "" is the top level.
    pub(crate) path: &'static str,
    /// Its keys, in the order in which the resolved scene has them.
    pub(crate) rows: &'static [Row],
    /// Keys that exclude or need one another.
    pub(crate) groups: &'static [Group],
    /// Names that other programs and papers give to keys, with the key; none is like its key.
    pub(crate) other_names: &'static [(&'static str, &'static str)],
}

/// A key of a table.
#[derive(Debug)]
pub(crate) struct Row {
    pub(crate) name: &'static str,
    pub(crate) kind: Kind,
    pub(crate) need: Need,
    /// A value, as TOML.
    pub(crate) example: &'static str,
    /// One line of documentation.
    pub(crate) doc: &'static str,
}

/// Whether a key may be left out.
#[derive(Debug)]
pub(crate) enum Need {
    Required,
    /// Its default, as TOML.
    Default(&'static str),
    /// Value that holds without it, in words.
    Without(&'static str),
}

/// Keys of a table that depend on one another.
#[derive(Debug)]
pub(crate) enum Group {
    /// Sets of keys of which a scene has one. Where it has keys of two, the set listed first counts;
    /// where it has none, the set of this index is missing. A key may be in two sets.
    Forms(Forms, usize),
    /// Keys that have a meaning with another key only; the allowed form without it.
    With(&'static [&'static str], &'static str, &'static str),
}

/// Keys that belong together.
pub(crate) type Form = &'static [&'static str];
/// Sets of keys that exclude one another.
pub(crate) type Forms = &'static [Form];

/// Kind of quantity that a key takes.
#[derive(Debug)]
pub(crate) enum Kind {
    /// One line of text.
    Line,
    /// A quantity with its unit.
    Quantity(Dimension, Range),
    /// A length, or two of them, x and z.
    Pair(Range),
    /// Lengths along x, y and z, by their meaning.
    Lengths(&'static str, Range),
    /// A list of corners.
    Corners(u32),
    /// A list of pairs of lengths: ends of slits, or steps along x and z.
    Ends(u32),
    /// A list of rows of 0 and 1, as texts, with an upper limit of their number and length.
    Bits(u32),
    /// A list of rectangles, each its middle along x and z, width and height, with an upper limit of their number.
    Rectangles(u32),
    /// A length or an angle, as the list that it stands for.
    Step,
    /// A list of quantities with an upper limit of their number, or a range of them.
    Series(Dimension, u32),
    /// A list of lists of quantities, or of numbers, of one length each, with an upper limit of their
    /// number.
    Lists(Option<Dimension>, u32),
    /// A unit of length.
    Unit,
    /// A number without a unit, by its meaning.
    Number(&'static str, Range),
    /// Three numbers.
    Direction,
    /// A whole number.
    Count(u64, u64),
    /// Two whole numbers, by their meaning.
    Counts(&'static str, u64, u64),
    /// True or false.
    Flag,
    /// One of these words.
    Word(&'static [&'static str]),
    /// A name, by its meaning.
    Name(&'static str),
    /// Path of a file, by its contents.
    File(&'static str),
    /// SHA-256 of a file.
    Hash,
    /// A table.
    Inner(&'static Spec),
    /// A list of tables.
    Tables(&'static Spec),
    /// A table whose keys are names, and the kind of its values.
    Named(&'static Self),
    /// One of two kinds, the shorter one first; the allowed form, if they do not express it.
    Either(&'static str, &'static Self, &'static Self),
}

/// Name of a material.
pub(crate) const MATERIAL: Kind = Kind::Name("name of a material");
/// An image of a kernel or spot.
pub(crate) const IMAGE: Kind = Kind::File("path of an NPY, TIFF or PNG file");

/// Bounds of a finite number, each with whether it is allowed itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Range {
    pub(crate) low: Option<(f64, bool)>,
    pub(crate) high: Option<(f64, bool)>,
}

/// Any finite number.
pub(crate) const ANY: Range = Range { low: None, high: None };
/// Above 0.
pub(crate) const POSITIVE: Range = Range { low: Some((0.0, false)), high: None };
/// 0 or above.
pub(crate) const NOT_NEGATIVE: Range = Range { low: Some((0.0, true)), high: None };

/// From a number to another, both allowed.
pub(crate) const fn within(low: f64, high: f64) -> Range {
    Range { low: Some((low, true)), high: Some((high, true)) }
}

impl Range {
    /// The same range, up to a number which is allowed.
    pub(crate) const fn up_to(self, high: f64) -> Self {
        Self { high: Some((high, true)), ..self }
    }

    /// The same range, below a number.
    pub(crate) const fn below(self, high: f64) -> Self {
        Self { high: Some((high, false)), ..self }
    }

    pub(crate) fn contains(&self, value: f64) -> bool {
        let low = self.low.is_none_or(|(low, itself)| value > low || (itself && value >= low));
        let high = self.high.is_none_or(|(high, itself)| value < high || (itself && value <= high));
        value.is_finite() && low && high
    }

    /// The bounds in words, with numbers as `show` writes them; "" where there are none.
    pub(crate) fn words(&self, show: impl Fn(f64) -> String) -> String {
        let show = |value: f64| if value == 0.0 { "0".to_owned() } else { show(value) };
        if let (Some((low, true)), Some((high, true))) = (self.low, self.high) {
            return format!("{} to {}", show(low), show(high));
        }
        let low = self
            .low
            .map(|(low, itself)| format!("{} {}", if itself { ">=" } else { ">" }, show(low)));
        let high = self.high.map(|(high, itself)| {
            format!("{} {}", if itself { "up to" } else { "less than" }, show(high))
        });
        low.into_iter().chain(high).collect::<Vec<_>>().join(", ")
    }
}

/// A number of a range as people write it.
pub(crate) fn plain(value: f64) -> String {
    if (1e-2..1e5).contains(&value.abs()) && value.abs() > 1e-2 {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

impl Kind {
    /// Dimension, noun and range of a number.
    pub(crate) const fn measure(&self) -> (Option<Dimension>, &'static str, Range) {
        match self {
            Self::Quantity(dimension, range) => (Some(*dimension), "a value", *range),
            Self::Pair(range) | Self::Lengths(_, range) => {
                (Some(Dimension::Length), "a value", *range)
            }
            Self::Number(noun, range) => (None, noun, *range),
            _ => (None, "a number", ANY),
        }
    }

    /// The range of a number in words; `None` where it has no bounds.
    pub(crate) fn bounds(&self) -> Option<String> {
        match self {
            Self::Count(low, high) => Some(format!("{low} to {high}")),
            Self::Counts(_, low, high) => Some(format!("{low} to {high} each")),
            _ => {
                let (dimension, _, range) = self.measure();
                let words =
                    range.words(|it| dimension.map_or_else(|| plain(it), |d| d.rounded(it)));
                (!words.is_empty()).then_some(words)
            }
        }
    }

    /// The allowed range of a number of this kind, in words.
    pub(crate) fn range_allowed(&self) -> String {
        let (_, noun, range) = self.measure();
        match (self.bounds(), range.low, range.high) {
            (None, ..) => format!("a finite {}", noun.trim_start_matches("a ")),
            (Some(words), Some((_, true)), Some((_, true))) => format!("{noun} from {words}"),
            (Some(words), ..) => format!("{noun} {words}"),
        }
    }

    /// The table that this kind is, or may be.
    pub(crate) fn table(&self) -> Option<&'static Spec> {
        match self {
            Self::Inner(spec) | Self::Tables(spec) => Some(spec),
            Self::Either(_, short, table) => table.table().or_else(|| short.table()),
            _ => None,
        }
    }
}

impl Row {
    /// The allowed values of the key, in words.
    pub(crate) fn allowed(&self) -> String {
        self.allowed_of(&self.kind)
    }

    fn allowed_of(&self, kind: &Kind) -> String {
        let such = |noun: &str| format!("{noun}, such as {}", self.example);
        match kind {
            Kind::Quantity(dimension, _) => dimension.allowed(),
            Kind::Pair(_) => {
                format!("{}; or a list of two of them, [x, z]", Dimension::Length.allowed())
            }
            Kind::Lengths(noun, _) | Kind::Counts(noun, ..) | Kind::Number(noun, _) => such(noun),
            Kind::Count(low, high) => format!("a whole number from {low} to {high}"),
            Kind::Flag => "true or false".to_owned(),
            Kind::Word(words) => {
                words.iter().map(|it| format!("{it:?}")).collect::<Vec<_>>().join(", ")
            }
            Kind::Name(noun) | Kind::File(noun) => (*noun).to_owned(),
            Kind::Line => "a line of text, of 1 to 200 characters".to_owned(),
            Kind::Corners(_) => such("corners around a polygon"),
            Kind::Ends(most) => such(&format!("a list of 1 to {most} pairs of ends")),
            Kind::Bits(_) => such("a list of rows of 0 and 1"),
            Kind::Rectangles(most) => {
                such(&format!("a list of 1 to {most} lists of x, z, width and height"))
            }
            Kind::Step => "a length or an angle".to_owned(),
            Kind::Series(_, most) => {
                format!(
                    "a list of 1 to {most} quantities, or {{ from, to, count }} or {{ from, to, step }}"
                )
            }
            Kind::Lists(..) => such("a list of lists of one length"),
            Kind::Unit => such("the length of 1.0 in the mesh file"),
            Kind::Direction => such("a direction"),
            Kind::Hash => "the SHA-256 of the file, 64 hexadecimal digits".to_owned(),
            Kind::Inner(spec) if !spec.path.contains('.') => format!("a table [{}]", spec.path),
            Kind::Inner(_) | Kind::Named(_) => such("a table"),
            Kind::Tables(_) => such("a list of tables"),
            Kind::Either("", list, Kind::Ends(_)) => {
                format!("{}, or a list of pairs [x, z]", self.allowed_of(list))
            }
            Kind::Either("", list, Kind::File(noun)) => {
                format!("{}; or {noun}", self.allowed_of(list))
            }
            Kind::Either("", short, _) => self.allowed_of(short),
            Kind::Either(words, ..) => (*words).to_owned(),
        }
    }
}

impl Spec {
    pub(crate) fn row(&self, name: &str) -> Option<&'static Row> {
        self.rows.iter().find(|row| row.name == name)
    }

    /// Each choice of forms, with the one that is missing where there is none.
    pub(crate) fn all_forms(&self) -> impl Iterator<Item = (Forms, usize)> {
        self.groups.iter().filter_map(|group| match group {
            Group::Forms(forms, missing) => Some((*forms, *missing)),
            Group::With(..) => None,
        })
    }

    /// The choice of forms that a key belongs to.
    pub(crate) fn forms(&self, name: &str) -> Option<(Forms, usize)> {
        self.all_forms().find(|(forms, _)| forms.iter().any(|form| form.contains(&name)))
    }

    /// The form that a table has: the first of which it has a key that is in no other.
    pub(crate) fn own(forms: Forms, has: impl Fn(&str) -> bool) -> Option<Form> {
        let shared = |key: &&str| forms.iter().filter(|form| form.contains(key)).count() > 1;
        let any =
            |form: &&Form, own: bool| form.iter().any(|key| has(key) && !(own && shared(key)));
        let found = forms.iter().find(|form| any(form, true));
        found.or_else(|| forms.iter().find(|form| any(form, false))).copied()
    }

    /// The key required by a key, and the allowed form without it.
    pub(crate) fn with(&self, name: &str) -> Option<(&'static str, &'static str)> {
        self.groups.iter().find_map(|group| match group {
            Group::With(keys, head, why) => keys.contains(&name).then_some((*head, *why)),
            Group::Forms(..) => None,
        })
    }

    /// A key that others need, and the keys that may take its place.
    pub(crate) fn heads(&self, head: &'static str) -> Vec<&'static str> {
        std::iter::once(head).chain(self.rivals(head)).collect()
    }

    /// Keys that a key excludes.
    pub(crate) fn rivals(&self, name: &str) -> Vec<&'static str> {
        let Some((forms, _)) = self.forms(name) else { return Vec::new() };
        let own: Vec<_> = forms.iter().filter(|form| form.contains(&name)).collect();
        let keys = forms.iter().flat_map(|form| form.iter().copied());
        keys.filter(|key| !own.iter().any(|form| form.contains(key))).collect()
    }

    /// Keys that a form excludes.
    pub(crate) fn rivals_of(&self, own: Form) -> Vec<&'static str> {
        let Some((forms, _)) = self.all_forms().find(|(forms, _)| forms.contains(&own)) else {
            return Vec::new();
        };
        let keys = forms.iter().flat_map(|form| form.iter().copied());
        keys.filter(|key| !own.contains(key)).collect()
    }

    /// The forms in words, as "either image, or kernel and pixel".
    pub(crate) fn choice(&self, forms: &[&[&str]]) -> String {
        let place =
            |form: &&[&str]| self.rows.iter().position(|row| Some(&row.name) == form.first());
        let mut forms = forms.to_vec();
        forms.sort_by_key(place);
        let words = |form: &&[&str]| {
            let needed =
                |key: &&&str| self.row(key).is_some_and(|row| matches!(row.need, Need::Required));
            let keys: Vec<&str> = form.iter().filter(needed).copied().collect();
            if keys.is_empty() { form[0].to_owned() } else { keys.join(" and ") }
        };
        let words: Vec<String> = forms.iter().map(words).collect();
        match words.as_slice() {
            [one, other] if words.iter().any(|it| it.contains(' ')) => {
                format!("either {one}, or {other}")
            }
            [one, other] => format!("either {one} or {other}"),
            _ => format!("one of: {}", words.join("; ")),
        }
    }
}
