//! Illumination curves behind a bundle of parallel fibres along z: rays from the centre of the source are
//! straight lines between fibres and bent lines within them, and draw the normals of rough fibres. The
//! focal spot is a blur at the detector mask; that its light crosses fibres 0.1 um beside changes the
//! dark field by 1e-3.

use super::normal::cumulative;
use super::rough::{Gauss, passed};
use super::stack::Setup;
use super::surfaces::Random;
use super::vector::{Vector, add, dot, scaled, sub, unit};

/// Fibres in a block.
pub struct Bundle {
    /// Axes of the fibres in x and y from the rotation centre, m.
    pub axes: Vec<[f64; 2]>,
    /// Radius of a fibre, m.
    pub radius: f64,
    /// Roughness of a fibre.
    pub roughness: f64,
    /// Attenuation (1/m) and decrement of the block and of the fibres.
    pub constants: [[f64; 2]; 2],
    /// Thickness of the block along y, m.
    pub thickness: f64,
}

impl Bundle {
    /// The same with axes in the order of their direction from the source.
    pub fn sorted(mut self, setup: &Setup) -> Self {
        let slope = |[x, y]: &[f64; 2]| x / (y + setup.source_distance);
        self.axes.sort_by(|a, b| slope(a).total_cmp(&slope(b)));
        self
    }

    /// Optical depth of a ray of this slope, and its displacement at the analyser, m.
    fn trace(&self, setup: &Setup, slope: f64, gauss: &mut Gauss) -> [f64; 2] {
        let [block, fibre] = self.constants;
        let index = [1.0 - block[1], 1.0 - fibre[1]];
        let line: Vector = unit([slope, 1.0, 0.0]);
        let from_source = |[x, y]: &[f64; 2]| [*x, y + setup.source_distance, 0.0];
        let direction = |axis: &[f64; 2]| axis[0] / (axis[1] + setup.source_distance);
        let reach = 1.1 * self.radius / setup.source_distance;
        let first = self.axes.partition_point(|axis| direction(axis) < slope - reach);
        let (mut depth, mut displacement) = (block[0] * self.thickness / line[1], 0.0);
        for axis in self.axes[first..].iter().take_while(|axis| direction(axis) < slope + reach) {
            let centre = from_source(axis);
            let nearest = sub(scaled(line, dot(centre, line)), centre);
            let half = self.radius * self.radius - dot(nearest, nearest);
            if half <= 0.0 {
                continue;
            }
            let entry = sub(nearest, scaled(line, half.sqrt()));
            let face = scaled(entry, -1.0 / self.radius);
            let (mut ray, inside) = passed(gauss, self.roughness, face, line, index);
            if inside {
                let way = -2.0 * dot(entry, ray) / (1.0 - ray[2] * ray[2]);
                let exit = add(entry, scaled(ray, way));
                let face = unit([exit[0], exit[1], 0.0]);
                ray = passed(gauss, self.roughness, face, ray, [index[1], index[0]]).0;
                depth += (fibre[0] - block[0]) * way;
            }
            let lever = setup.analyser() - setup.source_distance - axis[1];
            displacement += (ray[0] / ray[1] - slope) * lever;
        }
        [depth, displacement]
    }

    /// Light of a pixel at each offset of the sample mask, share of open beam, by `rays` rays to an
    /// aperture. Masks are thin and opaque.
    pub fn curve(
        &self,
        setup: &Setup,
        column: u32,
        offsets: &[f64],
        rays: u32,
    ) -> Option<Vec<f64>> {
        let (first, second) = (setup.sample_mask?, setup.detector_mask?);
        let mut gauss = Gauss(Random::new(u64::from(column) + 1));
        let centre = setup.centre(column, 0)[0];
        let magnification = second.distance / first.distance;
        let blur = (magnification - 1.0) * setup.sigma()[0];
        let farthest = offsets.iter().fold(0.0_f64, |most, offset| most.max(offset.abs()));
        let step = first.aperture / f64::from(rays);
        let count = ((2.0 * farthest + first.aperture) / step).round() as i32;
        let mut curve = vec![0.0; offsets.len()];
        for i in 0..count {
            let x = (f64::from(i) + 0.5 - 0.5 * f64::from(count)) * step;
            let slope = (centre / magnification + x) / first.distance;
            let [depth, displacement] = self.trace(setup, slope, &mut gauss);
            let at = magnification * x + displacement;
            let below = |edge: f64| cumulative((edge - at) / blur);
            let seen = below(0.5 * second.aperture) - below(-0.5 * second.aperture);
            for (sum, offset) in curve.iter_mut().zip(offsets) {
                if (x - offset).abs() < 0.5 * first.aperture {
                    *sum += seen * (-depth).exp() * step / first.period;
                }
            }
        }
        Some(curve)
    }
}
