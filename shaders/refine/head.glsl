// Parameters of the refinement, and the dispatches that the device sizes itself.

#include "interface/RefinePush.glsl"

#define P push.params.at[0]
// Energies, where the scene has a spectrum.
#define S P.spectrum.at[0]

layout(local_size_x = GROUP) in;

// Words that are kept of the moments of a ray.
uint kept_stride() {
    return S.material_count * KEPT_WORDS + S.pair_count;
}

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

bool has_spectrum() {
    return uvec2(P.spectrum) != uvec2(0u);
}

// Whether the host makes the cells.
bool hands_leaves() {
    return uvec2(P.leaves) != uvec2(0u);
}

// Whether apertures of masks end along z.
bool has_heights() {
    return uvec2(P.heights) != uvec2(0u);
}

// Cells of a rectangle in the row of its run, by list. Energies that share no cell beyond these have rows of their
// own.
const uint BANDS = 3u;

// Most cells of a rectangle: one, or one of each energy in each group beside the places in its row.
uint most_cells() {
    return has_spectrum() ? (S.nodes + BANDS) * max(S.groups, 1u) : 1u;
}
