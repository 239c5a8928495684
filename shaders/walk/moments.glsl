// The order-free walk: moments of a ray, summed over its crossings in any order.
// Runs of crossings between the same two materials are summed in registers.

struct Walk {
    uint signature;
    uint balance;
    uint flags;
    uint crossings;
    uint inside; // materials of the run
    uint outside;
    uint base; // first word of the ray's moments
    float grazing; // least cosine of incidence over the one that a surface asks for
    float path;
    vec2 lever;
    vec2 slope;
};

Walk walk_begin(uint base) {
    return Walk(0u, 0u, 0u, 0u, 0u, 0u, base, 1e30, 0.0, vec2(0.0), vec2(0.0));
}

void moments_add(Floats moments, uint material, float sign_, Walk walk) {
    uint m = walk.base + material * MOMENTS_PER_MATERIAL;
    moments.at[m] += sign_ * walk.path;
    moments.at[m + 1] += sign_ * walk.lever.x;
    moments.at[m + 2] += sign_ * walk.lever.y;
    moments.at[m + 3] += sign_ * walk.slope.x;
    moments.at[m + 4] += sign_ * walk.slope.y;
}

void walk_flush(Floats moments, inout Walk walk) {
    if (walk.inside != walk.outside) {
        moments_add(moments, walk.inside, 1.0, walk);
        moments_add(moments, walk.outside, -1.0, walk);
    }
    walk.path = 0.0;
    walk.lever = vec2(0.0);
    walk.slope = vec2(0.0);
}

// A candidate of the search: everything after "which primitive" is here, for both backends.
void visit(Beam beam, Leaf leaf, Floats moments, inout Walk walk) {
    float y;
    bool entering;
    if (!crosses(beam, leaf.a, leaf.b, leaf.c, y, entering)) return;
    Surface surface = sample_.surfaces.at[leaf.surface & 0x0fffffffu];
    vec2 slope = vec2(beam.slope_x, beam.slope_z);
    vec3 normal_ = beam_from_world(beam, leaf.normal);
    walk.signature += surface.hash;
    walk.balance += entering ? surface.hash : ~surface.hash + 1u;
    walk.crossings += 1u;
    if (surface.inside == surface.outside) return;
    walk.grazing = min(walk.grazing, incidence(slope, normal_) / max(surface.grazing, 1e-30));
    if (surface.inside != walk.inside || surface.outside != walk.outside) {
        walk_flush(moments, walk);
        walk.inside = surface.inside;
        walk.outside = surface.outside;
    }
    float sign_ = entering ? 1.0 : -1.0;
    vec2 g = sign_ * slope_per_delta(slope, normal_);
    walk.path -= sign_ * y * sqrt(1.0 + dot(slope, slope));
    walk.lever += g * (beam.analyser - y);
    walk.slope += g;
}
