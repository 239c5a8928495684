//! Keys of sampling.

use super::prelude::*;
use crate::scene::{Quality, RandomRays, Sampling, Scheme, Transport};

keys! { SAMPLING: Sampling, "sampling", [], [];
    scheme => Word(SCHEMES), Default(r#""cells""#), r#""random""#,
        "Cells that are integrated, or random rays.";
    quality => Word(QUALITIES), Without("\"noise\" with `detector.photons`, else \"standard\""), r#""fine""#,
        "Preset of the two tolerances below, unless they are numbers.";
    tolerance => Number("a share of open beam", within(*limits::TOLERANCE.start(), *limits::TOLERANCE.end())),
        Without("by `quality`"), "1e-3", "Error that sampling may leave in a recorded value.";
    angle_tolerance => Quantity(Angle, POSITIVE), Without("by `quality`"), r#""1 nrad""#,
        "Error of the mean refraction of the light that a mask step lets through, where no silhouette crosses the pixel.";
    max_rays => Count(1, limits::RAYS as u64), Default("200000"), "20000",
        "Most rays of a beamlet and row in a view.";
    audit => Number("a share of the beamlets and rows", within(0.0, 1.0)), Default("0.005"), "0.1",
        "Share of the beamlets and rows whose error is measured by rays of their own; those of larger estimated errors are drawn more often. 0: none.";
    rays => Either(RAYS, &ONE, &Counts("counts in x, z", 1, limits::RAYS as u64)), Default("5000"), "[100, 10]",
        "Rays of a pixel under the scheme `random`, spread over it or in a grid; up to 400000 in all.";
    transport => Word(TRANSPORTS), Default(r#""auto""#), r#""exact""#,
        "Order of the transport through the sample, or waves ([waves](waves.md)).";
    seed => Count(0, u64::MAX), Default("1"), "7", "Seed of every random number.";
}

words!(Scheme, SCHEMES: "cells" => Cells, "random" => Random);
words!(Quality, QUALITIES: "noise" => Noise, "standard" => Standard, "fine" => Fine);
words!(Transport, TRANSPORTS: "auto" => Auto, "first-order" => FirstOrder, "exact" => Exact,
    "wave" => Wave);

impl Record for Sampling {
    const KEYS: &'static Keys<Self> = &SAMPLING;

    fn begin(_: &dyn Fn(&str) -> bool) -> Self {
        Self::default()
    }
}

const RAYS: &str =
    "a number of rays, such as 5000, or a grid of them in x and z, such as [5000, 4]";
const ONE: Kind = Count(1, limits::RAYS as u64);

impl Value for RandomRays {
    fn read(item: &ListItem<'_>, row: &'static Row) -> Result<Self> {
        let most = limits::RAYS;
        let rays = |item: &ListItem<'_>| {
            item.integer(1..=u64::from(most)).map(|rays| u32::try_from(rays).unwrap_or(most))
        };
        match item.is_list() {
            true => item.array(&row.allowed(), rays).map(Self::Grid),
            false => rays(item).map(Self::Count),
        }
    }

    fn write(&self, row: &Row, base: &Base<'_>) -> Result<Option<String>> {
        match self {
            Self::Count(count) => count.write(row, base),
            Self::Grid(grid) => grid.write(row, base),
        }
    }

    fn check(&self, key: &str, _: &Row, faults: &mut Faults) {
        let [x, z] = match *self {
            Self::Count(count) => [count, 1],
            Self::Grid(grid) => grid,
        };
        let [x, z] = [x, z].map(u64::from);
        let each = whole(key, &ONE, x).and_then(|()| whole(key, &ONE, z));
        if each.is_ok() && x * z > limits::RAYS_OF_PIXEL {
            let allowed = format!("up to {} in a pixel", limits::RAYS_OF_PIXEL);
            faults.add(Error::scene(key, format!("{} in a pixel", x * z), allowed));
        }
        faults.note(each);
    }
}
