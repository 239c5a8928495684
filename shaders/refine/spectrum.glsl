// Light of several energies as one cell (docs/physics.md, "Spectra").

#define S P.spectrum.at[0]

// Bend of the logarithm of light over a whole beamlet that parts energies.
const float BEND = 2e-5;
// Light below this, of open beam, is left out.
const float DARK = 1e-18;

// Words of the shares of a beamlet in a block of rows: whether energies share no edges; the share of each node in
// all groups; first and last node of each group, and columns of a patch that it is merged into; shares by group and
// node; narrowing by either mask by node.
uint shares_of(RefinedPatch patch_) {
    int block = int(floor(float(patch_.row) / float(S.alike_rows))) - S.first_block;
    uint words = 1u + S.nodes + S.groups * (3u + S.nodes) + 2u * S.nodes;
    return (uint(block) * S.columns + patch_.column) * words;
}

float share_at(uint word) {
    Floats shares = S.shares;
    return shares.at[word];
}

// Sums over energies, weighted with their light: at the low end, in the middle and at the high end; the others in
// the middle. Displacements are counted from that of the ray.
struct Sums {
    vec3 light;
    vec3 x;
    float x2;
    float z;
    float slope_x;
    vec2 narrowing; // by either mask
    vec2 narrowing_x;
};

Sums no_sums() {
    return Sums(vec3(0.0), vec3(0.0), 0.0, 0.0, 0.0, vec2(0.0), vec2(0.0));
}

float variance_of(Sums sums) {
    float mean = sums.x.y / sums.light.y;
    return max(sums.x2 / sums.light.y - mean * mean, 0.0);
}

// Whether one cell has the light of several energies; `all`: light of the rectangle in all groups. It may err by
// `scale` times the tolerances, and its displacements spread by so much.
bool is_one(Sums sums, float all, float scale, float spread) {
    if (any(lessThan(sums.light, vec3(DARK)))) return true;
    float part = sums.light.y / all;
    float bend = abs(sums.light.y / sqrt(sums.light.x * sums.light.z) - 1.0);
    vec3 x = sums.x / sums.light;
    float drift = abs(x.y - 0.5 * (x.x + x.z));
    return part * bend <= BEND * scale && part * drift <= S.tolerance * scale
        && part * variance_of(sums) <= spread * spread;
}

// Writes a cell of a list.
void push_cell(uint list, Rectangle g, RefinedPatch patch_, Rows rows, Cell cell) {
    uint slot = atomicAdd(S.counts.at[2u * (S.groups + S.nodes)], 1u);
    write_cell(slot, g, patch_, cell);
    uint kind = 2u * list + (rows.is_near ? 0u : 1u);
    S.marks.at[2u * slot] = kind;
    S.marks.at[2u * slot + 1u] = atomicAdd(S.counts.at[kind], 1u);
}
