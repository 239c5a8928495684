//! Snell's law on the normals that a ray draws at a rough face.

use super::surfaces::Random;
use super::vector::{Vector, add, dot, scaled, sub, unit};

/// Normal numbers, two at a time.
pub struct Gauss(pub Random);

impl Gauss {
    pub fn pair(&mut self, sigma: f64) -> [f64; 2] {
        let radius = sigma * (-2.0 * (1.0 - self.0.next()).ln()).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * self.0.next()).sin_cos();
        [radius * cos, radius * sin]
    }
}

/// Direction of a ray after a face along z, of which `face` is the normal along the ray, and whether the
/// ray is behind it. Normals face the ray, and are drawn anew where the face says that the ray has not
/// left it. `index`: refractive indices before and behind.
pub fn passed(
    gauss: &mut Gauss,
    sigma: f64,
    face: Vector,
    mut ray: Vector,
    index: [f64; 2],
) -> (Vector, bool) {
    let u1: Vector = unit([face[1], -face[0], 0.0]);
    let u2: Vector = [0.0, 0.0, 1.0];
    let mut behind = false;
    loop {
        let ahead = if dot(face, ray) > 0.0 { face } else { scaled(face, -1.0) };
        let normal = loop {
            let [s1, s2] = gauss.pair(sigma);
            let normal = unit(add(ahead, add(scaled(u1, s1), scaled(u2, s2))));
            if dot(normal, ray) > 0.0 {
                break normal;
            }
        };
        let ratio = if behind { index[1] / index[0] } else { index[0] / index[1] };
        let along = dot(normal, ray);
        let across = sub(ray, scaled(normal, along));
        let sine2 = ratio * ratio * dot(across, across);
        if sine2 > 1.0 {
            ray = sub(ray, scaled(normal, 2.0 * along));
        } else {
            ray = add(scaled(across, ratio), scaled(normal, (1.0 - sine2).sqrt()));
            behind = !behind;
        }
        if (dot(face, ray) > 0.0) == behind {
            return (ray, behind);
        }
    }
}
