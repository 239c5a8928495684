// Rectangles of patches: rays, neighbours, and sums of errors.

#include "light/words.glsl"
#include "refine/heights.glsl"

// The ray through a place of a patch.
Ray ray_at(RefinedPatch patch_, float x, float z) {
    RefinedColumn column = P.columns.at[patch_.column];
    RefinedRow row = P.rows.at[uint(patch_.row - P.first_row)];
    // Sums of two numbers, rounded once.
    float aside = column.slope_rest + x * P.inverse_plane;
    float below = row.slope_rest + z * P.row_slope;
    return Ray(column.x + (column.x_rest + x * P.inverse_plane * P.rotation),
               row.z + (row.z_rest + z * P.row_slope * P.rotation), column.slope + aside,
               row.slope + below, P.pose, 0u);
}

// A base rectangle; its neighbours have the same bits at the side that they share.
void set_base(inout Rectangle g, RefinedPatch patch_, uvec2 at) {
    float half_period = 0.5 * P.period;
    uvec2 last = uvec2(patch_.base[0], patch_.base[1]) - 1u;
    vec2 size = vec2(P.period / float(last.x + 1u), 1.0 / float(last.y + 1u));
    g.x_low = at.x == 0u ? -half_period : float(at.x) * size.x - half_period;
    g.x_high = at.x == last.x ? half_period : float(at.x + 1u) * size.x - half_period;
    g.z_low = at.y == 0u ? 0.0 : float(at.y) * size.y;
    g.z_high = at.y == last.y ? 1.0 : float(at.y + 1u) * size.y;
}

vec2 middle_of(Rectangle g) {
    return vec2(0.5 * (g.x_low + g.x_high), 0.5 * (g.z_low + g.z_high));
}

// Places beside a rectangle at lower and higher x.
vec2 beside_x(Rectangle g) {
    float out_ = max(1e-4 * (g.x_high - g.x_low), P.beside.x);
    return vec2(g.x_low - out_, g.x_high + out_);
}

// Places above and below it.
vec2 beside_z(Rectangle g) {
    float out_ = max(1e-4 * (g.z_high - g.z_low), P.beside.y);
    return vec2(g.z_low - out_, g.z_high + out_);
}

// The result of the ray of a rectangle, and its place from the middle of the beamlet of the patch in work.
struct Found {
    bool known;
    uint index; // of a rectangle of this patch
    uint rectangle; // of any patch
    vec2 at;
    float depth;
    float displacement;
    float landing;
    uint signature;
    uint flags;
};

Found found_of(Rectangle g, uint index, vec2 shift) {
    return Found(true, index, index, middle_of(g) + shift, g.optical_depth, g.displacement, g.landing,
                 g.signature, g.flags);
}

const uint NO_RECTANGLE = 0xffffffffu;

// The part at a place of a rectangle.
uint part_at(uint index, vec2 at) {
    uint parts = P.rectangles.at[index].parts;
    while (parts != 0u) {
        bool along_x = (P.rectangles.at[index].flags & RECTANGLE_ALONG_X) != 0u;
        float v = along_x ? at.x : at.y;
        float a = along_x ? P.rectangles.at[parts].x_high : P.rectangles.at[parts].z_high;
        float b = along_x ? P.rectangles.at[parts + 1u].x_high : P.rectangles.at[parts + 1u].z_high;
        index = parts + (v < a ? 0u : v < b ? 1u : 2u);
        parts = P.rectangles.at[index].parts;
    }
    return index;
}

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

bool holds(uint index, vec2 at) {
    return at.x >= P.rectangles.at[index].x_low && at.x < P.rectangles.at[index].x_high
        && at.y >= P.rectangles.at[index].z_low && at.y < P.rectangles.at[index].z_high;
}

// The base rectangle at a place of a patch.
uint base_at(RefinedPatch patch_, vec2 place, bool own) {
    uvec2 base = uvec2(patch_.base[0], patch_.base[1]);
    vec2 share = vec2(place.x / P.period + 0.5, place.y) * vec2(base);
    uvec2 at = min(uvec2(max(share, vec2(0.0))), base - 1u);
    uint index = patch_.first + at.x * base.y + at.y;
    if (own) {
        // Shares are rounded: the sides of rectangles decide.
        Rectangle g = P.rectangles.at[index];
        if (place.x < g.x_low && at.x > 0u) index -= base.y;
        if (place.x >= g.x_high && at.x + 1u < base.x) index += base.y;
        if (place.y < g.z_low && at.y > 0u) index -= 1u;
        if (place.y >= g.z_high && at.y + 1u < base.y) index += 1u;
    }
    return index;
}

// The rectangle at a place near one of a patch, or the base rectangle of the patch beside it: results do not
// depend on how far that is refined.
Found found_at(uint near, uint patch_index, float x, float z) {
    float half_period = 0.5 * P.period;
    if (x >= -half_period && x < half_period && z >= 0.0 && z < 1.0) {
        // Up to what holds both.
        vec2 at = vec2(x, z);
        uint whole = P.rectangles.at[near].whole;
        while (whole != near && !holds(whole, at)) {
            near = whole;
            whole = P.rectangles.at[near].whole;
        }
        if (whole == near && !holds(whole, at)) whole = base_at(P.patches.at[patch_index], at, true);
        uint index = part_at(whole, at);
        return found_of(P.rectangles.at[index], index, vec2(0.0));
    }
    RefinedPatch patch_ = P.patches.at[patch_index];
    uint other = z < 0.0 ? patch_.above : patch_.below;
    vec2 shift = vec2(0.0, z < 0.0 ? -1.0 : 1.0);
    if (x < -half_period || x >= half_period) {
        other = x < 0.0 ? patch_.low : patch_.high;
        shift = vec2(x < 0.0 ? -P.period : P.period, 0.0);
    }
    Found nothing = Found(other != PATCH_UNKNOWN, NO_RECTANGLE, NO_RECTANGLE, vec2(x, z), 0.0, 0.0, 0.0, 0u, 0u);
    if (other == PATCH_UNKNOWN || other == PATCH_MISSED) return nothing;
    uint index = base_at(P.patches.at[other], vec2(x, z) - shift, false);
    Found found = found_of(P.rectangles.at[index], index, shift);
    found.index = NO_RECTANGLE;
    return found;
}

// Whether one of two rays drew a normal at a rough surface: another ray there may go elsewhere.
bool is_drawn(Found a, Found b) {
    return ((a.flags | b.flags) & FLAG_DRAWN) != 0u;
}

// Whether two rays crossed the same components in the same way.
bool alike(Found a, Found b) {
    return a.signature == b.signature && ((a.flags ^ b.flags) & FLAG_REFLECTED) == 0u
        && ((a.flags | b.flags) & FLAG_NOT_FINITE) == 0u && !is_drawn(a, b);
}

// Most crossings that are counted.
const uint MOST_CROSSINGS = (1u << (FLAG_SHARE_SHIFT - RECTANGLE_CROSSINGS)) - 1u;

uint crossings_of(uint flags) {
    return (flags >> RECTANGLE_CROSSINGS) & MOST_CROSSINGS;
}

// Whether a silhouette is between two rays. Rays that draw normals may reflect or not on one surface: any two that
// cross the sample are alike.
bool is_silhouette(Found a, Found b) {
    if (is_drawn(a, b)) return (crossings_of(a.flags) == 0u) != (crossings_of(b.flags) == 0u);
    return !alike(a, b);
}

// Squares of errors are sums of 2^-16 of the square of the budget, as integers of 64 bits: they do not
// depend on the order of their terms, and what is taken out of them is what was added.
const float UNIT = 65536.0;
const float MOST_SQUARE = 1e12;

void add_square(uint at, float square, bool add) {
    precise float units = floor(min(square, MOST_SQUARE) * UNIT);
    float high = floor(units / 4294967296.0);
    uvec2 value = uvec2(uint(units - high * 4294967296.0), uint(high));
    if (value != uvec2(0u)) add_pair(P.sums, at, add ? value : negative(value));
}

// Shares of a rectangle that a step opens, by step.
struct Shares {
    uint step_;
    float open;
    float most; // of all steps so far
    float height; // largest share along z
};

// Adds the errors of a rectangle at a step, or takes them out: of the light, and of the displacement, which
// light that leaks through bars does not move.
void add_step(inout Shares shares, uint first, Rectangle g, bool add) {
    precise float open = min(shares.open, 1.0) * shares.height;
    precise float lit = P.leak + (1.0 - P.leak) * open;
    if (open > 0.0) {
        precise float light = g.light_error * (lit * lit - P.leak * P.leak);
        add_square(first + 2u * shares.step_, light, add);
        precise float turned = g.turn_error * (open * open);
        if (turned > 0.0) add_square(first + 2u * (P.steps + 1u) + 2u * shares.step_, turned, add);
    }
    shares.most = max(shares.most, lit);
    shares.open = 0.0;
}

// Ends along x of an opening in a beamlet: of the period that ends at x, or behind it.
vec2 opening_from(MaskOpening opening, RefinedColumn column, float x) {
    precise float low = opening.low - column.mask_offset + column.shadow;
    precise float high = opening.high - column.mask_offset - column.shadow;
    precise float ahead = ceil((x - high) / opening.period) * opening.period;
    low += ahead;
    high += ahead;
    return vec2(low, high);
}

// Adds the errors of a rectangle to the sums of all steps, or takes them out; the largest share of it that a
// step lets through.
float weigh(Rectangle g, bool add) {
    uint first = step_sums_of(g.patch_index);
    RefinedPatch patch_ = P.patches.at[g.patch_index];
    Shares shares = Shares(0u, 0.0, P.leak, open_along_z(patch_.row, g.z_low, g.z_high));
    RefinedColumn column = P.columns.at[patch_.column];
    if (P.opening_count == 0u) shares.open = 1.0;
    for (uint i = 0u; i < P.opening_count; i++) {
        MaskOpening opening = P.openings.at[i];
        if (opening.step != shares.step_) {
            add_step(shares, first, g, add);
            shares.step_ = opening.step;
        }
        // The opening that ends in the rectangle, or behind it, and the next one.
        vec2 ends = opening_from(opening, column, g.x_low);
        precise float part = max(min(ends.y, g.x_high) - max(ends.x, g.x_low), 0.0)
            + max(min(ends.y + opening.period, g.x_high) - max(ends.x + opening.period, g.x_low), 0.0);
        precise float open = shares.open + part / (g.x_high - g.x_low);
        if (ends.y > ends.x) shares.open = open;
    }
    add_step(shares, first, g, add);
    precise float of_all = g.light_error * (P.leak * P.leak);
    add_square(first + 2u * P.steps, of_all, add);
    return shares.most;
}

int octave_of(float square) {
    return int(floatBitsToUint(square) >> 23u) - 127 + int(LOWEST_OCTAVE);
}

// Errors that the patch counts, in its octaves, of a rectangle: of the light, or with the displacement.
float counted_of(Rectangle g, bool turns) {
    precise float square = (turns ? g.light_error + g.turn_error : g.light_error) * g.weight;
    return square;
}

// Counts an error in its octave, or takes it out.
void count_octave(uint first, float square, bool add) {
    // The largest octave has all beyond it.
    float limited = min(square, 4095.0);
    int octave = octave_of(limited);
    if (!(square > 0.0) || octave < 0) return;
    uint mantissa = ((floatBitsToUint(limited) & 0x7fffffu) | 0x800000u) >> 13u;
    atomicAdd(P.sums.at[first + uint(octave)], add ? mantissa : ~mantissa + 1u);
    atomicAdd(P.sums.at[first + OCTAVES + uint(octave)], add ? 1u : 0xffffffffu);
}

// First word of the octaves of a patch.
uint octaves_of(uint patch_index, bool turns) {
    return sums_of(patch_index) + PATCH_HEAD + (turns ? 2u * OCTAVES : 0u);
}

// Counts the errors of a rectangle, or takes them out.
void count(Rectangle g, bool add) {
    count_octave(octaves_of(g.patch_index, false), counted_of(g, false), add);
    count_octave(octaves_of(g.patch_index, true), counted_of(g, true), add);
}

// Whether the error of the displacement is bounded: where no silhouette crosses the patch.
bool has_turns(uint patch_index) {
    return (P.sums.at[sums_of(patch_index) + PATCH_FLAGS] & PATCH_IS_CROSSED) == 0u;
}

// Sum of the errors of an octave.
float sum_of_octave(uint patch_index, bool turns, uint octave) {
    uint sum = P.sums.at[octaves_of(patch_index, turns) + octave];
    return float(sum) / 1024.0 * exp2(float(int(octave) - int(LOWEST_OCTAVE)));
}

// Whether some ray of a patch crosses the sample.
bool is_hit(uint patch_index) {
    return (P.sums.at[sums_of(patch_index) + PATCH_FLAGS] & PATCH_IS_HIT) != 0u;
}

// Squared changes of the light are sums of 2^-24, as integers of 64 bits.
const float CHANGE_UNIT = 16777216.0;
const float MOST_CHANGE = 16.0;

void add_change(uint word, float change) {
    add_pair(P.sums, word, uvec2(uint(min(change * change, MOST_CHANGE) * CHANGE_UNIT), 0u));
}

float changes_at(uint word) {
    return (float(P.sums.at[word]) + 4294967296.0 * float(P.sums.at[word + 1u])) / CHANGE_UNIT;
}
