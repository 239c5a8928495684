// A leaf of the sample in the way of a line: a triangle, a shape, or a placed mesh with a tree of its
// own.
void candidate(Beam beam, float near, uint leaf, inout Gathered all) {
    uint word = sample_.leaves.at[leaf].surface;
    uint kind = word & ~SURFACE_INDEX;
    if (kind == 0u) {
        visit(beam, leaf, sample_.leaves.at[leaf], all);
        return;
    }
    Placed placed = sample_.placed.at[word & SURFACE_INDEX];
    if ((KINDS & KIND_MESH) == 0u || kind == LEAF_SHAPE) {
        if ((KINDS & ~KIND_MESH) != 0u) visit_shape(beam, leaf, placed, all);
        return;
    }
    Prototype prototype = sample_.prototypes.at[placed.prototype];
    vec3 origin = world_from_beam(beam, vec3(beam.x, 0.0, beam.z));
    traverse_own(beam, near, own_from_world(placed, origin),
                 own_from_world_direction(placed, line_direction(beam)), prototype.root,
                 PlacedMesh(placed, placed.primitive - prototype.leaf_base), all);
}
