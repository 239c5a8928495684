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

// The rectangle that a ray was traced for: the part in the middle has the ray of the whole.
uint traced_for(uint index) {
    if (index == NO_RECTANGLE) return index;
    uint whole = P.rectangles.at[index].whole;
    while (whole != index && P.rectangles.at[whole].parts + 1u == index) {
        index = whole;
        whole = P.rectangles.at[index].whole;
    }
    return index;
}

// A moment of a ray; none of one that misses the sample.
float kept_at(uint index, uint material, uint word) {
    Floats kept = S.kept;
    if (index == NO_RECTANGLE) return 0.0;
    return kept.at[(index * S.material_count + material) * KEPT_WORDS + word];
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
};

// First-order result; behind the nodes at the constants of the rays.
AtNode first_order_at(Beside beside, uint node) {
    AtNode result = AtNode(vec2(0.0), vec2(0.0), 0.0, 0.0);
    Floats constants = S.constants;
    for (uint m = 0u; m < S.material_count; m++) {
        uint at = 2u * (node * S.material_count + m);
        float mu = constants.at[at];
        float delta = constants.at[at + 1u];
        result.depth += mu * moment_of(beside, m, 0u);
        result.x += delta * moment_of(beside, m, 1u);
        result.z += delta * kept_at(beside.own, m, 2u);
        result.slope_x += delta * kept_at(beside.own, m, 3u);
    }
    return result;
}

float depth_at(uint own, uint node) {
    float depth = 0.0;
    Floats constants = S.constants;
    for (uint m = 0u; m < S.material_count; m++) {
        depth += constants.at[2u * (node * S.material_count + m)] * kept_at(own, m, 0u);
    }
    return depth;
}

// Adds what exact transport found beyond the first order: of second order, so it grows with the square of delta,
// but for total reflection.
void correct(inout AtNode result, AtNode exact, AtNode first, uint node, float grazing) {
    Floats ratios = S.ratios;
    float ratio = ratios.at[2u * node];
    if (first.depth.x > 0.0) {
        result.depth += (exact.depth - first.depth) * (ratio * result.depth.x / first.depth.x);
    }
    if (grazing < ratios.at[2u * node + 1u]) result.x = exact.x;
    else result.x += (exact.x - first.x) * (ratio * ratio);
}

// Limits what slopes predict at the ends.
void limit(inout AtNode result, float width) {
    float most = 0.5 * P.magnification * width;
    result.x.y = clamp(result.x.y, -most, most);
    result.depth.y = clamp(result.depth.y, -abs(result.depth.x), abs(result.depth.x));
}

// Adds the light of an energy, of which the masks let a share through; `origin`: displacement of the ray.
Sums plus(Sums sums, AtNode at, float origin, float share, vec2 narrowing) {
    float middle = share * exp(-at.depth.x);
    vec3 light = vec3(share * exp(-at.depth.x + 0.5 * at.depth.y), middle, share * exp(-at.depth.x - 0.5 * at.depth.y));
    float x = at.x.x - origin;
    sums.light += light;
    sums.x += light * vec3(x - 0.5 * at.x.y, x, x + 0.5 * at.x.y);
    sums.x2 += middle * x * x;
    sums.z += middle * at.z;
    sums.slope_x += middle * at.slope_x;
    sums.narrowing += middle * narrowing;
    sums.narrowing_x += middle * x * narrowing;
    return sums;
}
