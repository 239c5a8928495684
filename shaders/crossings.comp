// Lists the first crossings of every ray in order, for pictures of the sample.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/CrossingsPush.glsl"

#define sample_ push.sample_ref.at[0]

#include "walk/triangle.glsl"
#include "walk/primitive.glsl"
#include "walk/list.glsl"

// The list holds the first crossings so far, sorted.
void list_add(inout Gathered list, Crossing crossing) {
    if (list.count == push.capacity) {
        if (!later(list_at(list, list.count - 1u), crossing)) return;
        list.count -= 1u;
    }
    uint j = list.count;
    while (j > 0u) {
        Crossing before = list_at(list, j - 1u);
        if (!later(before, crossing)) break;
        list_set(list, j, before);
        j -= 1u;
    }
    list_set(list, j, crossing);
    list.count += 1u;
}

#include "walk/bvh.glsl"

void main() {
    uint index = push.first + gl_GlobalInvocationID.x;
    if (index >= push.count) return;
    Ray ray = push.rays.at[index];
    Beam beam = beam_of(ray, sample_.poses.at[ray.pose]);
    Gathered list = list_begin(-1e30, NO_LEAF);
    traverse(beam, -1e30, list);
    for (uint i = 0u; i < list.count; i++) {
        Crossing crossing = list_at(list, i);
        Placed placed;
        bool shape = is_shape(crossing.facet & FACET_LEAF, placed);
        vec3 normal = shape ? normal_of_shape(beam, placed, crossing)
            : beam_from_world_direction(beam, leaf_at(crossing.facet & FACET_LEAF).normal);
        push.met.at[index * push.capacity + i] =
            SurfaceCrossing(crossing.y, object_of(crossing),
                       (crossing.facet & FACET_ENTERED) != 0u ? 1u : 0u,
                       normal);
    }
    push.counts.at[index] = list.count;
}
