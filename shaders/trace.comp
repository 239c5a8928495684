// Traces a list of rays to first order: moments, and their result at one energy.
#extension GL_EXT_control_flow_attributes : require
#ifdef BACKEND_RAY_QUERY
#extension GL_EXT_ray_query : require
#endif
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "walk/first_order.glsl"

#ifdef PLACED
#include "walk/cross_rough.glsl"
#include "walk/crossed_shape.glsl"
#endif

// A candidate of the search.
void visit(Beam beam, uint primitive, Leaf leaf, inout Gathered all) {
    Facet facet = facet_of(beam, leaf);
    if (!facet.crossed) return;
    Surface surface = sample_.surfaces.at[leaf.surface & SURFACE_INDEX];
    if (run_ends_at(all.run, surface)) run_flush(all.sums, all.run);
    vec3 normal_ = beam_from_world_direction(beam, leaf.normal);
#ifdef PLACED
    if ((KINDS & (KIND_ROUGH | KIND_SMOOTH)) != 0u) {
        vec3 met = normal_;
        if ((KINDS & KIND_SMOOTH) != 0u && surface.smooth_ != 0u) {
            vec3 direction = vec3(beam.slope_x, 1.0, beam.slope_z);
            met = smooth_normal(beam, primitive, facet, normal_, direction);
        }
        // Grazing is what either normal says.
        if (surface.inside != surface.outside) {
            float share = incidence(slope_of(beam), normal_, all.stretch.inverse);
            all.run.grazing = min(all.run.grazing, share / max(surface.grazing, 1e-30));
        }
        float y = place_of(slope_of(beam), facet, normal_);
        cross_rough(beam, surface, primitive, met, y, facet.entering, all);
        return;
    }
#endif
    visit(beam, facet, surface, normal_, all);
}

#ifdef PLACED
// A shape that others may cross.
void visit_crossed(Beam beam, uint primitive, Placed placed, inout Gathered all) {
    CrossedShape shape =
        crossed_shape(beam, placed, sample_.leaves.at[primitive].surface & SURFACE_INDEX);
    bool crossed = is_crossed(placed);
    Surface own = sample_.surfaces.at[placed.surface];
    for (uint i = 0u; i < shape.found.count; i++) {
        bool entering = i % 2u == 0u;
        Surface surface = own;
        uint signature = own.hash;
        if (crossed) {
            uint around = material_of_object(shape.around_contact[i]);
            surface.outside = shape.covered_contact[i] ? own.inside : around;
            signature = signature_of(surface);
            surface.outside =
                shape.covered[i] ? own.inside : material_of_object(shape.around[i]);
        }
        if (run_ends_at(all.run, surface)) run_flush(all.sums, all.run);
        vec3 normal_ = shape.found.normal_[i];
        vec3 met = normal_;
        float y = shape.found.y[i];
        Surface rough = surface;
        if ((KINDS & KIND_ROUGH) != 0u) {
            if (crossed) {
                rough.outside =
                    shape.hidden[i] ? own.inside : material_of_object(shape.around_rough[i]);
            }
            met = rough_normal(beam, rough, primitive, normal_, y, all);
        }
        run_count(all.run, own.hash, signature, entering);
        run_add(all.run, beam, all.stretch, surface, met, y, entering);
        if ((KINDS & KIND_ROUGH) != 0u && met != normal_ && rough.outside != surface.outside) {
            // The drawn normal belongs to the whole interface. A face that lies in this one has a part of
            // the interface.
            Surface part = surface;
            part.inside = surface.outside;
            part.outside = rough.outside;
            if (run_ends_at(all.run, part)) run_flush(all.sums, all.run);
            run_add(all.run, beam, all.stretch, part, met, y, entering);
            run_add(all.run, beam, all.stretch, part, normal_, y, !entering);
        }
    }
}

// A shape that may be crossed.
void visit_shape(Beam beam, uint primitive, Placed placed, inout Gathered all) {
    if ((KINDS & KIND_CROSSED) != 0u) {
        visit_crossed(beam, primitive, placed, all);
        return;
    }
    ShapeCrossings found = shape_crossings(beam, vec2(0.0), vec2(0.0), placed);
    if (found.count == 0u) return;
    Surface surface = sample_.surfaces.at[placed.surface];
    if (run_ends_at(all.run, surface)) run_flush(all.sums, all.run);
    for (uint i = 0u; i < found.count; i++) {
        if ((KINDS & KIND_ROUGH) != 0u) {
            cross_rough(beam, surface, primitive, found.normal_[i], found.y[i], i % 2u == 0u, all);
        } else {
            run_cross(all.run, beam, all.stretch, surface, found.normal_[i], found.y[i], i % 2u == 0u);
        }
    }
}
#endif

#ifdef BACKEND_RAY_QUERY
#include "walk/ray_query.glsl"
#else
#include "walk/bvh.glsl"
#endif

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= ray_count()) return;
    if (push.rays_are == RAYS_LEFT) index = push.left.at[index];
    Ray own = push.rays.at[index];
    PoseTransform pose = sample_.poses.at[own.pose];
    uint attempt = 0u;
    bool again;
    do {
        Beam beam = beam_of(attempted(own, attempt), pose);
        Gathered all = gathered_begin(beam, index, true);
#ifdef PLACED
        if ((KINDS & KIND_ROUGH) != 0u) {
            all.key = own.key != 0u ? own.key : key_of(own);
            all.draws = own.key != 0u;
        }
#endif
        traverse(beam, -1e30, all);
        again = finish(index, all, attempt);
        attempt += 1u;
    } while (again);
}
