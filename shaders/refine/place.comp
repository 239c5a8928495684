#version 460
// Puts the parts of cell rows of a spectrum in order, list by list.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"
#include "refine/head.glsl"

void main() {
    uint row;
    if (!item_of(STAGE_PLACE, row)) return;
    uint first = S.counts.at[2u * (S.groups + S.nodes) + 1u + S.marks.at[3u * row]];
    uint slot = S.marks.at[3u * row + 2u];
    P.parts.at[first + S.marks.at[3u * row + 1u]] = CellRowPart(slot, 0u, P.cell_rows.at[slot].cell_count);
}
