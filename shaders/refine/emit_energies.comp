#version 460
// Makes cells of rectangles under a spectrum: in each group of light the energies that share a cell.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"
#include "refine/head.glsl"
#include "physics/gauss.glsl"
#include "refine/rectangle.glsl"
#include "refine/even.glsl"
#include "refine/slopes.glsl"
#include "refine/made.glsl"
#include "refine/shares.glsl"
#include "refine/spectrum.glsl"
#include "refine/at_node.glsl"
#include "refine/merged.glsl"

// A rectangle in work.
struct Own {
    Rectangle g;
    RefinedPatch patch_;
    Beside beside;
    HeldMoments held;
    bool exact;
    AtNode found; // result of the ray, and what the first order says of it
    AtNode first;
    vec2 along_z; // at the constants of the rays
};

Own own_of(Rectangle g, uint index) {
    bool hit = is_hit(g.patch_index) && !is_even(g.patch_index);
    Own own;
    own.g = g;
    own.patch_ = P.patches.at[g.patch_index];
    Found ray = found_of(P.rectangles.at[index], index, vec2(0.0));
    float width = g.x_high - g.x_low;
    vec2 x = beside_x(g);
    Found low = found_at(index, g.patch_index, x.x, ray.at.y);
    Found high = found_at(index, g.patch_index, x.y, ray.at.y);
    bvec2 has = bvec2(hit && low.known && alike(low, ray), hit && high.known && alike(high, ray));
    vec2 along = vec2(low.at.x, high.at.x) - ray.at.x;
    own.beside = Beside(traced_for(index), traced_for(low.rectangle), traced_for(high.rectangle), along, has, width);
    own.held = held_of(own.beside);
    own.along_z = hit && has_heights() ? along_z(g, slopes_at(g, index)) : vec2(0.0);
    uint flags = ray.flags | (has.x ? low.flags : 0u) | (has.y ? high.flags : 0u);
    own.exact = (flags & FLAG_EXACT) != 0u;
    if (own.exact) {
        own.first = first_order_at(own.beside, own.held, S.nodes);
        vec2 depth = vec2(low.depth, high.depth) - ray.depth;
        vec2 moved = vec2(low.displacement, high.displacement) - ray.displacement;
        vec2 depth_rise = vec2(ray.depth, width * slope_along(depth, along, vec2(0.0), has.x, has.y, 0.0));
        vec2 moved_rise = vec2(ray.displacement, width * slope_along(moved, along, vec2(0.0), has.x, has.y, 0.0));
        own.found = AtNode(depth_rise, moved_rise, g.landing, slope_of(g), 0.0, 1.0);
    }
    return own;
}

AtNode result_at(Own own, uint node) {
    AtNode result = first_order_at(own.beside, own.held, node);
    float grazing = float(own.g.flags >> FLAG_SHARE_SHIFT) / 255.0;
    bool drawn = (own.g.flags & FLAG_DRAWN) != 0u;
    if (own.exact) correct(result, own.found, own.first, node, grazing, drawn);
    limit(result, own.beside.width);
    if (own.g.variance > 0.0) result.variance = spread_by_roughness(own.beside.own, node);
    return result;
}

// Shares of the light of a cell in the rows beside its own, or its light along z where apertures end there: by the
// means of refraction and depth.
vec2 along_z_of(Own own, Sums sums, Rows rows) {
    if (!has_heights()) return vec2(rows.above, rows.below);
    vec2 mean = sums.along_z / sums.light.y;
    return own.along_z * vec2(mean.x, own.g.optical_depth > 0.0 ? mean.y / own.g.optical_depth : 0.0);
}

// The cell of a rectangle with this light; one without light where that is not wanted.
Cell cell_of(Own own, Sums sums) {
    if (any(lessThan(sums.light, vec3(DARK)))) return no_cell(own.g);
    vec3 x = sums.x / sums.light;
    float middle = sums.light.y;
    float landing = sums.z / middle;
    Rows rows = rows_of(own.g, landing);
    count_landing(landing);
    vec2 depth = -log(sums.light.xz);
    vec2 displacement = own.g.displacement + x.xz;
    float pixel_shift = shift_of(0.5 * (displacement.x + displacement.y), sums.slope_x / middle);
    vec2 narrowing = sums.narrowing / middle;
    vec2 covariance = sums.narrowing_x / middle - narrowing * x.y;
    vec2 shares = along_z_of(own, sums, rows);
    return Cell(own.g.x_low, own.g.x_high, depth.x, depth.y, displacement.x, displacement.y, landing,
                shares.x, shares.y, pixel_shift, variance_of(sums), narrowing.x, narrowing.y,
                covariance.x, covariance.y);
}

// A cell in a row of its own.
void push_alone(uint list, Own own, Sums sums) {
    Cell cell = cell_of(own, sums);
    if (!has_light(cell) || !is_wanted(own.g, own.patch_, cell)) return;
    Made made = made_from(atomicAdd(P.head.at[HEAD_CELLS], 1u));
    P.cells.at[made.first] = cell;
    take_cell(made, cell);
    push_row(list, own.g, own.patch_, made);
}

// A cell for each energy: these share no edges.
void write_nodes(Own own, uint slot, uint stride) {
    for (uint node = 0u; node < S.nodes; node++) {
        AtNode at = result_at(own, node);
        P.cells.at[slot + node * stride] =
            cell_of(own, plus(no_sums(), at, own.g.displacement, light_of(at), vec2(0.0)));
    }
}

// Writes a cell to the row of its run where that has room.
void give(uint list, Own own, Sums sums, uint slot, inout uint bands) {
    if (bands == BANDS) {
        push_alone(list, own, sums);
        return;
    }
    P.cells.at[slot + bands] = cell_of(own, sums);
    bands++;
}

// Cells by group: one takes energies as long as one cell has their light.
void write_groups(Own own, GroupShares shares, uint slot, uint stride) {
    float all = 0.0;
    for (uint node = 0u; node < S.nodes; node++) {
        all += share_at(shares.nodes + node) * exp(-first_order_at(own.beside, own.held, node).depth.x);
    }
    float scale = max(S.full_width / own.beside.width, 1.0);
    // The effect of the third moment grows with the light.
    vec2 spread = vec2(S.spread, S.spread_z) * pow(scale, 1.0 / 3.0);
    Sums sums[SPECTRUM_GROUPS];
    uint slots[SPECTRUM_GROUPS];
    uint bands[SPECTRUM_GROUPS];
    for (uint group = 0u; group < S.groups; group++) {
        sums[group] = no_sums();
        slots[group] = slot;
        bands[group] = 0u;
        if (columns_of(shares, group) == 0u) slot += stride;
    }
    for (uint node = 0u; node < S.nodes; node++) {
        AtNode at = result_at(own, node);
        vec3 light = light_of(at);
        uint words = shares.narrowings + 2u * node;
        vec2 narrowing = vec2(share_at(words), share_at(words + 1u));
        for (uint group = 0u; group < S.groups; group++) {
            words = shares.groups + 3u * group;
            if (float(node) < share_at(words) || float(node) >= share_at(words + 1u)) continue;
            vec3 passed = share_at(shares.by_group + group * S.nodes + node) * light;
            Sums more = plus(sums[group], at, own.g.displacement, passed, narrowing);
            bool merges = columns_of(shares, group) != 0u;
            if (!merges && sums[group].light.y > 0.0 && !is_one(more, all, scale, spread)) {
                give(group, own, sums[group], slots[group], bands[group]);
                more = plus(no_sums(), at, own.g.displacement, passed, narrowing);
            }
            sums[group] = more;
        }
    }
    for (uint group = 0u; group < S.groups; group++) {
        uint columns = columns_of(shares, group);
        if (columns == 0u) {
            give(group, own, sums[group], slots[group], bands[group]);
            while (bands[group] < BANDS) P.cells.at[slots[group] + bands[group]++] = no_cell(own.g);
        } else if (!any(lessThan(sums[group].light, vec3(DARK)))) {
            uint first = merged_of(own.g.patch_index, group);
            if (!merge(first, columns, own.g, sums[group])) push_alone(group, own, sums[group]);
        }
    }
}

// Whether a ray is close to total reflection, where exact transport at one energy does not determine other
// energies: the host traces it at each.
bool is_repeated(Own own) {
    float grazing = float(own.g.flags >> FLAG_SHARE_SHIFT) / 255.0;
    return (own.g.flags & FLAG_EXACT) != 0u && grazing < S.repeated_below;
}

void repeat_at_nodes(Own own, uint slot, uint stride) {
    for (uint list = 0u; list < lists_of(own.patch_); list++) {
        for (uint band = 0u; band < bands_of(own.patch_); band++) {
            P.cells.at[slot + list * stride + band] = no_cell(own.g);
        }
    }
    vec2 at = place_of_ray(own.g, own.beside.own);
    Ray ray = ray_at(own.patch_, at.x, at.y);
    S.repeated.at[atomicAdd(P.head.at[HEAD_REPEATED], 1u)] =
        RepeatedRectangle(ray.x, ray.z, ray.slope_x, ray.slope_z, own.g.x_low, own.g.x_high, own.g.z_low,
                          own.g.z_high, own.patch_.column, own.patch_.row, own.g.variance);
}

void main() {
    uint item;
    if (!item_of(STAGE_EMIT, item)) return;
    uint index = P.made.at[3u * item];
    Own own = own_of(rectangle_at(index), index);
    uint slot = P.made.at[3u * item + 1u];
    uint stride = P.made.at[3u * item + 2u];
    uint shares = shares_of(own.patch_);
    if (is_repeated(own)) repeat_at_nodes(own, slot, stride);
    else if (is_apart(shares)) write_nodes(own, slot, stride);
    else write_groups(own, shares_at(shares), slot, stride);
}
