// Which surfaces count as in contact.

const float CONTACT = 5e-9;          // m; a thinner gap does not reflect
const float CONTACT_ROUNDING = 4e-7; // of coordinates: what f32 makes of faces that coincide
const float CONTACT_COSINE = 1e-4;   // least cosine of incidence that is resolved
const float PLACE_ROUNDING = 1.3e-7; // of y of the beam frame: crossings of two shapes, each rounded once

// Largest distance along a normal at which surfaces of shapes are in contact: at y of the beam frame, for
// the larger extent of the shapes, m. Positions of shapes have 48 bits and round nothing.
float contact_limit(float y, float extent) {
    return max(CONTACT, CONTACT_ROUNDING * extent + PLACE_ROUNDING * abs(y));
}

// How far the pose moves the sample, beam frame.
float moved_by(Beam beam) {
#ifdef PLACED
    if (MOVED) {
        vec3 moved = abs(beam.pose.position);
        return max(max(moved.x, moved.y), moved.z);
    }
#endif
    return 0.0;
}
