//! Fields through a thick block, by propagation and phase in turn.

use super::field::Grid;
use super::light::Light;
use super::setup::{Setup, Slits, Window};
use rustfft::num_complex::Complex;

/// Steps along the block: its face comes nearer by a fifth of a sample in each.
const STEPS: u32 = 5000;

/// A block whose face crosses the optical axis in its middle. The block fills the side of larger x, and its face
/// comes nearer to the other side along the beam.
#[derive(Debug, Clone, Copy)]
pub struct Block {
    /// Distance of its middle from the source, m.
    pub middle: f64,
    /// Length along the beam, m.
    pub depth: f64,
    /// Glancing angle of the face to the axis, rad.
    pub angle: f64,
    /// Decrement.
    pub delta: f64,
}

impl Block {
    /// Change of the light of windows about `centres` (analyser, m) by the block behind one aperture (m).
    pub fn change(
        &self,
        setup: &Setup,
        aperture: f64,
        window: &Window,
        centres: &[f64],
    ) -> Vec<f64> {
        let near = Grid { count: 1 << 13, spacing: 5e-9, repeats: false };
        // Mirrored light is hundreds of um away.
        let far = Grid { count: 1 << 18, ..near };
        let light = |field: &[Complex<f64>], from: f64| -> Vec<f64> {
            let mut all = vec![Complex::ZERO; far.count];
            let first = (far.count - near.count) / 2;
            all[first..first + near.count].copy_from_slice(field);
            far.propagate(&mut all, setup.wavelength, setup.effective(from, setup.analyser));
            let intensity: Vec<f64> = all.iter().map(Complex::norm_sqr).collect();
            let light = Light::blurred(far, setup, &intensity, &setup.spot);
            centres.iter().map(|centre| light.seen(setup, window, *centre)).collect()
        };
        let open = near.behind(&Slits::one(aperture));
        let mut field = open.clone();
        self.carry(near, setup, &mut field, STEPS);
        let behind = light(&field, self.middle + 0.5 * self.depth);
        behind.iter().zip(light(&open, setup.mask)).map(|(with, without)| with - without).collect()
    }

    /// Carries a field from the plane of the mask to the back of the block, in coordinates of the mask.
    fn carry(&self, grid: Grid, setup: &Setup, field: &mut [Complex<f64>], steps: u32) {
        let ends = [-0.5, 0.5].map(|end| self.middle + end * self.depth);
        let length = self.depth / f64::from(steps);
        let phase = -setup.wavenumber() * self.delta * length;
        let inside = Complex::from_polar(1.0, phase);
        let mut at = setup.mask;
        for step in 0..steps {
            let y = ends[0] + (f64::from(step) + 0.5) * length;
            grid.propagate(field, setup.wavelength, setup.effective(at, y));
            at = y;
            let face = -self.angle * (y - self.middle) * setup.mask / y;
            for (i, value) in field.iter_mut().enumerate() {
                let share = (grid.x(i) - face) / grid.spacing + 0.5;
                if share >= 1.0 {
                    *value *= inside;
                } else if share > 0.0 {
                    *value *= Complex::from_polar(1.0, phase * share);
                }
            }
        }
        grid.propagate(field, setup.wavelength, setup.effective(at, ends[1]));
    }
}
