//! The time that work will still take, from the share of it that is done.

use std::collections::VecDeque;
use std::time::Duration;

/// Share and time of the work before which nobody knows.
const LEAST_SHARE: f64 = 0.03;
const LEAST_SECONDS: f64 = 5.0;
/// New ends of the work count over this part of the time gone: a few slow rows move little.
const MEMORY: f64 = 0.15;
/// Share of the work, or half of the work done if less, that the pace leaves out if it was slower than
/// the work after it: a slow beginning does not predict the rest.
const BEGINNING: f64 = 0.03;
/// Steps of less than this share are not kept apart.
const LEAST_STEP: f64 = 0.001;
/// An end is moved farther away where it is this much later than shown, and these seconds.
const LATER: f64 = 1.25;
const LATER_SECONDS: f64 = 2.0;

/// When work will end. Times are those since any fixed moment, so that tests have a clock of their
/// own.
#[derive(Debug, Default)]
pub(super) struct Estimate {
    /// Time and share at its beginning: earlier work had another pace.
    began: Option<[f64; 2]>,
    /// Times and shares of steps, from the one that the pace is counted from.
    steps: VecDeque<[f64; 2]>,
    /// Time and share of the last step.
    at: [f64; 2],
    /// Seconds that will be left after the next one.
    then: f64,
    /// Expected time of the end,
    end: f64,
    /// and the one that was shown last.
    shown: Option<f64>,
}

impl Estimate {
    /// The work begins, with this share of it done before.
    pub(super) fn begin(&mut self, now: Duration, share: f64) {
        let at = [now.as_secs_f64(), share];
        *self = Self { began: Some(at), at, steps: [at].into(), ..Self::default() };
    }

    /// This share of the work is done.
    pub(super) fn reach(&mut self, now: Duration, share: f64) {
        let now = now.as_secs_f64();
        let Some([began, before]) = self.began else {
            return self.begin(Duration::from_secs_f64(now), share);
        };
        if share <= self.at[1] {
            return;
        }
        let since = now - self.at[0];
        let [from, from_share] = self.recent(before + BEGINNING.min(0.5 * (share - before)));
        let gone = now - from;
        // A quick beginning counts: of waves it is one.
        let pace = (gone / (share - from_share)).min((now - began) / (share - before));
        let end = now + pace * (1.0 - share);
        if self.steps.back().is_none_or(|last| share - last[1] >= LEAST_STEP) {
            self.steps.push_back([now, share]);
        }
        let first = self.end <= 0.0;
        let weight = since / (since + MEMORY * gone).max(1e-9);
        self.end = if first { end } else { self.end + weight * (end - self.end) };
        // The next step is taken to be as long as this one. It counts down to then, and waits there.
        let after = (1.0 - 2.0 * share + self.at[1]).max(0.0) / (1.0 - share).max(1e-9);
        // Lines of a log show an end rarely: an earlier one counts at once.
        self.then = (self.shown.unwrap_or(self.end).min(self.end) - now).max(0.0) * after;
        self.at = [now, share];
    }

    /// The last step that does not go beyond a share; those before it are forgotten.
    fn recent(&mut self, share: f64) -> [f64; 2] {
        while self.steps.get(1).is_some_and(|step| step[1] <= share) {
            self.steps.pop_front();
        }
        self.steps.front().copied().unwrap_or(self.at)
    }

    /// Remaining time; `None` if it is too early to estimate it.
    pub(super) fn left(&mut self, now: Duration) -> Option<Duration> {
        let now = now.as_secs_f64();
        let [began, before] = self.began?;
        let [_, share] = self.at;
        if share - before < LEAST_SHARE || now - began < LEAST_SECONDS {
            return None;
        }
        let left = (self.end - now).max(self.then);
        let shown = self.shown.map(|end| end - now);
        let left = match shown {
            Some(shown) if left > shown && left < LATER * shown + LATER_SECONDS => {
                shown.max(self.then)
            }
            _ => left,
        };
        self.shown = Some(now + left);
        Some(Duration::from_secs_f64(left.max(0.0)))
    }
}

/// A time that is left, no finer than it is known.
pub(super) fn words(left: Duration) -> String {
    let seconds = left.as_secs();
    match seconds {
        0..10 => "a few seconds left".to_owned(),
        10..56 => format!("about {} s left", seconds.div_ceil(5) * 5),
        56..180 => format!("about {} s left", seconds.div_ceil(10) * 10),
        180..3540 => format!("about {} min left", seconds.div_ceil(60)),
        _ => {
            let minutes = seconds.div_ceil(600) * 10;
            format!("about {} h {:02} min left", minutes / 60, minutes % 60)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> Duration {
        Duration::from_secs_f64(seconds)
    }

    /// Display at each second of work with the share `share`, reported at `steps`.
    fn shown(total: u32, step: f64, share: impl Fn(f64) -> f64) -> Vec<(f64, Option<f64>)> {
        let mut estimate = Estimate::default();
        estimate.begin(at(0.0), 0.0);
        let mut next = step;
        let tick = |second: u32| {
            let now = f64::from(second);
            while next <= now {
                estimate.reach(at(next), share(next));
                next += step;
            }
            (now, estimate.left(at(now)).map(|left| left.as_secs_f64()))
        };
        (0..total).map(tick).collect()
    }

    #[test]
    fn nothing_is_told_before_it_is_known() {
        let mut estimate = Estimate::default();
        assert_eq!(estimate.left(at(100.0)), None, "nothing has begun");
        estimate.begin(at(100.0), 0.2);
        assert_eq!(estimate.left(at(200.0)), None, "what was done before tells nothing");
        estimate.reach(at(101.0), 0.4);
        assert_eq!(estimate.left(at(101.0)), None, "one second is not enough");
        let mut estimate = Estimate::default();
        estimate.begin(at(0.0), 0.0);
        estimate.reach(at(60.0), 0.01);
        assert_eq!(estimate.left(at(60.0)), None, "one per cent is not enough");
        estimate.reach(at(180.0), 0.03);
        assert!(estimate.left(at(180.0)).is_some());
    }

    #[test]
    fn steady_work_counts_down_to_its_end() {
        for step in [0.3, 7.0, 20.0] {
            for (now, left) in shown(200, step, |now| now / 200.0) {
                let Some(left) = left else {
                    assert!(now < 7.0_f64.max(step), "nothing told at {now} s, steps of {step} s");
                    continue;
                };
                let error = left - (200.0 - now);
                assert!(
                    (-1e-6..=1.0).contains(&error),
                    "{left} left at {now} s, steps of {step} s"
                );
            }
        }
    }

    #[test]
    fn an_unsteady_pace_moves_it_little_and_never_up_and_down() {
        // Rows cost up to three times as much as others, in waves of 20 s.
        let share = |now: f64| now / 300.0 + 0.5 * 20.0 / 300.0 / 6.3 * (now / 20.0 * 6.3).sin();
        let told = shown(300, 0.5, share);
        let told: Vec<(f64, f64)> = told.into_iter().filter_map(|(t, it)| Some((t, it?))).collect();
        assert!(told.len() > 250);
        for ((_, before), (now, left)) in told.iter().zip(&told[1..]) {
            assert!(
                *left < before + 1e-6 || left - before > 5.0,
                "{before} then {left} at {now} s"
            );
        }
        let rises = told.windows(2).filter(|it| it[1].1 > it[0].1).count();
        assert!(rises <= 2, "{rises} times it rose");
        for (now, left) in told.iter().filter(|(now, _)| *now > 60.0) {
            assert!((left - (300.0 - now)).abs() < 0.15 * 300.0, "{left} left at {now} s");
        }
    }

    #[test]
    fn a_slow_beginning_and_other_work_leave_the_rest_within_a_third() {
        // 120 views of 0.35 s or 2 s, the first one slow; beside other work a view takes up to twice
        // as long, in waves.
        for (view, first, busy) in [
            (0.35, 0.0, 0.0),
            (0.35, 4.0, 0.0),
            (2.0, 30.0, 0.0),
            (0.35, 4.0, 1.0),
            (2.0, 9.0, 1.0),
        ] {
            let cost = |n: u32| {
                let wave = (f64::from(n) * 2.1).sin() + 0.5 * (f64::from(n) * 0.9).sin();
                view * (1.0 + busy * (0.5 + wave / 3.0)) + if n == 0 { first } else { 0.0 }
            };
            let total: f64 = (0..120).map(cost).sum();
            let (mut estimate, mut now) = (Estimate::default(), 0.0);
            estimate.begin(at(0.0), 0.0);
            for n in 0..119 {
                now += cost(n);
                estimate.reach(at(now), f64::from(n + 1) / 120.0);
                let Some(left) = estimate.left(at(now)) else { continue };
                let (left, rest) = (left.as_secs_f64(), total - now);
                // Below ten seconds it says no number.
                if n >= 12 && rest >= 10.0 {
                    assert!((0.7..1.4).contains(&(left / rest)), "{left} of {rest} s, view {n}");
                }
            }
        }
    }

    #[test]
    fn lines_of_a_log_follow_a_pace_that_grows() {
        // 150 s to 6 %, 650 s for the rest, a step each half second and a line each 30 s.
        let share = |now: f64| match now < 150.0 {
            true => 0.06 * now / 150.0,
            false => 0.06 + 0.94 * (now - 150.0) / 650.0,
        };
        let (mut estimate, mut next) = (Estimate::default(), 0.5);
        estimate.begin(at(0.0), 0.0);
        for line in (30..=720).step_by(30).map(f64::from) {
            while next <= line {
                estimate.reach(at(next), share(next));
                next += 0.5;
            }
            let Some(left) = estimate.left(at(line)) else { continue };
            let over = left.as_secs_f64() / (800.0 - line);
            assert!(
                line < 400.0 || (0.9..1.35).contains(&over),
                "{over} times the rest at {line} s"
            );
        }
    }

    #[test]
    fn a_long_step_makes_it_wait_and_not_run_out() {
        let mut estimate = Estimate::default();
        estimate.begin(at(0.0), 0.0);
        (1..=50).for_each(|n| estimate.reach(at(f64::from(n)), f64::from(n) / 100.0));
        let mut before = f64::INFINITY;
        for now in 50..500 {
            let left = estimate.left(at(f64::from(now))).unwrap().as_secs_f64();
            assert!(left <= before && left >= 48.9, "{left} left at {now} s");
            before = left;
        }
        estimate.reach(at(500.0), 0.51);
        assert!(estimate.left(at(500.0)).unwrap() > at(200.0), "the step is known to be slow now");
    }

    #[test]
    fn what_is_left_is_told_no_finer_than_it_is_known() {
        let of = |seconds: u64| words(Duration::from_secs(seconds));
        assert_eq!(of(0), "a few seconds left");
        assert_eq!(of(31), "about 35 s left");
        assert_eq!(of(58), "about 60 s left");
        assert_eq!(of(61), "about 70 s left");
        assert_eq!(of(181), "about 4 min left");
        assert_eq!(of(3600), "about 1 h 00 min left");
        assert_eq!(of(3601), "about 1 h 10 min left");
    }
}
