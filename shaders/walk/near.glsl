// Which surfaces count as in contact.

const float CONTACT = 5e-9;          // m; a thinner gap does not reflect
const float CONTACT_ROUNDING = 4e-7; // of coordinates: what f32 makes of faces that coincide
const float CONTACT_COSINE = 1e-4;   // least cosine of incidence that is resolved

// How far the view moves the sample, beam frame.
float moved_by(Beam beam) {
#ifdef PLACED
    if (MOVED) {
        vec3 moved = abs(beam.view.position);
        return max(max(moved.x, moved.y), moved.z);
    }
#endif
    return 0.0;
}
