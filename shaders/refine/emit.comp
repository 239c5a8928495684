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

// Blur of rows from which on light goes beyond the rows beside, share of a row.
const float WIDE = 1.0 / 6.0;
// Standard deviations that a blur reaches.
const float BLURS = 6.0;

// Share of light spread evenly over [low, high] and blurred that lies before a border.
float share_before(float border, float low, float high) {
    float blur = P.row_blur;
    if (blur <= 0.0) return clamp((border - low) / (high - low), 0.0, 1.0);
    float near = (border - high) / blur;
    float far = (border - low) / blur;
    if (far - near > 0.25) return clamp((ramp(far) - ramp(near)) / (far - near), 0.0, 1.0);
    // The difference would lose its digits: Simpson's rule.
    float density, a, b, c;
    normal(near, density, a);
    normal(0.5 * (near + far), density, b);
    normal(far, density, c);
    return (a + 4.0 * b + c) / 6.0;
}

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
    bool hit = (P.sums.at[sums_of(g.patch_index) + PATCH_FLAGS] & PATCH_IS_HIT) != 0u;
    // A patch that misses the sample is one cell.
    if (!hit && (index != patch_.first || patch_.is_lit == 0u)) return;
    if (hit && (g.parts != 0u || (g.flags & FLAG_NOT_FINITE) != 0u)) return;
    if (!hit) {
        g.x_low = -0.5 * P.period;
        g.x_high = 0.5 * P.period;
        g.z_low = 0.0;
        g.z_high = 1.0;
    }
    float down = -g.landing / P.row_pitch;
    float low = g.z_low + down;
    float high = g.z_high + down;
    float reach = BLURS * P.row_blur;
    if (abs(down) > P.halo) atomicAdd(P.report.at[REPORT_LANDED_OFF], 1u);
    float row = float(patch_.row);
    if (row + high + reach < float(P.wanted[0]) || row + low - reach > float(P.wanted[1])) return;
    RaySlopes slopes = slopes_along_x(g, index);
    float width = g.x_high - g.x_low;
    vec2 ends = 0.5 * width * vec2(-1.0, 1.0);
    vec2 depth = g.optical_depth + ends * (hit ? slopes.depth.x : 0.0);
    vec2 displacement = g.displacement + ends * (hit ? slopes.displacement.x : 0.0);
    bool is_near = P.row_blur <= WIDE && low - reach >= -1.0 && high + reach <= 2.0;
    float above = is_near ? share_before(0.0, low, high) : -1.0;
    float below = is_near ? min(1.0 - share_before(1.0, low, high), 1.0 - above) : 0.0;
    float rise = depth.y - depth.x;
    float light = width * exp(-0.5 * (depth.x + depth.y)) * (1.0 + rise * rise / 24.0);
    float low_landing = min(displacement.x, displacement.y) - g.pixel_shift;
    float high_landing = max(displacement.x, displacement.y) - g.pixel_shift;
    uint part = atomicAdd(P.head.at[is_near ? HEAD_NEAR : HEAD_FAR], 1u);
    uint slot = gl_GlobalInvocationID.x + P.head.at[HEAD_CELLS]
        - P.head.at[HEAD_STAGES + STAGE_EMIT * STAGE_WORDS + 1u];
    P.cells.at[slot] = Cell(g.x_low, g.x_high, depth.x, depth.y, displacement.x, displacement.y,
                            g.landing, above, below, g.pixel_shift, 0.0, 0.0, 0.0, 0.0, 0.0);
    P.cell_rows.at[slot] = CellRow(slot, 1u, patch_.column, patch_.row, g.z_low, g.z_high, 1u, light,
                                   low_landing, high_landing, 0.0,
                                   abs(displacement.y - displacement.x) / width);
    P.parts.at[(is_near ? 0u : P.cell_room) + part] = CellRowPart(slot, 0u, 1u);
}
