// Parameters of the refinement, and the dispatches that the device sizes itself.

#include "interface/RefinePush.glsl"

#define P push.params.at[0]

layout(local_size_x = GROUP) in;

// The item of this invocation; false where a stage has fewer.
bool item_of(uint stage, out uint item) {
    uint words = HEAD_STAGES + stage * STAGE_WORDS;
    item = gl_GlobalInvocationID.x;
    bool is_item = item < P.head.at[words + 1u];
    item += P.head.at[words];
    return is_item;
}

// First word of the sums of a patch.
uint sums_of(uint patch_index) {
    return patch_index * (PATCH_HEAD + 4u * OCTAVES + 4u * (P.steps + 1u));
}

// First word of its sums of errors by step: of the light, then of the displacement.
uint step_sums_of(uint patch_index) {
    return sums_of(patch_index) + PATCH_HEAD + 4u * OCTAVES;
}

// Cells that a rectangle may have: one, or one of each energy in each group, and what its row keeps free.
uint most_cells() {
    if (uvec2(P.spectrum) == uvec2(0u)) return 1u;
    return (P.spectrum.at[0].nodes + 3u) * max(P.spectrum.at[0].groups, 1u);
}
