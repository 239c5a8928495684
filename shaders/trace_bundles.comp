// As trace.comp, for devices with small subgroups: the rays of a subgroup walk the software BVH
// as one bundle (walk/bundle.glsl). Rays in an order that keeps neighbours together gain most.
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#define EACH_RAY [[unroll]] for (uint k = 0u; k < RAYS_PER_LANE; k++)

#include "walk/first_order.glsl"
#include "walk/node.glsl"
#include "walk/subgroup.glsl"
#include "walk/bundle.glsl"
#ifdef PLACED
#include "walk/cross_rough.glsl"
#endif

// A ray of a lane.
struct Member {
    uint index;
    bool tries; // is not done
    bool waits; // for its pose to be walked
    bool walks;
    uint pose;
    Beam beam; // its pose set while it walks
    Gathered all;
};

// The rays of this lane. Here rather than handed from function to function: copies of so much
// take their time when a driver makes the kernel.
Member rays[RAYS_PER_LANE];

// Bounds of the rays that walk.
Bounds bounds_of_rays() {
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

// Bits of the children that some ray may cross: of leaves, and of inner children with `all_`.
uint children_met(Children children, bool all_) {
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

// A bundle on its way through the tree.
struct Search {
    PoseTransform pose;
    Bounds bounds;
    Stack stack;
    uvec2 group;    // inner children that are left, for pop_child()
    uint leaves;    // bits of the leaves of a node that are left
    uint leaf_base;
    uint visited;   // nodes
    uint triangles; // that some ray crosses
    bool more;      // nodes are left
};

Search search_begin(PoseTransform pose, Bounds bounds) {
    return Search(pose, bounds, stack_begin(), uvec2(0u, 0x80000000u), 0u, 0u, 0u, 0u, true);
}

// Continues with a node that has leaves in the way of some ray.
void next_node(inout Search search) {
    do {
        if (search.group.y < 0x01000000u) search.group = stack_pop(search.stack);
        uint node = pop_child(search.group);
        if (search.group.y >= 0x01000000u) stack_push(search.stack, search.group);
        Children children =
            children_of(Words(uvec2(sample_.nodes)), node, search.pose, search.bounds);
        search.visited += 1u;
        bool wide = search.visited > NODES + NODES_PER_TRIANGLE * search.triangles;
        uint met = children_met(children, wide);
        search.group = uvec2(children.base, (met & 0xff000000u) | children.inner);
        search.leaf_base = children.leaf_base;
        search.leaves = met & 0x00ffffffu;
        search.more = search.group.y >= 0x01000000u || search.stack.height > 0u;
    } while (search.more && search.leaves == 0u);
}

// A surface; its object and the length of its heights are left out.
Surface surface_of(uint index) {
    Words surfaces = Words(uvec2(sample_.surfaces));
    Record sides = record_at(surfaces, index, SURFACE_WORDS);
    float roughness = 0.0;
    uint smooth_ = 0u;
#ifdef PLACED
    if ((KINDS & KIND_ROUGH) != 0u) roughness = number_of(sides, SURFACE_ROUGHNESS);
    if ((KINDS & KIND_SMOOTH) != 0u) smooth_ = word_of(sides, SURFACE_SMOOTH_);
#endif
    return Surface(0u, word_of(sides, SURFACE_INSIDE), word_of(sides, SURFACE_OUTSIDE),
                   word_of(sides, SURFACE_HASH), number_of(sides, SURFACE_GRAZING), roughness, 0.0, smooth_);
}

#ifdef PLACED
// Handles a surface with other normals than its own, at y: slopes spread to first order are summed here;
// a ray that needs a normal for itself is left to the kernel without bundles.
void meet_other_normals(Beam beam, Surface surface, vec3 normal_, float y, inout Gathered all) {
    if (surface.inside == surface.outside) return;
    if ((KINDS & KIND_SMOOTH) != 0u && surface.smooth_ != 0u) all.left = true;
    if ((KINDS & KIND_ROUGH) != 0u && surface.roughness > 0.0) {
        bool draws = HEIGHTS || draws_at(beam, surface, normal_, all);
        all.left = all.left || draws;
        if (!draws) spread_slopes(beam, surface, normal_, y, all);
    }
}
#endif

// Index of the first of the leaves that are left.
uint leaf_of(Search search) {
    return search.leaf_base + uint(findLSB(search.leaves));
}

// Whether a surface ends the runs of some of the rays that cross it: `ending`.
bool ends_runs(Surface surface, bool crossed[RAYS_PER_LANE], out bool ending[RAYS_PER_LANE]) {
    bool ends = false;
    EACH_RAY {
        ending[k] = crossed[k] && run_ends_at(rays[k].all.run, surface);
        ends = ends || ending[k];
    }
    return any_lane(uint(ends)) != 0u;
}

// Takes leaves of a node until some ray crosses a triangle, a shape comes, which is left, or no leaf
// is left. `frame`: the beam's pose, which is the same for all rays; `before`: leaves that were left
// before the last one was taken.
void next_triangle(inout Search search, Beam frame, out Record leaf,
                   out Facet facets[RAYS_PER_LANE], out bool shape, out uint before) {
    bool some;
    do {
        before = search.leaves;
        leaf = record_at(Words(uvec2(sample_.leaves)), leaf_of(search), LEAF_WORDS);
        search.leaves &= search.leaves - 1u;
        shape = false;
#ifdef PLACED
        shape = (word_of(leaf, LEAF_SURFACE) & ~SURFACE_INDEX) != 0u;
#endif
        vec3 a = beam_from_world(frame, numbers_of(leaf, LEAF_A));
        vec3 b = beam_from_world(frame, numbers_of(leaf, LEAF_B));
        vec3 c = beam_from_world(frame, numbers_of(leaf, LEAF_C));
        some = false;
        EACH_RAY {
            facets[k] = facet_of(rays[k].beam, a, b, c);
            facets[k].crossed = facets[k].crossed && rays[k].walks && !shape;
            some = some || facets[k].crossed;
        }
        some = any_lane(uint(some)) != 0u;
    } while (!some && !shape && search.leaves != 0u);
    if (shape) search.leaves = before;
}

// Hands the triangles of a node to the rays, up to a shape. True if runs of some rays must end first:
// the rays of `ending`; their leaf is left for later.
bool visit_triangles(inout Search search, Beam frame, out bool ending[RAYS_PER_LANE]) {
    bool ends;
    bool shape;
    do {
        Record leaf;
        Facet facets[RAYS_PER_LANE];
        uint before;
        next_triangle(search, frame, leaf, facets, shape, before);
        Surface surface = surface_of(word_of(leaf, LEAF_SURFACE) & SURFACE_INDEX);
        bool crossed[RAYS_PER_LANE];
        EACH_RAY crossed[k] = facets[k].crossed;
        ends = ends_runs(surface, crossed, ending);
        if (ends) {
            search.leaves = before;
            break;
        }
        vec3 normal_ = beam_from_world_direction(frame, numbers_of(leaf, LEAF_NORMAL));
        search.triangles += 1u;
        EACH_RAY {
            if (crossed[k]) {
                visit(rays[k].beam, facets[k], surface, normal_, rays[k].all);
#ifdef PLACED
                float y = place_of(slope_of(rays[k].beam), facets[k], normal_);
                meet_other_normals(rays[k].beam, surface, normal_, y, rays[k].all);
#endif
            }
        }
    } while (search.leaves != 0u && !shape);
    return ends;
}

#ifdef PLACED
// A place and its shape, loaded by all lanes together.
Placed placed_at(uint index, out AnalyticShape shape) {
    Record place = record_at(Words(uvec2(sample_.placed)), index, PLACED_WORDS);
    uint at = word_of(place, PLACED_PROTOTYPE);
    Record prototype = record_at(Words(uvec2(sample_.prototypes)), at, PROTOTYPE_WORDS);
    at = word_of(prototype, PROTOTYPE_ROOT);
    Record own = record_at(Words(uvec2(sample_.shapes)), at, ANALYTIC_SHAPE_WORDS);
    shape = AnalyticShape(word_of(own, ANALYTIC_SHAPE_KIND),
                          numbers_of(own, ANALYTIC_SHAPE_PARAMETERS));
    vec4 rotation = vec4(numbers_of(place, PLACED_ROTATION),
                         number_of(place, PLACED_ROTATION + 3u));
    return Placed(numbers_of(place, PLACED_POSITION), numbers_of(place, PLACED_REST), rotation,
                  number_of(place, PLACED_SCALE), number_of(place, PLACED_SCALE_Z),
                  word_of(place, PLACED_PROTOTYPE), word_of(place, PLACED_PRIMITIVE),
                  word_of(place, PLACED_SURFACE), word_of(place, PLACED_PARTNERS));
}

// Takes leaves of a node until some ray crosses a shape, a triangle comes, which is left, or no
// leaf is left. `surface`: index of the shape's; `crossed`: other shapes cross it.
void next_shape(inout Search search, Beam frame, out uint surface, out bool crossed,
                out Chord chords[RAYS_PER_LANE], out Chord seconds[RAYS_PER_LANE], out bool triangle,
                out uint before) {
    Words leaves = Words(uvec2(sample_.leaves));
    bool some;
    do {
        before = search.leaves;
        uint word = leaves.at[leaf_of(search) * LEAF_WORDS + LEAF_SURFACE];
        search.leaves &= search.leaves - 1u;
        triangle = (word & ~SURFACE_INDEX) == 0u;
        // In place of a triangle the first shape is as good as any.
        AnalyticShape analytic;
        Placed placed = placed_at(triangle ? 0u : word & SURFACE_INDEX, analytic);
        surface = placed.surface;
        crossed = is_crossed(placed);
        Convex convex = convex_of(frame, placed, analytic);
        some = false;
        EACH_RAY {
            chords_of(convex, rays[k].beam, vec2(0.0), vec2(0.0), chords[k], seconds[k]);
            chords[k].crossed = chords[k].crossed && rays[k].walks && !triangle;
            some = some || chords[k].crossed;
        }
        some = any_lane(uint(some)) != 0u;
    } while (!some && !triangle && search.leaves != 0u);
    if (triangle) search.leaves = before;
}

// Adds the crossings of a chord.
void cross_chord(Beam beam, Chord chord, Surface surface, inout Gathered all) {
    run_cross(all.run, beam, all.stretch, surface, chord.entry_normal, chord.enter, true);
    run_cross(all.run, beam, all.stretch, surface, chord.exit_normal, chord.leave, false);
    meet_other_normals(beam, surface, chord.entry_normal, chord.enter, all);
    meet_other_normals(beam, surface, chord.exit_normal, chord.leave, all);
}

// As visit_triangles(), of shapes, up to a triangle.
bool visit_shapes(inout Search search, Beam frame, out bool ending[RAYS_PER_LANE]) {
    bool ends;
    bool triangle;
    do {
        uint index;
        Chord chords[RAYS_PER_LANE];
        Chord seconds[RAYS_PER_LANE];
        uint before;
        bool others;
        next_shape(search, frame, index, others, chords, seconds, triangle, before);
        Surface surface = surface_of(index);
        bool crossed[RAYS_PER_LANE];
        EACH_RAY crossed[k] = chords[k].crossed;
        ends = ends_runs(surface, crossed, ending);
        if (ends) {
            search.leaves = before;
            break;
        }
        search.triangles += 1u;
        EACH_RAY {
            // The kernel without bundles finds the materials around shapes that cross.
            rays[k].all.left = rays[k].all.left || (others && crossed[k]);
            if (crossed[k]) cross_chord(rays[k].beam, chords[k], surface, rays[k].all);
            if (TUBES && crossed[k] && seconds[k].crossed) {
                cross_chord(rays[k].beam, seconds[k], surface, rays[k].all);
            }
        }
    } while (search.leaves != 0u && !triangle);
    return ends;
}

// Goes on over shapes until a triangle comes, runs have to end, or no node is left.
bool visit_to_triangle(inout Search search, Beam frame, inout bool ending[RAYS_PER_LANE]) {
    bool ends;
    do {
        if (search.leaves == 0u && search.more) next_node(search);
        ends = false;
        if (search.leaves != 0u) ends = visit_shapes(search, frame, ending);
    } while (search.more && search.leaves == 0u);
    return ends;
}
#endif

// Hands all crossings of the rays that walk to their runs.
void walk_together(PoseTransform pose) {
    Search search = search_begin(pose, bounds_of_rays());
    Beam frame = rays[0].beam;
    set_pose(frame, pose);
    bool ends; // runs of some rays
    // CPU devices skip no code but by leaving a loop at its end: rare code is outside, and triangles and
    // shapes have loops of their own.
    do {
        bool ending[RAYS_PER_LANE];
        EACH_RAY ending[k] = false;
        do {
#ifdef PLACED
            ends = visit_to_triangle(search, frame, ending);
#else
            if (search.leaves == 0u) next_node(search);
            ends = false;
#endif
            if (search.leaves != 0u && !ends) ends = visit_triangles(search, frame, ending);
        } while ((search.more || search.leaves != 0u) && !ends);
        EACH_RAY {
            if (ending[k]) run_flush(rays[k].all.sums, rays[k].all.run);
        }
    } while (ends);
}

// Begins an attempt of a ray of this lane.
void member_begin(uint k, uint attempt) {
    Ray ray = attempted(push.rays.at[rays[k].index], attempt);
    rays[k].waits = rays[k].tries;
    rays[k].pose = ray.pose;
    rays[k].beam = beam_of(ray);
    rays[k].all = gathered_begin(rays[k].beam, rays[k].index, rays[k].tries);
#ifdef PLACED
    if ((KINDS & KIND_ROUGH) != 0u) rays[k].all.draws = ray.key != 0u;
#endif
}

// Walks the rays that wait, one pose after another, where a bundle has several.
void walk_poses() {
    bool left;
    do {
        uint pose = 0u;
        EACH_RAY pose = max(pose, rays[k].waits ? rays[k].pose + 1u : 0u);
        pose = max(most_of_lanes(pose), 1u) - 1u;
        left = false;
        EACH_RAY {
            rays[k].walks = rays[k].waits && rays[k].pose == pose;
            rays[k].waits = rays[k].waits && !rays[k].walks;
            left = left || rays[k].waits;
        }
        left = any_lane(uint(left)) != 0u;
        PoseTransform frame = sample_.poses.at[pose];
        EACH_RAY rays[k].beam.analyser = frame.analyser;
        walk_together(frame);
    } while (left);
}

void main() {
    // Neighbours in the list are neighbours in a bundle.
    uint lane = gl_GlobalInvocationID.x % gl_SubgroupSize;
    uint first = (gl_GlobalInvocationID.x - lane) * RAYS_PER_LANE + lane;
    uint count = ray_count();
    EACH_RAY {
        uint index = first + k * gl_SubgroupSize;
        rays[k].tries = index < count;
        // Lanes without a ray of their own help to load for the others.
        rays[k].index = min(index, count - 1u);
    }
    uint attempt = 0u;
    bool again;
    do {
        EACH_RAY member_begin(k, attempt);
        walk_poses();
        again = false;
        EACH_RAY {
            if (rays[k].tries) rays[k].tries = finish(rays[k].index, rays[k].all, attempt);
            again = again || rays[k].tries;
        }
        again = any_lane(uint(again)) != 0u;
        attempt += 1u;
    } while (again);
}
