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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_find_their_word_and_other_words_none() {
        let known = ["energy", "distance", "spot"];
        let meant = |word: &str| nearest(word, known, str::to_lowercase);
        assert_eq!(meant("Enregy"), Some("energy"));
        assert_eq!(meant("dist"), Some("distance"));
        assert_eq!(meant("mask"), None);
        assert_eq!(meant(""), None);
    }
}
