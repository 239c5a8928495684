// Results of rectangles at the energies of a spectrum, and the light of several of them as one cell
// (docs/physics.md, "Spectra").

#define S P.spectrum.at[0]

// Bend of the logarithm of light over a whole beamlet that parts energies.
const float BEND = 2e-5;
// Light below this, of open beam, is left out.
const float DARK = 1e-18;

// Words of the shares of a beamlet in a block of rows: whether energies share no edges; the share of each node in
// all groups; first and last node of each group; shares by group and node; narrowing by either mask by node.
uint shares_of(RefinedPatch patch_) {
    int block = int(floor(float(patch_.row) / float(S.alike_rows))) - S.first_block;
    uint words = 1u + S.nodes + S.groups * (2u + S.nodes) + 2u * S.nodes;
    return (uint(block) * S.columns + patch_.column) * words;
}

float share_at(uint word) {
    Floats shares = S.shares;
    return shares.at[word];
}

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

// Sums over energies, weighted with their light: at the low end, in the middle and at the high end; the others in
// the middle. Displacements are counted from that of the ray.
struct Sums {
    vec3 light;
    vec3 x;
    float x2;
    float z;
    float slope_x;
    vec2 narrowing; // by either mask
    vec2 narrowing_x;
};

Sums no_sums() {
    return Sums(vec3(0.0), vec3(0.0), 0.0, 0.0, 0.0, vec2(0.0), vec2(0.0));
}

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

float variance_of(Sums sums) {
    float mean = sums.x.y / sums.light.y;
    return max(sums.x2 / sums.light.y - mean * mean, 0.0);
}

// Whether one cell has the light of several energies; `all`: light of the rectangle in all groups.
bool is_one(Sums sums, float all, float width) {
    if (any(lessThan(sums.light, vec3(DARK)))) return true;
    float scale = max(S.full_width / width, 1.0);
    float part = sums.light.y / all;
    float bend = abs(sums.light.y / sqrt(sums.light.x * sums.light.z) - 1.0);
    vec3 x = sums.x / sums.light;
    float drift = abs(x.y - 0.5 * (x.x + x.z));
    // The effect of the third moment grows with the light.
    float spread = S.spread * pow(scale, 1.0 / 3.0);
    return part * bend <= BEND * scale && part * drift <= S.tolerance * scale
        && part * variance_of(sums) <= spread * spread;
}
