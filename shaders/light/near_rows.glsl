// Light of a cell row lands in its own row and the two beside it. What lands in three pixels waits in
// registers until the step ends.

// Adds light that waits for a pixel: in the row above a cell row's, its own and the one below, for
// each row of the cell row, to the same sums as if each row had its own cell row.
void flush(int pixel, uint mask_step, vec3 waiting) {
    int rows = int(cell_row.rows);
    vec3 thresholds = rounding_thresholds(pixel);
    uvec2 above = fixed_point(waiting.x, thresholds.x);
    uvec2 own = fixed_point(waiting.y, thresholds.y);
    uvec2 below = fixed_point(waiting.z, thresholds.z);
    int r = -1;
    do {
        uvec2 value = r < rows - 1 ? above : uvec2(0u);
        if (r >= 0 && r < rows) value = plus(value, own);
        if (r > 0) value = plus(value, below);
        add_to_pixel(cell_row.row + r, pixel, mask_step, value);
        r++;
    } while (r <= rows);
}

// Where light of a cell row goes at one mask step.
struct Landing {
    uint mask_step;
    // Light that waits, by rows: of the pixel `base`, counted from the own, and the next two.
    int base;
    vec3 left;
    vec3 middle;
    vec3 right;
    // Of these, those with light.
    int first_lit;
    int last_lit;
};

// `faint`: light that stays in its pixel; `pixels`: the first and last that light may reach.
Landing landing_begin(uint mask_step, float faint, ivec2 pixels) {
    // Three pixels that light reaches, or else the own and its neighbours.
    int base = pixels.y < pixels.x + 3 ? pixels.x : -1;
    Landing landing = Landing(mask_step, base, vec3(0.0), vec3(0.0), vec3(0.0),
                              faint > 0.0 ? 0 : base + 3, faint > 0.0 ? 0 : base - 1);
    landing.left.y = base == 0 ? faint : 0.0;
    landing.middle.y = base == -1 ? faint : 0.0;
    landing.right.y = base == -2 ? faint : 0.0;
    return landing;
}

// Light of a cell lands in a pixel, counted from the beamlet's own.
void land(inout Landing landing, Cell cell, int pixel, float value) {
    int base = landing.base;
    vec3 rows = value * vec3(cell.share_above, 1.0 - cell.share_above - cell.share_below, cell.share_below);
    landing.left += pixel == base ? rows : vec3(0.0);
    landing.middle += pixel == base + 1 ? rows : vec3(0.0);
    landing.right += pixel == base + 2 ? rows : vec3(0.0);
    bool waits = value != 0.0 && pixel >= base && pixel <= base + 2;
    landing.first_lit = waits ? min(landing.first_lit, pixel) : landing.first_lit;
    landing.last_lit = waits ? max(landing.last_lit, pixel) : landing.last_lit;
    if (value != 0.0 && !waits) {
        flush(beamlet.pixel + pixel, landing.mask_step, rows);
    }
}

void landing_end(Landing landing) {
    int base = landing.base;
    int pixel = landing.first_lit;
    do {
        vec3 waiting = pixel == base ? landing.left
            : (pixel == base + 1 ? landing.middle : landing.right);
        if (pixel <= landing.last_lit) {
            flush(beamlet.pixel + pixel, landing.mask_step, waiting);
        }
        pixel++;
    } while (pixel <= landing.last_lit);
}
