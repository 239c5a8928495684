// Apertures that end along z. Places are rows downwards, from the upper end of a row.

#define H P.heights.at[0]

// Rows before a place that apertures open, which follow from 0 on.
float open_before(float at) {
    precise float periods = floor(at / H.period);
    precise float open = periods * H.height + min(at - periods * H.period, H.height);
    return open;
}

// Largest share of the light between two places that the sample mask lets through along z at a step.
float open_along_z(int row, float low, float high) {
    if (!has_heights() || H.top_count == 0u) return 1.0;
    float place = P.rows.at[uint(row - P.first_row)].lit_place;
    float most = 0.0;
    for (uint i = 0u; i < H.top_count; i++) {
        precise float from = place - H.tops.at[i];
        precise float begin = from + low;
        precise float end = from + high;
        precise float open = open_before(end) - open_before(begin);
        most = max(most, open);
    }
    precise float share = most / (high - low);
    return min(share, 1.0);
}

// Edges of the detector mask along z up to a place.
float edges_before(float at) {
    float periods = floor(at / H.edge_period);
    float rest = at - periods * H.edge_period;
    uint first = 0u;
    uint last = H.edge_count;
    while (first < last) {
        uint middle = (first + last) / 2u;
        bool before = H.edges.at[middle] <= rest;
        first = before ? middle + 1u : first;
        last = before ? last : middle;
    }
    return periods * float(H.edge_count) + float(first);
}

// Whether an edge of the detector mask along z lies between two places.
bool lands_at_edge(int row, float low, float high) {
    if (!has_heights() || H.edge_count == 0u) return false;
    float place = P.rows.at[uint(row - P.first_row)].landing_place;
    return edges_before(place + low) != edges_before(place + high);
}
