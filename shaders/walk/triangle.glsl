// The one ray-triangle test of both backends: Woop's watertight test in the beam frame, where
// the beam runs along y and no choice of axes is needed, with a top-left rule for ties.
// Edge functions are antisymmetric bit by bit, so that neighbours decide a shared edge alike.

#include "walk/motion.glsl"

// Length of a ray per length of y, and its inverse: the same for all crossings.
struct Stretch {
    float length_;
    float inverse;
};

Stretch stretch_of(Beam beam) {
    vec2 slope = vec2(beam.slope_x, beam.slope_z);
    return Stretch(sqrt(1.0 + dot(slope, slope)), inversesqrt(1.0 + dot(slope, slope)));
}

// A point of the beam frame relative to the ray, sheared along it: (x, z) and y.
vec3 sheared(Beam beam, vec3 v) {
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
    return e > 0.0 || (e == 0.0 && (p.z < q.z || (p.z == q.z && p.x > q.x)));
}

// A triangle as a ray sees it.
struct Facet {
    vec3 p; // sheared vertices
    vec3 q;
    vec3 r;
    vec3 edges;  // edge functions, of the edges opposite to p, q, r
    bvec3 sides; // which side of those edges the ray is on
    float area;
    bool crossed;
    bool entering; // against the normal
};

// From sheared vertices.
Facet facet_of(vec3 p, vec3 q, vec3 r) {
    precise float u = edge(q, r);
    precise float v = edge(r, p);
    precise float w = edge(p, q);
    bool su = side(u, q, r);
    bool sv = side(v, r, p);
    bool sw = side(w, p, q);
    precise float area = u + v + w;
    return Facet(p, q, r, vec3(u, v, w), bvec3(su, sv, sw), area,
                 su == sv && sv == sw && area != 0.0, su);
}

// `a`, `b`, `c` in the beam frame.
Facet facet_of(Beam beam, vec3 a, vec3 b, vec3 c) {
    precise vec3 p = sheared(beam, a);
    precise vec3 q = sheared(beam, b);
    precise vec3 r = sheared(beam, c);
    return facet_of(p, q, r);
}

// Where a ray of this slope crosses the facet's plane, y. `normal` from f64: weights of the edge
// functions are far less exact on long facets that lean towards the beam. Measured from the
// nearest vertex, since the error of the normal grows with the distance; a rounded plane does not
// leave the facet's own interval of y.
float place_of(vec2 slope, Facet f, vec3 normal) {
    vec3 near = abs(f.q.x) + abs(f.q.z) < abs(f.p.x) + abs(f.p.z) ? f.q : f.p;
    near = abs(f.r.x) + abs(f.r.z) < abs(near.x) + abs(near.z) ? f.r : near;
    precise float along = normal.x * slope.x + normal.y + normal.z * slope.y;
    precise float across = normal.x * near.x + normal.z * near.z;
    precise float y = near.y + (along == 0.0 ? 0.0 : across / along);
    return clamp(y, min(min(f.p.y, f.q.y), f.r.y), max(max(f.p.y, f.q.y), f.r.y));
}

// A triangle of the world as a ray sees it.
Facet facet_of(Beam beam, Leaf leaf) {
    return facet_of(beam, beam_from_world(beam, leaf.a), beam_from_world(beam, leaf.b),
                    beam_from_world(beam, leaf.c));
}

vec2 slope_of(Beam beam) {
    return vec2(beam.slope_x, beam.slope_z);
}
