#version 460
// Sets the error from which on the rectangles of a patch are split.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"
#include "refine/head.glsl"
#include "refine/rectangle.glsl"
#include "refine/worst.glsl"

// Part of its error that a rectangle loses when it is split.
const float LOST = 8.0 / 9.0;
// Splitting ends, too, where what stays whole has less than this share of the budget.
const float UNSPLIT = 0.5;

void main() {
    uint patch_index;
    if (!item_of(STAGE_BUDGET, patch_index)) return;
    uint words = sums_of(patch_index);
    if ((P.sums.at[words + PATCH_FLAGS] & PATCH_IS_DONE) != 0u) return;
    bool turns = has_turns(patch_index);
    float worst = worst_square(patch_index, turns);
    uint left = P.max_rays - min(P.sums.at[words + PATCH_RAYS], P.max_rays);
    float all = 0.0;
    for (uint octave = 0u; octave < OCTAVES; octave++) all += sum_of_octave(patch_index, turns, octave);
    float rest = all;
    float unsplit = all;
    float goal = all / max(worst, 1e-9);
    float threshold = -1.0;
    int octave = int(OCTAVES) - 1;
    bool splits = worst > 1.0;
    while (splits && octave >= 0 && rest > goal && unsplit > UNSPLIT * goal) {
        uint count = P.sums.at[octaves_of(patch_index, turns) + OCTAVES + uint(octave)];
        splits = count <= left / 2u;
        if (splits && count > 0u) {
            float here = sum_of_octave(patch_index, turns, uint(octave));
            rest -= LOST * here;
            unsplit -= here;
            left -= 2u * count;
            threshold = exp2(float(octave - int(LOWEST_OCTAVE)));
        }
        octave--;
    }
    P.sums.at[words + PATCH_THRESHOLD] = floatBitsToUint(threshold);
    if (threshold < 0.0) P.sums.at[words + PATCH_FLAGS] |= PATCH_IS_DONE;
}
