// Results of rectangles at the energies of a spectrum.

// A rectangle, and the rays beside it that crossed the same surfaces.
struct Beside {
    uint own; // rectangle whose ray it is
    uint low;
    uint high;
    vec2 along; // places of the rays beside it
    bvec2 has;
    float width;
};

// A moment of a ray; none of one that misses the sample.
float kept_at(uint index, uint material, uint word) {
    Floats kept = S.kept;
    if (index == NO_RECTANGLE) return 0.0;
    return kept.at[index * kept_stride() + material * KEPT_WORDS + word];
}

// A moment, and how it rises over the rectangle.
vec2 moment_of(Beside beside, uint material, uint word) {
    float own = kept_at(beside.own, material, word);
    float low = beside.has.x ? kept_at(beside.low, material, word) : own;
    float high = beside.has.y ? kept_at(beside.high, material, word) : own;
    vec2 rise = vec2(low, high) - own;
    float slope = slope_along(rise, beside.along, vec2(0.0), beside.has.x, beside.has.y, 0.0);
    return vec2(own, slope * beside.width);
}

// Result at one energy: in the middle, and how it rises over the rectangle.
struct AtNode {
    vec2 depth;
    vec2 x;
    float z; // at the detector
    float slope_x;
    float variance; // of x, by rough surfaces
    float refraction; // over that at the constants of the rays
};

// Moments in a material that the rays cross.
struct Held {
    uint material;
    vec2 path;
    vec2 lever;
    float z;
    float slope_x;
};

// Materials whose moments are held: rays that cross more of them read them again.
const uint MOST_HELD = 4u;

struct HeldMoments {
    Held of[MOST_HELD];
    uint count;
};

Held moments_in(Beside beside, uint material) {
    return Held(material, moment_of(beside, material, 0u), moment_of(beside, material, 1u),
                kept_at(beside.own, material, 2u), kept_at(beside.own, material, 3u));
}

HeldMoments held_of(Beside beside) {
    HeldMoments held;
    held.count = 0u;
    for (uint m = 0u; m < S.material_count; m++) {
        Held one = moments_in(beside, m);
        if (one.path == vec2(0.0) && one.lever == vec2(0.0) && one.z == 0.0 && one.slope_x == 0.0) continue;
        if (held.count < MOST_HELD) held.of[held.count] = one;
        held.count++;
    }
    return held;
}

void add_material(inout AtNode result, uint node, Held one) {
    Floats constants = S.constants;
    uint at = 2u * (node * S.material_count + one.material);
    float mu = constants.at[at];
    float delta = constants.at[at + 1u];
    result.depth += mu * one.path;
    result.x += delta * one.lever;
    result.z += delta * one.z;
    result.slope_x += delta * one.slope_x;
}

// First-order result; behind the nodes at the constants of the rays.
AtNode first_order_at(Beside beside, HeldMoments held, uint node) {
    Floats ratios = S.ratios;
    float refraction = node < S.nodes ? ratios.at[2u * node] : 1.0;
    AtNode result = AtNode(vec2(0.0), vec2(0.0), 0.0, 0.0, 0.0, refraction);
    if (held.count <= MOST_HELD) {
        for (uint i = 0u; i < held.count; i++) add_material(result, node, held.of[i]);
        return result;
    }
    for (uint m = 0u; m < S.material_count; m++) {
        add_material(result, node, moments_in(beside, m));
    }
    return result;
}

// Variance of the displacement by rough surfaces, times the square of the step of delta for each pair of materials.
float spread_by_roughness(uint index, uint node) {
    Floats kept = S.kept;
    Floats steps = S.steps;
    uint first = index * kept_stride() + S.material_count * KEPT_WORDS;
    float variance = 0.0;
    for (uint p = 0u; p < S.pair_count; p++) {
        variance += kept.at[first + p] * steps.at[node * S.pair_count + p];
    }
    return variance;
}

// Adds what exact transport found beyond the first order: of second order, so it grows with the square of delta,
// but for total reflection. Normals that were drawn bend in proportion.
void correct(inout AtNode result, AtNode exact, AtNode first, uint node, float grazing, bool drawn) {
    Floats ratios = S.ratios;
    float ratio = result.refraction;
    if (first.depth.x > 0.0) {
        result.depth += (exact.depth - first.depth) * (ratio * result.depth.x / first.depth.x);
    }
    if (drawn) {
        result.x = exact.x * ratio;
        result.z = exact.z * ratio;
        result.slope_x = exact.slope_x * ratio;
    } else if (grazing < ratios.at[2u * node + 1u]) result.x = exact.x;
    else result.x += (exact.x - first.x) * (ratio * ratio);
}

// Limits what slopes predict at the ends.
void limit(inout AtNode result, float width) {
    float most = 0.5 * P.magnification * width;
    result.x.y = clamp(result.x.y, -most, most);
    result.depth.y = clamp(result.depth.y, -abs(result.depth.x), abs(result.depth.x));
}

// Light of an energy at the low end, in the middle and at the high end.
vec3 light_of(AtNode at) {
    return exp(-at.depth.x + vec3(0.5, 0.0, -0.5) * at.depth.y);
}

// Adds light of an energy, of which the masks let a share through; `origin`: displacement of the ray.
Sums plus(Sums sums, AtNode at, float origin, vec3 light, vec2 narrowing) {
    float x = at.x.x - origin;
    sums.light += light;
    sums.x += light * vec3(x - 0.5 * at.x.y, x, x + 0.5 * at.x.y);
    sums.x2 += light.y * (x * x + at.variance);
    sums.z += light.y * at.z;
    sums.z2 += light.y * at.z * at.z;
    sums.slope_x += light.y * at.slope_x;
    sums.narrowing += light.y * narrowing;
    sums.narrowing_x += light.y * x * narrowing;
    sums.along_z += light.y * vec2(at.refraction, at.depth.x);
    return sums;
}
