// Objects in contact: crossings of several at one place, within rounding or a gap of nanometres,
// are one interface, from the medium before them to the medium after them. X-rays tunnel through
// such a gap; taken one by one its surfaces would reflect rays that graze them.

const float CONTACT = 5e-9;          // m; a thinner gap does not reflect
const float CONTACT_ROUNDING = 4e-7; // of coordinates: what f32 makes of faces that coincide
const float CONTACT_COSINE = 1e-4;   // least cosine of incidence that is told apart
const float CONTACT_FAR = 1e-2;      // m; crossings farther apart along the ray are not compared

// Whether the surface of the later crossing passes the place of the earlier one.
bool in_contact(Bent ray, Crossing earlier, Crossing after) {
    float apart = after.y - earlier.y;
    if (apart > CONTACT_FAR) return false;
    Leaf a = sample_.leaves.at[earlier.facet & FACET_LEAF];
    Leaf b = sample_.leaves.at[after.facet & FACET_LEAF];
    vec3 direction = vec3(slope_of(ray.line), 1.0).xzy;
    float cosine = max(abs(dot(beam_from_world(ray.line, a.normal), direction)),
                       abs(dot(beam_from_world(ray.line, b.normal), direction)));
    vec3 reach = max(abs(vec3(a.a)), abs(vec3(b.a)));
    float contact = max(CONTACT, CONTACT_ROUNDING * max(max(reach.x, reach.y), reach.z));
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
        at = meet(walk.ray, at.leaf, (first.facet & FACET_ENTERED) != 0u);
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
