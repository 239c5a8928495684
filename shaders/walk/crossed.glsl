// Exact shapes whose surfaces cross (docs/developers/numerics.md, "Positions of crossings"). What lies around a shape at
// one of its crossings with a line follows from the intervals of the line in the shapes that cross
// it, so sums need no order. The shape listed last wins, and shapes of one object are one.

// Whether other shapes cross a shape.
bool is_crossed(Placed placed) {
    return (KINDS & KIND_CROSSED) != 0u && placed.partners != NO_PARTNERS;
}

// A material by its object, counted from 1; 0: the surroundings.
uint material_of_object(uint object) {
    return object == 0u ? 0u : sample_.object_materials.at[object - 1u];
}

// Part of the signature of a ray: a crossing from one material to another.
uint signature_of(Surface surface) {
    return surface.inside == surface.outside ? 0u : surface.hash * (2u * surface.outside + 1u);
}
