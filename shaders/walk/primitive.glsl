// Primitives by number. Numbers below `sample_leaves` are leaves of the sample: triangles and, in
// kernels that know of PLACED surfaces, shapes. Larger ones are facets of placed meshes, prototype by
// prototype, place by place.

#ifdef PLACED
// Whether a primitive is a facet of a placed mesh.
bool is_placed(uint primitive) {
    return (KINDS & KIND_MESH) != 0u && primitive >= sample_.sample_leaves;
}

// A vector, turned by a quaternion of any length.
vec3 turned(vec4 rotation, vec3 v) {
    precise vec3 half_ = cross(rotation.xyz, v) + rotation.w * v;
    precise vec3 turn = cross(rotation.xyz, half_);
    precise float share = 2.0 / dot(rotation, rotation);
    precise vec3 result = v + share * turn;
    return result;
}

vec3 scales_of(Placed placed) {
    return vec3(placed.scale, placed.scale, placed.scale_z);
}

vec3 world_from_own(Placed placed, vec3 v) {
    precise vec3 moved = turned(placed.rotation, v * scales_of(placed)) + placed.rest;
    precise vec3 place = moved + placed.position;
    return place;
}

vec3 world_from_own_normal(Placed placed, vec3 n) {
    return normalize(turned(placed.rotation, n / scales_of(placed)));
}

vec3 own_from_world_direction(Placed placed, vec3 v) {
    return turned(vec4(-placed.rotation.xyz, placed.rotation.w), v) / scales_of(placed);
}

vec3 own_from_world(Placed placed, vec3 v) {
    return own_from_world_direction(placed, (v - placed.position) - placed.rest);
}

// The place that a primitive belongs to, and its leaf.
Placed placed_of(uint primitive, out uint leaf) {
    uint k = sample_.prototype_count - 1u;
    while (k > 0u && sample_.prototypes.at[k].primitive > primitive) k--;
    Prototype prototype = sample_.prototypes.at[k];
    uint number = primitive - prototype.primitive;
    leaf = prototype.leaf_base + number % prototype.leaves;
    return sample_.placed.at[prototype.placed + number / prototype.leaves];
}

// A leaf of a placed mesh, in its place.
Leaf leaf_of_place(Placed placed, uint leaf) {
    Leaf own = sample_.leaves.at[leaf];
    return Leaf(world_from_own(placed, own.a), world_from_own(placed, own.b),
                world_from_own(placed, own.c), world_from_own_normal(placed, own.normal),
                placed.surface + own.surface);
}
#endif

// A primitive as a triangle of the world.
Leaf leaf_at(uint primitive) {
#ifdef PLACED
    if (is_placed(primitive)) {
        uint index;
        Placed placed = placed_of(primitive, index);
        return leaf_of_place(placed, index);
    }
#endif
    return sample_.leaves.at[primitive];
}

#ifdef PLACED
// The place of a primitive that is a shape; false for a triangle.
bool is_shape(uint primitive, out Placed placed) {
    if ((KINDS & ~KIND_MESH) == 0u || primitive >= sample_.sample_leaves) return false;
    uint word = sample_.leaves.at[primitive].surface;
    if ((word & ~SURFACE_INDEX) != LEAF_SHAPE) return false;
    placed = sample_.placed.at[word & SURFACE_INDEX];
    return true;
}

AnalyticShape shape_of(Placed placed) {
    return sample_.shapes.at[sample_.prototypes.at[placed.prototype].root];
}
#endif

// The primitive across an edge of a primitive; NO_LEAF at an open edge.
uint neighbour_of(uint primitive, uint edge) {
#ifdef PLACED
    if (is_placed(primitive)) {
        uint leaf;
        Placed placed = placed_of(primitive, leaf);
        uint other = sample_.neighbours.at[3u * leaf + edge];
        return other == NO_LEAF ? NO_LEAF : placed.primitive + other;
    }
#endif
    return sample_.neighbours.at[3u * primitive + edge];
}

#ifdef PLACED
#include "walk/shape.glsl"
#include "walk/crossed.glsl"
#endif
