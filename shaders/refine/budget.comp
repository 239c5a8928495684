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
#include "refine/even.glsl"
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

// Crossings of a ray, on average, from which on structure may be too fine for rays.
const uint FINE_CROSSINGS = 8u;
// Squared error of the mean of two rays over their squared difference, from which on rays do not resolve a patch: 3/4 for
// random light, 1/4 at a jump, 0 for smooth light.
const float UNLIKE = 0.3;
// Rays of the first trial.
const float FIRST_TRIAL = 48.0;
// Part of the budget that the number of rays aims at for the worst mask step.
const float AIM = 0.4;
// The same with a single step, where the root mean square should be a third of the budget.
const float AIM_OF_ONE = 0.3;
// Part of the budget up to which rays that were settled on are left as they are.
const float ACCEPTED = 0.9;
// Largest growth of the number of rays after a trial, and after one of few rays, which is less exact.
const float MOST_GROWTH = 100.0;
const float MOST_GROWTH_OF_FEW = 8.0;
const float FEW = 256.0;
// Least and most lines.
const float LEAST_LINES = 4.0;
const float MOST_LINES = 64.0;

// Whether rays cross many surfaces, and those beside them do not predict their light.
bool is_unresolved(uint words) {
    return P.sums.at[words + PATCH_CROSSINGS] > FINE_CROSSINGS * P.sums.at[words + PATCH_COUNTED]
        && changes_at(words + PATCH_CHANGES) > UNLIKE * changes_at(words + PATCH_FAR_CHANGES);
}

// Lists about this number of new rays for a patch, in place of all that it has, if that is not less than `least`.
bool spread(uint patch_index, float wanted, uint least) {
    uint words = sums_of(patch_index);
    uint left = P.max_rays - min(P.sums.at[words + PATCH_RAYS], P.max_rays);
    float most = min(float(left), P.period / P.least.x);
    uint lines = 1u << findMSB(uint(clamp(0.5 * sqrt(min(wanted, most)), LEAST_LINES, MOST_LINES)));
    uint columns = uint(ceil(wanted / float(lines)));
    columns = min(columns, uint(most / float(lines)));
    uint count = lines * columns;
    if (count <= least) return false;
    uint end = sums_of(patch_index + 1u);
    for (uint word = words + PATCH_CHANGES; word < end; word++) P.sums.at[word] = 0u;
    uint slot = atomicAdd(P.head.at[HEAD_SPLITS], count / 2u);
    P.sums.at[words + PATCH_EVEN_FIRST] = P.head.at[HEAD_RECTANGLES] + 3u * slot;
    P.sums.at[words + PATCH_EVEN_COUNT] = count;
    P.sums.at[words + PATCH_EVEN_LINES] = lines;
    uvec2 open = open_parts(P.patches.at[patch_index]);
    P.sums.at[words + PATCH_EVEN_OPEN] = open.x;
    P.sums.at[words + PATCH_EVEN_OPEN + 1u] = open.y;
    // Without room for all, their level ends before it takes those beyond.
    for (uint i = slot; i < min(slot + count / 2u, P.room); i++) P.splits.at[i] = SPLIT_IS_EVEN | patch_index;
    return true;
}

// Spreads more rays over a patch than it has; false if these are enough.
bool spread_more(uint patch_index) {
    uint words = sums_of(patch_index);
    uint count = P.sums.at[words + PATCH_EVEN_COUNT];
    bool settled = (P.sums.at[words + PATCH_FLAGS] & PATCH_IS_SETTLED) != 0u;
    // As it is reported, of the tolerance.
    float off = P.reported * sqrt(worst_square(patch_index, false)) / float(P.tolerance);
    if (settled && off <= ACCEPTED) return false;
    // The square of the error is inverse to the number of rays, and as the squared change from one to the next.
    float aim = P.steps > 1u ? AIM : AIM_OF_ONE;
    float growth = pow(off / aim, 2.0 / (1.0 + log2(growth_of(patch_index))));
    if (growth <= 1.0) return false;
    float most = float(count) < FEW ? MOST_GROWTH_OF_FEW : MOST_GROWTH;
    if (growth <= most) P.sums.at[words + PATCH_FLAGS] |= PATCH_IS_SETTLED;
    return spread(patch_index, min(growth, most) * float(count), count);
}

void main() {
    uint patch_index;
    if (!item_of(STAGE_BUDGET, patch_index)) return;
    uint words = sums_of(patch_index);
    if ((P.sums.at[words + PATCH_FLAGS] & PATCH_IS_DONE) != 0u) return;
    bool even = is_even(patch_index);
    if (even || (is_unresolved(words) && worst_square(patch_index, false) > 1.0)) {
        bool more = even ? spread_more(patch_index) : spread(patch_index, FIRST_TRIAL, 0u);
        uint flags = even ? 0u : PATCH_IS_EVEN | PATCH_IS_CROSSED | PATCH_IS_HIT;
        P.sums.at[words + PATCH_FLAGS] |= more ? flags : PATCH_IS_DONE;
        return;
    }
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
