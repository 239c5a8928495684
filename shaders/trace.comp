#version 460
// Traces a list of rays to first order: moments, and their law at one energy.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#ifdef BACKEND_RAY_QUERY
#extension GL_EXT_ray_query : require
#endif
#ifdef PACKETS
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#endif
#include "interface.glsl"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform TracePush {
    SampleRef sample_ref;
    Rays rays;
    Words moments;  // [ray][MOMENTS_HEAD + materials * MOMENTS_PER_MATERIAL]
    Laws laws;
    Words exact;      // [0]: count, then indices of rays to trace in order
    Words unbalanced; // [0]: count, then indices of rays to trace again
    Words list;       // [0]: count, then indices of rays to trace, where `listed`
    Words tally;
    uint count;
    uint materials;
    uint listed;
    uint last;   // no further attempt follows
    float nudge; // moves the rays in x, and in z by 0.7 of it, m
} push;

#define sample_ push.sample_ref.at[0]

#include "walk/triangle.glsl"
#include "physics/refraction.glsl"
#include "walk/order.glsl"
#include "walk/moments.glsl"
#ifdef BACKEND_RAY_QUERY
#include "walk/ray_query.glsl"
#else
#include "walk/bvh.glsl"
#endif

Law law_of(Floats moments, Walk walk) {
    Law law = Law(0.0, 0.0, 0.0, 0.0, 0.0, walk.signature, walk.flags, walk.crossings);
    for (uint m = 0u; m < push.materials; m++) {
        Constants k = sample_.constants.at[m];
        uint base = walk.base + m * MOMENTS_PER_MATERIAL;
        law.optical_depth += k.mu * moments.at[base];
        law.displacement_x += k.delta * moments.at[base + 1];
        law.displacement_z += k.delta * moments.at[base + 2];
        law.slope_x += k.delta * moments.at[base + 3];
        law.slope_z += k.delta * moments.at[base + 4];
    }
    return law;
}

bool finite(Law law) {
    float sum = abs(law.optical_depth) + abs(law.displacement_x) + abs(law.displacement_z);
    return sum < 1e30; // false for NaN too
}

void main() {
    uint index = gl_GlobalInvocationID.x;
#ifdef PACKETS
    // Lanes without a ray of their own help to load for the others.
    bool live = index < push.count;
    index = min(index, push.count - 1u);
#else
    if (index >= push.count) return;
#endif
    if (push.listed != 0u) index = push.list.at[1u + index];
    Ray ray = push.rays.at[index];
    ray.x += push.nudge;
    ray.z += 0.7 * push.nudge;
    Beam beam = beam_of(ray, sample_.views.at[ray.view]);

    uint stride = MOMENTS_HEAD + push.materials * MOMENTS_PER_MATERIAL;
    uint head = index * stride;
    Floats moments = Floats(push.moments);
    Walk walk = walk_begin(head + MOMENTS_HEAD);
#ifdef PACKETS
    if (live) {
        for (uint i = MOMENTS_HEAD; i < stride; i++) moments.at[head + i] = 0.0;
    }
    walk_together(live, beam, moments, walk);
    if (!live) return;
#else
    for (uint i = MOMENTS_HEAD; i < stride; i++) moments.at[head + i] = 0.0;
    walk_all(beam, moments, walk);
#endif
    walk_flush(moments, walk);
    if (walk.balance != 0u) walk.flags |= FLAG_UNBALANCED;
    if (walk.grazing < 1.0) walk.flags |= FLAG_GRAZING;
    walk.flags |= uint(255.0 * min(walk.grazing, 1.0)) << FLAG_SHARE_SHIFT;

    Law law = law_of(moments, walk);
    if (!finite(law)) law.flags |= FLAG_NOT_FINITE;
    push.laws.at[index] = law;
    push.moments.at[head] = walk.signature;
    push.moments.at[head + 1u] = walk.balance;
    push.moments.at[head + 2u] = law.flags;
    push.moments.at[head + 3u] = walk.crossings;
    if ((law.flags & FLAG_NOT_FINITE) != 0u) atomicAdd(push.tally.at[TALLY_NOT_FINITE], 1u);
    if ((law.flags & FLAG_UNBALANCED) != 0u) {
        if (push.last != 0u) {
            atomicAdd(push.tally.at[TALLY_UNBALANCED], 1u);
        } else {
            uint slot = atomicAdd(push.unbalanced.at[0], 1u);
            push.unbalanced.at[1u + slot] = index;
        }
    } else if ((law.flags & FLAG_GRAZING) != 0u) {
        uint slot = atomicAdd(push.exact.at[0], 1u);
        push.exact.at[1u + slot] = index;
    }
}
