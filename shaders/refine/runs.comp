#version 460
// Finds runs of rectangles side by side over the same height: their cells are a row.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"
#include "refine/head.glsl"
#include "refine/rectangle.glsl"
#include "refine/even.glsl"
#include "refine/shares.glsl"

// The rectangle of the next ray on the line of one that is spread evenly, or of the one before.
uint along_line(Even even, uint index, bool is_high) {
    uint i = ray_of(even, index);
    if (is_high ? i + even.lines >= even.count : i < even.lines) return NO_RECTANGLE;
    return rectangle_of(even, is_high ? i + even.lines : i - even.lines);
}

// The rectangle beside another at its lower or higher x, over the same height; none where it ends otherwise.
uint beside_of(uint index, bool is_high) {
    Rectangle g = P.rectangles.at[index];
    uint other;
    if (is_even(g.patch_index)) {
        other = along_line(even_of(g.patch_index), index, is_high);
    } else {
        float half_period = 0.5 * P.period;
        if (is_high ? g.x_high >= half_period : g.x_low <= -half_period) return NO_RECTANGLE;
        vec2 x = beside_x(g);
        other = found_at(index, g.patch_index, is_high ? x.y : x.x, 0.5 * (g.z_low + g.z_high)).index;
    }
    if (other == NO_RECTANGLE) return other;
    bool same = P.rectangles.at[other].z_low == g.z_low && P.rectangles.at[other].z_high == g.z_high
        && (P.rectangles.at[other].flags & FLAG_NOT_FINITE) == 0u;
    return same ? other : NO_RECTANGLE;
}

// The number of rectangles in the run that begins with this one; 0 where another begins it.
uint count_of(uint index, RefinedPatch patch_) {
    Rectangle g = P.rectangles.at[index];
    // The first rectangle of a patch that misses the sample has the whole patch.
    if (!is_hit(g.patch_index)) return index == patch_.first && patch_.is_lit != 0u ? 1u : 0u;
    if (g.parts != 0u || (g.flags & FLAG_NOT_FINITE) != 0u) return 0u;
    if (is_even(g.patch_index) && !has_ray(even_of(g.patch_index), index)) return 0u;
    if (beside_of(index, false) != NO_RECTANGLE) return 0u;
    uint count = 0u;
    for (uint next = index; next != NO_RECTANGLE; next = beside_of(next, true)) count++;
    return count;
}

void main() {
    uint index;
    if (!item_of(STAGE_RUNS, index)) return;
    if (P.head.at[HEAD_RETRIES] != 0u) index = P.again.at[index % P.room];
    RefinedPatch patch_ = P.patches.at[P.rectangles.at[index].patch_index];
    uint count = count_of(index, patch_);
    if (count == 0u) return;
    uint reserved = atomicAdd(P.head.at[HEAD_RESERVED], count * most_cells());
    if (reserved + count * most_cells() > P.cell_room) {
        P.again.at[atomicAdd(P.head.at[HEAD_AGAINS], 1u) % P.room] = index;
        return;
    }
    uint bands = bands_of(patch_);
    uint cell = atomicAdd(P.head.at[HEAD_CELLS], count * bands * lists_of(patch_));
    uint item = atomicAdd(P.head.at[HEAD_MADE], count);
    uint run = atomicAdd(P.head.at[HEAD_RUNS], 1u);
    P.runs.at[2u * run] = item;
    P.runs.at[2u * run + 1u] = count;
    for (uint i = 0u; i < count; i++) {
        P.made.at[3u * (item + i)] = index;
        P.made.at[3u * (item + i) + 1u] = cell + bands * i;
        P.made.at[3u * (item + i) + 2u] = bands * count;
        if (i + 1u < count) index = beside_of(index, true);
    }
}
