#version 460
// Lists the first crossings of every ray in order, for pictures of the sample.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform CrossingsPush {
    SampleRef sample_ref;
    Rays rays;
    MetSurfaces met; // [ray][most]
    Words counts;    // [ray]
    uint count;
    uint first;
    uint most;
} push;

#define sample_ push.sample_ref.at[0]

#include "walk/triangle.glsl"
#include "physics/refraction.glsl"
#include "walk/order.glsl"
#include "walk/bvh.glsl"

void main() {
    uint index = push.first + gl_GlobalInvocationID.x;
    if (index >= push.count) return;
    Ray ray = push.rays.at[index];
    Beam beam = beam_of(ray, sample_.views.at[ray.view]);
    float y = -1e30;
    uint id = 0xffffffffu;
    uint found = 0u;
    Crossing crossing;
    while (found < push.most && next(beam, y, id, crossing)) {
        y = crossing.y;
        id = crossing.id;
        uint object = sample_.surfaces.at[crossing.surface].object;
        push.met.at[index * push.most + found] =
            MetSurface(y, object, crossing.entering ? 1u : 0u, crossing.normal);
        found += 1u;
    }
    push.counts.at[index] = found;
}
