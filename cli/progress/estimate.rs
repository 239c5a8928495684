//! The remaining time of work, from the share of it that is done.

use std::collections::VecDeque;
use std::time::Duration;

/// Share and time of the work before which the remaining time is unknown.
const LEAST_SHARE: f64 = 0.03;
const LEAST_SECONDS: f64 = 5.0;
/// Smaller steps, as shares of the work, join the step before.
const LEAST_STEP: f64 = 0.001;

/// Pace of the later half of the work that is done: a slow beginning does not predict the rest. Times count from
/// any fixed moment.
#[derive(Debug, Default)]
pub(super) struct Estimate {
    /// Time and share at the beginning: earlier work had another pace.
    began: Option<[f64; 2]>,
    /// Times and shares of steps, from the one at half of the work that is done.
    steps: VecDeque<[f64; 2]>,
    /// Time and share of the last step, and the share of the one before.
    at: [f64; 2],
    before: f64,
}

impl Estimate {
    /// The work begins, with this share of it done before.
    fn begin(&mut self, now: Duration, share: f64) {
        let at = [now.as_secs_f64(), share];
        *self = Self { began: Some(at), at, before: share, steps: [at].into() };
    }

    /// This share of the work is done.
    pub(super) fn reach(&mut self, now: Duration, share: f64) {
        let Some([_, first]) = self.began else { return self.begin(now, share) };
        if share <= self.at[1] {
            return;
        }
        self.before = self.at[1];
        self.at = [now.as_secs_f64(), share];
        if self.steps.back().is_none_or(|last| share - last[1] >= LEAST_STEP) {
            self.steps.push_back(self.at);
        }
        while self.steps.get(1).is_some_and(|step| step[1] <= f64::midpoint(first, share)) {
            self.steps.pop_front();
        }
    }

    /// Remaining time; `None` if it is too early to estimate it. It waits where a step takes longer than the last.
    pub(super) fn left(&self, now: Duration) -> Option<Duration> {
        let now = now.as_secs_f64();
        let ([began, first], [at, share]) = (self.began?, self.at);
        if share - first < LEAST_SHARE || now - began < LEAST_SECONDS {
            return None;
        }
        let [from, from_share] = *self.steps.front()?;
        let pace = (at - from) / (share - from_share);
        let rest = 1.0 - share;
        let after_next = (rest - (share - self.before)).max(0.0);
        let left = (pace * rest - (now - at)).max(pace * after_next);
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
            let (mut estimate, mut next) = (Estimate::default(), step);
            estimate.begin(at(0.0), 0.0);
            for now in (0..200).map(f64::from) {
                while next <= now {
                    estimate.reach(at(next), next / 200.0);
                    next += step;
                }
                let Some(left) = estimate.left(at(now)) else {
                    assert!(now < 7.0_f64.max(step), "nothing told at {now} s, steps of {step} s");
                    continue;
                };
                let error = left.as_secs_f64() - (200.0 - now);
                assert!((-1e-6..=1.0).contains(&error), "{error} at {now} s, steps of {step} s");
            }
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
