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

// Largest rectangles at the borders of patches near silhouettes: bodies may enter between rays.
const float WIDEST = 1.0 / 17.0;
const float HIGHEST = 1.0 / 5.0;

bool looks_at(Rectangle g) {
    bool near = (P.sums.at[sums_of(g.patch_index) + PATCH_FLAGS] & PATCH_IS_NEAR) != 0u;
    bool at_border = g.x_low <= -0.5 * P.period || g.x_high >= 0.5 * P.period || g.z_low <= 0.0 || g.z_high >= 1.0;
    bool large = g.x_high - g.x_low > WIDEST * P.period || g.z_high - g.z_low > HIGHEST;
    return near && at_border && large && g.weight > 0.0 && P.head.at[HEAD_LEVELS] < LOOKS;
}

void main() {
    uint item;
    if (!item_of(STAGE_SELECT, item)) return;
    uint list = P.head.at[HEAD_LIST];
    uint index = P.lists.at[list * P.room + item];
    Rectangle g = P.rectangles.at[index];
    uint words = sums_of(g.patch_index);
    if ((P.sums.at[words + PATCH_FLAGS] & (PATCH_IS_DONE | PATCH_IS_EVEN)) != 0u) return;
    // As the budget counted it.
    float counted = min(counted_of(g, has_turns(g.patch_index)), 4095.0);
    float threshold = uintBitsToFloat(P.sums.at[words + PATCH_THRESHOLD]);
    bool chosen = counted > 0.0 && counted >= threshold;
    if (!chosen && looks_at(g)) {
        bool along_x = g.x_high - g.x_low > WIDEST * P.period;
        P.rectangles.at[index].flags = (g.flags & ~RECTANGLE_ALONG_X) | (along_x ? RECTANGLE_ALONG_X : 0u);
        chosen = true;
    }
    if (chosen) {
        count(g, false);
        // Even patches take places, too. Without room for all, the level ends at a place before the end of the list.
        uint slot = atomicAdd(P.head.at[HEAD_SPLITS], 1u);
        if (slot < P.room) P.splits.at[slot] = index;
    } else {
        P.lists.at[(1u - list) * P.room + atomicAdd(P.head.at[HEAD_LISTED + 1u - list], 1u)] = index;
    }
}
