// Light of a cell row may land in any row: each of its terms goes to the sums at once. Past walls along z, cells that
// land no farther than in the rows beside know their shares of these, as elsewhere.

// Rows below `at` that receive light spread evenly over rows from 0 on, with a blur.
float rows_before(float at, float blur) {
    if (at >= NO_LIGHT * blur) return at;
    return at <= -NO_LIGHT * blur ? 0.0 : blur * ramp(at / blur);
}

// Adds light of a cell to all rows where it lands, for each row of the cell row.
void spread_over_rows(Cell cell, int pixel, uint mask_step, float value) {
    float shift = light.row_shift - cell.displacement_z / light.row_pitch;
    float top = cell_row.top + shift;
    float bottom = cell_row.bottom + shift;
    float per_row = value / (cell_row.bottom - cell_row.top);
    float reach = NO_LIGHT * light.row_blur;
    float threshold = rounding_thresholds(pixel).x;
    float before = 0.0;
    int last = int(floor(bottom + reach));
    for (int r = int(floor(top - reach)); r <= last; r++) {
        float end = float(r + 1);
        float through = rows_before(end - top, light.row_blur)
            - rows_before(end - bottom, light.row_blur);
        uvec2 words = fixed_point(per_row * (through - before), threshold);
        for (uint k = 0u; k < cell_row.rows; k++) {
            add_to_pixel(cell_row.row + r + int(k), pixel, mask_step, words);
        }
        before = through;
    }
}

// Adds light of a cell to its row and the two beside it.
void add_shares(Cell cell, int pixel, uint mask_step, float value) {
    vec3 rows = value * vec3(cell.share_above, 1.0 - cell.share_above - cell.share_below, cell.share_below);
    vec3 thresholds = rounding_thresholds(pixel);
    for (int r = -1; r <= 1; r++) {
        uvec2 words = fixed_point(rows[r + 1], thresholds[r + 1]);
        for (uint k = 0u; k < cell_row.rows; k++) {
            add_to_pixel(cell_row.row + r + int(k), pixel, mask_step, words);
        }
    }
}

// Where light of a cell row goes at one mask step.
struct Landing {
    uint mask_step;
};

// `faint`: light that stays in its pixel; `pixels`: the first and last that light may reach.
Landing landing_begin(uint mask_step, float faint, ivec2 pixels) {
    Landing landing = Landing(mask_step);
    if (faint > 0.0) {
        spread_over_rows(push.cells.at[cell_row.first_cell], beamlet.pixel, mask_step, faint);
    }
    return landing;
}

// Light of a cell lands in a pixel, counted from the beamlet's own.
void land(inout Landing landing, Cell cell, int pixel, float value) {
    if (light.rows_apart == 0u && cell.share_above >= 0.0) {
        add_shares(cell, beamlet.pixel + pixel, landing.mask_step, value);
    } else {
        spread_over_rows(cell, beamlet.pixel + pixel, landing.mask_step, value);
    }
}

void landing_end(Landing landing) {}
