#version 460
// Makes cells of leaked light, which was merged over the rectangles of a patch.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"
#include "refine/head.glsl"
#include "physics/gauss.glsl"
#include "refine/rectangle.glsl"
#include "refine/made.glsl"
#include "refine/shares.glsl"
#include "refine/spectrum.glsl"
#include "refine/merged.glsl"

// Largest change of the light of a cell from its middle to an end, share of it.
const float MOST_TILT = 1.0 / 3.0;

// The cell of a column of a group.
Cell cell_of_column(uint words, Rectangle g) {
    float light = merged_at(words);
    if (!(light > 0.0)) return no_cell(g);
    float place = merged_at(words + 1u) / light;
    float moved = merged_at(words + 3u) / light;
    float spread = max(merged_at(words + 2u) / light - place * place, 1e-6);
    float rise = merged_at(words + 4u) / light - place * moved;
    // Half the rise of the displacement over the column, on a straight line.
    float most = 0.25 * P.magnification * (g.x_high - g.x_low) / S.reach;
    float slope = clamp(rise / spread, -most, most);
    float square = merged_at(words + 5u) / light - moved * moved;
    float variance = max(square - 2.0 * slope * rise + slope * slope * spread, 0.0);
    float tilt = clamp(3.0 * place, -MOST_TILT, MOST_TILT);
    // Light falls off exponentially between the ends: these are such that the cell has the light of its parts.
    float fall = log((1.0 + tilt) / (1.0 - tilt));
    float mean = sqrt(1.0 - tilt * tilt) * (1.0 + fall * fall / 24.0);
    vec2 depth = -log(light * vec2(1.0 - tilt, 1.0 + tilt) / mean);
    // Light that lies farther to a side than the ends say lands there, too.
    float aside = (place - tilt / 3.0) * 0.5 * (g.x_high - g.x_low) * P.magnification;
    float centre = (moved - slope * place) * S.reach + aside;
    vec2 displacement = centre + slope * S.reach * vec2(-1.0, 1.0);
    float landing = merged_at(words + 6u) / light * P.row_pitch;
    float pixel_shift = shift_of(moved * S.reach, merged_at(words + 7u) / light);
    vec2 narrowing = vec2(merged_at(words + 10u), merged_at(words + 11u)) * MOST_NARROWING / light;
    vec2 narrowing_x = vec2(merged_at(words + 12u), merged_at(words + 13u)) * MOST_NARROWING / light;
    vec2 covariance = (narrowing_x - narrowing * moved) * S.reach;
    // A wide blur of rows is computed with the light.
    bool wide = P.row_blur > WIDE;
    float above = wide ? -1.0 : clamp(merged_at(words + 8u) / light, 0.0, 1.0);
    float below = wide ? 0.0 : clamp(merged_at(words + 9u) / light, 0.0, 1.0 - above);
    return Cell(g.x_low, g.x_high, depth.x, depth.y, displacement.x, displacement.y, landing, above, below,
                pixel_shift, variance * S.reach * S.reach, narrowing.x, narrowing.y, covariance.x,
                covariance.y);
}

void main() {
    uint patch_index;
    if (!item_of(STAGE_MERGE, patch_index)) return;
    RefinedPatch patch_ = P.patches.at[patch_index];
    uint shares = shares_of(patch_);
    if (is_apart(shares)) return;
    Rectangle g;
    g.z_low = 0.0;
    g.z_high = 1.0;
    for (uint group = 0u; group < S.groups; group++) {
        uint columns = columns_of(shares_at(shares), group);
        Made made = made_from(columns == 0u ? 0u : atomicAdd(P.head.at[HEAD_CELLS], columns));
        for (uint column = 0u; column < columns; column++) {
            g.x_low = low_of_column(column, columns);
            g.x_high = low_of_column(column + 1u, columns);
            Cell cell = cell_of_column(merged_of(patch_index, group) + column * MERGED_WORDS, g);
            if (!has_light(cell)) continue;
            P.cells.at[made.first + made.count] = cell;
            take_cell(made, cell);
        }
        push_row(group, g, patch_, made);
    }
}
