// Follows a ray through the sample, crossing by crossing of its list.

const uint SEARCHES = 1u << 12;   // of one ray
const float SAME_PLACE = 2e-9;    // m; what rounding leaves of a place across a facet
const uint REFLECTION_HASH = 0x9e3779b9u;

// A ray on its way through the sample.
struct Walk {
    Bent ray;
    MediumSet media;
    uint constants; // of material 0
    uint material;
    float entered; // y where the material began
    float depth;   // beyond that of the surroundings
    uint signature;
    uint flags;
    uint crossings;
    uint searches;
    // The last crossing.
    float y;
    float clearance; // what rounding leaves of y
    uint leaf;
#ifdef PLACED
    uint key;   // of the normals that it draws
    bool draws; // at any incidence
#endif
};

const uint THROUGH = 0u;    // behind the last crossing of the list
const uint SEARCHING = 1u;  // no longer on the list
const uint LOST = 2u;       // an object is left that was not entered, or a limit is met
const uint UNCLEAR = 3u;    // crossings are to be taken one by one

// Whether a crossing was taken before the search that brought it up: a new search begins at a
// crossing, which neighbours of the facet may bring up once more. `place`: of the object in the
// set of media.
bool is_known(Walk walk, Gathered list, Crossing crossing, uint place) {
    bool entering = (crossing.facet & FACET_ENTERED) != 0u;
    bool near = walk.searches > 1u && crossing.y - list.after <= walk.clearance;
    return near && entering == (place < DEPTH);
}

// The first crossing behind entry i into the object, or out of it; the count if there is none.
uint next_of(Gathered list, uint i, uint object, uint entered) {
    for (uint j = i + 1u; j < list.count; j++) {
        Crossing crossing = list_at(list, j);
        if ((crossing.facet & FACET_MISSED) != 0u) continue;
        if ((crossing.facet & FACET_ENTERED) == entered && object_of(crossing) == object) return j;
    }
    return list.count;
}

// Takes an entry and the exit behind it off the list. False where there is no such exit, or it
// belongs to another entry.
bool miss(Gathered list, uint i, uint object) {
    uint exit = next_of(list, i, object, 0u);
    if (exit == list.count || next_of(list, i, object, FACET_ENTERED) < exit) return false;
    Crossing crossing = list_at(list, exit);
    crossing.facet |= FACET_MISSED;
    list_set(list, exit, crossing);
    return true;
}

// Refraction or total reflection into `material`; true on reflection.
bool pass_into(inout Walk walk, Meeting at, uint surface_index, uint material) {
    vec2 slope = slope_of(walk.ray);
    Constants from = sample_.constants.at[walk.constants + walk.material];
    Constants to = sample_.constants.at[walk.constants + material];
    float mu = from.mu - sample_.constants.at[walk.constants].mu;
    walk.depth += mu * (at.y - walk.entered) * sqrt(1.0 + dot(slope, slope));
    walk.entered = at.y;
    bool reflected;
    vec2 bend;
#ifdef PLACED
    const uint NORMALS_DIFFER = KIND_ROUGH | KIND_SMOOTH;
    Surface surface;
    if ((KINDS & NORMALS_DIFFER) != 0u) surface = sample_.surfaces.at[surface_index];
    if ((KINDS & KIND_ROUGH) != 0u && surface.roughness > 0.0
        && (walk.draws || incidence(slope, at.refracts, inversesqrt(1.0 + dot(slope, slope)))
                              < ROUGH_GRAZING * surface.roughness)) {
        bend = rough_bend(slope, at.normal, at.refracts, surface, walk.key, at.leaf, from.delta,
                          to.delta, reflected);
    } else if ((KINDS & KIND_SMOOTH) != 0u && surface.smooth_ != 0u) {
        bend = smooth_bend(slope, at.normal, at.refracts, from.delta, to.delta, reflected);
    } else
#endif
    bend = refract_slope(slope, at.normal, from.delta, to.delta, reflected);
    bend_at(walk.ray, at.y, bend);
    if (reflected) {
        walk.flags |= FLAG_REFLECTED;
        walk.signature += REFLECTION_HASH;
    } else {
        walk.material = material;
    }
    return reflected;
}

// Where a crossing of a leaf may come at the earliest: behind the last one, but for rounding; and
// beyond that where the ray has just left the leaf, which it enters anew.
float earliest(Walk walk, uint leaf, bool entering) {
    return walk.y + (entering && walk.leaf == leaf ? walk.clearance : -walk.clearance);
}

#include "walk/contact.glsl"

// A single crossing: its object, and the position of the object in the set of media.
struct Single {
    Crossing crossing;
    uint object;
    uint place;
};

// The crossing at i of the list, which is to be taken alone; UNCLEAR where it leads to an interface.
uint single(inout Walk walk, Gathered list, uint i, inout Single one) {
    one.object = object_of(one.crossing);
    one.place = place_of(walk.media, one.object);
    if (is_known(walk, list, one.crossing, one.place)) return THROUGH;
    if ((one.crossing.facet & FACET_ENTERED) == 0u && one.place == DEPTH) {
        // Rounding put its entry behind it: exchange them.
        uint entry = next_of(list, i, one.object, FACET_ENTERED);
        if (entry == list.count) return LOST;
        list_set(list, i, list_at(list, entry));
        list_set(list, entry, one.crossing);
        one.crossing = list_at(list, i);
    }
    if ((one.crossing.facet & FACET_ENTERED) != 0u && walk.media.count == DEPTH) {
        walk.flags |= FLAG_DROPPED;
        return LOST;
    }
    return UNCLEAR;
}

#ifdef PLACED
// Part of the signature of crossing j of those from `first` to `end`, which are one interface; `media`:
// those before it. As of the order-free walk: objects of one interface come in their order.
uint signature_at(MediumSet media, Gathered list, uint first, uint end, uint j) {
    Crossing crossing = list_at(list, j);
    Surface surface = sample_.surfaces.at[crossing.surface];
    Placed placed;
    if (!is_shape(crossing.facet & FACET_LEAF, placed) || !is_crossed(placed)) return surface.hash;
    for (uint k = first; k < end; k++) {
        Crossing other = list_at(list, k);
        uint object = object_of(other);
        bool before = object != surface.object
            ? object < surface.object
            : (other.facet & FACET_LEAF) < (crossing.facet & FACET_LEAF);
        if (k != j && (!before || (other.facet & FACET_MISSED) != 0u)) continue;
        bool entering = (other.facet & FACET_ENTERED) != 0u;
        // Objects that are left are removed, the own object too; the own object is not added.
        if (k == j && entering) continue;
        uint place = place_of(media, object);
        if (entering ? media.count < DEPTH : place < DEPTH) media_change(media, object, entering, place);
    }
    uint winner = 0u;
    for (uint i = 0u; i < media.count; i++) winner = max(winner, media.objects[i] + 1u);
    surface.outside = winner > surface.object ? surface.inside : material_of_object(winner);
    return signature_of(surface);
}
#endif

#ifdef PLACED
// The surface whose roughness an interface of the crossings from `first` to `end` has: of faces that lie
// in each other the face of the object listed last.
uint rough_surface(Gathered list, uint first, uint end) {
    Crossing one = list_at(list, first);
    Crossing last = one;
    for (uint j = first + 1u; j < end; j++) {
        Crossing crossing = list_at(list, j);
        bool flush = ((crossing.facet ^ one.facet) & FACET_ENTERED) == 0u;
        bool missed = (crossing.facet & FACET_MISSED) != 0u;
        if (flush && !missed && object_of(crossing) > object_of(last)) last = crossing;
    }
    return last.surface;
}
#endif

// Takes the crossings at i of the list, as far as they are one interface; i: behind them. Interfaces
// of one crossing and of several go through the same calls, since drivers copy a function to each
// of its calls.
uint take_next(inout Walk walk, Gathered list, inout uint i) {
    uint first = i;
    Single one;
    one.crossing = list_at(list, first);
    uint end = contact_end(walk.ray, list, first, one.crossing);
    MediumSet media;
    bool together = end > first + 1u
        && !is_known(walk, list, one.crossing, place_of(walk.media, object_of(one.crossing)))
        && media_behind(walk, list, first, end, media);
    Meeting at;
    bool entering;
    bool reflected = false;
    float along = 1e-2;
    for (bool clear = false; !clear;) {
        if (!together) {
            end = first + 1u;
            uint outcome = single(walk, list, first, one);
            if (outcome != UNCLEAR) {
                i = end;
                return outcome;
            }
        }
        i = end;
        entering = (one.crossing.facet & FACET_ENTERED) != 0u;
        at = Meeting(MEETS, one.crossing.facet & FACET_LEAF, one.crossing.y, vec3(0.0), vec3(0.0));
        uint material = together ? material_of(media)
                                 : material_after(walk.media, one.object, entering, one.place);
        clear = true;
        if (material != walk.material) {
            at = meet(walk.ray, at.leaf, entering, at.y, earliest(walk, at.leaf, entering));
            if (at.outcome == MEETS) {
                uint surface = one.crossing.surface;
#ifdef PLACED
                const uint ROUGH_CROSSED = KIND_ROUGH | KIND_CROSSED;
                if (together && (KINDS & ROUGH_CROSSED) == ROUGH_CROSSED) {
                    surface = rough_surface(list, first, end);
                }
#endif
                reflected = pass_into(walk, at, surface, material);
                along = dot(at.normal, vec3(slope_of(walk.ray.line), 1.0).xzy);
            } else if (!together) {
                bool missed = at.outcome == MISSES && entering && miss(list, first, one.object);
                return missed ? THROUGH : SEARCHING;
            } else {
                together = false;
                clear = false;
            }
        }
    }
    float stretch = 0.0;
    for (uint j = first; j < end; j++) {
        Crossing crossing = list_at(list, j);
        stretch = crossing.y - one.crossing.y;
        if ((crossing.facet & FACET_MISSED) != 0u) continue;
        uint signature = sample_.surfaces.at[crossing.surface].hash;
#ifdef PLACED
        if ((KINDS & KIND_CROSSED) != 0u) signature = signature_at(walk.media, list, first, end, j);
#endif
        walk.crossings += signature == 0u ? 0u : 1u;
        walk.signature += signature;
    }
    walk.y = at.y;
    // A new search may bring up any of several once more.
    walk.clearance = (together ? 2.0 * CONTACT : SAME_PLACE) / max(abs(along), 1e-5) + stretch;
    walk.leaf = at.leaf;
    if (reflected) return SEARCHING;
    if (together) walk.media = media;
    else media_change(walk.media, one.object, entering, one.place);
    return THROUGH;
}

// Crossings that were missed at another energy count again.
void list_renew(Gathered list) {
    for (uint i = 0u; i < list.count; i++) {
        Crossing crossing = list_at(list, i);
        crossing.facet &= ~FACET_MISSED;
        list_set(list, i, crossing);
    }
}

// Follows a ray until it is behind the sample; SEARCHING if a list does not hold its crossings. `known`:
// the list belongs to the ray at its start.
uint follow(inout Walk walk, inout Gathered list, inout bool known) {
    uint outcome;
    do {
        if (known) {
            list_renew(list);
        } else {
            list = list_begin(walk.y, walk.leaf);
            traverse(walk.ray.line, walk.y - walk.clearance, list);
            if (list.count > push.capacity) return SEARCHING;
            list_sort(list);
        }
        walk.searches += 1u;
        outcome = THROUGH;
        for (uint i = 0u; i < list.count && outcome == THROUGH;) {
            bool missed = (list_at(list, i).facet & FACET_MISSED) != 0u;
            if (missed) i += 1u;
            else outcome = take_next(walk, list, i);
        }
        straighten(walk.ray);
        known = outcome != SEARCHING && walk.searches == 1u;
    } while (outcome == SEARCHING && walk.searches < SEARCHES);
    return outcome == THROUGH && walk.media.count == 0u ? THROUGH : LOST;
}

Walk walk_begin(Beam line, uint flags, uint constants) {
    Walk walk;
    walk.ray = Bent(line, vec2(0.0), vec2(0.0), vec2(0.0), vec2(0.0));
    walk.media.count = 0u;
    walk.constants = constants;
    walk.material = 0u;
    walk.entered = 0.0;
    walk.depth = 0.0;
    walk.signature = 0u;
    walk.flags = FLAG_EXACT | (flags & (FLAG_GRAZING | FLAG_DRAWN | (255u << FLAG_SHARE_SHIFT)));
    walk.crossings = 0u;
    walk.searches = 0u;
    walk.y = -1e30;
    walk.clearance = 0.0;
    walk.leaf = NO_LEAF;
#ifdef PLACED
    walk.key = 0u;
    walk.draws = false;
#endif
    return walk;
}
