//! Quantiles of the standard normal distribution: one uniform number gives one normal number.

#![allow(clippy::excessive_precision, reason = "the coefficients as they are printed")]

/// The number below which a share `p`, in (0, 1), of the standard normal distribution lies; to
/// 1e-15 relative (Wichura 1988, algorithm AS 241, PPND16).
pub(super) fn normal_quantile(p: f64) -> f64 {
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        return q * ratio(&CENTRE, 0.180_625 - q * q);
    }
    let tail = (-libm::log(if q < 0.0 { p } else { 1.0 - p })).sqrt();
    let far = if tail <= 5.0 { ratio(&MIDDLE, tail - 1.6) } else { ratio(&TAIL, tail - 5.0) };
    if q < 0.0 { -far } else { far }
}

/// Coefficients of numerator and denominator from the lowest power on.
type Ratio = [[f64; 8]; 2];

fn ratio([above, below]: &Ratio, r: f64) -> f64 {
    let sum = |all: &[f64; 8]| all.iter().rev().fold(0.0, |sum, a| sum * r + a);
    sum(above) / sum(below)
}

const CENTRE: Ratio = [
    [
        3.387_132_872_796_366_608,
        133.141_667_891_784_377_45,
        1_971.590_950_306_551_442_7,
        13_731.693_765_509_461_125,
        45_921.953_931_549_871_457,
        67_265.770_927_008_700_853,
        33_430.575_583_588_128_105,
        2_509.080_928_730_122_672_7,
    ],
    [
        1.0,
        42.313_330_701_600_911_252,
        687.187_007_492_057_908_3,
        5_394.196_021_424_751_107_7,
        21_213.794_301_586_595_867,
        39_307.895_800_092_710_61,
        28_729.085_735_721_942_674,
        5_226.495_278_852_854_561,
    ],
];

const MIDDLE: Ratio = [
    [
        1.423_437_110_749_683_577_34,
        4.630_337_846_156_545_295_9,
        5.769_497_221_460_691_405_5,
        3.647_848_324_763_204_605_04,
        1.270_458_252_452_368_382_58,
        0.241_780_725_177_450_611_77,
        0.022_723_844_989_269_184_583_3,
        7.745_450_142_783_414_076_4e-4,
    ],
    [
        1.0,
        2.053_191_626_637_758_821_87,
        1.676_384_830_183_803_849_4,
        0.689_767_334_985_100_004_55,
        0.148_103_976_427_480_074_59,
        0.015_198_666_563_616_457_196_6,
        5.475_938_084_995_344_946e-4,
        1.050_750_071_644_416_843_24e-9,
    ],
];

const TAIL: Ratio = [
    [
        6.657_904_643_501_103_777_2,
        5.463_784_911_164_114_369_9,
        1.784_826_539_917_291_335_8,
        0.296_560_571_828_504_891_23,
        0.026_532_189_526_576_123_093,
        0.001_242_660_947_388_078_438_6,
        2.711_555_568_743_487_578_15e-5,
        2.010_334_399_292_288_132_65e-7,
    ],
    [
        1.0,
        0.599_832_206_555_887_937_69,
        0.136_929_880_922_735_805_31,
        0.014_875_361_290_850_614_852_5,
        7.868_691_311_456_132_591e-4,
        1.846_318_317_510_054_681_8e-5,
        1.421_511_758_316_445_888_7e-7,
        2.044_263_103_389_939_785_64e-15,
    ],
];

#[cfg(test)]
mod tests {
    use super::super::REACH;
    use super::super::philox::unit;
    use super::*;

    #[test]
    fn no_draw_is_beyond_the_reach_of_noise() {
        let [least, most] = [[0; 2], [u32::MAX; 2]].map(|bits| normal_quantile(unit(bits)));
        assert!(
            (-REACH..-8.29).contains(&least) && (8.2..REACH).contains(&most),
            "{least}, {most}"
        );
    }

    #[test]
    fn quantile_undoes_the_distribution_function() {
        // From 1e-16 to 1/2: the three ranges.
        for i in 0..=320 {
            let p = 0.5 * libm::pow(10.0, -f64::from(i) / 20.0);
            let x = normal_quantile(p);
            let share = 0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2);
            assert!((share / p - 1.0).abs() < 1e-13, "{p:e}: {x}, {share:e}");
            if p > 1e-3 {
                assert!((normal_quantile(1.0 - p) + x).abs() < 1e-12);
            }
        }
    }
}
