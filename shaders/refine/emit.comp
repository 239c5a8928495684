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
#include "refine/slopes.glsl"
#include "refine/made.glsl"

// Linear result of a rectangle along x.
RaySlopes slopes_along_x(Rectangle g, uint index) {
    Found own = found_of(g, index, vec2(0.0));
    float out_ = max(1e-4 * (g.x_high - g.x_low), P.beside.x);
    Found found[4];
    bool same[4] = bool[4](false, false, false, false);
    found[0] = found_at(index, g.patch_index, g.x_low - out_, own.at.y);
    found[1] = found_at(index, g.patch_index, g.x_high + out_, own.at.y);
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

void main() {
    uint index;
    if (!item_of(STAGE_EMIT, index)) return;
    Rectangle g = P.rectangles.at[index];
    RefinedPatch patch_ = P.patches.at[g.patch_index];
    bool hit = is_hit(g.patch_index);
    if (!has_cells(g, patch_, index, hit)) return;
    Rows rows = rows_of(g, g.landing);
    if (!is_wanted(patch_, rows, g.landing)) return;
    RaySlopes slopes = slopes_along_x(g, index);
    vec2 ends = 0.5 * (g.x_high - g.x_low) * vec2(-1.0, 1.0);
    vec2 depth = g.optical_depth + ends * (hit ? slopes.depth.x : 0.0);
    vec2 displacement = g.displacement + ends * (hit ? slopes.displacement.x : 0.0);
    uint part = atomicAdd(P.head.at[rows.is_near ? HEAD_NEAR : HEAD_FAR], 1u);
    uint slot = gl_GlobalInvocationID.x + P.head.at[HEAD_CELLS]
        - P.head.at[HEAD_STAGES + STAGE_EMIT * STAGE_WORDS + 1u];
    Cell cell = Cell(g.x_low, g.x_high, depth.x, depth.y, displacement.x, displacement.y, g.landing,
                     rows.above, rows.below, g.pixel_shift, 0.0, 0.0, 0.0, 0.0, 0.0);
    write_cell(slot, g, patch_, cell);
    P.parts.at[(rows.is_near ? 0u : P.cell_room) + part] = CellRowPart(slot, 0u, 1u);
}
