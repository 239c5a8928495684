#version 460
// Lists the rectangles that are not split, in place of runs, where the host makes the cells.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"
#include "refine/head.glsl"
#include "refine/rectangle.glsl"
#include "refine/even.glsl"
#include "refine/slopes.glsl"

void main() {
    uint index;
    if (!item_of(STAGE_RUNS, index)) return;
    Rectangle g = P.rectangles.at[index];
    RefinedPatch patch_ = P.patches.at[g.patch_index];
    // Of a patch that misses the sample only its first rectangle is listed.
    bool is_listed = is_hit(g.patch_index) ? g.parts == 0u && (g.flags & FLAG_NOT_FINITE) == 0u
                                           : index == patch_.first && patch_.is_lit != 0u;
    if (!is_listed) return;
    if (is_even(g.patch_index) && !has_ray(even_of(g.patch_index), index)) return;
    uint traced = traced_for(index);
    vec2 at = place_of_ray(P.rectangles.at[traced], traced);
    RaySlopes slopes = limited_slopes_at(g, index);
    vec2 over_height = has_heights() ? along_z(g, slopes) : vec2(0.0);
    P.leaves.at[atomicAdd(P.head.at[HEAD_CELLS], 1u)] =
        RefinedLeaf(g.x_low, g.x_high, g.z_low, g.z_high, at, ray_at(patch_, at.x, at.y), P.all_results.at[traced],
                    slopes.depth.x, slopes.displacement.x, over_height.x, over_height.y, patch_.column, patch_.row, 0u);
}
