#version 460
// Sums up the errors and rays of patches.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"
#include "refine/head.glsl"
#include "refine/rectangle.glsl"
#include "refine/even.glsl"
#include "refine/worst.glsl"

void main() {
    uint patch_index;
    if (!item_of(STAGE_REPORT, patch_index)) return;
    RefinedPatch patch_ = P.patches.at[patch_index];
    uint rays = P.sums.at[sums_of(patch_index) + PATCH_RAYS] + patch_.base[0] * patch_.base[1];
    float error = min(P.reported * sqrt(worst_square(patch_index, false)), 4e9);
    uint parts = uint(error);
    Words told = P.report;
    atomicAdd(told.at[REPORT_PATCHES], 1u);
    add_pair(told, REPORT_RAYS, uvec2(rays, 0u));
    atomicMax(told.at[REPORT_MOST], rays);
    atomicMax(told.at[REPORT_WORST], parts);
    uvec2 square;
    umulExtended(parts, parts, square.y, square.x);
    add_pair(told, REPORT_SQUARES, square);
    // With the error of the displacement, share of its own budget, where it is bounded.
    if (P.reported * sqrt(worst_square(patch_index, has_turns(patch_index))) > float(P.tolerance)) {
        atomicAdd(told.at[REPORT_BEYOND], 1u);
    }
}
