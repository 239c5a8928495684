#version 460
// Gives new rectangles the results of their rays.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"
#include "refine/head.glsl"

void main() {
    uint ray;
    if (!item_of(STAGE_KEEP, ray)) return;
    uint base = HEAD_STAGES + STAGE_BASE * STAGE_WORDS;
    uint split = P.head.at[HEAD_STAGES + STAGE_SPLIT * STAGE_WORDS + 1u];
    uint index = P.head.at[base] + ray;
    if (split != 0u) {
        index = P.head.at[HEAD_RECTANGLES] - 3u * split + 3u * (ray / 2u) + 2u * (ray % 2u);
    }
    RayResult result = P.results.at[ray];
    P.rectangles.at[index].optical_depth = result.optical_depth;
    P.rectangles.at[index].displacement = result.displacement_x;
    P.rectangles.at[index].landing = result.displacement_z + P.gap * result.slope_z;
    P.rectangles.at[index].pixel_shift = result.displacement_x * (1.0 - P.ratio)
        - result.slope_x * P.gap * P.ratio;
    P.rectangles.at[index].signature = result.signature;
    uint most = (1u << (32u - RECTANGLE_CROSSINGS)) - 1u;
    uint flags = result.flags & ((1u << RECTANGLE_CROSSINGS) - 1u);
    P.rectangles.at[index].flags = flags | min(result.crossings, most) << RECTANGLE_CROSSINGS;
}
