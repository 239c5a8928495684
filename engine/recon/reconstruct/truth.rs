//! The scene on the voxels of a volume, and the errors of a reconstruction by object.

use super::geometry::ScanGeometry;
use super::grid::{Volume, VolumeGrid};
use super::quantity::Quantity;
use beamlet_core::cancel::Cancel;
use beamlet_core::numbers::single;
use beamlet_core::{Error, Result};
use beamlet_model::material::{Constants, constants_at};
use beamlet_model::media::{MaterialTable, ScatteringAxis};
use beamlet_model::optics::modulated;
use beamlet_model::scene::{Scan, Scene};
use ndarray::{Array3, s};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Share of the largest constant below which one is zero but for rounding.
const ROUNDING: f64 = 1e-9;

/// Objects of a scene at the centres of voxels, with their constants.
#[derive(Debug, Clone)]
pub struct Truth {
    /// `[z][y][x]`: 0 in the surroundings, 1 + the index of the object.
    pub(crate) labels: Array3<u16>,
    /// Names and materials by label.
    names: Vec<[String; 2]>,
    /// Constants minus the surroundings', by label.
    constants: Vec<Constants>,
    /// Voxels.
    pub(crate) grid: VolumeGrid,
    /// Geometry of the scan.
    pub(crate) geometry: ScanGeometry,
}

impl Truth {
    /// The objects of a scene, which `labels` finds at the centres of voxels, `[z][y][x]`: 0 in the
    /// surroundings, 1 + the index of the object. It is called with the scene in the view at 0. Constants
    /// at the energy, or means over the spectrum of the light that masks modulate, minus the surroundings'.
    ///
    /// # Errors
    /// [`Error::Argument`] for a geometry or grid that cannot be and more than 65,535 objects; errors of
    /// the materials and of `labels`.
    #[doc(hidden)]
    pub fn with_labels(
        scene: &Scene,
        geometry: &ScanGeometry,
        grid: &VolumeGrid,
        labels: impl FnOnce(&Scene) -> Result<Array3<u16>>,
    ) -> Result<Self> {
        geometry.check()?;
        grid.check(geometry)?;
        if u16::try_from(scene.objects.len()).is_err() {
            let found = format!("{} objects", scene.objects.len());
            return Err(Error::argument("truth", found, "65535 objects: labels have 16 bits"));
        }
        // Lines along y are rays of the view at 0.
        let mut upright = scene.clone();
        upright.scan = Scan::new(vec![0.0], vec![0.0]);
        let mut media = MaterialTable::of(&upright)?;
        media.weights = modulated(scene, (&media.energies, &media.weights))?;
        let mean = media.mean();
        let around = mean[0];
        let less = |c: &Constants| Constants {
            mu: c.mu - around.mu,
            delta: c.delta - around.delta,
            scattering: c.scattering - around.scattering,
        };
        let of_object = media.of_object.iter().map(|medium| {
            let medium = *medium as usize;
            let axis = media.axes.get(medium).and_then(Option::as_ref);
            let share = axis.map_or(1.0, |axis| share_of_views(scene, axis));
            let constants = less(&mean[medium]);
            Constants { scattering: constants.scattering * share, ..constants }
        });
        let constants = std::iter::once(less(&around)).chain(of_object).collect();
        let surroundings = ["surroundings".to_owned(), scene.surroundings.clone()];
        let objects =
            scene.objects.iter().map(|object| [object.name.clone(), object.material.clone()]);
        let names = std::iter::once(surroundings).chain(objects).collect();
        let labels = labels(&upright)?;
        Ok(Self { labels, names, constants, grid: *grid, geometry: geometry.clone() })
    }

    /// The same with μ at an energy, keV, in place of the mean over a spectrum.
    ///
    /// # Errors
    /// Errors of the materials of the scene.
    pub fn with_mu_at(mut self, scene: &Scene, energy: f64) -> Result<Self> {
        let mu = |material: &str| Ok::<f64, Error>(constants_at(scene, material, energy)?.mu);
        let around = mu(&scene.surroundings)?;
        let materials = std::iter::once(&scene.surroundings)
            .chain(scene.objects.iter().map(|object| &object.material));
        for (constants, material) in self.constants.iter_mut().zip(materials) {
            constants.mu = mu(material)? - around;
        }
        Ok(self)
    }

    /// Labels of the voxels, `[z][y][x]`: 0 in the surroundings, 1 + the index of the object.
    #[must_use]
    pub const fn labels(&self) -> &Array3<u16> {
        &self.labels
    }

    /// Object and material of each label.
    #[must_use]
    pub fn names(&self) -> BTreeMap<u32, String> {
        let name = |[object, material]: &[String; 2]| format!("{object} ({material})");
        (0..).zip(self.names.iter().map(name)).collect()
    }

    /// True values of a quantity; `None` for the dark field where no material scatters: structure that objects
    /// describe is in no constant of a material. NaN for the dark field of a material that scatters along an axis by
    /// another variance than across it, where views see it differently: no one value is that of a voxel.
    #[must_use]
    pub fn values(&self, quantity: Quantity) -> Option<Array3<f32>> {
        let by_label: Vec<f32> = self.by_label(quantity)?.map(single).collect();
        Some(self.labels.mapv(|label| by_label[usize::from(label)]))
    }

    fn by_label(&self, quantity: Quantity) -> Option<impl Iterator<Item = f64> + '_> {
        let of = match quantity {
            Quantity::Mu => |constants: &Constants| constants.mu,
            Quantity::Delta => |constants: &Constants| constants.delta,
            Quantity::DarkField => |constants: &Constants| constants.scattering,
        };
        let none = |constants: &Constants| constants.scattering == 0.0;
        let is_known = quantity != Quantity::DarkField || !self.constants.iter().all(none);
        is_known.then(|| self.constants.iter().map(of))
    }

    /// # Errors
    /// [`Error::Argument`] for another grid than the truth's.
    pub(super) fn require_grid(&self, grid: &VolumeGrid) -> Result<()> {
        if *grid == self.grid {
            return Ok(());
        }
        let words = |grid: &VolumeGrid| {
            format!("{:?} voxels of {:?} m from {:?} m", grid.size, grid.voxel, grid.origin)
        };
        Err(Error::argument("truth", words(&self.grid), format!("the volume's {}", words(grid))))
    }

    /// Errors of a volume on the same grid as CSV, one line for each object with voxels whose
    /// neighbours all have its label, and which every view sees.
    ///
    /// # Errors
    /// [`Error::Argument`] for a volume on another grid; [`Error::Interrupted`].
    pub fn errors(&self, volume: &Volume, cancel: &Cancel) -> Result<String> {
        self.require_grid(&volume.grid)?;
        let mut text = String::from(
            "object,material,quantity,unit,inner_voxels,truth,mean,error_percent,rms_error\n",
        );
        let Some(by_label) = self.by_label(volume.quantity) else { return Ok(text) };
        let truths: Vec<f64> = by_label.collect();
        let mut sums = vec![Sums::default(); truths.len()];
        let radius = self.geometry.seen_radius();
        for ((at, label), value) in self.labels.indexed_iter().zip(&volume.values) {
            if at.2 == 0 {
                cancel.check()?;
            }
            let [x, y, z] = volume.grid.centre(at);
            let from_axis = x.hypot(y);
            let is_seen = from_axis <= radius && self.geometry.rows_see(from_axis, z);
            if is_seen && self.is_inner(at) {
                let label = usize::from(*label);
                sums[label].take(f64::from(*value) - truths[label]);
            }
        }
        let (quantity, unit) = (volume.quantity.name(), volume.quantity.unit());
        let largest = truths.iter().fold(0.0_f64, |most, truth| most.max(truth.abs()));
        for (([object, material], truth), sums) in self.names.iter().zip(&truths).zip(sums) {
            if sums.voxels == 0 || truth.is_nan() {
                continue;
            }
            let count = sums.voxels as f64;
            // Materials that differ by rounding alone from the surroundings have no relative error.
            let (error, rms) = (sums.off / count, (sums.squares / count).sqrt());
            let percent = match truth.abs() > ROUNDING * largest {
                true => format!("{:.4}", 100.0 * error / truth),
                false => String::new(),
            };
            let mean = truth + error;
            let [object, material] = [object, material].map(|name| quoted(name));
            let _ = writeln!(
                text,
                "{object},{material},{quantity},{unit},{},{truth:e},{mean:e},{percent},{rms:e}",
                sums.voxels
            );
        }
        Ok(text)
    }

    /// True if a voxel and its neighbours have one label; neighbours beyond the volume do not count.
    fn is_inner(&self, (z, y, x): (usize, usize, usize)) -> bool {
        let (depth, height, width) = self.labels.dim();
        let around = |at: usize, most: usize| at.saturating_sub(1)..(at + 2).min(most);
        let [z_range, y_range, x_range] = [around(z, depth), around(y, height), around(x, width)];
        let own = self.labels[[z, y, x]];
        self.labels.slice(s![z_range, y_range, x_range]).iter().all(|label| *label == own)
    }
}

/// Variance along x in all views of a material that scatters along an axis, over that of its constants; NaN where views
/// differ.
fn share_of_views(scene: &Scene, axis: &ScatteringAxis) -> f64 {
    let tensor = axis.tensor();
    let mut shares = scene.poses().map(|motion| {
        let x = motion.rows()[0];
        x.dot(tensor * x)
    });
    let first = shares.next().unwrap_or(f64::NAN);
    if shares.all(|share| (share - first).abs() <= ROUNDING) { first } else { f64::NAN }
}

/// Sums over the inner voxels of an object.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    voxels: u64,
    /// Differences from the truth, and their squares.
    off: f64,
    squares: f64,
}

impl Sums {
    fn take(&mut self, off: f64) {
        self.voxels += 1;
        self.off += off;
        self.squares += off * off;
    }
}

/// A field of CSV.
fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}
