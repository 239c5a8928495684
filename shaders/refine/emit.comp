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

Cell cell_of(Rectangle g, uint index, Rows rows, bool hit) {
    RaySlopes slopes = limited_slopes_at(g, index);
    vec2 ends = 0.5 * (g.x_high - g.x_low) * vec2(-1.0, 1.0);
    vec2 depth = g.optical_depth + ends * (hit ? slopes.depth.x : 0.0);
    vec2 displacement = g.displacement + ends * (hit ? slopes.displacement.x : 0.0);
    vec2 shares = vec2(rows.above, rows.below);
    if (has_heights()) shares = hit ? along_z(g, slopes) : vec2(0.0);
    return Cell(g.x_low, g.x_high, depth.x, depth.y, displacement.x, displacement.y, g.landing, shares.x,
                shares.y, g.pixel_shift, g.variance, 0.0, 0.0, 0.0, 0.0);
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
