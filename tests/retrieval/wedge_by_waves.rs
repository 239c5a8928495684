//! Angle of a wedge by waves: methods that fit the curve of rays are biased.

use crate::support::engine;
use beamlet::Backend;
use beamlet::ndarray::Axis;
use beamlet::retrieve::{ImagesTo, Input, Method, RetrieveOptions, Retriever, retrieve};
use beamlet::scene::Scene;
use beamlet::stack::{Format, OpenRun, RunDirectory};
use beamlet::{Control, RowsControl};

/// Angle of the wedge, rad: 0.3 per length with δ = 1e-6.
const ANGLE: f64 = -0.3e-6;

fn scene(transport: &str, (reach, steps): (&str, u32)) -> Scene {
    let text = format!(
        "[source]\ndistance = \"1.203 m\"\nspot = [\"30 um\", \"0 um\"]\nenergy = \"30 keV\"\n\
         [sample_mask]\ndistance = \"1.2 m\"\naperture = \"20 um\"\nperiod = \"100 um\"\ntransmission = 0.0\n\
         [detector_mask]\ndistance = \"1.8 m\"\naperture = \"30 um\"\ntransmission = 0.0\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [4, 1]\npitch = \"150 um\"\n\
         [scan]\nmask_offsets = {{ from = \"-{reach}\", to = \"{reach}\", count = {steps} }}\n\
         [sampling]\ntolerance = 5e-6\nangle_tolerance = \"0.05 nrad\"\ntransport = \"{transport}\"\n\
         [materials.matter]\nmu = \"0 /m\"\ndelta = 1e-6\n\
         [[object]]\nname = \"wedge\"\nmaterial = \"matter\"\n\
         shape = {{ extrusion = {{ points = [[\"-1 mm\", \"0 mm\"], [\"1 mm\", \"0 mm\"], [\"1 mm\", \"0.6 mm\"]], \
         height = \"4 mm\" }} }}\n"
    );
    Scene::from_toml(&text, ".").unwrap()
}

/// Relative error of the angle, mean of the two columns in the middle.
fn error(transport: &str, steps: (&str, u32), method: Method) -> f64 {
    let (engine, scene) = (engine(Backend::Bvh), scene(transport, steps));
    let stacks = engine.simulate(&scene).unwrap();
    let options = RetrieveOptions::default().with_method(method);
    let mut retriever = Retriever::new(&engine, &scene, &options).unwrap();
    retriever.set_flat_array(stacks.flat.view()).unwrap();
    let images = retriever.retrieve_array(stacks.sample.index_axis(Axis(0), 0)).unwrap();
    let angles = images.get("refraction").unwrap();
    0.5 * (f64::from(angles[[0, 1]]) + f64::from(angles[[0, 2]])) / ANGLE - 1.0
}

#[test]
fn exact_curves_err_by_less_than_a_thousandth_of_an_angle_by_waves() {
    let (seven, eleven) = (("30 um", 7), ("25 um", 11));
    let [waves, rays, gaussian] = [
        error("wave", seven, Method::ExactCurve),
        error("auto", seven, Method::ExactCurve),
        error("wave", seven, Method::Gaussian),
    ];
    let more = error("wave", eleven, Method::ExactCurve);
    println!("waves {waves:e}, rays {rays:e}, gaussian {gaussian:e}, eleven steps {more:e}");
    // The wedge is thick: its middle is nearer to the detector than the axis.
    assert!(rays.abs() < 1e-3, "{rays:e}");
    assert!(waves.abs() < 1e-3, "{waves:e}");
    assert!((-0.06..-0.03).contains(&gaussian), "{gaussian:e}");
    assert!(more.abs() < 1e-3, "{more:e}");
}

#[test]
fn exact_curves_of_a_run_by_waves_are_warned_of() {
    let place = tempfile::tempdir().unwrap();
    let engine = engine(Backend::Bvh);
    let warnings = |transport: &str, method: Method| {
        let name = format!("{transport}-{}", method.name());
        let path = place.path().join(&name);
        let mut sink = RunDirectory::create(&path, Format::Npy, false).unwrap();
        engine.run(&scene(transport, ("30 um", 7)), &mut sink, Control::default()).unwrap();
        let input = Input::of_run(&OpenRun::open(&path).unwrap(), false).unwrap();
        let images = place.path().join(format!("{name}-images"));
        let to = ImagesTo::new(&images, Format::Npy);
        let options = RetrieveOptions::default().with_method(method);
        let record = retrieve(&engine, input, &options, to, &mut RowsControl::default()).unwrap();
        record.warnings.join("\n")
    };
    let text = warnings("wave", Method::ExactCurve);
    assert!(text.contains("exact-curve") && text.contains("by waves"), "{text}");
    for (transport, method) in [("auto", Method::ExactCurve), ("wave", Method::Gaussian)] {
        let text = warnings(transport, method);
        assert!(!text.contains("by waves"), "{text}");
    }
}
