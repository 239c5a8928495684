// Light of a cell summed over energies, and how far one cell can stand for it.

// At the low end, the middle and the high end: light, and light times displacement. In the middle: times its square,
// displacement along z and its square, slope, refraction and depth; for either mask times narrowing, and times narrowing
// and displacement. Displacements are relative to an origin, so that variances are not differences of large numbers.
struct Sums {
    vec3 light;
    vec3 x;
    float x2;
    float z;
    float z2;
    float slope_x;
    float refraction;
    float depth;
    vec2 narrowing;
    vec2 narrowing_x;
    vec3 origin;
    float origin_z;
};

Sums no_sums(vec3 origin, float origin_z) {
    return Sums(vec3(0.0), vec3(0.0), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, vec2(0.0), vec2(0.0), origin, origin_z);
}

// Adds sums times a factor.
void add_sums(inout Sums all, Sums other, float factor) {
    vec3 by = other.origin - all.origin;
    float by_z = other.origin_z - all.origin_z;
    float light = other.light.y;
    all.light += factor * other.light;
    all.x += factor * (other.x + by * other.light);
    all.x2 += factor * (other.x2 + by.y * (2.0 * other.x.y + by.y * light));
    all.z += factor * (other.z + by_z * light);
    all.z2 += factor * (other.z2 + by_z * (2.0 * other.z + by_z * light));
    all.slope_x += factor * other.slope_x;
    all.narrowing += factor * other.narrowing;
    all.narrowing_x += factor * (other.narrowing_x + by.y * other.narrowing);
}

// Mean displacements.
vec3 mean_x(Sums sums) {
    return sums.origin + sums.x / sums.light;
}

// Variance of the displacement over the energies, in the middle.
float variance_x(Sums sums) {
    float mean = sums.x.y / sums.light.y;
    return max(sums.x2 / sums.light.y - mean * mean, 0.0);
}

// The same of the displacement along z.
float variance_z(Sums sums) {
    float mean = sums.z / sums.light.y;
    return max(sums.z2 / sums.light.y - mean * mean, 0.0);
}

// Optical depth in the middle less the mean of that at the ends, to first order.
float depth_curvature(Sums sums) {
    return abs(sums.light.y / (sqrt(sums.light.x) * sqrt(sums.light.z)) - 1.0);
}

// The same of the displacement.
float drift(Sums sums) {
    vec3 x = sums.x / sums.light;
    return abs(x.y - 0.5 * (x.x + x.z) + sums.origin.y - 0.5 * (sums.origin.x + sums.origin.z));
}

// Integrals of a piecewise linear function over a run from 0 on: of the value, of value times place, of its square.
void add_piece(inout vec3 integrals, vec2 place, vec2 value) {
    float width = place.y - place.x;
    integrals += width * vec3(0.5 * (value.x + value.y),
                              (2.0 * place.x * value.x + place.x * value.y + place.y * value.x
                               + 2.0 * place.y * value.y) / 6.0,
                              (value.x * value.x + value.x * value.y + value.y * value.y) / 3.0);
}

// Ends of the straight line closest to it over [0, width], and the mean square that the line leaves.
vec3 line_of(vec3 integrals, float width) {
    float mean = integrals.x / width;
    float rise = 12.0 * (integrals.y - 0.5 * width * integrals.x) / (width * width);
    float left = integrals.z / width - mean * mean - rise * rise / 12.0;
    return vec3(mean - 0.5 * rise, mean + 0.5 * rise, max(left, 0.0));
}

// Cells that are joined: their light, its displacement, and straight lines for both.
struct Joining {
    bool has_cells;
    vec2 ends;
    Sums sums;     // per metre, times the widths
    vec3 light;    // integrals
    vec3 x;        // integrals, relative to the origin of the sums
    vec2 range;    // least and most light
};

Joining nothing_joined() {
    return Joining(false, vec2(0.0), no_sums(vec3(0.0), 0.0), vec3(0.0), vec3(0.0), vec2(0.0));
}

// Adds a cell, if it fits with those before it. Limits: width (m), deviation of the displacement from a straight line
// (m), change of the light (share of it).
bool joins(inout Joining joining, vec2 ends, Sums sums, vec3 limits) {
    if (!joining.has_cells) {
        joining = nothing_joined();
        joining.ends = ends.xx;
        joining.range = vec2(1e30, 0.0);
        joining.sums = no_sums(mean_x(sums).xxx, sums.origin_z);
    }
    vec2 place = ends - joining.ends.x;
    vec2 range = vec2(min(joining.range.x, min(sums.light.x, sums.light.z)),
                      max(joining.range.y, max(sums.light.x, sums.light.z)));
    vec3 x = mean_x(sums) - joining.sums.origin.x;
    vec3 line = joining.x;
    add_piece(line, place, x.xz);
    bool fits = !joining.has_cells
        || (joining.ends.y == ends.x && place.y <= limits.x && range.y - range.x <= limits.z * range.y
            && line_of(line, place.y).z <= limits.y * limits.y);
    if (!fits) return false;
    joining.has_cells = true;
    joining.ends.y = ends.y;
    joining.range = range;
    joining.x = line;
    add_piece(joining.light, place, sums.light.xz);
    // Light of the cell over that in its middle.
    float mean = sums.light.x > 0.0 && sums.light.z > 0.0 ? mean_passed(0.0, log(sums.light.x / sums.light.z)) : 1.0;
    add_sums(joining.sums, sums, mean * (place.y - place.x));
    return true;
}

// The sums of joined cells per metre, as of one cell with straight lines of light and displacement: the spread of the
// displacement about its line stays.
Sums joined(Joining joining) {
    float width = joining.ends.y - joining.ends.x;
    Sums one = no_sums(joining.sums.origin, joining.sums.origin_z);
    add_sums(one, joining.sums, 1.0 / width);
    vec2 light = line_of(joining.light, width).xy;
    vec2 x = line_of(joining.x, width).xy;
    float middle = one.light.y;
    float mean = one.x.y / middle;
    float rise = x.y - x.x;
    one.x2 = middle * (mean * mean + max(variance_x(one) - rise * rise / 12.0, 0.0));
    // Light of a cell falls off exponentially between its ends: they are chosen so that the cell has the light of its
    // parts, which lands where theirs lands on average.
    float least = min(light.x, light.y);
    vec2 ends = vec2(middle);
    if (least > 0.0 && max(light.x, light.y) <= 2.0 * least) {
        float fall = log(light.y / light.x);
        ends = light * middle / (sqrt(light.x * light.y) * mean_passed(0.0, fall));
    }
    float off = mean - 0.5 * (x.x + x.y) - rise * (ends.y - ends.x) / (12.0 * middle);
    one.light.xz = ends;
    one.x.xz = ends * (x + off);
    return one;
}
