//! Vectors of three f64.

/// A point or direction.
pub type Vector = [f64; 3];

pub fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn scaled(a: Vector, f: f64) -> Vector {
    [a[0] * f, a[1] * f, a[2] * f]
}

pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Changes only its sign when the arguments are swapped, to the last bit.
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

pub fn unit(a: Vector) -> Vector {
    scaled(a, 1.0 / length(a))
}

/// `a` turned by `angle` about `axis` (right-handed; Rodrigues).
pub fn turned(a: Vector, axis: Vector, angle: f64) -> Vector {
    let k = unit(axis);
    let (sin, cos) = angle.sin_cos();
    add(add(scaled(a, cos), scaled(cross(k, a), sin)), scaled(k, dot(k, a) * (1.0 - cos)))
}
