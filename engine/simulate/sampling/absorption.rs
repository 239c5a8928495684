//! Light behind an optical depth that is linear over a piece, as `shaders/physics/absorption.glsl`.

/// Largest change of the depth whose linear light is nowhere below zero: there [`linear_change`] is 2.
const LARGEST: f32 = 2.1548;

/// Share of the light that passes, on average. `middle`: depth in the middle of the piece; `change`: of the depth over it.
pub(crate) fn mean_passed(middle: f32, change: f32) -> f32 {
    let (size, square) = (change.abs(), change * change);
    if size < 0.5 {
        // The difference of a small change would lose its digits.
        (-middle).exp() * (1.0 + square * (1.0 / 24.0 + square / 1920.0))
    } else {
        (0.5 * size - middle).exp() * (1.0 - (-size).exp()) / size
    }
}

/// Change over a piece, over the light in the middle, of the linear light with the centre of light of the exponential;
/// of a large change the linear light is 0 at the dark end.
pub(crate) fn linear_change(change: f32) -> f32 {
    let change = change.clamp(-LARGEST, LARGEST);
    change / (1.0 + change * change / 60.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamlet_core::numbers::single;

    /// Light and its centre against sums in f64: 3e-6 of the light is the rounding of f32 where a change is 0.5, and the
    /// centre of linear light is that of the exponential within 1e-3 of the half width until the dark end is 0.
    #[test]
    fn light_and_its_centre_are_those_of_the_exponential() {
        for change in [0.0, 0.01, 0.4999, 0.5, 1.0, 2.0, 20.0, 160.0] {
            for sign in [-1.0, 1.0] {
                let change = sign * change;
                let middle = 0.5 * f64::abs(change) + 0.3;
                let places = (0..200_000).map(|at| (f64::from(at) + 0.5) / 1e5 - 1.0);
                let light = |xi: f64| 5e-6 * (-middle - 0.5 * change * xi).exp();
                let [all, centre] =
                    places.fold([0.0, 0.0], |[a, c], xi| [a + light(xi), c + xi * light(xi)]);
                let got = f64::from(mean_passed(single(middle), single(change)));
                assert!((got / all - 1.0).abs() < 3e-6 + 1e-7 * middle, "{change}: {got} {all}");
                let linear = -f64::from(linear_change(single(change))) / 6.0;
                let want = if change.abs() <= 2.0 { centre / all } else { -sign / 3.0 };
                assert!((linear - want).abs() < 1e-3, "{change}: {linear} {want}");
            }
        }
    }
}
