// Objects in contact: crossings of several at one place, within rounding or a gap of nanometres,
// are one interface, from the medium before them to the medium after them. X-rays tunnel through
// such a gap; taken one by one its surfaces would reflect rays that graze them.

const float CONTACT = 5e-9;          // m; a thinner gap does not reflect
const float CONTACT_ROUNDING = 4e-7; // of coordinates: what f32 makes of faces that coincide
const float CONTACT_COSINE = 1e-4;   // least cosine of incidence that is told apart
const float CONTACT_FAR = 1e-2;      // m; crossings farther apart along the ray are not compared

// Unit normal at a crossing of the straight line, beam frame; `reach`: the largest coordinate there,
// about.
vec3 normal_at(Bent ray, Crossing crossing, out float reach) {
#ifdef PLACED
    Placed placed;
    if (is_shape(crossing.facet & FACET_LEAF, placed)) {
        vec3 place = placed.position;
        reach = max(max(abs(place.x), abs(place.y)), abs(place.z));
        return normal_of_shape(ray.line, placed, crossing);
    }
#endif
    Leaf leaf = leaf_at(crossing.facet & FACET_LEAF);
    reach = max(max(abs(leaf.a.x), abs(leaf.a.y)), abs(leaf.a.z));
    return beam_from_world(ray.line, leaf.normal);
}

// Whether the surface of the later crossing passes the place of the earlier one.
bool in_contact(Bent ray, Crossing earlier, Crossing after) {
    float apart = after.y - earlier.y;
    if (apart > CONTACT_FAR) return false;
    float reach_a;
    float reach_b;
    vec3 direction = vec3(slope_of(ray.line), 1.0).xzy;
    float cosine = max(abs(dot(normal_at(ray, earlier, reach_a), direction)),
                       abs(dot(normal_at(ray, after, reach_b), direction)));
    float contact = max(CONTACT, CONTACT_ROUNDING * max(reach_a, reach_b));
    return apart * max(cosine, CONTACT_COSINE) <= contact;
}

// Behind the last of the crossings from i on that are one interface; i + 1 where there is none.
// Until both an entry and an exit are among them no object stands among them twice: a thin
// plate is entered before it is left.
uint contact_end(Bent ray, Gathered list, uint i, Crossing first) {
    uint entered = first.facet & FACET_ENTERED;
    bool mixed = false;
    uint j = i + 1u;
    for (; j < list.count; j++) {
        Crossing crossing = list_at(list, j);
        bool repeated = false;
        for (uint k = i; k < j && !mixed; k++) {
            repeated = repeated || object_of(list_at(list, k)) == object_of(crossing);
        }
        if (repeated || !in_contact(ray, first, crossing)) break;
        mixed = mixed || (crossing.facet & FACET_ENTERED) != entered;
    }
    return mixed ? j : i + 1u;
}

// The media behind the crossings from i to end; false where one leaves what was not entered.
bool media_behind(Walk walk, Gathered list, uint i, uint end, out MediumSet media) {
    media = walk.media;
    for (uint pass = 0u; pass < 2u; pass++) {
        for (uint j = i; j < end; j++) {
            Crossing crossing = list_at(list, j);
            bool entering = (crossing.facet & FACET_ENTERED) != 0u;
            uint object = object_of(crossing);
            uint before = place_of(walk.media, object);
            bool skipped = (crossing.facet & FACET_MISSED) != 0u
                || is_known(walk, list, crossing, before);
            if (skipped || entering != (pass == 0u)) continue;
            uint place = place_of(media, object);
            if (entering ? media.count == DEPTH : place == DEPTH) return false;
            media_change(media, object, entering, place);
        }
    }
    return true;
}

// Takes the crossings from i to end as one interface; UNCLEAR where they are not.
uint take_contact(inout Walk walk, Gathered list, uint i, uint end) {
    MediumSet media;
    if (!media_behind(walk, list, i, end, media)) return UNCLEAR;
    Crossing first = list_at(list, i);
    Meeting at;
    at.leaf = first.facet & FACET_LEAF;
    at.y = first.y;
    at.normal = vec3(0.0);
    uint material = material_of(media);
    bool reflected = false;
    float along = 1e-2;
    if (material != walk.material) {
        bool entering = (first.facet & FACET_ENTERED) != 0u;
        at = meet(walk.ray, at.leaf, entering, first.y, earliest(walk, at.leaf, entering));
        if (at.outcome != MEETS) return UNCLEAR;
        reflected = pass_into(walk, at, material);
        along = dot(at.normal, vec3(slope_of(walk.ray.line), 1.0).xzy);
    }
    for (uint j = i; j < end; j++) {
        Crossing crossing = list_at(list, j);
        if ((crossing.facet & FACET_MISSED) != 0u) continue;
        walk.crossings += 1u;
        walk.signature += sample_.surfaces.at[surface_at(crossing.facet & FACET_LEAF)].hash;
    }
    walk.y = at.y;
    // A new search may bring up any of them once more.
    walk.clearance = 2.0 * CONTACT / max(abs(along), 1e-5) + list_at(list, end - 1u).y - first.y;
    walk.leaf = at.leaf;
    if (reflected) return SEARCHING;
    walk.media = media;
    return THROUGH;
}
