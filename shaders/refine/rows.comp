#version 460
// Makes cell rows of the cells of runs.
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

// Moves the cells that have light to the first places of their row. A row is kept whole where a cell is wanted,
// since faint light is a sum over the row; other rows lose all cells.
Made made_of(uint first, uint count, Rectangle g, RefinedPatch patch_) {
    Made made = made_from(first);
    bool wanted = false;
    for (uint i = 0u; i < count; i++) {
        wanted = wanted || is_wanted(g, patch_, P.cells.at[first + i]);
    }
    if (!wanted) return made;
    for (uint i = 0u; i < count; i++) {
        Cell cell = P.cells.at[first + i];
        if (!has_light(cell)) continue;
        if (first + i != made.first + made.count) P.cells.at[made.first + made.count] = cell;
        take_cell(made, cell);
    }
    return made;
}

// A row of the only list at one energy.
void push_only(Rectangle g, RefinedPatch patch_, Made made) {
    if (made.count == 0u) return;
    uint part = atomicAdd(P.head.at[made.is_near ? HEAD_NEAR : HEAD_FAR], 1u);
    P.cell_rows.at[made.first] = row_of(made, g, patch_);
    P.parts.at[(made.is_near ? 0u : P.cell_room) + part] = CellRowPart(made.first, 0u, made.count);
}

void main() {
    uint run;
    if (!item_of(STAGE_ROWS, run)) return;
    uint item = P.runs.at[2u * run];
    Rectangle g = rectangle_at(P.made.at[3u * item]);
    uint first = P.made.at[3u * item + 1u];
    uint count = P.made.at[3u * item + 2u];
    RefinedPatch patch_ = P.patches.at[g.patch_index];
    if (!has_spectrum()) {
        push_only(g, patch_, made_of(first, count, g, patch_));
        return;
    }
    uint words = shares_of(patch_);
    bool apart = is_apart(words);
    uint list = apart ? S.groups : 0u;
    uint end = apart ? S.groups + S.nodes : S.groups;
    for (; list < end; list++) {
        if (!apart && columns_of(shares_at(words), list) != 0u) continue;
        push_row(list, g, patch_, made_of(first, count, g, patch_));
        first += count;
    }
}
