// The one ray-triangle test of both backends: Woop's watertight test in the beam frame, where
// the beam runs along y and no choice of axes is needed, with a top-left rule for ties.
// Edge functions are antisymmetric bit by bit, so that neighbours decide a shared edge alike.

// A ray in the beam frame of its view.
struct Beam {
    float x; // at y = 0
    float z;
    float slope_x;
    float slope_z;
    float cos_angle;
    float sin_angle;
    float start;
    float analyser;
};

Beam beam_of(Ray ray, View view) {
    return Beam(ray.x, ray.z, ray.slope_x, ray.slope_z, view.cos_angle, view.sin_angle,
                view.start, view.analyser);
}

vec3 beam_from_world(Beam beam, vec3 v) {
    precise float x = v.x * beam.cos_angle + v.y * beam.sin_angle;
    precise float y = v.y * beam.cos_angle - v.x * beam.sin_angle;
    return vec3(x, y, v.z);
}

vec3 world_from_beam(Beam beam, vec3 v) {
    return vec3(v.x * beam.cos_angle - v.y * beam.sin_angle,
                v.x * beam.sin_angle + v.y * beam.cos_angle, v.z);
}

// The vertex relative to the ray, sheared along it: (x, z) and y.
vec3 sheared(Beam beam, vec3 vertex) {
    precise vec3 v = beam_from_world(beam, vertex);
    precise float x = (v.x - beam.x) - beam.slope_x * v.y;
    precise float z = (v.z - beam.z) - beam.slope_z * v.y;
    return vec3(x, v.y, z);
}

float edge(vec3 p, vec3 q) {
    precise float first = p.x * q.z;
    precise float second = p.z * q.x;
    precise float e = first - second;
    return e;
}

bool side(float e, vec3 p, vec3 q) {
    if (e != 0.0) return e > 0.0;
    return p.z < q.z || (p.z == q.z && p.x > q.x);
}

// True where the ray crosses the triangle; `y` is where, `entering` whether against its normal.
bool crosses(Beam beam, vec3 a, vec3 b, vec3 c, out float y, out bool entering) {
    precise vec3 p = sheared(beam, a);
    precise vec3 q = sheared(beam, b);
    precise vec3 r = sheared(beam, c);
    precise float u = edge(q, r);
    precise float v = edge(r, p);
    precise float w = edge(p, q);
    bool su = side(u, q, r);
    bool sv = side(v, r, p);
    bool sw = side(w, p, q);
    y = 0.0;
    entering = su;
    if (su != sv || sv != sw) return false;
    precise float area = u + v + w;
    if (area == 0.0) return false;
    // Offsets from the first vertex keep the digits of y; the weights are in [0, 1].
    precise float depth = p.y + (v * (q.y - p.y) + w * (r.y - p.y)) / area;
    y = depth;
    return true;
}
