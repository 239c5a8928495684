// A shape that others cross, in the order-free walk.

#include "walk/near.glsl"

const float AWAY_ROUNDING = 1e-6; // of coordinates: far more than f32 loses of a distance

// The crossings of a line with a shape, and the object around it there: by the order of the crossings on the
// line, and, for signatures, with those in contact in the order of their objects. Rounding decides
// the order of surfaces that coincide; signatures of neighbours would differ by it.
struct CrossedShape {
    ShapeCrossings found;
    uint around[4];         // object, counted from 1
    bool covered[4];        // by an object that wins
    uint around_contact[4];
    bool covered_contact[4];
    // For roughness: as in contact, but of faces that lie in each other the last object's is alone.
    uint around_rough[4];
    bool hidden[4];
};

// Cosine of incidence at each crossing.
vec4 cosines_of(Beam beam, ShapeCrossings found) {
    vec3 direction = vec3(beam.slope_x, 1.0, beam.slope_z);
    float inverse = inversesqrt(dot(direction, direction));
    vec4 cosines = vec4(0.0);
    for (uint i = 0u; i < found.count; i++) cosines[i] = abs(dot(found.normal_[i], direction)) * inverse;
    return cosines;
}

// Whether a line certainly passes by a shape: beside the ball around it, or beside the rod around its axis.
bool passes_by(Beam beam, uint index, float ball, float rod) {
    vec3 position = sample_.placed.at[index].position;
    vec3 direction = vec3(beam.slope_x, 1.0, beam.slope_z);
    vec3 centre = beam_from_world(beam, position);
    vec3 off = vec3(beam.x, 0.0, beam.z) + direction * centre.y - centre;
    vec3 size = abs(position);
    float room = max(max(size.x, size.y), size.z) + abs(beam.x) + abs(beam.z) + moved_by(beam);
    room *= AWAY_ROUNDING;
    float square = dot(direction, direction);
    vec3 across = cross(off, direction);
    if (dot(across, across) > (ball + room) * (ball + room) * square) return true;
    vec3 axis = turned(sample_.placed.at[index].rotation, vec3(0.0, 0.0, 1.0));
    vec3 normal_ = cross(direction, beam_from_world_direction(beam, axis));
    float rounding = AWAY_ROUNDING * (length(off) + room);
    return abs(dot(off, normal_)) > (rod + room) * length(normal_) + rounding;
}

// Takes the partner `other`, with its object and index among the placed, into the surroundings of a shape.
// `extent`: of the larger of the two, m.
void surround(inout CrossedShape shape, vec4 cosines, float extent, uint object, uint index,
              ShapeCrossings other, vec4 other_cosines, uint other_object, uint other_index) {
    bool first = other_object != object ? other_object < object : other_index < index;
    bool wins = other_object >= object;
    for (uint i = 0u; i < shape.found.count; i++) {
        bool inside = false;
        bool inside_contact = false;
        bool inside_rough = false;
        for (uint j = 0u; j < other.count; j++) {
            float apart = other.y[j] - shape.found.y[i];
            bool before = apart < 0.0 || (apart == 0.0 && first);
            float cosine = max(max(cosines[i], other_cosines[j]), CONTACT_COSINE);
            float y = max(abs(other.y[j]), abs(shape.found.y[i]));
            bool contact = abs(apart) * cosine <= contact_limit(y, extent);
            bool before_contact = contact ? first : before;
            inside = inside != before;
            inside_contact = inside_contact != before_contact;
            if ((KINDS & KIND_ROUGH) != 0u) {
                // The face of the earlier object is none.
                bool flush = contact && i % 2u == j % 2u;
                if (flush && other_object > object) shape.hidden[i] = true;
                bool none = flush && other_object < object;
                inside_rough = inside_rough != (none ? i % 2u != 0u : before_contact);
            }
        }
        shape.covered[i] = shape.covered[i] || (inside && wins);
        shape.covered_contact[i] = shape.covered_contact[i] || (inside_contact && wins);
        if (inside && !wins) shape.around[i] = max(shape.around[i], other_object + 1u);
        if (inside_contact && !wins) {
            shape.around_contact[i] = max(shape.around_contact[i], other_object + 1u);
        }
        if ((KINDS & KIND_ROUGH) != 0u) {
            shape.hidden[i] = shape.hidden[i] || (inside_contact && wins);
            if (inside_rough && !wins) {
                shape.around_rough[i] = max(shape.around_rough[i], other_object + 1u);
            }
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
    float extent = 0.0;
    for (uint i = 0u; i < 4u; i++) {
        shape.around[i] = shape.around_contact[i] = shape.around_rough[i] = around;
        shape.covered[i] = shape.covered_contact[i] = shape.hidden[i] = false;
    }
    uint at = index;
    [[dont_unroll]] for (uint k = 0u; k <= count; k++) {
        // Partners that the line passes by. A loop, since CPU devices execute both sides of a condition.
        [[dont_unroll]] for (; k > 0u && k <= count; k++) {
            uint entry = list + PARTNERS_HEAD + (k - 1u) * PARTNER_WORDS;
            at = sample_.partners.at[entry];
            float ball = uintBitsToFloat(sample_.partners.at[entry + PARTNER_BALL]);
            float rod = uintBitsToFloat(sample_.partners.at[entry + PARTNER_ROD]);
            if (!passes_by(beam, at, ball, rod)) break;
        }
        if (k > count) break;
        Placed it = sample_.placed.at[at];
        ShapeCrossings found = shape_crossings(beam, vec2(0.0), vec2(0.0), it);
        if (k == 0u) {
            shape.found = found;
            if (found.count == 0u || !crossed) break;
            cosines = cosines_of(beam, found);
            extent = extent_of(it);
        } else if (found.count > 0u) {
            surround(shape, cosines, max(extent, extent_of(it)), object, index, found,
                     cosines_of(beam, found), sample_.surfaces.at[it.surface].object, at);
        }
    }
    return shape;
}
