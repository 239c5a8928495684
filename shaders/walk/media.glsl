// The objects that a ray is inside of, each as often as it is; the one listed last wins.

const uint DEPTH = 16u; // objects that a point may be inside of at once

struct MediumSet {
    uint objects[DEPTH];
    uint count;
};

// Position of the object in the set; DEPTH: absent.
uint place_of(MediumSet media, uint object) {
    for (uint i = 0u; i < media.count; i++) {
        if (media.objects[i] == object) return i;
    }
    return DEPTH;
}

// The material once the object has been entered, or left.
uint material_after(MediumSet media, uint object, bool entering, uint place) {
    uint winner = entering ? object + 1u : 0u; // object index + 1
    for (uint i = 0u; i < media.count; i++) {
        if (entering || i != place) winner = max(winner, media.objects[i] + 1u);
    }
    return winner == 0u ? 0u : sample_.object_materials.at[winner - 1u];
}

// The material that wins.
uint material_of(MediumSet media) {
    uint winner = 0u; // object index + 1
    for (uint i = 0u; i < media.count; i++) winner = max(winner, media.objects[i] + 1u);
    return winner == 0u ? 0u : sample_.object_materials.at[winner - 1u];
}

// Enters the object, or leaves it from its place.
void media_change(inout MediumSet media, uint object, bool entering, uint place) {
    if (entering) {
        media.objects[media.count] = object;
        media.count += 1u;
    } else {
        media.count -= 1u;
        media.objects[place] = media.objects[media.count];
    }
}
