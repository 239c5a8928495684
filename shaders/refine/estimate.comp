#version 460
// Estimates the errors of rectangles: how the recorded light would change if a rectangle were like its
// neighbours. With AGAIN of older ones whose younger neighbours crossed other surfaces: these ask in a dispatch
// of their own, so that no estimate depends on which runs first.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"
#include "refine/head.glsl"
#include "refine/rectangle.glsl"
#include "refine/hardening.glsl"
#include "refine/even.glsl"
#include "refine/light.glsl"
#include "refine/slopes.glsl"
#include "refine/change.glsl"

// Light at a silhouette that a rectangle may have on the wrong side, share of its light.
const float SILHOUETTE = 0.3;
// Crossings up to which one silhouette may take that much.
const float SILHOUETTE_CROSSINGS = 8.0;
// Share of the light at a silhouette that may land in recorded rows from outside.
const float THROWN = 0.05;
// Neighbours whose ray is farther aside, of the side of the rectangle, are not compared.
const float ASIDE = 0.6;
// Part of a side below which a neighbour shows that a silhouette ends along it.
const float PART_OF_SIDE = 0.5;
// Crossings from which on rays beside each other are samples of fine structure, and how many times larger their errors
// are than at a single silhouette: the light of such rays is random, and alike along fibres over several rectangles.
const uint SEVERAL_CROSSINGS = 8u;
const float FINE = 4.0;
// Standard deviation of a share of light, at most: rays that draw normals may have any. An error by the draws themselves
// would split rectangles of rays that are bent far.
const float DRAWN = 0.5;
// Crossings of a ray from which on it says whether its patch is resolved.
const uint TELLING_CROSSINGS = 4u;
// Rectangles in line from which on a silhouette is taken as parallel to them; along a slanting one fewer are alike.
const float IN_LINE = 4.0;
// Places along a side where the corners of a neighbour are looked for, from its middle.
const float CORNER = 0.42;

// Changes towards a neighbour.
struct Change {
    float light;
    float moved; // of the displacement, against what the rectangle predicts
    bool silhouette;
};

// The change if the silhouette towards a neighbour were on the other side.
Change over_silhouette(Own own, Found found) {
    float there = recorded(own, found);
    float lit = max(own.passed, there);
    if (lit == 0.0) return Change(THROWN * light_behind(min(own.found.depth, found.depth)), 0.0, true);
    float moved = own.at + found.displacement - own.found.displacement;
    float light = change_to(own, Landed(there, moved));
    uint crossings = max(max(crossings_of(own.found.flags), crossings_of(found.flags)), 1u);
    float all = SILHOUETTE * min(SILHOUETTE_CROSSINGS / float(crossings), 1.0) * lit;
    return Change(max(light, all), 0.0, true);
}

// The error of the linear result at a neighbour on the same surfaces.
Change on_surface(Own own, Found found) {
    vec2 apart = found.at - own.found.at;
    float depth = found.depth - own.found.depth - dot(own.slopes.depth, apart);
    float moved = found.displacement - own.found.displacement - dot(own.slopes.displacement, apart);
    float there = recorded(own, found);
    if (max(own.passed, there) == 0.0) return Change(0.0, 0.0, false);
    // A slope between rays close to each other may predict any depth.
    float other = there == 0.0 ? 0.0 : min(light_behind(own.found.depth + depth), 2.0 * max(own.passed, there));
    float light = change_to(own, Landed(other, own.at + moved));
    // Light that moves over the border of a row or an edge along z.
    float fall = abs(found.landing - own.found.landing - own.slopes.landing.y * apart.y) / P.row_pitch;
    float down = -own.found.landing / P.row_pitch;
    float low = own.g.z_low + down - fall;
    float high = own.g.z_high + down + fall;
    bool crosses = own.g.z_low <= 0.0 || own.g.z_high >= 1.0 || floor(low) < floor(high)
        || lands_at_edge(own.patch_.row, low, high);
    if (crosses) light += own.passed * min(fall / own.size.y, 1.0);
    return Change(light, abs(moved), false);
}

// An older rectangle beside a younger one that crosses other surfaces is to take that into account.
void ask(Own own, Found found, uint axis, float change) {
    // A younger one that takes a part of the side says that the silhouette ends along it.
    Rectangle older = P.rectangles.at[found.index];
    vec2 size = vec2(older.x_high - older.x_low, older.z_high - older.z_low);
    if (own.size[1u - axis] < PART_OF_SIDE * size[1u - axis]) axis = 1u - axis;
    if (change <= (axis == 0u ? older.change_x : older.change_z)) return;
    atomicMax(P.asked.at[3u * found.index + axis], floatBitsToUint(change));
    if (atomicOr(P.asked.at[3u * found.index + 2u], 1u) == 0u) {
        uint slot = atomicAdd(P.head.at[HEAD_AGAINS], 1u);
        P.again.at[slot] = found.index;
    }
}

Own own_of(uint index) {
    Own own;
    own.g = P.rectangles.at[index];
    own.patch_ = P.patches.at[own.g.patch_index];
    own.column = P.columns.at[own.patch_.column];
    own.found = found_of(own.g, index, vec2(0.0));
    own.size = vec2(own.g.x_high - own.g.x_low, own.g.z_high - own.g.z_low);
    own.passed = recorded(own, own.found);
    own.at = P.magnification * own.found.at.x + own.found.displacement;
    return own;
}

// A place beside a side: 0 and 1 at lower and higher x, 2 and 3 above and below, and along it from its middle.
vec2 place_beside(Own own, uint side, float along) {
    vec2 low = vec2(own.g.x_low, own.g.z_low);
    vec2 high = vec2(own.g.x_high, own.g.z_high);
    vec2 at = own.found.at + along * own.size;
    vec2 out_ = max(1e-4 * own.size, P.beside);
    bool is_low = side % 2u == 0u;
    if (side < 2u) at.x = is_low ? low.x - out_.x : high.x + out_.x;
    else at.y = is_low ? low.y - out_.y : high.y + out_.y;
    return at;
}

// Part of a side, from 0 to 1, between two places along an axis from its begin; none has its end before its begin.
vec2 part_within(float low, float high, float side) {
    if (side == 0.0) return vec2(0.0, low > 0.0 || high < 0.0 ? -1.0 : 1.0);
    float a = low / side;
    float b = high / side;
    return vec2(max(min(a, b), 0.0), min(max(a, b), 1.0));
}

// Adds the light that facets between its rays may bend, by the axis across them. Rectangles no wider than a facet
// have a ray in it.
bool look_at_walls(Own own, inout vec2 change) {
    vec2 metres = vec2(1.0, P.row_height);
    float area = own.size.x * own.size.y;
    vec2 hidden = vec2(0.0);
    uint end = own.patch_.first_wall + own.patch_.walls;
    for (uint i = own.patch_.first_wall; i < end; i++) {
        RefinedWall wall = P.walls.at[i];
        vec2 from = vec2(wall.from_x, wall.from_z);
        vec2 side = vec2(wall.to_x, wall.to_z) - from;
        vec2 along = abs(normalize(side * metres));
        float across = along.y * own.size.x + along.x * own.size.y * P.row_height;
        if (across <= wall.width) continue;
        // Part of the longest side in the rectangle.
        vec2 reach = 0.5 * (own.size + wall.width / metres);
        vec2 low = own.found.at - reach - from;
        vec2 high = own.found.at + reach - from;
        vec2 within_x = part_within(low.x, high.x, side.x);
        vec2 within_z = part_within(low.y, high.y, side.y);
        float length_ = min(within_x.y, within_z.y) - max(within_x.x, within_z.x);
        float light = length_ > 0.0 ? wall.light * length_ : 0.0;
        vec2 taken = abs(side) / own.size;
        hidden += light * (taken.y >= taken.x ? vec2(1.0, 0.0) : vec2(0.0, 1.0));
    }
    vec2 share = min(hidden / (SPREAD * area), vec2(1.0));
    change = max(change, own.passed * share);
    return share != vec2(0.0);
}

Found found_of_own(Own own, vec2 at) {
    return found_at(own.found.index, own.g.patch_index, at.x, at.y);
}

bool is_aside(Own own, Found found, uint side) {
    uint other = 1u - side / 2u;
    return !found.known || abs(found.at[other] - own.found.at[other]) > ASIDE * own.size[other];
}

// Number of rectangles in line beyond a side whose rays crossed the same surfaces, looked at after 1, 2, 4, ... of them;
// `ends` is set if all up to the end of the patch did.
float alike_beyond(Own own, uint side, inout bool ends) {
    uint axis = side / 2u;
    vec2 low = vec2(-0.5 * P.period, 0.0);
    vec2 high = vec2(0.5 * P.period, 1.0);
    bool is_low = side % 2u == 0u;
    float left = is_low ? own.found.at[axis] - low[axis] : high[axis] - own.found.at[axis];
    float most = floor(left / own.size[axis]);
    float count = 0.0;
    for (float apart = 1.0; apart <= most; apart *= 2.0) {
        vec2 at = own.found.at;
        at[axis] += (is_low ? -apart : apart) * own.size[axis];
        Found found = found_of_own(own, at);
        if (is_aside(own, found, side) || !alike(found, own.found)) return count;
        count = apart;
    }
    ends = true;
    return most;
}

// Rectangles along a silhouette that runs parallel to them: it is at one place in all of them, so that their errors
// add. Others err in any way.
float in_line(Own own, vec2 change) {
    if (error_of(own, max(change.x, change.y)) < LITTLE) return 1.0;
    uint side = change.x >= change.y ? 2u : 0u;
    bool ends = false;
    float count = 1.0 + alike_beyond(own, side, ends) + alike_beyond(own, side + 1u, ends);
    return ends && count >= IN_LINE ? count : 1.0;
}

// Error of a rectangle from its largest changes.
void settle(inout Own own, uint index, vec2 change, float moved, bool silhouette) {
    float area = own.size.x * own.size.y;
    precise float light = error_of(own, max(change.x, change.y));
    precise float square = light * light * (silhouette ? in_line(own, change) : 1.0);
    own.g.light_error = square;
    own.g.turn_error = 0.0;
    float lit = open_along_z(own.patch_.row, 0.0, 1.0);
    if (!silhouette && P.displacement_budget > 0.0 && lit > 0.0) {
        precise float turned = SPREAD * moved * area / (P.open_width * lit * P.displacement_budget);
        precise float turned_square = turned * turned;
        own.g.turn_error = turned_square;
    }
    // Rays above one another draw together at an upright silhouette.
    bool upright = (own.found.flags & FLAG_DRAWN) != 0u || own.size.y * P.row_height <= own.size.x;
    bool along_x = change.x > 2.0 * change.y || (change.y <= 2.0 * change.x && upright);
    float most = weigh(own.g, true);
    bool least = along_x ? own.size.x <= P.least.x : own.size.y <= P.least.y;
    precise float weight = most * most;
    own.g.weight = least ? 0.0 : weight;
    count(own.g, true);
    P.rectangles.at[index].light_error = own.g.light_error;
    P.rectangles.at[index].turn_error = own.g.turn_error;
    P.rectangles.at[index].weight = own.g.weight;
    P.rectangles.at[index].change_x = change.x;
    P.rectangles.at[index].change_z = change.y;
    uint flags = own.g.flags & ~RECTANGLE_ALONG_X;
    P.rectangles.at[index].flags = flags | (along_x ? RECTANGLE_ALONG_X : 0u);
}

#ifdef AGAIN
void main() {
    uint item;
    if (!item_of(STAGE_AGAIN, item)) return;
    uint index = P.again.at[item];
    Own own = own_of(index);
    P.asked.at[3u * index + 2u] = 0u;
    if (own.g.parts != 0u) return;
    weigh(own.g, false);
    count(own.g, false);
    vec2 asked = vec2(uintBitsToFloat(P.asked.at[3u * index]), uintBitsToFloat(P.asked.at[3u * index + 1u]));
    settle(own, index, max(vec2(own.g.change_x, own.g.change_z), asked), 0.0, true);
    atomicOr(P.sums.at[sums_of(own.g.patch_index) + PATCH_FLAGS], PATCH_IS_CROSSED);
}
#else
// Whether two rays crossed many surfaces.
bool is_fine(Found a, Found b) {
    return min(crossings_of(a.flags), crossings_of(b.flags)) >= SEVERAL_CROSSINGS;
}

// Changes towards the neighbours at the middles of the sides.
void look_beside(Own own, Found found[4], bool aside[4], inout vec2 change, inout float moved, inout bool silhouette) {
    for (uint side = 0u; side < 4u; side++) {
        bool unlike = found[side].known && is_silhouette(found[side], own.found);
        if (unlike && found[side].index < P.head.at[HEAD_OLDER]) {
            float lit = max(own.passed, recorded(own, found[side]));
            ask(own, found[side], side / 2u, SILHOUETTE * lit);
        }
        if (!found[side].known || (unlike && aside[side])) continue;
        Change towards;
        if (unlike) {
            towards = over_silhouette(own, found[side]);
            if (is_fine(own.found, found[side])) towards.light *= FINE;
        } else if (is_drawn(own.found, found[side])) {
            // Also of rays that are thrown off the detector.
            float lit = max(own.passed, recorded(own, found[side]));
            towards = Change(DRAWN / SPREAD * lit, 0.0, true);
        } else {
            towards = on_surface(own, found[side]);
        }
        change[side / 2u] = max(change[side / 2u], towards.light);
        moved = max(moved, towards.moved);
        silhouette = silhouette || towards.silhouette;
    }
}

// Silhouettes that end along a side.
void look_at_corners(Own own, Found found[4], bool same[4], inout vec2 change, inout bool silhouette) {
    for (uint corner = 0u; corner < 8u; corner++) {
        uint side = corner / 2u;
        vec2 at = place_beside(own, side, corner % 2u == 0u ? -CORNER : CORNER);
        // One neighbour along the whole side is looked at once.
        uint middle = found[side].index;
        if (middle != NO_RECTANGLE && holds(middle, at)) continue;
        Found other = found_of_own(own, at);
        if (!other.known || !is_silhouette(other, own.found) || is_aside(own, other, side)) continue;
        Change towards = over_silhouette(own, other);
        // Where the middle of the side has the same surfaces, the silhouette ends along it.
        uint axis = same[side] ? 1u - side / 2u : side / 2u;
        change[axis] = max(change[axis], towards.light);
        silhouette = true;
    }
}

// Adds changes of the light at a ray: from the mean of the two rays beside it, and between these.
void look_for_structure(Own own, Found found[4], uint words) {
    for (uint axis = 0u; axis < 2u; axis++) {
        Found low = found[2u * axis];
        Found high = found[2u * axis + 1u];
        if (!low.known || !high.known) continue;
        Found mean = low;
        mean.depth = 0.5 * (low.depth + high.depth);
        mean.displacement = 0.5 * (low.displacement + high.displacement);
        add_change(words + PATCH_CHANGES, whole_change_to(own, landed_of(own, mean)));
        Own other = own;
        set_light(other, landed_of(own, low));
        add_change(words + PATCH_FAR_CHANGES, whole_change_to(other, landed_of(own, high)));
    }
}

// Adds the error of a ray that is spread evenly: the light may change by as much as to the next ray along x.
void estimate_even(Own own, uint index, uint words) {
    Even even = even_of(own.g.patch_index);
    if (!has_ray(even, index)) return;
    uint i = ray_of(even, index);
    own.found.at = place_of(even, i);
    own.half_ = 0.5 * abs(P.magnification) * own.size.x;
    set_light(own, Landed(recorded(own, own.found), P.magnification * own.found.at.x + own.found.displacement));
    for (uint apart = 1u; apart <= 2u && i + apart < even.count; apart++) {
        uint next = rectangle_of(even, i + apart);
        Found other = found_of(P.rectangles.at[next], next, vec2(0.0));
        other.at = own.found.at;
        float change = whole_change_to(own, landed_of(own, other));
        add_change(words + (apart == 1u ? PATCH_CHANGES : PATCH_FAR_CHANGES), change);
        if (apart == 1u) {
            precise float light = error_of(own, change);
            precise float square = light * light;
            own.g.light_error = square;
        }
    }
    weigh(own.g, true);
}

void main() {
    uint index;
    if (!item_of(STAGE_ESTIMATE, index)) return;
    Own own = own_of(index);
    uint words = sums_of(own.g.patch_index);
    if ((P.sums.at[words + PATCH_FLAGS] & PATCH_IS_DONE) != 0u) return;
    if (is_even(own.g.patch_index)) {
        estimate_even(own, index, words);
        return;
    }
    Found found[4];
    bool aside[4];
    bool same[4];
    for (uint side = 0u; side < 4u; side++) {
        found[side] = found_of_own(own, place_beside(own, side, 0.0));
        aside[side] = is_aside(own, found[side], side);
        same[side] = found[side].known && alike(found[side], own.found);
    }
    // Steps may lie on a line that is steeper than a result may be.
    own.slopes = followed(own.g, slopes_of(own.found, found, same));
    own.half_ = 0.5 * abs(P.magnification + own.slopes.displacement.x) * own.size.x;
    set_light(own, Landed(own.passed, own.at));
    uint crossings = crossings_of(own.g.flags);
    if (P.head.at[HEAD_LEVELS] < STRUCTURE_LEVELS) {
        if (crossings >= TELLING_CROSSINGS) look_for_structure(own, found, words);
        atomicAdd(P.sums.at[words + PATCH_CROSSINGS], crossings);
        atomicAdd(P.sums.at[words + PATCH_COUNTED], 1u);
    }
    vec2 change = vec2(0.0);
    float moved = 0.0;
    bool silhouette = false;
    look_beside(own, found, aside, change, moved, silhouette);
    if (error_of(own, SILHOUETTE) > LITTLE) look_at_corners(own, found, same, change, silhouette);
    silhouette = look_at_walls(own, change) || silhouette;
    // What the whole knew of an axis holds for its parts.
    if (aside[0] || aside[1]) change.x = max(change.x, own.g.change_x);
    if (aside[2] || aside[3]) change.y = max(change.y, own.g.change_z);
    settle(own, index, change, moved, silhouette);
    uint flags = (own.g.signature != 0u || crossings != 0u ? PATCH_IS_HIT : 0u)
        | (silhouette ? PATCH_IS_CROSSED : 0u);
    if ((P.sums.at[words + PATCH_FLAGS] & flags) != flags) {
        atomicOr(P.sums.at[words + PATCH_FLAGS], flags);
    }
}
#endif
