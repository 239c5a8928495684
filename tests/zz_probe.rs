mod reference;
mod support;
use beamlet::Backend;
use reference::scenes;
use reference::stack::Setup;
use reference::surfaces::*;
use support::{CARBON, engine};
#[test]
fn probe() {
    let e = engine(Backend::Bvh);
    for (name, setup, mesh) in [
        ("sphere", Setup::paper([32,12]), sphere(1.2e-3, 5).moved([0.05e-3, 0.0, 0.02e-3])),
        ("sphere unmoved", Setup::paper([32,12]), sphere(1.2e-3, 5)),
        ("tilted", Setup::paper([40,12]), cylinder(1.0e-3, 6e-3, 512, 0.1).turned([0.0, 1.0, 0.0], 0.5)),
        ("tilted64", Setup::paper([40,12]), cylinder(1.0e-3, 6e-3, 64, 0.1).turned([0.0, 1.0, 0.0], 0.5)),
    ] {
        let bodies = [body(mesh.rounded(), CARBON[0], CARBON[1])];
        for t in [beamlet::scene::Transport::FirstOrder, beamlet::scene::Transport::Auto] {
            let mut scene = scenes::scene(&setup, &bodies, &[0.0]);
            scene.sampling.transport = t;
            println!("{name} {t:?} {:?}", e.simulate(&scene).map(|s| s.record.tally));
        }
    }
}
