// Shared by the kernels of the order-free walk: inputs, and outputs.

#include "interface/TracePush.glsl"

#define sample_ push.sample_ref.at[0]

#include "walk/triangle.glsl"
#include "walk/primitive.glsl"
#include "physics/refraction.glsl"
#include "walk/moments.glsl"
#include "walk/queue.glsl"
#ifdef PLACED
#include "random/hash.glsl"
#include "walk/rough.glsl"
#include "walk/smooth.glsl"
#endif

// Number of the rays of this pass.
uint ray_count() {
    return push.rays_are == RAYS_COUNTED ? push.count : queued(QUEUE_LEFT);
}

// Sums of a ray.
struct Gathered {
    Stretch stretch;
    Run run;
    Sums sums;
#ifdef PLACED
    uint key;   // of the normals that its ray draws
    bool draws; // at any incidence
    bool left;  // to a kernel that walks its rays one by one
#endif
};

Gathered gathered_begin(Beam beam, uint index, bool live) {
#ifdef PLACED
    return Gathered(stretch_of(beam), run_begin(), sums_begin(index, live), 0u, false, false);
#else
    return Gathered(stretch_of(beam), run_begin(), sums_begin(index, live));
#endif
}

// A ray crosses a facet: everything after "which primitive" is here, for every walk. A run that
// ends at the surface (run_ends_at) has been flushed. `normal_`: of the facet, beam frame.
void visit(Beam beam, Facet facet, Surface surface, vec3 normal_, inout Gathered all) {
    run_cross(all.run, beam, all.stretch, surface, normal_,
              place_of(slope_of(beam), facet, normal_), facet.entering);
}

// Whether a ray is traced exactly: if it crosses a surface below a share of the surface's grazing
// incidence. Among many bodies the share is small: a ray at a rim, nanometres wide, is bent off it by
// the bodies before, and no ray whose straight line passes the rim is bent onto it, so that wide angles
// would be lost. Above this share the first order errs by less than a percent of the angle. A ray of a
// cell that draws normals is traced exactly among few bodies.
bool is_in_order(Run run) {
    if (run.crossings > MANY_CROSSINGS) return run.grazing < MANY_GRAZING;
    return run.grazing < 1.0 || (run.flags & FLAG_DRAWN) != 0u;
}

bool finite(RayResult result) {
    float sum = abs(result.optical_depth) + abs(result.displacement_x) + abs(result.displacement_z);
    return sum < 1e30; // false for NaN too
}

// Writes the result of a ray, and puts a ray that needs another pass into its queue. True if this walk tries
// it again.
bool finish(uint index, inout Gathered all, uint attempt) {
#ifdef PLACED
    if (all.left) {
        enqueue(QUEUE_LEFT, push.left, index);
        return false;
    }
#endif
    run_flush(all.sums, all.run);
    if (all.run.balance != 0u) all.run.flags |= FLAG_UNBALANCED;
    if (is_in_order(all.run)) all.run.flags |= FLAG_GRAZING;
    all.run.flags |= uint(255.0 * min(all.run.grazing, 1.0)) << FLAG_SHARE_SHIFT;
    RayResult result = result_of(all.sums, all.run);
    if (HAS_SCATTERING_AXIS) {
        Ray own = push.rays.at[index];
        direct(all.sums, beam_of(own, sample_.poses.at[own.pose]), result);
    }
    if (!finite(result)) result.flags |= FLAG_NOT_FINITE;
    push.results.at[index] = result;
    sums_end(all.sums, index, result, all.run.balance);
    if ((result.flags & FLAG_NOT_FINITE) != 0u) atomicAdd(push.tally.at[TALLY_NOT_FINITE], 1u);
    bool is_balanced = (result.flags & FLAG_UNBALANCED) == 0u;
    bool is_last = attempt + 1u >= ATTEMPTS;
    if ((is_balanced || is_last) && path_is_negative(all.sums)) {
        atomicAdd(push.tally.at[TALLY_NEGATIVE], 1u);
    }
    if (is_balanced) {
        if ((result.flags & FLAG_GRAZING) != 0u) enqueue(QUEUE_EXACT, push.exact, index);
        return false;
    }
    bool again = attempt + 1u < push.attempts;
    if (is_last) atomicAdd(push.tally.at[TALLY_UNBALANCED], 1u);
    else if (again) atomicAdd(push.tally.at[TALLY_RETRACED], 1u);
    else enqueue(QUEUE_LEFT, push.left, index);
    return again;
}
