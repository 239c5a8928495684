#version 460
// As trace.comp, for devices with small subgroups: the rays of a subgroup walk the software BVH
// as one bundle (walk/bundle.glsl). Rays in an order that keeps neighbours together gain most.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#define EACH_RAY [[unroll]] for (uint k = 0u; k < RAYS_PER_LANE; k++)

#include "walk/first_order.glsl"
#include "walk/node.glsl"
#include "walk/subgroup.glsl"
#include "walk/bundle.glsl"

// A ray of a lane.
struct Member {
    uint index;
    bool waits; // for its view to be walked
    bool walks;
    uint view;
    Beam beam; // its view set while it walks
    Stretch stretch;
    Run run;
    Sums sums;
};

// Bounds of the rays that walk.
Bounds bounds_of(Member rays[RAYS_PER_LANE]) {
    vec4 place = vec4(1e30);
    vec4 slope = vec4(1e30);
    EACH_RAY {
        if (rays[k].walks) {
            Beam beam = rays[k].beam;
            place = min(place, vec4(beam.x, beam.z, -beam.x, -beam.z));
            slope = min(slope, vec4(beam.slope_x, beam.slope_z, -beam.slope_x, -beam.slope_z));
        }
    }
    place = least_of_lanes(place);
    slope = least_of_lanes(slope);
    return Bounds(place.xy, -place.zw, slope.xy, -slope.zw);
}

// Bits of the children that some ray may meet: of leaves, and of inner children where `all_`.
uint children_met(Children children, Member rays[RAYS_PER_LANE], bool all_) {
    uint tested = all_ ? 0xffffffffu : 0x00ffffffu;
    uint met = any_lane(children.bits & ~tested);
    uint left = any_lane((children.bits & tested) != 0u ? 1u << LANE : 0u);
    uint mine = 0u;
    do {
        uint lane = uint(findLSB(left)) & 7u;
        uint bits = left != 0u ? WORD(children.bits, lane) : 0u;
        Box box = box_of_lane(children.box, lane);
        left &= left - 1u;
        bool some = false;
        EACH_RAY some = some || (rays[k].walks && meets(rays[k].beam, box));
        mine |= some ? bits : 0u;
    } while (left != 0u);
    return met | any_lane(mine);
}

// Hands all crossings of the rays that walk to their runs.
void walk_together(inout Member rays[RAYS_PER_LANE], View view) {
    Words nodes = Words(uvec2(sample_.nodes));
    Words leaf_words = Words(uvec2(sample_.leaves));
    Words surfaces = Words(uvec2(sample_.surfaces));
    Bounds bounds = bounds_of(rays);
    Beam frame = rays[0].beam; // its view, for what is the same for all rays
    frame.cos_angle = view.cos_angle;
    frame.sin_angle = view.sin_angle;
    Stack stack = stack_begin();
    uvec2 group = uvec2(0u, 0x80000000u);
    uint leaves = 0u;
    uint leaf_base = 0u;
    uint visited = 0u;
    uint crossed_by_some = 0u; // triangles
    bool more = true;
    bool ends; // runs of some rays
    // CPU devices skip no code but by leaving a loop at its end: what is rare stands outside.
    do {
        bool ending[RAYS_PER_LANE];
        EACH_RAY ending[k] = false;
        do {
            if (leaves == 0u) {
                do {
                    if (group.y < 0x01000000u) group = stack_pop(stack);
                    uint node = pop_child(group);
                    if (group.y >= 0x01000000u) stack_push(stack, group);
                    Children children = children_of(nodes, node, view, bounds);
                    visited += 1u;
                    bool wide = visited > NODES + NODES_PER_TRIANGLE * crossed_by_some;
                    uint met = children_met(children, rays, wide);
                    group = uvec2(children.base, (met & 0xff000000u) | children.inner);
                    leaf_base = children.leaf_base;
                    leaves = met & 0x00ffffffu;
                    more = group.y >= 0x01000000u || stack.height > 0u;
                } while (more && leaves == 0u);
            }
            ends = false;
            if (leaves != 0u) {
                do {
                    Facet facets[RAYS_PER_LANE];
                    uint before = leaves;
                    Record leaf;
                    bool crossed;
                    do {
                        before = leaves;
                        leaf = record_at(leaf_words, leaf_base + uint(findLSB(leaves)), LEAF_WORDS);
                        leaves &= leaves - 1u;
                        vec3 a = beam_from_world(frame, numbers_of(leaf, LEAF_A));
                        vec3 b = beam_from_world(frame, numbers_of(leaf, LEAF_B));
                        vec3 c = beam_from_world(frame, numbers_of(leaf, LEAF_C));
                        crossed = false;
                        EACH_RAY {
                            facets[k] = facet_of(rays[k].beam, a, b, c);
                            facets[k].crossed = facets[k].crossed && rays[k].walks;
                            crossed = crossed || facets[k].crossed;
                        }
                        crossed = any_lane(uint(crossed)) != 0u;
                    } while (!crossed && leaves != 0u);

                    Record sides = record_at(surfaces, word_of(leaf, LEAF_SURFACE) & SURFACE_INDEX,
                                             SURFACE_WORDS);
                    Surface surface = Surface(0u, word_of(sides, SURFACE_INSIDE),
                                              word_of(sides, SURFACE_OUTSIDE),
                                              word_of(sides, SURFACE_HASH),
                                              number_of(sides, SURFACE_GRAZING));
                    EACH_RAY {
                        ending[k] = facets[k].crossed && run_ends_at(rays[k].run, surface);
                        ends = ends || ending[k];
                    }
                    ends = any_lane(uint(ends)) != 0u;
                    if (ends) { // the same triangle again, after that
                        leaves = before;
                        break;
                    }
                    vec3 normal_ = beam_from_world(frame, numbers_of(leaf, LEAF_NORMAL));
                    crossed_by_some += 1u;
                    EACH_RAY {
                        if (facets[k].crossed) {
                            run_cross(rays[k].run, rays[k].beam, rays[k].stretch, surface,
                                      normal_, place_of(slope_of(rays[k].beam), facets[k], normal_),
                                      facets[k].entering);
                        }
                    }
                } while (leaves != 0u);
            }
        } while (more && !ends);
        EACH_RAY {
            if (ending[k]) run_flush(rays[k].sums, rays[k].run);
        }
    } while (ends);
}

void main() {
    // Neighbours in the list are neighbours in a bundle.
    uint lane = gl_GlobalInvocationID.x % gl_SubgroupSize;
    uint first = (gl_GlobalInvocationID.x - lane) * RAYS_PER_LANE + lane;
    Member rays[RAYS_PER_LANE];
    EACH_RAY {
        uint index = first + k * gl_SubgroupSize;
        rays[k].waits = index < push.count;
        // Lanes without a ray of their own help to load for the others.
        index = min(index, push.count - 1u);
        if (push.listed != 0u) index = push.list.at[1u + index];
        Ray ray = ray_at(index);
        rays[k].index = index;
        rays[k].view = ray.view;
        rays[k].beam = beam_of(ray, View(1.0, 0.0, 0.0, 0.0));
        rays[k].stretch = stretch_of(rays[k].beam);
        rays[k].run = run_begin();
        rays[k].sums = sums_begin(index, rays[k].waits);
    }
    bool left;
    do { // one view after another, where a bundle has several
        uint view = 0u;
        EACH_RAY view = max(view, rays[k].waits ? rays[k].view + 1u : 0u);
        view = max(most_of_lanes(view), 1u) - 1u;
        left = false;
        EACH_RAY {
            rays[k].walks = rays[k].waits && rays[k].view == view;
            rays[k].waits = rays[k].waits && !rays[k].walks;
            left = left || rays[k].waits;
        }
        left = any_lane(uint(left)) != 0u;
        View frame = sample_.views.at[view];
        EACH_RAY rays[k].beam.analyser = frame.analyser;
        walk_together(rays, frame);
    } while (left);
    EACH_RAY {
        if (first + k * gl_SubgroupSize < push.count) {
            finish(rays[k].index, rays[k].sums, rays[k].run);
        }
    }
}
