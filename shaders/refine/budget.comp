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

// Whether base rays of the patch and of patches beside it crossed different surfaces.
bool is_near_silhouette(uint patch_index) {
    RefinedPatch patch_ = P.patches.at[patch_index];
    uint beside[5] = uint[5](patch_index, patch_.low, patch_.high, patch_.above, patch_.below);
    // What enters beside the recorded rows is not seen.
    if (patch_.row < P.recorded[0] || patch_.row >= P.recorded[1]) return false;
    uint signature = P.rectangles.at[patch_.first].signature;
    bool near = false;
    for (uint i = 0u; i < 5u; i++) {
        if (beside[i] == PATCH_UNKNOWN) continue;
        if (beside[i] == PATCH_MISSED) {
            near = near || signature != 0u;
            continue;
        }
        RefinedPatch other = P.patches.at[beside[i]];
        uint end = other.first + other.base[0] * other.base[1];
        for (uint index = other.first; index < end; index++) {
            near = near || P.rectangles.at[index].signature != signature;
        }
    }
    return near;
}

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
    if (P.head.at[HEAD_LEVELS] == 0u && is_near_silhouette(patch_index)) {
        P.sums.at[words + PATCH_FLAGS] |= PATCH_IS_NEAR;
    }
    bool looks = (P.sums.at[words + PATCH_FLAGS] & PATCH_IS_NEAR) != 0u
        && P.head.at[HEAD_LEVELS] < LOOKS;
    // Nothing but the borders.
    if (threshold < 0.0 && looks) threshold = 1e30;
    P.sums.at[words + PATCH_THRESHOLD] = floatBitsToUint(threshold);
    if (threshold < 0.0) P.sums.at[words + PATCH_FLAGS] |= PATCH_IS_DONE;
}
