// Light of several energies as one cell (docs/developers/numerics.md, "Cells of all energies").

// Bend of the logarithm of light over a whole beamlet that parts energies.
const float BEND = 2e-5;
// Light below this, of open beam, is left out.
const float DARK = 1e-18;

// Sums over energies, weighted with their light: at the low end, in the middle and at the high end; the others in
// the middle. Displacements are counted from the displacement of the ray.
struct Sums {
    vec3 light;
    vec3 x;
    float x2;
    float z;
    float z2;
    float slope_x;
    vec2 narrowing; // by either mask
    vec2 narrowing_x;
    vec2 along_z; // refraction, where the ray has 1, and optical depth
};

Sums no_sums() {
    return Sums(vec3(0.0), vec3(0.0), 0.0, 0.0, 0.0, 0.0, vec2(0.0), vec2(0.0), vec2(0.0));
}

float variance_of(Sums sums) {
    float mean = sums.x.y / sums.light.y;
    return max(sums.x2 / sums.light.y - mean * mean, 0.0);
}

float variance_along_z(Sums sums) {
    float mean = sums.z / sums.light.y;
    return max(sums.z2 / sums.light.y - mean * mean, 0.0);
}

// Whether one cell has the light of several energies; `all`: light of the rectangle in all groups. It may err by
// `scale` times the tolerances, and its displacements spread by so much.
bool is_one(Sums sums, float all, float scale, vec2 spread) {
    if (any(lessThan(sums.light, vec3(DARK)))) return true;
    float part = sums.light.y / all;
    float bend = abs(sums.light.y / sqrt(sums.light.x * sums.light.z) - 1.0);
    vec3 x = sums.x / sums.light;
    float drift = abs(x.y - 0.5 * (x.x + x.z));
    return part * bend <= BEND * scale && part * drift <= S.tolerance * scale
        && part * variance_of(sums) <= spread.x * spread.x
        && part * variance_along_z(sums) <= spread.y * spread.y;
}

// Writes a cell row, of a list.
void push_row(uint list, Rectangle g, RefinedPatch patch_, Made made) {
    if (made.count == 0u) return;
    P.cell_rows.at[made.first] = row_of(made, g, patch_);
    uint kind = 2u * list + (made.is_near ? 0u : 1u);
    uint mark = 3u * atomicAdd(S.counts.at[2u * (S.groups + S.nodes)], 1u);
    S.marks.at[mark] = kind;
    S.marks.at[mark + 1u] = atomicAdd(S.counts.at[kind], 1u);
    S.marks.at[mark + 2u] = made.first;
}
