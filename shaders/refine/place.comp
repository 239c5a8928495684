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
    uint slot;
    if (!item_of(STAGE_PLACE, slot)) return;
    RefinedSpectrum s = P.spectrum.at[0];
    uint kinds = 2u * (s.groups + s.nodes);
    uint first = s.counts.at[kinds + 1u + s.marks.at[2u * slot]];
    P.parts.at[first + s.marks.at[2u * slot + 1u]] = CellRowPart(slot, 0u, 1u);
}
