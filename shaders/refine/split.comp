#version 460
// Makes the three parts of rectangles, of which the one in the middle has the ray of the whole; or rectangles of rays that
// are spread evenly.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"
#include "refine/head.glsl"
#include "refine/rectangle.glsl"
#include "refine/even.glsl"

// Makes rectangles of two rays of a patch; the one between has none.
void make_even(uint patch_index, uint first, uint place) {
    Even even = even_of(patch_index);
    RefinedPatch patch_ = P.patches.at[patch_index];
    uint pair = (first - even.first) / 3u;
    Rectangle g = P.rectangles.at[patch_.first];
    g.parts = 0u;
    g.change_x = g.change_z = g.light_error = g.turn_error = g.weight = 0.0;
    for (uint k = 0u; k < 3u; k++) {
        g.whole = first + k;
        if (k != 1u) {
            uint i = 2u * pair + k / 2u;
            set_sides(g, even, i);
            vec2 at = place_of(even, i);
            P.rays.at[2u * place + k / 2u] = ray_at(patch_, at.x, at.y);
        }
        P.rectangles.at[first + k] = g;
    }
    atomicAdd(P.sums.at[sums_of(patch_index) + PATCH_RAYS], 2u);
}

void main() {
    uint item;
    if (!item_of(STAGE_SPLIT, item)) return;
    uint place = gl_GlobalInvocationID.x;
    uint count = P.head.at[HEAD_STAGES + STAGE_SPLIT * STAGE_WORDS + 1u];
    uint first = P.head.at[HEAD_RECTANGLES] - 3u * (count - place);
    uint list = P.head.at[HEAD_LIST];
    uint end = list * P.room + P.head.at[HEAD_LISTED + list] - 3u * (count - place);
    for (uint k = 0u; k < 3u; k++) {
        for (uint word = 0u; word < 3u; word++) P.asked.at[3u * (first + k) + word] = 0u;
        P.lists.at[end + k] = first + k;
    }
    uint whole = P.splits.at[item];
    if ((whole & SPLIT_IS_EVEN) != 0u) {
        make_even(whole & ~SPLIT_IS_EVEN, first, place);
        return;
    }
    Rectangle g = P.rectangles.at[whole];
    weigh(g, false);
    bool along_x = (g.flags & RECTANGLE_ALONG_X) != 0u;
    vec2 ends = along_x ? vec2(g.x_low, g.x_high) : vec2(g.z_low, g.z_high);
    float third = (ends.y - ends.x) / 3.0;
    float borders[4] = float[4](ends.x, ends.x + third, ends.y - third, ends.y);
    RefinedPatch patch_ = P.patches.at[g.patch_index];
    for (uint k = 0u; k < 3u; k++) {
        Rectangle part = g;
        part.whole = whole;
        if (along_x) {
            part.x_low = borders[k];
            part.x_high = borders[k + 1u];
        } else {
            part.z_low = borders[k];
            part.z_high = borders[k + 1u];
        }
        part.light_error = part.turn_error = part.weight = 0.0;
        uint index = first + k;
        P.rectangles.at[index] = part;
        if (k != 1u) {
            vec2 at = middle_of(part);
            P.rays.at[2u * place + k / 2u] = ray_at(patch_, at.x, at.y);
        }
    }
    P.rectangles.at[whole].parts = first;
    atomicAdd(P.sums.at[sums_of(g.patch_index) + PATCH_RAYS], 2u);
}
