#version 460
// Makes cells of rectangles.
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

// Linear result of a rectangle along x.
RaySlopes slopes_along_x(Rectangle g, uint index) {
    if (is_even(g.patch_index)) return RaySlopes(vec2(0.0), vec2(0.0));
    Found own = found_of(g, index, vec2(0.0));
    vec2 x = beside_x(g);
    Found found[4];
    bool same[4] = bool[4](false, false, false, false);
    found[0] = found_at(index, g.patch_index, x.x, own.at.y);
    found[1] = found_at(index, g.patch_index, x.y, own.at.y);
    found[2] = found[3] = own;
    for (uint side = 0u; side < 2u; side++) {
        same[side] = found[side].known && alike(found[side], own);
    }
    RaySlopes slopes = slopes_of(own, found, same);
    float width = g.x_high - g.x_low;
    float steepest = 0.5 * P.magnification;
    slopes.displacement.x = clamp(slopes.displacement.x, -steepest, steepest);
    slopes.depth.x = clamp(slopes.depth.x, -abs(g.optical_depth) / width, abs(g.optical_depth) / width);
    return slopes;
}

Cell cell_of(Rectangle g, uint index, Rows rows, bool hit) {
    RaySlopes slopes = slopes_along_x(g, index);
    vec2 ends = 0.5 * (g.x_high - g.x_low) * vec2(-1.0, 1.0);
    vec2 depth = g.optical_depth + ends * (hit ? slopes.depth.x : 0.0);
    vec2 displacement = g.displacement + ends * (hit ? slopes.displacement.x : 0.0);
    return Cell(g.x_low, g.x_high, depth.x, depth.y, displacement.x, displacement.y, g.landing, rows.above,
                rows.below, g.pixel_shift, g.variance, 0.0, 0.0, 0.0, 0.0);
}

void main() {
    uint item;
    if (!item_of(STAGE_EMIT, item)) return;
    uint index = P.made.at[3u * item];
    Rectangle g = rectangle_at(index);
    Rows rows = rows_of(g, g.landing);
    count_landing(g.landing);
    P.cells.at[P.made.at[3u * item + 1u]] = cell_of(g, index, rows, is_hit(g.patch_index));
}
