#version 460
// Makes base rectangles, and their rays.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"
#include "refine/head.glsl"
#include "refine/rectangle.glsl"

// The patch of a base rectangle: patches are in the order of theirs.
uint patch_of(uint index) {
    uint first = 0u;
    uint last = P.all_patches;
    while (last - first > 1u) {
        uint middle = (first + last) / 2u;
        bool before = P.patches.at[middle].first <= index;
        first = before ? middle : first;
        last = before ? last : middle;
    }
    return first;
}

void main() {
    uint index;
    if (!item_of(STAGE_BASE, index)) return;
    uint patch_index = patch_of(index);
    RefinedPatch patch_ = P.patches.at[patch_index];
    uint own = index - patch_.first;
    uint high = patch_.base[1];
    Rectangle g;
    set_base(g, patch_, uvec2(own / high, own % high));
    g.optical_depth = g.displacement = g.landing = g.pixel_shift = g.variance = 0.0;
    g.signature = g.flags = g.parts = 0u;
    g.change_x = g.change_z = g.light_error = g.turn_error = g.weight = 0.0;
    g.patch_index = patch_index;
    g.whole = index;
    P.rectangles.at[index] = g;
    for (uint word = 0u; word < 3u; word++) P.asked.at[3u * index + word] = 0u;
    if (index < P.own_base) P.lists.at[index] = index;
    vec2 at = middle_of(g);
    P.rays.at[gl_GlobalInvocationID.x] = ray_at(patch_, at.x, at.y);
}
