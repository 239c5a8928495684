//! Estimates of objects by waves: one for all objects of the same bodies.

use super::SetUp;
use super::sizes::Sizes;
use beamlet_core::numbers::whole;
use beamlet_geometry::ObjectSummary;
use beamlet_model::optics::waves::{Bodies, Body, Form, Pixel, Rim};
use std::collections::HashMap;
use std::f64::consts::PI;

/// Most kinds of bodies with an estimate each; of more kinds bodies of nearly the same size share one. An estimate
/// takes some 50 ms.
const MOST: usize = 24;
/// Relative difference of sizes by rounding.
const ROUNDING: f64 = 1e-6;

/// Bodies of an object and the materials around them.
pub(super) struct Subject<'a> {
    pub(super) summary: &'a ObjectSummary,
    pub(super) sizes: Sizes,
    /// Differences of delta and of the attenuation coefficient (1/m) to each material around the object, by energy
    /// node.
    pub(super) hosts: Vec<Vec<[f64; 2]>>,
    /// True if the dark field is estimated.
    pub(super) has_dark_field: bool,
}

/// Errors of rays at an object, as in [`super::ObjectLimits`].
#[derive(Debug, Clone, Default)]
pub(super) struct Estimate {
    pub(super) rim: Option<f64>,
    pub(super) dark_field: Option<[f64; 2]>,
    pub(super) fitted_dark_field: Option<[f64; 2]>,
}

/// Numbers that an estimate depends on, rounded.
#[derive(Debug, PartialEq, Eq, Hash)]
struct Key {
    is_sphere: bool,
    /// Logarithms of radius and share of each size in steps, of both cylinders of bodies that are not round.
    sizes: Vec<Vec<[i64; 2]>>,
    /// Logarithm of the mean path over the radius in steps: with the sizes it gives the density.
    layers: i64,
    hosts: Vec<Vec<[u64; 2]>>,
    has_dark_field: bool,
}

/// Estimates so far.
pub(super) struct Estimates<'a> {
    set_up: &'a SetUp<'a>,
    pixel: &'a Pixel,
    /// Step of logarithms of sizes within which objects share an estimate.
    step: f64,
    /// Estimate of each kind, with the name of the object that it was made for.
    known: HashMap<Key, (Estimate, &'a str)>,
}

impl<'a> Estimates<'a> {
    pub(super) fn new(set_up: &'a SetUp<'a>, pixel: &'a Pixel, all: &[Subject<'_>]) -> Self {
        let mut kinds: HashMap<Key, ()> = HashMap::new();
        let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
        for subject in all {
            if let Some([least, greatest]) = subject.sizes.diameters() {
                (low, high) = (low.min(least), high.max(greatest));
                kinds.insert(subject.key(ROUNDING), ());
            }
        }
        let step = if kinds.len() > MOST { (high / low).ln() / MOST as f64 } else { ROUNDING };
        Self { set_up, pixel, step: step.max(ROUNDING), known: HashMap::new() }
    }

    /// The estimate of an object, and the other object whose bodies it was made for.
    pub(super) fn of(&mut self, subject: &Subject<'a>) -> (Estimate, Option<&'a str>) {
        let (set_up, pixel) = (self.set_up, self.pixel);
        let own = subject.summary.name.as_str();
        let key = subject.key(self.step);
        let (found, of) =
            self.known.entry(key).or_insert_with(|| (subject.estimate(set_up, pixel), own));
        (found.clone(), (self.step > ROUNDING && *of != own).then_some(*of))
    }
}

impl Subject<'_> {
    /// Forms and sizes with an estimate: both cylinders of bodies that are not round.
    fn kinds(&self) -> Vec<(Form, &Vec<Body>)> {
        match &self.sizes {
            Sizes::Round(form, bodies) => vec![(*form, bodies)],
            Sizes::Between(inscribed, enclosing) => {
                vec![(Form::Cylinder, inscribed), (Form::Cylinder, enclosing)]
            }
            Sizes::Unknown(..) => Vec::new(),
        }
    }

    fn key(&self, step: f64) -> Key {
        let class = |value: f64| whole::<i64>((value.ln() / step).round());
        let kinds = self.kinds();
        let sizes = |(_, bodies): &(Form, &Vec<Body>)| {
            bodies.iter().map(|body| [class(body.radius), class(body.share)]).collect()
        };
        let bits = |of: &Vec<[f64; 2]>| of.iter().map(|pair| pair.map(f64::to_bits)).collect();
        let first = kinds.first();
        Key {
            is_sphere: first.is_some_and(|(form, _)| *form == Form::Sphere),
            sizes: kinds.iter().map(sizes).collect(),
            layers: class(first.map_or(1.0, |(_, bodies)| layers(bodies, self.summary))),
            hosts: self.hosts.iter().map(bits).collect(),
            has_dark_field: self.has_dark_field,
        }
    }

    fn estimate(&self, set_up: &SetUp<'_>, pixel: &Pixel) -> Estimate {
        let mut found = Estimate { rim: self.rim(set_up, pixel), ..Estimate::default() };
        let (mut ratios, mut fitted) = (Vec::new(), Vec::new());
        for constants in self.hosts.iter().filter(|_| self.has_dark_field) {
            for (form, bodies) in self.kinds() {
                let bodies = Bodies {
                    form,
                    sizes: bodies.clone(),
                    delta: constants.iter().map(|[delta, _]| *delta).collect(),
                    density: density(form, bodies, self.summary),
                };
                ratios.push(bodies.ratio(pixel, &set_up.nodes));
                let fields = bodies.dark_fields(pixel, &set_up.nodes, &set_up.offsets);
                fitted
                    .push(fields.filter(|[_, rays]| *rays > 0.0).map(|[waves, rays]| waves / rays));
            }
        }
        found.dark_field = range(&ratios);
        found.fitted_dark_field = range(&fitted);
        found
    }

    /// Greatest error at a rim, of the largest bodies; `None` where they are not round.
    fn rim(&self, set_up: &SetUp<'_>, pixel: &Pixel) -> Option<f64> {
        let Sizes::Round(_, bodies) = &self.sizes else { return None };
        let radius = bodies.iter().map(|body| body.radius).fold(0.0, f64::max);
        let of = |constants: &Vec<[f64; 2]>| {
            let rim = Rim { radius, constants: constants.clone() };
            rim.error(pixel, &set_up.nodes, &set_up.offsets)
        };
        self.hosts.iter().map(of).reduce(|a, b| Some(a?.max(b?)))?
    }
}

/// Mean path through the bodies of an object over the radius of the first.
fn layers(bodies: &[Body], summary: &ObjectSummary) -> f64 {
    let [low, high] = summary.bounds;
    let face = (high[0] - low[0]) * (high[2] - low[2]);
    summary.volume / face / bodies.first().map_or(1.0, |body| body.radius)
}

/// Bodies across the beam: per length for cylinders, 1/m, and per area for spheres, 1/m², from the volume of an
/// object and the side of its box along the beam at rest.
fn density(form: Form, bodies: &[Body], summary: &ObjectSummary) -> f64 {
    let [low, high] = summary.bounds;
    let face = (high[0] - low[0]) * (high[2] - low[2]);
    let each = |body: &Body| {
        body.share
            * match form {
                Form::Cylinder => PI * body.radius.powi(2),
                Form::Sphere => 4.0 / 3.0 * PI * body.radius.powi(3),
            }
    };
    summary.volume / face / bodies.iter().map(each).sum::<f64>()
}

/// Least and greatest of some values; `None` where one is missing.
fn range(values: &[Option<f64>]) -> Option<[f64; 2]> {
    let known: Option<Vec<f64>> = values.iter().copied().collect();
    let known = known.filter(|known| !known.is_empty())?;
    let low = known.iter().copied().fold(f64::INFINITY, f64::min);
    Some([low, known.into_iter().fold(f64::NEG_INFINITY, f64::max)])
}
