#version 460
// Gives new rectangles the results of their rays; with ENERGIES the moments, too.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"
#include "refine/head.glsl"
#include "refine/rectangle.glsl"

#ifdef ENERGIES

// Keeps the moments of a ray in the materials that act on light, and what rough surfaces between them spread.
void keep_moments(uint ray, uint index) {
    uint own = index * kept_stride();
    for (uint p = 0u; p < S.pair_count; p++) {
        S.kept.at[own + S.material_count * KEPT_WORDS + p] = S.traced.at[ray * S.stride + S.pairs.at[p]];
    }
    for (uint m = 0u; m < S.material_count; m++) {
        uint from = ray * S.stride + MOMENTS_HEAD + S.materials.at[m] * MOMENTS_PER_MATERIAL;
        uint to = own + m * KEPT_WORDS;
        Floats traced = S.traced;
        Floats kept = S.kept;
        kept.at[to] = traced.at[from + MOMENTS_PATH];
        kept.at[to + 1u] = traced.at[from + MOMENTS_LEVER];
        kept.at[to + 2u] = traced.at[from + MOMENTS_LEVER + 1u]
            + P.gap * traced.at[from + MOMENTS_SLOPE + 1u];
        kept.at[to + 3u] = traced.at[from + MOMENTS_SLOPE];
    }
}
#endif

void main() {
    uint ray;
    if (!item_of(STAGE_KEEP, ray)) return;
    uint base = HEAD_STAGES + STAGE_BASE * STAGE_WORDS;
    uint split = P.head.at[HEAD_STAGES + STAGE_SPLIT * STAGE_WORDS + 1u];
    uint index = P.head.at[base] + ray;
    if (split != 0u) {
        index = P.head.at[HEAD_RECTANGLES] - 3u * split + 3u * (ray / 2u) + 2u * (ray % 2u);
    }
    RayResult result = P.results.at[ray];
    P.rectangles.at[index].optical_depth = result.optical_depth;
    P.rectangles.at[index].displacement = result.displacement_x;
    P.rectangles.at[index].landing = result.displacement_z + P.gap * result.slope_z;
    P.rectangles.at[index].pixel_shift = result.displacement_x * (1.0 - P.ratio)
        - result.slope_x * P.gap * P.ratio;
    P.rectangles.at[index].variance = result.displacement_variance;
    P.rectangles.at[index].signature = result.signature;
    uint share = result.flags >> FLAG_SHARE_SHIFT << FLAG_SHARE_SHIFT;
    uint flags = result.flags & ((1u << RECTANGLE_CROSSINGS) - 1u);
    uint crossings = min(result.crossings, MOST_CROSSINGS);
    P.rectangles.at[index].flags = share | crossings << RECTANGLE_CROSSINGS | flags;
    if (hands_leaves()) P.all_results.at[index] = result;
#ifdef ENERGIES
    keep_moments(ray, index);
#endif
}
