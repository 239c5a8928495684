#version 460
// Traces listed rays in order, with refraction or total reflection at every surface.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#ifdef BACKEND_RAY_QUERY
#extension GL_EXT_ray_query : require
#endif
#include "interface.glsl"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform ExactPush {
    SampleRef sample_ref;
    Rays rays;
    Laws laws;
    Words list; // [0]: count, then indices; not used when `all` is set
    Words unbalanced; // [0]: count, then indices of rays to trace again
    Words tally;
    uint count;
    uint all;
    uint first;
    uint last;   // no further attempt follows
    float nudge; // moves the rays in x, and in z by 0.7 of it, m
} push;

#define sample_ push.sample_ref.at[0]

#include "walk/triangle.glsl"
#include "physics/refraction.glsl"
#include "walk/order.glsl"
#ifdef BACKEND_RAY_QUERY
#include "walk/ray_query.glsl"
#else
#include "walk/bvh.glsl"
#endif

const uint DEPTH = 16u;           // objects that a point may be inside of at once
const uint CROSSINGS = 1u << 20;  // offered to one ray
const uint REFLECTION_HASH = 0x9e3779b9u;

// The objects that the ray is inside of, each as often as it is; the one listed last wins.
struct Media {
    uint objects[DEPTH];
    uint count;
};

uint material_of(Media media) {
    uint winner = 0u; // object index + 1
    for (uint i = 0u; i < media.count; i++) winner = max(winner, media.objects[i] + 1u);
    return winner == 0u ? 0u : sample_.object_materials.at[winner - 1u];
}

uint place_of(Media media, uint object) {
    for (uint i = 0u; i < media.count; i++) {
        if (media.objects[i] == object) return i;
    }
    return DEPTH;
}

void main() {
    uint index = push.first + gl_GlobalInvocationID.x;
    if (index >= push.count) return;
    if (push.all == 0u) index = push.list.at[1u + index];
    Ray ray = push.rays.at[index];
    ray.x += push.nudge;
    ray.z += 0.7 * push.nudge;
    Beam beam = beam_of(ray, sample_.views.at[ray.view]);
    Law first_order = push.laws.at[index];

    vec2 straight = vec2(beam.slope_x, beam.slope_z);
    vec2 slope = vec2(0.0); // change so far
    vec2 displacement = vec2(0.0);
    vec2 origin = vec2(beam.x, beam.z);
    vec2 moved = vec2(0.0); // of the line at y = 0
    float depth = 0.0;
    float mu_surroundings = sample_.constants.at[0].mu;
    uint signature = 0u;
    uint flags = FLAG_EXACT | (first_order.flags & (FLAG_GRAZING | (255u << FLAG_SHARE_SHIFT)));
    uint crossings = 0u;
    uint offered = 0u;
    Media media;
    media.count = 0u;

    float y = -1e30;
    uint id = 0xffffffffu;
    float again = -1e30; // y of an entry of an object that the ray is inside of
    uint again_object = 0u;
    float entered = 0.0; // y where the current medium began
    uint material = 0u;
    Crossing crossing;
    while (next(beam, y, id, crossing)) {
        y = crossing.y;
        id = crossing.id;
        offered += 1u;
        if (offered > CROSSINGS) {
            flags |= FLAG_DROPPED;
            break;
        }
        Surface surface = sample_.surfaces.at[crossing.surface];
        uint place = place_of(media, surface.object);
        // Where sheets of one object lie on one another the next may be entered before the last
        // is left: the two cancel. Any other entry while inside, or exit while outside, comes
        // from a bend at an edge that brings a facet up twice or loses one: not a crossing.
        bool inside = place < DEPTH;
        if (crossing.entering && inside) {
            again = y;
            again_object = surface.object;
            continue;
        }
        if (!crossing.entering && inside && again_object == surface.object
            && y - again <= 1e-6 * abs(y) + 2e-9) {
            again = -1e30;
            crossings += 2u;
            signature += 2u * surface.hash;
            continue;
        }
        if (!crossing.entering && !inside) continue;
        crossings += 1u;
        Media after = media;
        if (crossing.entering) {
            if (after.count == DEPTH) {
                flags |= FLAG_DROPPED;
                break;
            }
            after.objects[after.count] = surface.object;
            after.count += 1u;
        } else {
            after.count -= 1u;
            after.objects[place] = after.objects[after.count];
        }
        uint next_material = material_of(after);
        signature += surface.hash;
        if (next_material == material) {
            media = after;
            continue;
        }
        vec2 now = straight + slope;
        depth += (sample_.constants.at[material].mu - mu_surroundings) * (y - entered)
            * sqrt(1.0 + dot(now, now));
        entered = y;
        bool reflected;
        vec2 bend = refract_slope(now, crossing.normal, sample_.constants.at[material].delta,
                                  sample_.constants.at[next_material].delta, reflected);
        slope += bend;
        displacement += bend * (beam.analyser - y);
        moved -= bend * y;
        beam.x = origin.x + moved.x;
        beam.z = origin.y + moved.y;
        beam.slope_x = straight.x + slope.x;
        beam.slope_z = straight.y + slope.y;
        if (reflected) {
            flags |= FLAG_REFLECTED;
            signature += REFLECTION_HASH;
        } else {
            media = after;
            material = next_material;
        }
    }
    if (media.count != 0u) {
        if (push.last == 0u) {
            uint slot = atomicAdd(push.unbalanced.at[0], 1u);
            push.unbalanced.at[1u + slot] = index;
            return;
        }
        // A crossing was lost between two bends: the first order is the better answer.
        flags |= FLAG_UNBALANCED;
        atomicAdd(push.tally.at[TALLY_UNORDERED], 1u);
        first_order.flags |= flags;
        push.laws.at[index] = first_order;
        return;
    }
    Law law = Law(depth, displacement.x, displacement.y, slope.x, slope.y, signature, flags, crossings);
    float sum = abs(depth) + abs(displacement.x) + abs(displacement.y);
    if (!(sum < 1e30)) {
        law.flags |= FLAG_NOT_FINITE;
        atomicAdd(push.tally.at[TALLY_NOT_FINITE], 1u);
    }
    if ((flags & FLAG_REFLECTED) != 0u) atomicAdd(push.tally.at[TALLY_REFLECTED], 1u);
    if ((flags & FLAG_DROPPED) != 0u) atomicAdd(push.tally.at[TALLY_DROPPED], 1u);
    push.laws.at[index] = law;
}
