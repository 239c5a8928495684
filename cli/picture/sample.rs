//! The sample: materials in colours, surrounding objects translucent. Exact shapes of opaque objects are found by their
//! places (`impostors`), all others by rays.

use super::colour::{Rgb, SMALL};
use super::drawing::{Anchor, Area, Drawing, GREY, INK, Paint};
use super::impostors::{Impostors, Surface, View};
use super::palette::{colour_of, colour_of_object, materials};
use super::text::{cut, length, wrapped};
use crate::numbers::{self, single};
use beamlet::cli_support::{MaterialTable, require_memory};
use beamlet::geometry::Sample;
use beamlet::scene::{Sampling, Scan, Scene, Transport};
use beamlet::{
    Backend, Engine, EngineOptions, Ray, Result, Simulation, SurfaceCrossing, uncovered,
};
use glam::DVec3;
use rayon::prelude::*;

/// Where the sample is looked at from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Camera {
    /// Turned about +z from the source's side towards +x, rad.
    pub(crate) azimuth: f64,
    /// Above the horizontal plane, rad.
    pub(crate) elevation: f64,
}

impl Default for Camera {
    fn default() -> Self {
        Self { azimuth: 35.0_f64.to_radians(), elevation: 24.0_f64.to_radians() }
    }
}

/// Crossings of a ray that are looked at: behind this many translucent surfaces nothing shows.
const CROSSINGS: u32 = 48;
/// Opacity of surfaces of an object with something inside, seen face on.
const TRANSLUCENT: f64 = 0.16;
/// Rays across a pixel where the picture changes.
const FINE: usize = 3;
/// Pixels that are looked at again together.
const TOGETHER: usize = 1 << 15;
/// Bytes of the picture while it is made: rays and colours of its pixels, crossings on host and
/// device, bodies in front at each place that is looked at.
const WHILE_MADE: u64 = 320 << 20;
/// Materials in the legend with their objects, and without.
const FULL: usize = 10;
const CLOSE: usize = 21;
const SIZE: f64 = 760.0;
/// Lines of the title of a scene.
const MOST_LINES: usize = 4;
const SCALE: f64 = 1.5;

/// Draws the sample; no rays are traced where there is none.
pub(crate) fn draw(
    scene: &Scene,
    sample: &Sample,
    camera: Camera,
    device: Option<&str>,
) -> Result<Drawing> {
    let mut drawing = Drawing::new(SIZE + 250.0, SIZE + 20.0);
    let picture = Picture::of(scene, sample, camera);
    let side = numbers::whole::<usize>(SIZE * SCALE);
    require_memory(WHILE_MADE, "the picture of the sample")?;
    let shapes = Impostors::objects(sample, &picture.translucent);
    // Wrong materials are errors whether rays cross them or not.
    MaterialTable::of(scene)?;
    let traced = RayTraced::of(scene, sample, &picture, &shapes, device)?;
    let impostors = Impostors::draw(sample, &shapes, &picture.view, FINE * side);
    let pixels = render(traced.as_ref(), &impostors, &picture, side)?;
    let area = Area::new(10.0, 10.0, SIZE, SIZE);
    drawing.pixels(area, side, pixels);
    legend(&mut drawing, scene, sample, &picture);
    Ok(drawing)
}

/// Properties of the sample for the picture.
struct Picture {
    view: View,
    /// No point of the sample is farther from the rotation centre, m.
    reach: f64,
    camera: Camera,
    colours: Vec<Rgb>,
    translucent: Vec<bool>,
}

impl Picture {
    fn of(scene: &Scene, sample: &Sample, camera: Camera) -> Self {
        let axes = turn(camera).map(DVec3::from_array);
        let vertices = || sample.vertices.iter().map(|it| DVec3::from_array(*it));
        let extent = axes.map(|axis| {
            let own = vertices().map(|it| axis.dot(it)).map(|it| [it, it]);
            let placed = sample.placed.iter().map(|it| sample.extent_of_placed(it, axis));
            own.chain(placed).fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], it| {
                [low.min(it[0]), high.max(it[1])]
            })
        });
        let half = [extent[0], extent[2]].map(|[low, high]| high - low);
        let farthest = extent.map(|[low, high]| low.abs().max(high.abs()));
        let count = sample.objects.len();
        // Objects around another object or a void are translucent.
        let translucent = (0..count).map(|object| {
            sample.components.iter().any(|component| {
                component.outside.is_some_and(|outside| outside as usize == object)
                    || (component.object as usize == object && component.volume < 0.0)
            })
        });
        let colour = |object| colour_of_object(scene, u32::try_from(object).ok());
        Self {
            view: View {
                axes,
                centre: extent.map(|[low, high]| f64::midpoint(low, high)),
                half: half[0].max(half[1]) / 2.0 * 1.12,
            },
            reach: DVec3::from_array(farthest).length(),
            camera,
            colours: (0..count).map(colour).collect(),
            translucent: translucent.collect(),
        }
    }

    /// The ray through a point of the picture, -1..=1 to the right and upwards: parallel, into
    /// the picture along +y.
    fn ray(&self, across: f64, up: f64) -> Ray {
        let View { centre, half, .. } = self.view;
        let [x, z] = [centre[0] + across * half, centre[2] + up * half];
        Ray::new(0, [single(x), single(z)], [0.0; 2])
    }

    /// Colour of surfaces one behind another, and a hash of those that show: pixels whose hash differs from a
    /// neighbour's are looked at again, finer.
    fn seen(&self, met: &[Surface]) -> ([f64; 3], u64) {
        let mut light = [0.0; 3];
        let mut through = 1.0;
        let mut key = 0_u64;
        for surface in met {
            let object = surface.object;
            let [x, y, z] = surface.normal.map(f64::from);
            key = (key ^ (1 + object as u64)).wrapping_mul(0x0100_0000_01b3);
            let facing = y.abs().min(1.0);
            // Towards the viewer, whichever side is seen.
            let side = if y > 0.0 { -1.0 } else { 1.0 };
            let normal = [side * x, side * y, side * z];
            let glow = |towards: [f64; 3]| dot(normal, unit(towards)).max(0.0);
            let shade = 0.46 + 0.66 * glow([-0.5, -0.75, 0.65]) + 0.22 * glow([0.8, -0.6, 0.1]);
            let shine = 0.22 * glow([-0.32, -0.86, 0.43]).powi(36);
            let opacity = match self.translucent[object] {
                true => TRANSLUCENT + (0.75 - TRANSLUCENT) * (1.0 - facing).powi(4),
                false => 1.0,
            };
            for (sum, colour) in light.iter_mut().zip(self.colours[object]) {
                let base = 0.12 + 0.88 * f64::from(colour) / 255.0;
                *sum += through * opacity * (base * shade + shine).min(1.0);
            }
            through *= 1.0 - opacity;
            if through < 1e-3 {
                break;
            }
        }
        for sum in &mut light {
            *sum += through;
        }
        (light, key)
    }
}

/// Objects whose surfaces are found by rays.
struct RayTraced {
    simulation: Simulation,
    /// Their indices in the whole scene.
    objects: Vec<usize>,
}

impl RayTraced {
    /// Opens a device for the objects that are not drawn as `shapes`; `None` where there are none. A device that the
    /// user names is always opened, so that a wrong name is an error.
    fn of(
        scene: &Scene,
        sample: &Sample,
        picture: &Picture,
        shapes: &[bool],
        device: Option<&str>,
    ) -> Result<Option<Self>> {
        let mut is_traced = vec![false; sample.objects.len()];
        let placed = sample.placed.iter().map(|it| it.component);
        for component in sample.triangle_component.iter().copied().chain(placed) {
            let object = sample.object_of(component);
            is_traced[object] = !shapes[object];
        }
        let objects: Vec<usize> = (0..is_traced.len()).filter(|it| is_traced[*it]).collect();
        if objects.is_empty() && device.is_none() {
            return Ok(None);
        }
        let options = EngineOptions::default().with_device(device.map(str::to_owned));
        let engine = Engine::open(&options.with_backend(Backend::Bvh))?;
        if objects.is_empty() {
            return Ok(None);
        }
        let mut turned = turned(scene, picture.camera, picture.reach);
        let mut is_traced = is_traced.into_iter();
        turned.objects.retain(|_| is_traced.next().unwrap_or(true));
        Ok(Some(Self { simulation: engine.prepare(&turned)?, objects }))
    }

    /// Calls `visit` with the index of each ray, in order, and its surfaces from front to back.
    fn find(&self, rays: &[Ray], mut visit: impl FnMut(usize, Vec<Surface>)) -> Result<()> {
        self.simulation.crossings(rays, CROSSINGS, |ray, met| {
            let surface = |it: &SurfaceCrossing| Surface {
                depth: it.y,
                object: self.objects[it.object as usize],
                normal: it.normal,
            };
            visit(ray, uncovered(met).iter().map(surface).collect());
        })
    }
}

/// Places that are looked at: pixels, and parts of pixels.
struct Place {
    column: usize,
    row: usize,
}

/// Calls `visit` with the surfaces at places of a picture of `side` columns, in order.
fn visit_places(
    traced: Option<&RayTraced>,
    impostors: &Impostors<'_>,
    picture: &Picture,
    places: &[Place],
    mut visit: impl FnMut(usize, &[Surface]),
) -> Result<()> {
    let front = |place: &Place| impostors.at(place.column, place.row);
    let fronts: Vec<Option<Surface>> = places.par_iter().map(front).collect();
    let mut at = |index: usize, mut met: Vec<Surface>| {
        if let Some(front) = fronts[index] {
            met.insert(met.partition_point(|it| it.depth < front.depth), front);
        }
        visit(index, &met);
    };
    let Some(traced) = traced else {
        (0..places.len()).for_each(|index| at(index, Vec::new()));
        return Ok(());
    };
    let place = |index| View::place(index, impostors.side());
    let ray = |it: &Place| picture.ray(place(it.column), -place(it.row));
    traced.find(&places.iter().map(ray).collect::<Vec<_>>(), at)
}

/// Colours of `side` rows of as many pixels; `impostors` has `FINE` times as many.
fn render(
    traced: Option<&RayTraced>,
    impostors: &Impostors<'_>,
    picture: &Picture,
    side: usize,
) -> Result<Vec<Rgb>> {
    let part = |pixel: usize, [across, down]: [usize; 2]| Place {
        column: FINE * (pixel % side) + across,
        row: FINE * (pixel / side) + down,
    };
    let middles: Vec<Place> = (0..side * side).map(|it| part(it, [FINE / 2; 2])).collect();
    let mut seen = Vec::with_capacity(middles.len());
    visit_places(traced, impostors, picture, &middles, |_, met| seen.push(picture.seen(met)))?;
    // Pixels beside which something else is seen are looked at again, finer.
    let differs = |i: usize| {
        let (x, y) = (i % side, i / side);
        let mut beside = Vec::with_capacity(4);
        for (ok, j) in [
            (x > 0, i.wrapping_sub(1)),
            (x + 1 < side, i + 1),
            (y > 0, i.wrapping_sub(side)),
            (y + 1 < side, i + side),
        ] {
            if ok {
                beside.push(j);
            }
        }
        let far = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).any(|(a, b)| (a - b).abs() > 0.05);
        beside.into_iter().any(|j| seen[i].1 != seen[j].1 || far(&seen[i].0, &seen[j].0))
    };
    let edges: Vec<usize> = (0..seen.len()).filter(|i| differs(*i)).collect();
    for pixels in edges.chunks(TOGETHER) {
        let parts = |i: &usize| {
            let i = *i;
            (0..FINE * FINE).map(move |at| part(i, [at % FINE, at / FINE]))
        };
        let fine: Vec<Place> = pixels.iter().flat_map(parts).collect();
        let mut sums = vec![[0.0; 3]; pixels.len()];
        visit_places(traced, impostors, picture, &fine, |at, met| {
            let (light, _) = picture.seen(met);
            let sum = &mut sums[at / (FINE * FINE)];
            (0..3).for_each(|i| sum[i] += light[i] / (FINE * FINE) as f64);
        })?;
        for (pixel, sum) in pixels.iter().zip(sums) {
            seen[*pixel].0 = sum;
        }
    }
    Ok(seen
        .iter()
        .map(|(light, _)| light.map(|l| numbers::whole::<u8>((l.clamp(0.0, 1.0) * 255.0).round())))
        .collect())
}

/// The scene with its sample turned so that the camera looks along +y, and nothing else in it.
fn turned(scene: &Scene, camera: Camera, reach: f64) -> Scene {
    let mut turned = scene.clone();
    let turn = turn(camera);
    let (x_axis, z_axis) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    for object in &mut turned.objects {
        object.placement.rotate.push((z_axis, -camera.azimuth));
        object.placement.rotate.push((x_axis, camera.elevation));
        object.placement.position = times(&turn, object.placement.position);
    }
    // Room for the sample whichever way it is turned.
    turned.source.distance = 4.0 * reach + 1.0;
    turned.detector.distance = 2.0 * turned.source.distance;
    turned.detector.pixels = [1, 1];
    turned.detector.pitch = [8.0 * reach + 1e-3; 2];
    turned.microstructures.clear();
    turned.scattering.clear();
    turned.sample_mask = None;
    turned.detector_mask = None;
    turned.scan = Scan::default();
    turned.sampling = Sampling::default();
    turned.sampling.transport = Transport::FirstOrder;
    turned
}

/// World to camera: x to the right, y into the picture, z upwards.
fn turn(camera: Camera) -> [[f64; 3]; 3] {
    let (sa, ca) = (-camera.azimuth).sin_cos();
    let (se, ce) = camera.elevation.sin_cos();
    [[ca, -sa, 0.0], [ce * sa, ce * ca, -se], [se * sa, se * ca, ce]]
}

fn times(turn: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    turn.map(|row| dot(row, v))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    v.map(|part| part / length)
}

/// Materials with their objects, axes, scale.
fn legend(drawing: &mut Drawing, scene: &Scene, sample: &Sample, picture: &Picture) {
    let left = SIZE + 22.0;
    drawing.text([left, 30.0], "Sample", 19.0, INK, Anchor::Start);
    let mut y = 62.0;
    let title = scene.title.as_deref().unwrap_or_default();
    for line in wrapped(title, 215.0, SMALL).into_iter().take(MOST_LINES) {
        drawing.text([left, y - 12.0], cut(&line, 215.0, SMALL), SMALL, GREY, Anchor::Start);
        y += 16.0;
    }
    let all = materials(scene);
    // Many materials leave no room for the names of their objects.
    let (row, most) = if all.len() > FULL { (20.0, CLOSE) } else { (42.0, FULL) };
    for material in all.iter().take(most) {
        let colour = colour_of(scene, material);
        drawing.area(Area::new(left, y - 11.0, 14.0, 14.0), Paint::fill(colour));
        drawing.text([left + 21.0, y], cut(material, 190.0, 14.0), 14.0, INK, Anchor::Start);
        if all.len() <= FULL {
            let objects: Vec<&str> = scene
                .objects
                .iter()
                .filter(|object| object.material == *material)
                .map(|object| object.name.as_str())
                .collect();
            let text = match objects.len() {
                count if count > 3 => format!("{count} objects"),
                _ => objects.join(", "),
            };
            let text = cut(&text, 190.0, SMALL);
            drawing.text([left + 21.0, y + 17.0], text, SMALL, GREY, Anchor::Start);
        }
        y += row;
    }
    if all.len() > most {
        let text = format!("and {} more", all.len() - most);
        drawing.text([left + 21.0, y], text, SMALL, GREY, Anchor::Start);
        y += row;
    }
    if picture.translucent.contains(&true) {
        for line in ["translucent: has objects or voids", "inside; the others are opaque"] {
            drawing.text([left, y], line, 11.0, GREY, Anchor::Start);
            y += 15.0;
        }
    }
    let triangles: usize = sample.objects.iter().map(|object| object.triangles).sum();
    let text = format!("{} triangles", beamlet::cli_support::count(triangles as u64));
    let instances: usize = sample.objects.iter().map(|object| object.instances).sum();
    let text = match instances {
        0 => text,
        _ => format!("{text}, {} instances", beamlet::cli_support::count(instances as u64)),
    };
    drawing.text([left, y + 6.0], text, 11.0, GREY, Anchor::Start);
    triad(drawing, picture, [left + 74.0, SIZE - 176.0]);
    scale_bar(drawing, picture, left);
}

/// Directions of the axes of the world; the beam runs along y at angle 0.
fn triad(drawing: &mut Drawing, picture: &Picture, at: [f64; 2]) {
    let turn = turn(picture.camera);
    let axes = [([1.0, 0.0, 0.0], "x"), ([0.0, 1.0, 0.0], "y (beam)"), ([0.0, 0.0, 1.0], "z")];
    for (axis, name) in axes {
        let [x, _, z] = times(&turn, axis);
        let tip = [at[0] + 52.0 * x, at[1] - 52.0 * z];
        drawing.arrow(at, tip, INK, 1.4);
        let anchor = match x {
            x if x > 0.3 => Anchor::Start,
            x if x < -0.3 => Anchor::End,
            _ => Anchor::Middle,
        };
        let (dx, dy) = (8.0 * x, if z > 0.3 { -7.0 } else { 14.0 * (0.4 - z).clamp(0.0, 1.0) });
        drawing.text([tip[0] + dx, tip[1] + dy], name, 13.0, INK, anchor);
    }
}

fn scale_bar(drawing: &mut Drawing, picture: &Picture, left: f64) {
    let metres_per_pixel = 2.0 * picture.view.half / SIZE;
    let most = 150.0 * metres_per_pixel;
    let power = 10.0_f64.powf(most.log10().floor());
    let size = [5.0, 2.0, 1.0].map(|part| part * power).into_iter().find(|s| *s <= most);
    let size = size.unwrap_or(power);
    let (right, y) = (left + size / metres_per_pixel, SIZE - 40.0);
    let ink = Paint::line(INK, 2.0);
    drawing.line([left, y], [right, y], ink);
    for x in [left, right] {
        drawing.line([x, y - 5.0], [x, y + 5.0], ink);
    }
    let middle = f64::midpoint(left, right);
    drawing.text([middle, y - 9.0], length(size), 13.0, INK, Anchor::Middle);
    let degrees = |angle: f64| super::text::short((angle.to_degrees() * 10.0).round() / 10.0);
    let Camera { azimuth, elevation } = picture.camera;
    for (row, text) in [
        (24.0, "parallel view from the source's".to_owned()),
        (39.0, format!("side, {}° to +x, {}° up", degrees(azimuth), degrees(elevation))),
    ] {
        drawing.text([left, y + row], text, 11.0, GREY, Anchor::Start);
    }
}
