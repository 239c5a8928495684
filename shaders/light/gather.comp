// Cells of all energies gathered into few: an invocation has a cell row and a list, of light that took one way through
// the masks (a group), or of one energy where energies share no edges of bars (docs/developers/numerics.md, "Cells of
// all energies").
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/GatherPush.glsl"

#include "physics/gauss.glsl"
#include "physics/absorption.glsl"
#include "light/energy_sums.glsl"

// Bend of the logarithm of light over a whole beamlet that parts energies.
const float DEPTH_TOLERANCE = 2e-5;
// Interval of the normal distribution, in standard deviations, from which on its mean is a difference of integrals.
const float NARROW = 0.05;

EnergyParams params;
// The cell row that is gathered, and its place among all.
CellRow source;
EnergyRow place;
// Its gathered cells: those that land in their row and the two beside it from the first place on, others from the last.
CellRow near;
CellRow far;
uint first_place;
uint end_place;
bool may_land_far;

// Share of light spread evenly over [low, high] and blurred that lies before `e`, rows.
float share_before(float e, float low, float high) {
    if (params.row_blur <= 0.0) return clamp((e - low) / (high - low), 0.0, 1.0);
    float from = (e - high) / params.row_blur;
    float to = (e - low) / params.row_blur;
    float width = to - from;
    if (width < NARROW) {
        float middle = 0.5 * (from + to);
        float density, below;
        normal(middle, density, below);
        return below - middle * density * width * width / 24.0;
    }
    return (ramp(to) - ramp(from)) / width;
}

// Shares that land in the row above and in the row below, moved down by some rows; -1 and 0 where light lands farther off.
vec2 row_shares(float down) {
    float low = source.top + down;
    float high = source.bottom + down;
    float reach = NO_LIGHT * params.row_blur;
    if (may_land_far && (reach > 1.0 || low - reach < -1.0 || high + reach > 2.0)) return vec2(-1.0, 0.0);
    return vec2(share_before(0.0, low, high), 1.0 - share_before(1.0, low, high));
}

// A cell with displacements at its ends, and along z, and optical depths at its ends.
Cell cell_of(vec2 ends, vec2 depth, vec2 x, float z, float slope_x) {
    vec2 shares = params.heights != 0u ? vec2(0.0) : row_shares(-z / params.row_pitch);
    float shift = 0.5 * (x.x + x.y) * (1.0 - params.ratio) - slope_x * params.gap * params.ratio;
    return Cell(ends.x, ends.y, depth.x, depth.y, x.x, x.y, z, shares.x, shares.y, shift, 0.0, 0.0, 0.0, 0.0, 0.0);
}

// The growth and the slope of light along z behind apertures that end there: those of the traced cell, times the means
// of refraction and depth.
void set_along_z(inout Cell cell, Cell traced, float refraction, float depth) {
    if (params.heights == 0u) return;
    float own = 0.5 * (traced.depth_low + traced.depth_high);
    cell.share_above = traced.share_above * refraction;
    cell.share_below = own > 0.0 ? traced.share_below * depth / own : 0.0;
}

// Adds a cell to the light of a cell row and to the reach of its light.
void add_to_row(inout CellRow row, Cell cell) {
    float width = cell.x_high - cell.x_low;
    row.light += width * mean_passed(0.5 * (cell.depth_low + cell.depth_high), cell.depth_high - cell.depth_low);
    float low = min(cell.displacement_low, cell.displacement_high);
    float high = max(cell.displacement_low, cell.displacement_high);
    row.low_landing = min(row.low_landing, low - cell.pixel_shift);
    row.high_landing = max(row.high_landing, high - cell.pixel_shift);
    row.displacement_slope = max(row.displacement_slope, (high - low) / width);
    row.displacement_variance = max(row.displacement_variance, cell.displacement_variance);
    row.cell_count++;
}

void add_cell(Cell cell) {
    bool is_far = params.heights == 0u && cell.share_above <= -1.0;
    push.gathered.at[is_far ? end_place - 1u - far.cell_count : first_place + near.cell_count] = cell;
    if (is_far) {
        add_to_row(far, cell);
    } else {
        add_to_row(near, cell);
    }
}

// The cell of a band of energies.
Cell cell_of_band(vec2 ends, Sums sums) {
    float light = sums.light.y;
    Cell cell = cell_of(ends, -log(sums.light.xz), mean_x(sums).xz, sums.origin_z + sums.z / light, sums.slope_x / light);
    vec2 narrowing = sums.narrowing / light;
    vec2 covariance = (sums.narrowing_x - narrowing * sums.x.y) / light;
    cell.displacement_variance = variance_x(sums);
    cell.sample_narrowing = narrowing.x;
    cell.detector_narrowing = narrowing.y;
    cell.sample_covariance = covariance.x;
    cell.detector_covariance = covariance.y;
    return cell;
}

void add_joined(inout Joining joining) {
    if (!joining.has_cells) return;
    Sums sums = joined(joining);
    if (sums.light.y > 0.0) add_cell(cell_of_band(joining.ends, sums));
    joining.has_cells = false;
}

// Refraction at an energy relative to the mean constants.
float refraction_at(uint energy) {
    uint stride = 1u + 2u * params.materials + params.variances;
    return Floats(params.constants).at[params.variances + energy * stride];
}

// Word of the bars behind the shares of groups.
uint bars_behind_shares() {
    return place.bars + params.groups * params.energies;
}

// Sums of a cell, whose results begin at `at`, over energies.
Sums sums_over(uint at, uint group, uint first, uint last) {
    EnergyResult origin = push.results.at[at + (first + last) / 2u];
    Sums sums = no_sums(vec3(origin.x_low, 0.5 * (origin.x_low + origin.x_high), origin.x_high), origin.z);
    for (uint n = first; n < last; n++) {
        EnergyResult result = push.results.at[at + n];
        float share = push.bars.at[place.bars + group * params.energies + n];
        vec2 x_ends = vec2(result.x_low, result.x_high) - sums.origin.xz;
        vec3 x = vec3(x_ends.x, 0.5 * (x_ends.x + x_ends.y), x_ends.y);
        vec3 light = share * vec3(exp(-result.depth_low), result.light, exp(-result.depth_high));
        float z = result.z - sums.origin_z;
        uint narrowings = bars_behind_shares() + params.energies + 2u * n;
        vec2 narrowing = light.y * vec2(push.bars.at[narrowings], push.bars.at[narrowings + 1u]);
        sums.light += light;
        sums.x += light * x;
        sums.x2 += light.y * (x.y * x.y + result.variance);
        sums.z += light.y * z;
        sums.z2 += light.y * z * z;
        sums.slope_x += light.y * result.slope_x;
        sums.narrowing += narrowing;
        sums.narrowing_x += narrowing * x.y;
        if (params.heights != 0u) {
            sums.refraction += light.y * refraction_at(n);
            sums.depth += light.y * 0.5 * (result.depth_low + result.depth_high);
        }
    }
    return sums;
}

// Energy that parts a band of this light in the middle of a cell into halves.
uint half_of(uint at, uint group, uint first, uint last, float light) {
    float below = 0.0;
    uint n = first;
    for (; n < last && below < 0.5 * light; n++) {
        below += push.bars.at[place.bars + group * params.energies + n] * push.results.at[at + n].light;
    }
    return clamp(n - 1u, first + 1u, last - 1u);
}

// Ends of the bands behind the one in work, a bit each.
uint ends_of_bands[MOST_ENERGIES / 32u];

// The first end behind `first`, which is taken; `end` where there is none.
uint next_end(uint first, uint end) {
    for (uint word = first / 32u; 32u * word < min(end, MOST_ENERGIES); word++) {
        uint bits = ends_of_bands[word];
        if (bits != 0u) {
            ends_of_bands[word] = bits & (bits - 1u);
            return 32u * word + uint(findLSB(bits));
        }
    }
    return end;
}

// Cells of one way through the masks: one, or the number that keeps the energies in each close enough.
void gather_group(uint group) {
    uint bars = bars_behind_shares() + 3u * params.energies + 5u * group;
    uint begin = uint(push.bars.at[bars]);
    uint end = uint(push.bars.at[bars + 1u]);
    vec3 limits = vec3(push.bars.at[bars + 2u], push.bars.at[bars + 3u], push.bars.at[bars + 4u]);
    for (uint word = 0u; word < MOST_ENERGIES / 32u; word++) ends_of_bands[word] = 0u;
    Joining joining = nothing_joined();
    for (uint i = 0u; i < source.cell_count; i++) {
        uint cell = source.first_cell + i;
        uint at = cell * params.energies;
        Cell traced = push.cells.at[cell];
        vec2 ends = vec2(traced.x_low, traced.x_high);
        float all = 0.0;
        for (uint n = 0u; n < params.energies; n++) {
            all += push.bars.at[bars_behind_shares() + n] * push.results.at[at + n].light;
        }
        // A narrow cell may err by more: it has less light. The effect of the third moment grows with the light.
        float scale = max(params.full_width / (ends.y - ends.x), 1.0);
        vec2 spread = vec2(params.spread_x, params.spread_z) * pow(scale, 1.0 / 3.0);
        uint first = begin;
        uint last = end;
        while (first < end) {
            Sums sums = sums_over(at, group, first, last);
            bool is_lit = sums.light.x > 0.0 && sums.light.y > 0.0 && sums.light.z > 0.0;
            float part = sums.light.y / all;
            bool is_resolved = part * depth_curvature(sums) <= DEPTH_TOLERANCE * scale
                && part * drift(sums) <= params.tolerance * scale;
            bool is_narrow = part * variance_x(sums) <= spread.x * spread.x
                && part * variance_z(sums) <= spread.y * spread.y;
            bool is_joined = is_lit && is_resolved && limits.x >= 0.0 && last - first == end - begin;
            bool is_one = (is_resolved && is_narrow) || last - first == 1u;
            if (is_joined) {
                if (!joins(joining, ends, sums, limits)) {
                    add_joined(joining);
                    joins(joining, ends, sums, limits);
                }
            } else if (is_lit) {
                // Cells of a cell row are sorted: the joined cells lie before this one.
                add_joined(joining);
                if (is_one) {
                    Cell made = cell_of_band(ends, sums);
                    set_along_z(made, traced, sums.refraction / sums.light.y, sums.depth / sums.light.y);
                    add_cell(made);
                }
            }
            if (!is_lit || is_joined || is_one) {
                first = last;
                last = next_end(first, end);
            } else {
                if (last < min(end, MOST_ENERGIES)) ends_of_bands[last / 32u] |= 1u << (last % 32u);
                last = half_of(at, group, first, last, sums.light.y);
            }
        }
    }
    add_joined(joining);
}

// Cells of one energy.
void gather_energy(uint energy) {
    for (uint i = 0u; i < source.cell_count; i++) {
        uint cell = source.first_cell + i;
        EnergyResult result = push.results.at[cell * params.energies + energy];
        Cell traced = push.cells.at[cell];
        vec2 depth = vec2(result.depth_low, result.depth_high);
        Cell made = cell_of(vec2(traced.x_low, traced.x_high), depth, vec2(result.x_low, result.x_high), result.z,
                            result.slope_x);
        made.displacement_variance = result.variance;
        set_along_z(made, traced, refraction_at(energy), 0.5 * (depth.x + depth.y));
        add_cell(made);
    }
}

// A cell row without cells.
CellRow empty_row(uint first_cell) {
    CellRow row = source;
    row.first_cell = first_cell;
    row.cell_count = 0u;
    row.light = 0.0;
    row.low_landing = 1e30;
    row.high_landing = -1e30;
    row.displacement_variance = 0.0;
    row.displacement_slope = 0.0;
    return row;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    uint list = gl_GlobalInvocationID.y;
    if (index >= push.row_count) return;
    params = push.params.at[0];
    source = push.cell_rows.at[index];
    place = push.energy_rows.at[index];
    may_land_far = index < push.far_count;
    uint places = source.cell_count * (push.by_energy != 0u ? 1u : params.energies);
    first_place = place.first_cell + list * places;
    end_place = first_place + places;
    near = empty_row(first_place);
    far = empty_row(0u);
    if (push.by_energy != 0u) {
        gather_energy(list);
    } else {
        gather_group(list);
    }
    uint first_row = list * (push.row_count + push.far_count);
    push.gathered_rows.at[first_row + index] = near;
    if (!may_land_far) return;
    // In the order of x, as others.
    far.first_cell = end_place - far.cell_count;
    for (uint i = 0u; i < far.cell_count / 2u; i++) {
        Cell cell = push.gathered.at[far.first_cell + i];
        push.gathered.at[far.first_cell + i] = push.gathered.at[end_place - 1u - i];
        push.gathered.at[end_place - 1u - i] = cell;
    }
    push.gathered_rows.at[first_row + push.row_count + index] = far;
}
