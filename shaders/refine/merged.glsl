// Light that leaks through bars is weak and smooth: rectangles of a patch are merged into columns of equal width.
// Sums are integers, so that they do not depend on the order of their terms.

// Units of a sum. A patch without a sample has the light 1.
const float MERGED_UNIT = 1073741824.0;
// Narrowing that a sum holds at most.
const float MOST_NARROWING = 4.0;

// First word of the columns of a group in a patch.
uint merged_of(uint patch_index, uint group) {
    return (patch_index * S.groups + group) * MERGED_COLUMNS * MERGED_WORDS;
}

float low_of_column(uint column, uint columns) {
    return P.period * (float(column) / float(columns) - 0.5);
}

void add_merged(uint word, float value) {
    atomicAdd(S.merged.at[word], uint(int(round(clamp(value, -1.0, 1.0) * MERGED_UNIT))));
}

float merged_at(uint word) {
    return float(int(S.merged.at[word])) / MERGED_UNIT;
}

// Adds the light of a rectangle to the columns that it is in; not light that lands farther off than these know.
bool merge(uint first, uint columns, Rectangle g, Sums sums) {
    float landing = sums.z / sums.light.y;
    Rows rows = rows_of(g, landing);
    count_landing(landing);
    if (!rows.is_near && P.row_blur <= WIDE) return false;
    float width = g.x_high - g.x_low;
    float column_width = P.period / float(columns);
    float middle = 0.5 * (g.x_low + g.x_high);
    uint low = uint(max((g.x_low + 0.5 * P.period) / column_width, 0.0));
    vec3 x = g.displacement + sums.x / sums.light;
    float fall = log(sums.light.z / sums.light.x);
    vec2 narrowing = sums.narrowing / sums.light.y;
    vec2 narrowing_x = (sums.narrowing_x / sums.light.y + narrowing * g.displacement) / S.reach;
    for (uint column = low; column < columns; column++) {
        float column_low = low_of_column(column, columns);
        float from = max(g.x_low, column_low);
        float to = min(g.x_high, column_low + column_width);
        if (to <= from) continue;
        // Share of the rectangle, from -0.5 to 0.5.
        float at = (0.5 * (from + to) - middle) / width;
        float light = sums.light.y * exp(at * fall) * (to - from) / column_width * (g.z_high - g.z_low);
        float place = (from + to - 2.0 * column_low) / column_width - 1.0;
        float spread = (to - from) / column_width;
        float moved = (x.y + at * (x.z - x.x)) / S.reach;
        float rise = (x.z - x.x) * (to - from) / (width * S.reach);
        float variance = variance_of(sums) / (S.reach * S.reach) + rise * rise / 12.0;
        uint words = first + column * MERGED_WORDS;
        add_merged(words, light);
        add_merged(words + 1u, light * place);
        add_merged(words + 2u, light * (place * place + spread * spread / 3.0));
        add_merged(words + 3u, light * moved);
        add_merged(words + 4u, light * (place * moved + spread * rise / 6.0));
        add_merged(words + 5u, light * (moved * moved + variance));
        add_merged(words + 6u, light * landing / P.row_pitch);
        add_merged(words + 7u, light * sums.slope_x / sums.light.y);
        add_merged(words + 8u, light * rows.above);
        add_merged(words + 9u, light * rows.below);
        add_merged(words + 10u, light * narrowing.x / MOST_NARROWING);
        add_merged(words + 11u, light * narrowing.y / MOST_NARROWING);
        add_merged(words + 12u, light * narrowing_x.x / MOST_NARROWING);
        add_merged(words + 13u, light * narrowing_x.y / MOST_NARROWING);
    }
    return true;
}
