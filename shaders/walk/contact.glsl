#include "walk/near.glsl"

// Objects in contact: crossings of several at one place, within rounding or a gap of nanometres,
// are one interface, from the medium before them to the medium after them. X-rays tunnel through
// such a gap; taken one by one its surfaces would reflect rays that graze them.

const float CONTACT_FAR = 1e-2;      // m; crossings farther apart along the ray are not compared

// Unit normal at a crossing of the straight line, beam frame; `limit`: the largest distance along it of
// surfaces in contact; `crossed`: of a shape that others cross.
vec3 normal_at(Bent ray, Crossing crossing, out float limit, out bool crossed) {
    crossed = false;
#ifdef PLACED
    Placed placed;
    if (is_shape(crossing.facet & FACET_LEAF, placed)) {
        crossed = is_crossed(placed);
        limit = contact_limit(crossing.y, extent_of(placed));
        return normal_of_shape(ray.line, placed, crossing);
    }
#endif
    Leaf leaf = leaf_at(crossing.facet & FACET_LEAF);
    float reach = max(max(abs(leaf.a.x), abs(leaf.a.y)), abs(leaf.a.z)) + moved_by(ray.line);
    limit = max(CONTACT, CONTACT_ROUNDING * reach);
    return beam_from_world_direction(ray.line, leaf.normal);
}

#ifdef PLACED
bool is_of_shape(Crossing crossing) {
    Placed placed;
    return is_shape(crossing.facet & FACET_LEAF, placed);
}

// Whether one body of an object is left and another one entered: exact shapes, for others that touch
// are one mesh. A body that is left and entered again at one place is grazed, and may reflect.
bool touch(Crossing before, Crossing crossing) {
    return ((before.facet | ~crossing.facet) & FACET_ENTERED) == 0u
        && before.surface != crossing.surface && is_of_shape(before) && is_of_shape(crossing);
}
#endif

// End of the crossings from i on that are one interface: surfaces at the place of the first; i + 1
// without others. Before both an entry and an exit are among them no object occurs twice, unless bodies
// of one touch: a thin plate is entered before it is left.
uint contact_end(Bent ray, Gathered list, uint i, Crossing first) {
    if (i + 1u == list.count || list_at(list, i + 1u).y - first.y > CONTACT_FAR) return i + 1u;
    vec3 direction = vec3(slope_of(ray.line), 1.0).xzy;
    float first_cosine = 0.0;
    float first_limit = 0.0;
    bool mixed = false;
    uint shapes = 0u; // that others cross
    uint j = i;
    [[dont_unroll]] for (; j < list.count; j++) {
        Crossing crossing = list_at(list, j);
        float apart = crossing.y - first.y;
        bool repeated = apart > CONTACT_FAR;
        for (uint k = i; k < j && !mixed; k++) {
            Crossing before = list_at(list, k);
            bool same = object_of(before) == object_of(crossing);
#ifdef PLACED
            same = same && !touch(before, crossing);
#endif
            repeated = repeated || same;
        }
        if (repeated) break;
        float limit;
        bool crossed;
        float cosine = abs(dot(normal_at(ray, crossing, limit, crossed), direction));
        cosine = max(cosine, first_cosine);
        limit = max(limit, first_limit);
        if (j == i) {
            first_cosine = cosine;
            first_limit = limit;
        }
        if (apart * max(cosine, CONTACT_COSINE) > limit) break;
        shapes += crossed ? 1u : 0u;
        mixed = mixed || ((crossing.facet ^ first.facet) & FACET_ENTERED) != 0u;
    }
    // Of shapes that overlap, several may be entered, or left, at one place.
    return mixed || shapes > 1u ? j : i + 1u;
}

// The media behind the crossings from i to end; false if an object is left that was not entered.
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
