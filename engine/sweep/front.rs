//! The best design by a score, and the Pareto front of two scores.

use super::{Outcome, Score};

/// Value of a design in a score, the better the smaller; infinite where it has none.
fn cost(outcome: &Outcome, place: usize, scores: &[Score]) -> f64 {
    match (outcome.values[place], scores[place].rises()) {
        (Some(value), true) => -value,
        (Some(value), false) => value,
        (None, _) => f64::INFINITY,
    }
}

/// The design that is best by the first score, of equals the first; `None` where no design has it.
#[must_use]
pub fn best(outcomes: &[Outcome], scores: &[Score]) -> Option<usize> {
    let costs = outcomes.iter().map(|outcome| cost(outcome, 0, scores)).enumerate();
    costs.filter(|(_, cost)| cost.is_finite()).min_by(|a, b| a.1.total_cmp(&b.1)).map(|best| best.0)
}

/// For each design, true if no other is better in one of the first two scores and as good in the other one. Empty with
/// one score.
pub(super) fn front(outcomes: &[Outcome], scores: &[Score]) -> Vec<bool> {
    if scores.len() < 2 {
        return Vec::new();
    }
    let cost = |design: usize| [0, 1].map(|place| cost(&outcomes[design], place, scores));
    let mut order: Vec<usize> = (0..outcomes.len())
        .filter(|design| cost(*design).iter().all(|value| value.is_finite()))
        .collect();
    order.sort_by(|a, b| {
        let ([a, second_a], [b, second_b]) = (cost(*a), cost(*b));
        a.total_cmp(&b).then(second_a.total_cmp(&second_b))
    });
    let mut on_front = vec![false; outcomes.len()];
    let mut least: Option<[f64; 2]> = None;
    for design in order {
        let own = cost(design);
        let is_better = least.is_none_or(|[first, second]| {
            own[1] < second || own.map(f64::to_bits) == [first, second].map(f64::to_bits)
        });
        if is_better {
            on_front[design] = true;
            least = Some(own);
        }
    }
    on_front
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_has_the_designs_that_nothing_beats() {
        let scores = [Score::SigmaAlpha, Score::Visibility];
        let of = |sigma: f64, visibility: f64| Outcome {
            values: vec![Some(sigma), Some(visibility)],
            ..Outcome::default()
        };
        let refused = Outcome { values: vec![None; 2], ..Outcome::default() };
        let all = [
            of(3.0, 0.9),
            of(1.0, 0.2),
            refused,
            of(2.0, 0.1),
            of(2.0, 0.5),
            of(2.0, 0.5),
            of(4.0, 0.9),
        ];
        assert_eq!(front(&all, &scores), [true, true, false, false, true, true, false]);
        assert_eq!(best(&all, &scores), Some(1));
        assert_eq!(best(&all, &[Score::Visibility]), Some(6));
        assert!(front(&all, &scores[..1]).is_empty());
    }
}
