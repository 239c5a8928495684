//! Keys of sampling.

use super::prelude::*;
use crate::scene::{Sampling, Scheme, Transport};

keys! { SAMPLING: Sampling, "sampling", [], [];
    scheme => Word(SCHEMES), Default(r#""cells""#), r#""random""#,
        "Cells that are integrated, or random rays.";
    cells => Count(1, limits::CELLS as u64), Without("from the geometry"), "20",
        "Cells per period in x before refinement; `cells` × `rows` up to 10000.";
    rows => Count(1, limits::ROWS as u64), Default("1"), "4",
        "Parts of a row of pixels in z before refinement.";
    tolerance => Number("a share of open beam", within(*limits::TOLERANCE.start(), *limits::TOLERANCE.end())),
        Default("1e-4"), "1e-3", "Error that sampling may leave in a recorded value.";
    angle_tolerance => Quantity(Angle, POSITIVE), Default(r#""2 nrad""#), r#""1 nrad""#,
        "Error of the mean refraction of the light that a mask step lets through, where no silhouette crosses the pixel.";
    max_rays => Count(1, limits::RAYS as u64), Default("200000"), "20000",
        "Most rays of a beamlet and row in a view.";
    rays => Counts("rays per pixel in x and z", 1, limits::RAYS as u64), Default("[5000, 1]"), "[5000, 1]",
        "Rays per pixel of the scheme `random`; up to 400000 in a pixel.";
    transport => Word(TRANSPORTS), Default(r#""auto""#), r#""exact""#,
        "Order of the transport through the sample.";
    seed => Count(0, u64::MAX), Default("1"), "7", "Seed of every random number.";
}

words!(Scheme, SCHEMES: "cells" => Cells, "random" => Random);
words!(Transport, TRANSPORTS: "auto" => Auto, "first-order" => FirstOrder, "exact" => Exact);

impl Record for Sampling {
    const KEYS: &'static Keys<Self> = &SAMPLING;

    fn begin(_: &dyn Fn(&str) -> bool) -> Self {
        Self::default()
    }

    fn comments(&self, key: &str) -> Vec<String> {
        let computed = key == "cells" && self.cells.is_none();
        computed.then(|| "cells: from the geometry".to_owned()).into_iter().collect()
    }

    fn relations(&self, key: &dyn Fn(&str) -> String, faults: &mut Faults) {
        let cells = u64::from(self.cells.unwrap_or(1)) * u64::from(self.rows);
        if cells > u64::from(limits::CELLS) {
            let found = format!("{cells} in {} rows", self.rows);
            let allowed = format!("cells × rows up to {}", limits::CELLS);
            faults.add(Error::scene(key("cells"), found, allowed));
        }
        let [x, z] = self.rays.map(u64::from);
        if x * z > limits::RAYS_OF_PIXEL {
            let allowed = format!("up to {} in a pixel", limits::RAYS_OF_PIXEL);
            faults.add(Error::scene(key("rays"), format!("{} in a pixel", x * z), allowed));
        }
    }
}
