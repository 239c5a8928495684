//! Suggestions for an unknown word.

/// The candidate most like `word`, where one is like it; both are compared as `fold` makes them.
pub fn nearest<'a>(
    word: &str,
    candidates: impl IntoIterator<Item = &'a str>,
    fold: impl Fn(&str) -> String,
) -> Option<&'a str> {
    let word = fold(word);
    let likeness = |candidate: &str| {
        let candidate = fold(candidate);
        let inside = candidate.contains(&word) || word.contains(&candidate);
        let bonus = if inside && !word.is_empty() && !candidate.is_empty() { 0.3 } else { 0.0 };
        strsim::normalized_damerau_levenshtein(&word, &candidate) + bonus
    };
    candidates
        .into_iter()
        .map(|candidate| (likeness(candidate), candidate))
        .filter(|pair| pair.0 > 0.5)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|pair| pair.1)
}

/// The candidate that `word` is with a slip or two, by its length; both are compared as `fold` makes them.
pub fn slip<'a>(
    word: &str,
    candidates: impl IntoIterator<Item = &'a str>,
    fold: impl Fn(&str) -> String,
) -> Option<&'a str> {
    let word = fold(word);
    let most = match word.chars().count() {
        0..4 => return None,
        4..8 => 1,
        _ => 2,
    };
    let slips = |candidate: &str| strsim::damerau_levenshtein(&word, &fold(candidate));
    let all = candidates.into_iter().map(|candidate| (slips(candidate), candidate));
    all.filter(|(slips, _)| *slips <= most).min_by_key(|(slips, _)| *slips).map(|(_, name)| name)
}
