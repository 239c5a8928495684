// Light of a beamlet by energies and by ways through the masks.

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

// Words of the groups of a beamlet, and of the shares by group and node, and of narrowing by node.
struct GroupShares {
    uint nodes;
    uint groups;
    uint by_group;
    uint narrowings;
};

GroupShares shares_at(uint first) {
    GroupShares shares;
    shares.nodes = first + 1u;
    shares.groups = shares.nodes + S.nodes;
    shares.by_group = shares.groups + 3u * S.groups;
    shares.narrowings = shares.by_group + S.groups * S.nodes;
    return shares;
}

// Columns that the light of a group is merged into; 0: it is not.
uint columns_of(GroupShares shares, uint group) {
    return uint(share_at(shares.groups + 3u * group + 2u));
}

// Whether energies share no edges: each has a list of its own.
bool is_apart(uint first) {
    return share_at(first) != 0.0;
}

// Cells of a rectangle of a patch in the row of its run, by list.
uint bands_of(RefinedPatch patch_) {
    return !has_spectrum() || is_apart(shares_of(patch_)) ? 1u : BANDS;
}

// Lists that a rectangle has cells in, but for groups whose light is merged.
uint lists_of(RefinedPatch patch_) {
    if (!has_spectrum()) return 1u;
    uint first = shares_of(patch_);
    if (is_apart(first)) return S.nodes;
    uint lists = 0u;
    for (uint group = 0u; group < S.groups; group++) lists += columns_of(shares_at(first), group) == 0u ? 1u : 0u;
    return lists;
}
