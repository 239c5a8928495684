// Rays that are spread evenly over a patch that they do not resolve, in place of rectangles that are split: light that
// is bent far would lose weight. Ray i of N has its own place along x, at even distances over what mask steps
// open, and lies on one of L lines; each line has N / L rectangles side by side.

// Parts of a beamlet of which each is open or closed.
const uint OPEN_PARTS = 64u;

// Whether the rays of a patch are spread evenly.
bool is_even(uint patch_index) {
    return (P.sums.at[sums_of(patch_index) + PATCH_FLAGS] & PATCH_IS_EVEN) != 0u;
}

// Squared change to the ray after the next, of that to the next: 2 where jumps are few, 1 where nothing is resolved.
float growth_of(uint patch_index) {
    uint words = sums_of(patch_index);
    float near = changes_at(words + PATCH_CHANGES);
    float far = changes_at(words + PATCH_FAR_CHANGES);
    return near > 0.0 ? clamp(far / near, 1.0, 2.0) : 1.0;
}

struct Even {
    uint first; // rectangle
    uint count;
    uint lines; // a power of two
    uvec2 open;
    float all; // open parts, and the share of the others that bars let through
};

Even even_of(uint patch_index) {
    uint words = sums_of(patch_index);
    Even even;
    even.first = P.sums.at[words + PATCH_EVEN_FIRST];
    even.count = P.sums.at[words + PATCH_EVEN_COUNT];
    even.lines = P.sums.at[words + PATCH_EVEN_LINES];
    even.open = uvec2(P.sums.at[words + PATCH_EVEN_OPEN], P.sums.at[words + PATCH_EVEN_OPEN + 1u]);
    float open = float(bitCount(even.open.x) + bitCount(even.open.y));
    even.all = open + P.leak * (float(OPEN_PARTS) - open);
    return even;
}

// Parts of a beamlet that some mask step opens.
uvec2 open_parts(RefinedPatch patch_) {
    RefinedColumn column = P.columns.at[patch_.column];
    float width = P.period / float(OPEN_PARTS);
    uvec2 open = uvec2(0u);
    for (uint part = 0u; part < OPEN_PARTS; part++) {
        float x_low = float(part) * width - 0.5 * P.period;
        bool seen = P.opening_count == 0u;
        for (uint i = 0u; i < P.opening_count && !seen; i++) {
            vec2 ends = opening_from(P.openings.at[i], column, x_low);
            seen = ends.y > ends.x && ends.x < x_low + width;
        }
        if (seen && part < 32u) open.x |= 1u << part;
        if (seen && part >= 32u) open.y |= 1u << (part - 32u);
    }
    return open == uvec2(0u) ? uvec2(0xffffffffu) : open;
}

// Place along x up to which a share of the open parts lies.
float x_at(Even even, float share) {
    float left = share * even.all;
    float width = P.period / float(OPEN_PARTS);
    float x = 0.5 * P.period;
    for (uint part = 0u; part < OPEN_PARTS; part++) {
        uint word = part < 32u ? even.open.x : even.open.y;
        float weight = (word >> (part & 31u) & 1u) != 0u ? 1.0 : P.leak;
        if (weight > 0.0 && left <= weight) {
            x = (float(part) + left / weight) * width - 0.5 * P.period;
            break;
        }
        left -= weight;
    }
    return min(x, 0.5 * P.period);
}

// The line that ray i is on: no two of a column have the same place along x.
uint line_of(Even even, uint i) {
    return bitfieldReverse(i % even.lines) >> (32 - findMSB(even.lines));
}

// The rectangle of ray i, and the ray that one has: `count` of one that has none. Rectangles are made in threes, of which
// the one in the middle has no ray.
uint rectangle_of(Even even, uint i) {
    return even.first + 3u * (i / 2u) + 2u * (i % 2u);
}

uint ray_of(Even even, uint index) {
    uint at = index - even.first;
    if (index < even.first || at % 3u == 1u) return even.count;
    return min(2u * (at / 3u) + (at % 3u) / 2u, even.count);
}

bool has_ray(Even even, uint index) {
    return ray_of(even, index) < even.count;
}

// Place of ray i: heights in a line are a Kronecker sequence.
vec2 place_of(Even even, uint i) {
    float up = fract(0.61803399 * float(i / even.lines) + 0.5);
    return vec2(x_at(even, (float(i) + 0.5) / float(even.count)), (float(line_of(even, i)) + up) / float(even.lines));
}

// Sets the sides of the rectangle of ray i.
void set_sides(inout Rectangle g, Even even, uint i) {
    uint column = i / even.lines;
    uint line = line_of(even, i);
    float columns = float(even.count / even.lines);
    g.x_low = x_at(even, float(column) / columns);
    g.x_high = x_at(even, float(column + 1u) / columns);
    g.z_low = float(line) / float(even.lines);
    g.z_high = float(line + 1u) / float(even.lines);
}

// Place of the ray of a rectangle.
vec2 place_of_ray(Rectangle g, uint index) {
    if (!is_even(g.patch_index)) return middle_of(g);
    Even even = even_of(g.patch_index);
    return place_of(even, ray_of(even, index));
}
