// A shape that others cross, in the order-free walk.

#include "walk/near.glsl"

// The crossings of a line with a shape, and the object around it there: by the order of the crossings on the
// line, and, for signatures, with those in contact in the order of their objects. Rounding decides
// the order of surfaces that coincide; signatures of neighbours would differ by it.
struct CrossedShape {
    ShapeCrossings found;
    uint around[4];         // object, counted from 1
    bool covered[4];        // by an object that wins
    uint around_contact[4];
    bool covered_contact[4];
};

// Cosine of incidence at each crossing.
vec4 cosines_of(Beam beam, ShapeCrossings found) {
    vec3 direction = vec3(beam.slope_x, 1.0, beam.slope_z);
    float inverse = inversesqrt(dot(direction, direction));
    vec4 cosines = vec4(0.0);
    for (uint i = 0u; i < found.count; i++) cosines[i] = abs(dot(found.normal_[i], direction)) * inverse;
    return cosines;
}

// Largest distance along a normal at which surfaces count as in contact, near a place.
float contact_limit(Beam beam, Placed placed) {
    vec3 place = abs(placed.position);
    float reach = max(max(place.x, place.y), place.z) + moved_by(beam);
    return max(CONTACT, CONTACT_ROUNDING * reach);
}

// Takes the partner `other`, with its object and index among the placed, into the surroundings of a shape.
void surround(inout CrossedShape shape, vec4 cosines, float limit, uint object, uint index,
              ShapeCrossings other, vec4 other_cosines, uint other_object, uint other_index) {
    bool first = other_object != object ? other_object < object : other_index < index;
    for (uint i = 0u; i < shape.found.count; i++) {
        bool inside = false;
        bool inside_contact = false;
        for (uint j = 0u; j < other.count; j++) {
            float apart = other.y[j] - shape.found.y[i];
            bool before = apart < 0.0 || (apart == 0.0 && first);
            float cosine = max(max(cosines[i], other_cosines[j]), CONTACT_COSINE);
            bool contact = abs(apart) * cosine <= limit;
            inside = inside != before;
            inside_contact = inside_contact != (contact ? first : before);
        }
        bool wins = other_object >= object;
        shape.covered[i] = shape.covered[i] || (inside && wins);
        shape.covered_contact[i] = shape.covered_contact[i] || (inside_contact && wins);
        if (inside && !wins) shape.around[i] = max(shape.around[i], other_object + 1u);
        if (inside_contact && !wins) {
            shape.around_contact[i] = max(shape.around_contact[i], other_object + 1u);
        }
    }
}

// A shape on a line, with the place `index`. All shapes go through one call of shape_crossings(), so that
// a shape has the same crossings, to the last digit, wherever it is looked at.
CrossedShape crossed_shape(Beam beam, Placed placed, uint index) {
    CrossedShape shape;
    bool crossed = is_crossed(placed);
    uint list = crossed ? placed.partners : 0u;
    uint count = crossed ? sample_.partners.at[list + 1u] : 0u;
    uint around = crossed ? sample_.partners.at[list] : 0u;
    uint object = sample_.surfaces.at[placed.surface].object;
    vec4 cosines = vec4(0.0);
    float limit = 0.0;
    for (uint i = 0u; i < 4u; i++) {
        shape.around[i] = shape.around_contact[i] = around;
        shape.covered[i] = shape.covered_contact[i] = false;
    }
    [[dont_unroll]] for (uint k = 0u; k <= count; k++) {
        uint at = index;
        Placed it = placed;
        if (k > 0u) {
            at = sample_.partners.at[list + PARTNERS_HEAD + k - 1u];
            it = sample_.placed.at[at];
        }
        ShapeCrossings found = shape_crossings(beam, vec2(0.0), vec2(0.0), it);
        if (k == 0u) {
            shape.found = found;
            if (found.count == 0u || !crossed) break;
            cosines = cosines_of(beam, found);
            limit = contact_limit(beam, placed);
        } else if (found.count > 0u) {
            surround(shape, cosines, limit, object, index, found, cosines_of(beam, found),
                     sample_.surfaces.at[it.surface].object, at);
        }
    }
    return shape;
}
