// Traces listed rays exactly, with refraction or total reflection at every surface: crossings of the
// straight ray are gathered and sorted, then the bent ray is refracted at one after another
// (docs/developers/numerics.md, "Exact transport").
#extension GL_EXT_control_flow_attributes : require
#ifdef BACKEND_RAY_QUERY
#extension GL_EXT_ray_query : require
#endif
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/ExactPush.glsl"

#define sample_ push.sample_ref.at[0]

#include "walk/triangle.glsl"
#include "walk/primitive.glsl"
#include "physics/refraction.glsl"
#include "walk/list.glsl"
#include "walk/queue.glsl"
#include "walk/gather_all.glsl"
#ifdef BACKEND_RAY_QUERY
#include "walk/ray_query.glsl"
#else
#include "walk/bvh.glsl"
#endif
#include "walk/media.glsl"
#ifdef PLACED
#include "random/hash.glsl"
#include "walk/rough.glsl"
#include "walk/smooth.glsl"
#endif
#include "walk/bent.glsl"
#include "walk/follow.glsl"

// Leaves a ray to another walk, or to the first order, which is the better answer for a ray that no attempt
// can follow.
void leave(uint index, uint flags) {
    if (push.attempts < ATTEMPTS) {
        enqueue(QUEUE_LOST, push.lost, index);
        return;
    }
    atomicAdd(push.tally.at[TALLY_UNORDERED], 1u);
    if ((flags & FLAG_DROPPED) != 0u) atomicAdd(push.tally.at[TALLY_DROPPED], 1u);
    push.results.at[index].flags |= flags | FLAG_UNBALANCED;
}

// The result of a ray that has gone through.
void write(uint index, Walk walk) {
    vec2 displacement = walk.ray.displacement;
    RayResult straight = push.results.at[index];
    RayResult result = RayResult(walk.depth, displacement.x, displacement.y, walk.ray.before.x, walk.ray.before.y,
                  walk.signature, walk.flags, walk.crossings,
                  straight.displacement_variance, straight.variance_z, straight.covariance);
    float sum = abs(walk.depth) + abs(displacement.x) + abs(displacement.y);
    if (!(sum < 1e30)) {
        result.flags |= FLAG_NOT_FINITE;
        atomicAdd(push.tally.at[TALLY_NOT_FINITE], 1u);
    }
    if ((walk.flags & FLAG_REFLECTED) != 0u) atomicAdd(push.tally.at[TALLY_REFLECTED], 1u);
    push.results.at[index] = result;
}

// Traces a ray, or a run of one at several energies.
void trace(uint place) {
    uint index = push.all != 0u ? place : push.indices.at[place];
    uint end = push.runs != 0u ? push.indices.at[place + 1u] : index + 1u;
    uint attempt = 0u;
    Gathered list = list_begin(0.0, NO_LEAF);
    bool known = false;
    // A bend at an edge, or a new search there, can lose a crossing: such rays are tried again.
    do {
        Ray own = push.rays.at[index];
        Beam line = beam_of(attempted(own, attempt), sample_.poses.at[own.pose]);
        uint constants = uvec2(push.nodes) == uvec2(0u) ? 0u : push.nodes.at[index];
        Walk walk = walk_begin(line, push.results.at[index].flags, constants);
#ifdef PLACED
        if ((KINDS & KIND_ROUGH) != 0u) {
            walk.key = own.key != 0u ? own.key : key_of(own);
            walk.draws = own.key != 0u;
        }
#endif
        uint outcome = follow(walk, list, known);
        bool again = false;
        if (outcome == THROUGH) {
            write(index, walk);
        } else if (outcome == SEARCHING && push.capacity < LONGEST_LIST) {
            enqueue(push.longer_queue, push.longer, index);
        } else if (attempt + 1u < push.attempts) {
            atomicAdd(push.tally.at[TALLY_RETRACED], 1u);
            again = true;
        } else {
            leave(index, walk.flags | (outcome == SEARCHING ? FLAG_DROPPED : 0u));
        }
        // The ray at the next energy has another list than one to the side.
        if (attempt > 0u || again) known = false;
        attempt = again ? attempt + 1u : 0u;
        index += again ? 0u : 1u;
    } while (index < end);
}

void main() {
    uint place = gl_GlobalInvocationID.x;
    if (place >= push.room) return;
    uint count = push.queue == NO_QUEUE ? push.count : queued(push.queue);
    for (; place < count; place += push.room) trace(place);
}
