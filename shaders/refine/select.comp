#version 460
// Chooses the rectangles to split, and keeps the others for later levels.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"
#include "refine/head.glsl"
#include "refine/rectangle.glsl"

void main() {
    uint item;
    if (!item_of(STAGE_SELECT, item)) return;
    uint list = P.head.at[HEAD_LIST];
    uint index = P.lists.at[list * P.room + item];
    Rectangle g = P.rectangles.at[index];
    uint words = sums_of(g.patch_index);
    if ((P.sums.at[words + PATCH_FLAGS] & PATCH_IS_DONE) != 0u) return;
    // As the budget counted it.
    float counted = min(counted_of(g, has_turns(g.patch_index)), 4095.0);
    float threshold = uintBitsToFloat(P.sums.at[words + PATCH_THRESHOLD]);
    if (counted > 0.0 && counted >= threshold) {
        count(g, false);
        P.splits.at[atomicAdd(P.head.at[HEAD_SPLITS], 1u)] = index;
    } else {
        P.lists.at[(1u - list) * P.room + atomicAdd(P.head.at[HEAD_LISTED + 1u - list], 1u)] = index;
    }
}
