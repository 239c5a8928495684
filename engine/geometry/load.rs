//! From the objects of a scene to a sample.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use super::analytic::AnalyticShape;
use super::assemble::{Note, assemble};
use super::body::Body;
use super::defects::Defects;
use super::examined::{Examined, examine};
use super::placed::{Group, Groups, Place, Prototype};
use super::read::{FileOf, ReadSurface, failed, read_file, read_surface};
use super::scattering_axis::keep_scattering_axis;
use super::surface::{Defect, PEAK_PER_TRIANGLE, SIMPLIFY, in_mm};
use super::trial::Trial;
use super::{Sample, mesh_file, nesting, placement};
use beamlet_core::error::{Error, Result};
use beamlet_core::parallel::start_threads;
use beamlet_core::watch::{LoadStep, Task, Watch, Watcher, watched};
use beamlet_core::{numbers, reserve};
use beamlet_model::scene::{Instances, Mesh, Normals, Object, Placement, Scene, ShapeOrMesh};

/// Normals of a rough surface lean by this many standard deviations of its slopes at most, about.
const ROUGH_LEANS: f64 = 6.0;

/// Reads, checks and places every object of the scene.
///
/// # Errors
/// Files that cannot be read, surfaces that are not closed or cross themselves (unless their
/// object allows defects), and objects that overlap and cannot be cut. A scene without objects
/// is an empty sample.
///
/// # Example
///
/// ```no_run
/// use beamlet::{geometry, scene::Scene};
///
/// let sample = geometry::load(&Scene::load("scene.toml")?)?;
/// println!("{} triangles", sample.triangles.len());
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn load(scene: &Scene) -> Result<Sample> {
    load_all(scene, &Watch::unwatched(scene.objects.len()))
}

/// As [`load`], watched.
///
/// # Errors
///
/// As [`load`]; [`Error::Interrupted`] when the watcher stops it.
pub fn load_watched(scene: &Arc<Scene>, watcher: Watcher<'_>) -> Result<Sample> {
    start_threads()?;
    let shared = scene.clone();
    watched(&names(scene), watcher, move |watch| load_all(&shared, watch))
}

fn load_all(scene: &Scene, watch: &Watch) -> Result<Sample> {
    let mut loaded = read_all(scene, watch)?;
    match loaded.iter_mut().find_map(|object| object.refusal.take()) {
        Some(refusal) => Err(refusal),
        None => sample(scene, loaded, false, watch),
    }
}

/// As [`load`], but accepts every defect, to report the defects of each object. Also returns the errors
/// that `load` would give, one for each refused object; the sample lists its overlaps.
///
/// # Errors
/// As [`load`], where an object has no surface.
pub fn load_lenient(scene: &Scene) -> Result<(Sample, Vec<Error>)> {
    load_all_leniently(scene, &Watch::unwatched(scene.objects.len()))
}

/// As [`load_lenient`], watched.
///
/// # Errors
///
/// As [`load_lenient`]; [`Error::Interrupted`] when the watcher stops it.
pub fn load_lenient_watched(
    scene: &Arc<Scene>,
    watcher: Watcher<'_>,
) -> Result<(Sample, Vec<Error>)> {
    let shared = scene.clone();
    watched(&names(scene), watcher, move |watch| load_all_leniently(&shared, watch))
}

fn load_all_leniently(scene: &Scene, watch: &Watch) -> Result<(Sample, Vec<Error>)> {
    let mut loaded = read_all(scene, watch)?;
    let mut refusals: Vec<Error> =
        loaded.iter_mut().filter_map(|object| object.refusal.take()).collect();
    match sample(scene, loaded, true, watch) {
        Ok(sample) => Ok((sample, refusals)),
        Err(Error::Interrupted) => Err(Error::Interrupted),
        // What goes wrong between broken objects follows from the first that is broken.
        Err(_) if !refusals.is_empty() => Err(refusals.swap_remove(0)),
        Err(error) => Err(error),
    }
}

fn names(scene: &Scene) -> Vec<String> {
    scene.objects.iter().map(|object| object.name.clone()).collect()
}

/// Examines a mesh in memory: the extension of `path` gives its format, `unit` is the length of 1.0 in
/// it, m, if the format has none. Defects do not make it an error.
///
/// # Errors
/// [`Error::Mesh`] where the bytes cannot be read as that format, or hold no solid part.
pub fn diagnose(path: &Path, bytes: &[u8], unit: f64) -> Result<Defects> {
    let failed =
        |defect: Defect| Error::mesh(path.display().to_string(), defect.problem, defect.place);
    let alone = Task::unwatched();
    let mesh = mesh_file::parse(path, bytes, alone).map_err(failed)?;
    let unit = mesh.unit.unwrap_or(unit);
    let (surface, _) = mesh.into_part(None).map_err(failed)?;
    let Examined { surface, edges, search, defects, .. } =
        examine(surface, unit, &Placement::default(), true, alone)?.map_err(failed)?;
    Body::new(surface, &edges, search, 0).map_err(failed)?;
    Ok(defects)
}

/// One object, read and examined.
struct Loaded {
    /// Empty if the object has several places.
    body: Body,
    group: Option<Group>,
    hash: String,
    defects: Defects,
    /// Why a run must not use it.
    refusal: Option<Error>,
}

impl Loaded {
    /// Places of an exact shape.
    fn of_exact_shape(group: Group) -> Self {
        let (body, defects) = (Body::empty(), Defects::default());
        Self { body, group: Some(group), hash: String::new(), defects, refusal: None }
    }
}

fn read_all(scene: &Scene, watch: &Watch) -> Result<Vec<Loaded>> {
    let mut loaded: Vec<(usize, Loaded)> = by_file(scene)
        .par_iter()
        .map(|members| read_members(scene, members, watch))
        .collect::<Result<Vec<_>>>()?
        .into_iter()
        .flatten()
        .collect();
    loaded.sort_unstable_by_key(|(number, _)| *number);
    Ok(loaded.into_iter().map(|(_, loaded)| loaded).collect())
}

/// Numbers of the objects, those that take of one mesh file together.
fn by_file(scene: &Scene) -> Vec<Vec<usize>> {
    let mut lists: Vec<Vec<usize>> = Vec::new();
    let mut known: HashMap<&Path, usize> = HashMap::new();
    for (number, object) in scene.objects.iter().enumerate() {
        match file_of(object).map(|path| known.entry(path)) {
            Some(Entry::Occupied(list)) => lists[*list.get()].push(number),
            Some(Entry::Vacant(list)) => {
                list.insert(lists.len());
                lists.push(vec![number]);
            }
            None => lists.push(vec![number]),
        }
    }
    lists
}

fn file_of(object: &Object) -> Option<&Path> {
    match &object.geometry {
        ShapeOrMesh::Mesh(Mesh::File { path, .. }) => Some(path),
        _ => None,
    }
}

/// Reads the objects of these numbers, which take of one mesh file, or one that takes of none.
fn read_members(scene: &Scene, members: &[usize], watch: &Watch) -> Result<Vec<(usize, Loaded)>> {
    let read = |number: usize, file: FileOf<'_>| {
        let object = &scene.objects[number];
        let task = watch.object(number);
        Ok((number, read_object(scene, object, numbers::count(number), file, task)?))
    };
    let first = members[0];
    let object = &scene.objects[first];
    let Some(path) = file_of(object) else { return Ok(vec![read(first, FileOf::None)?]) };
    let file = read_file(scene, path, &label(object), watch.object(first))?;
    if members.len() == 1 {
        return Ok(vec![read(first, FileOf::Own(Box::new(file)))?]);
    }
    members.par_iter().map(|number| read(*number, FileOf::Shared(&file))).collect()
}

/// An object as errors name it.
fn label(object: &Object) -> String {
    match file_of(object) {
        Some(path) => format!("\"{}\" ({})", object.name, path.display()),
        None => format!("\"{}\"", object.name),
    }
}

/// The sample; with `overlaps`, also the pairs of its objects that overlap.
fn sample(scene: &Scene, loaded: Vec<Loaded>, overlaps: bool, watch: &Watch) -> Result<Sample> {
    let names = names(scene);
    let mut bodies = Vec::with_capacity(loaded.len());
    let mut notes = Vec::with_capacity(loaded.len());
    let mut groups = Vec::new();
    for object in loaded {
        notes.push(Note {
            bounds: object.group.as_ref().map_or(object.body.bounds(), Group::bounds),
            hash: object.hash,
            defects: object.defects,
            cut_by: Vec::new(),
        });
        bodies.push(object.body);
        groups.extend(object.group);
    }
    let begin = Instant::now();
    let accepted = |note: &Note| note.defects.refused().then(|| note.defects.description(None));
    let defects: Vec<Option<String>> = notes.iter().map(accepted).collect();
    let mut groups = Groups::settle(groups, &mut bodies, &names, &defects, watch.nesting())?;
    let (mut cut_by, mut found) =
        nesting::nest(&mut bodies, &names, &defects, overlaps, watch.nesting())?;
    found.append(&mut groups.overlaps);
    let overlaps = if overlaps { found.into_iter().collect() } else { Vec::new() };
    groups.surround(&mut bodies);
    groups.add_cutters(&mut cut_by);
    log::info!("nesting resolved in {:.1} s", begin.elapsed().as_secs_f64());
    for (note, cut_by) in notes.iter_mut().zip(cut_by) {
        note.cut_by = cut_by;
    }
    let mut sample = Sample { overlaps, ..assemble(bodies, groups, names, notes)? };
    let own = sample.components.iter_mut();
    for component in own.chain(sample.prototypes.iter_mut().flat_map(|it| &mut it.components)) {
        let object = &scene.objects[component.object as usize];
        component.smooth = object.normals == Normals::Smooth;
        component.leans = ROUGH_LEANS * object.roughness;
        if component.smooth {
            component.lids = None;
        }
    }
    Ok(sample)
}

/// Triangles of the meshes of a scene as far as that is known without reading them: those in
/// binary STL files, and the faces of PLY files.
#[must_use]
pub fn triangles_in_files(scene: &Scene) -> u64 {
    let of = |object: &Object| match &object.geometry {
        ShapeOrMesh::Mesh(Mesh::File { path, .. }) => {
            mesh_file::triangles_in(&scene.directory.join(path))
        }
        _ => None,
    };
    scene.objects.iter().filter_map(of).sum()
}

fn read_object(
    scene: &Scene,
    object: &Object,
    number: u32,
    file: FileOf<'_>,
    task: Task<'_>,
) -> Result<Loaded> {
    let begin = Instant::now();
    let label = label(object);
    if let ShapeOrMesh::Shape(shape) = &object.geometry
        && let Some(shape) = AnalyticShape::of(shape)
    {
        task.begin(LoadStep::Reading, 0)?;
        let prototype = |places| Prototype::of_shape(shape, number, places);
        let group = group_of(scene, object, number, &label, prototype, task)?;
        task.finish();
        return Ok(Loaded::of_exact_shape(group));
    }
    let ReadSurface { surface, unit, hash, warnings: read_warnings } =
        read_surface(object, file, &label, task)?;
    if let Some(recorded) = &object.sha256
        && *recorded != hash
    {
        return Err(Error::mesh(
            label,
            "is not the mesh that the scene was made with",
            format!("sha256 {hash}, the scene records {recorded}"),
        ));
    }
    let is_mesh = matches!(object.geometry, ShapeOrMesh::Mesh(_));
    let (triangles, read) = (surface.triangles.len(), begin.elapsed().as_secs_f64());
    log::info!("{label}: {triangles} triangles read in {read:.1} s; looking for defects");
    let needed = PEAK_PER_TRIANGLE.saturating_mul(triangles as u64);
    reserve::ask(needed, &format!("checking {label}"), SIMPLIFY)?;
    let alone = Placement { center: object.placement.center, ..Placement::default() };
    let placement = if object.instances.is_some() { &alone } else { &object.placement };
    let Examined { surface, edges, search, defects, apart, warnings: of_parts } =
        examine(surface, unit, placement, is_mesh, task)?.map_err(failed(&label))?;
    let refused = defects.refused().then(|| defects.description(apart));
    let refusal = |trial: Option<Trial>| {
        let not_finite = defects.not_finite.count;
        let problem = match &refused {
            _ if not_finite > 0 => {
                format!("the vertices of {not_finite} triangles are not finite numbers")
            }
            Some(why) if !object.allow_defects => format!("{why}; {}", remedy(trial)),
            _ => return None,
        };
        Some(Error::mesh(label.clone(), problem, defects.places()))
    };
    let mut body = match Body::new(surface, &edges, search, number) {
        Ok(body) => body,
        // A refused mesh may have no body.
        Err(defect) => return Err(refusal(None).unwrap_or_else(|| failed(&label)(defect))),
    };
    let trial = refused.is_some().then(|| Trial::of(&body.surface));
    let refusal = refusal(trial);
    let mut warnings = defects.warnings();
    warnings.extend(of_parts);
    warnings.extend(read_warnings);
    if let (Some(why), Some(trial), None) = (&refused, trial, &refusal) {
        warnings.insert(0, format!("{why} (accepted: allow_defects); {trial}"));
    }
    warnings.append(&mut body.warnings);
    warnings.extend(odd_size(body.bounds()));
    body.warnings = warnings;
    let group = match &object.instances {
        None => None,
        Some(_) => {
            let prototype = |_| body.take_prototype();
            Some(group_of(scene, object, number, &label, prototype, task)?)
        }
    };
    let (parts, seconds) = (body.components.len(), begin.elapsed().as_secs_f64());
    log::info!("{label}: {parts} parts, read and checked in {seconds:.1} s");
    task.finish();
    Ok(Loaded { body, group, hash, defects, refusal })
}

/// A warning where a mesh of these bounds is oddly small or large.
fn odd_size([low, high]: [DVec3; 2]) -> Option<String> {
    let extent = (high - low).max_element();
    let is_usual = (1e-6..=1.0).contains(&extent);
    let problem = format!("it is {extent:.3e} m across: is its `unit` (or `scale`) the right one?");
    (!is_usual).then_some(problem)
}

/// Remedy for a mesh with defects, by the trial of its rays.
fn remedy(trial: Option<Trial>) -> String {
    match trial {
        None => "repair the mesh".to_owned(),
        Some(trial) if trial.is_sound() => {
            format!("repair the mesh, or accept it with allow_defects = true ({trial})")
        }
        Some(trial) => format!("{trial}: repair the mesh"),
    }
}

/// The places of an object with instances or an analytic surface; `prototype`: its surface, for that
/// number of places.
fn group_of(
    scene: &Scene,
    object: &Object,
    number: u32,
    label: &str,
    prototype: impl FnOnce(usize) -> Prototype,
    task: Task<'_>,
) -> Result<Group> {
    let around = placement::group(&object.placement).map_err(failed(label))?;
    let instances = beamlet_packing::watched(scene, object, task)?;
    keep_scattering_axis(scene, object, number, &instances)?;
    let places: Vec<Place> = instances.iter().map(|it| around.around(it)).collect();
    let prototype = prototype(places.len());
    let bounds = prototype.bounds();
    let held = |place: &&Place| place.bounds(bounds).iter().all(|it| it.as_vec3().is_finite());
    if let Some(place) = places.iter().find(|place| !held(place)) {
        let place = format!("at {}", in_mm(place.position));
        return Err(Error::mesh(
            label,
            "it reaches beyond 3.4e38 m: check its scale and position",
            place,
        ));
    }
    let apart = matches!(object.instances, Some(Instances::Packing(_)));
    Ok(Group { object: number, prototype, places, apart })
}
