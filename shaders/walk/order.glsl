// The ordered walk: crossings one after another, ties by primitive.

struct Crossing {
    bool found;
    float y;
    uint id;
    bool entering;
    uint surface;
    vec3 normal; // beam frame
};

Crossing no_crossing() {
    return Crossing(false, 1e30, 0xffffffffu, false, 0u, vec3(0.0));
}

// Room for the rounding of box tests when a search is cut to an interval of y.
float order_slack(float y) {
    return 1e-6 * min(abs(y), 1e3) + 1e-7;
}

// Keeps the candidate if it is the earliest after (y, id).
void offer(Beam beam, uint primitive, uint instance, float y, uint id, inout Crossing best) {
    Leaf leaf = sample_.leaves.at[primitive];
    Facet facet = facet_of(beam, leaf);
    if (!facet.crossed) return;
    vec3 normal = beam_from_world(beam, leaf.normal);
    float at = place_of(beam, facet, normal);
    bool later = at > y || (at == y && primitive > id);
    bool earlier = at < best.y || (at == best.y && primitive < best.id);
    if (!later || !earlier) return;
    best = Crossing(true, at, primitive, facet.entering, leaf.surface & 0x0fffffffu, normal);
}
