// Bundles: the rays of a subgroup, a few in each lane, walk the tree together. A node is loaded a
// word per lane and its eight children are tested, a lane each, against the bounds of the
// bundle; what may hold triangles then against each ray. In the frame of the beam these are
// comparisons of intervals. Padded boxes hold whatever a ray crosses, so every ray has its
// crossings, in the order of the single walk, whatever its company: the same bits.

// Nodes that a bundle may visit before its rays are tested against inner children too: this many,
// and this many per triangle that some ray crosses.
const uint NODES = 64u;
const uint NODES_PER_TRIANGLE = 4u;

// Bounds of the rays of a bundle, (x, z).
struct Bounds {
    vec2 low; // at y = 0
    vec2 high;
    vec2 low_slope;
    vec2 high_slope;
};

// A box of each lane in the frame of the beam.
struct Box {
    vec3 low;
    vec3 high;
};

// The eight children of a node, one in each lane.
struct Children {
    Box box;
    uint bits; // as children_met() gives them, of a child that the bundle may meet
    uint base; // first inner child
    uint inner; // mask of inner children
    uint leaf_base;
};

bool meets(Bounds b, Box box) {
    vec4 slopes = vec4(b.low_slope, b.high_slope);
    vec4 near = slopes * box.low.y;
    vec4 far = slopes * box.high.y;
    vec4 least = min(near, far);
    vec4 most = max(near, far);
    vec2 low = b.low + min(least.xy, least.zw);
    vec2 high = b.high + max(most.xy, most.zw);
    return all(lessThanEqual(low, box.high.xz)) && all(greaterThanEqual(high, box.low.xz));
}

bool meets(Beam beam, Box box) {
    vec2 slope = vec2(beam.slope_x, beam.slope_z);
    vec2 near = slope * box.low.y;
    vec2 far = slope * box.high.y;
    vec2 place = vec2(beam.x, beam.z);
    return all(lessThanEqual(place + min(near, far), box.high.xz))
        && all(greaterThanEqual(place + max(near, far), box.low.xz));
}

// A box of the world from the beam: the smallest around it.
Box box_from_world(vec3 low, vec3 high, PoseTransform pose) {
#ifdef PLACED
    if (MOVED) {
        mat3 from_world = transpose(mat3(pose.x, pose.y, pose.z));
        Box box = Box(pose.position, pose.position);
        for (uint axis = 0u; axis < 3u; axis++) {
            vec3 near = from_world[axis] * low[axis];
            vec3 far = from_world[axis] * high[axis];
            box.low += min(near, far);
            box.high += max(near, far);
        }
        return box;
    }
#endif
    vec2 xc = vec2(low.x, high.x) * pose.x.x;
    vec2 xs = vec2(low.x, high.x) * pose.x.y;
    vec2 yc = vec2(low.y, high.y) * pose.x.x;
    vec2 ys = vec2(low.y, high.y) * pose.x.y;
    return Box(vec3(min(xc.x, xc.y) + min(ys.x, ys.y), min(yc.x, yc.y) - max(xs.x, xs.y), low.z),
               vec3(max(xc.x, xc.y) + max(ys.x, ys.y), max(yc.x, yc.y) - min(xs.x, xs.y), high.z));
}

Box box_of_lane(Box box, uint lane) {
    return Box(subgroupShuffle(box.low, lane), subgroupShuffle(box.high, lane));
}

Children children_of(Words nodes, uint node, PoseTransform pose, Bounds bounds) {
    Record record = record_at(nodes, node, NODE_WORDS);
    vec3 origin = numbers_of(record, NODE_ORIGIN);
    uint exponents = word_of(record, NODE_EXPONENTS);
    vec3 scale = vec3(uintBitsToFloat((exponents & 0xffu) << 23),
                      uintBitsToFloat((exponents & 0xff00u) << 15),
                      uintBitsToFloat((exponents & 0xff0000u) << 7));
    // Four children to a word.
    uint word = LANE >> 2;
    uint shift = (LANE & 3u) * 8u;
    uvec3 low = uvec3(word_of_two(record, NODE_MIN_X, word), word_of_two(record, NODE_MIN_Y, word),
                      word_of_two(record, NODE_MIN_Z, word));
    uvec3 high = uvec3(word_of_two(record, NODE_MAX_X, word), word_of_two(record, NODE_MAX_Y, word),
                       word_of_two(record, NODE_MAX_Z, word));
    uint meta = word_of_two(record, NODE_META, word) >> shift & 0xffu;
    Children children;
    children.box = box_from_world(vec3(low >> shift & 0xffu) * scale + origin,
                                  vec3(high >> shift & 0xffu) * scale + origin, pose);
    children.bits = meets(bounds, children.box) ? (meta >> 5) << (meta & 31u) : 0u;
    children.base = word_of(record, NODE_CHILD_BASE);
    children.inner = exponents >> 24;
    children.leaf_base = word_of(record, NODE_LEAF_BASE);
    return children;
}
