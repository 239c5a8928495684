#version 460
// Light of cells: one invocation per strip and some mask steps integrates every cell over the
// sample mask, the focal spot, the detector mask and the pixels (docs/physics.md, "Cells").
// With FAR light may land in rows other than its own and the two beside it.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/IlluminatePush.glsl"

#include "physics/gauss.glsl"
#include "light/sum.glsl"
#include "light/mask.glsl"
#include "light/window.glsl"
#include "light/response.glsl"

void add_to_pixel(Light light, int row, int pixel, uint mask_step, uvec2 value) {
    uint index;
    if (value == uvec2(0u) || !place_of_light(light, row, pixel, mask_step, index)) return;
    add_words(push.sums, index, value);
}

#ifdef FAR
// Rows that light lands on which is evenly spread over as many from 0 on.
float rows_before(float at, float blur) {
    if (at >= 6.0 * blur) return at;
    return at <= -6.0 * blur ? 0.0 : blur * ramp(at / blur);
}

// Adds light of a cell to all rows where it lands, for each row of the strip.
void spread_over_rows(Light light, Strip strip, Cell cell, int pixel, uint mask_step, float value) {
    float shift = light.row_move - cell.displacement_z / light.row_pitch;
    float top = strip.top + shift;
    float bottom = strip.bottom + shift;
    float per_row = value / (strip.bottom - strip.top);
    float reach = 6.0 * light.row_blur;
    float before = 0.0;
    int last = int(floor(bottom + reach));
    for (int r = int(floor(top - reach)); r <= last; r++) {
        float end = float(r + 1);
        float through = rows_before(end - top, light.row_blur)
            - rows_before(end - bottom, light.row_blur);
        uvec2 words = fixed_point(per_row * (through - before));
        for (uint k = 0u; k < strip.rows; k++) {
            add_to_pixel(light, strip.row + r + int(k), pixel, mask_step, words);
        }
        before = through;
    }
}
#else
// Adds light that waits for a pixel: in the row above a strip's, its own and the one below, for
// each row of the strip, to the same sums as if each row had its own strip.
void flush(Light light, Strip strip, int pixel, uint mask_step, vec3 waiting) {
    int rows = int(strip.rows);
    uvec2 above = fixed_point(waiting.x);
    uvec2 own = fixed_point(waiting.y);
    uvec2 below = fixed_point(waiting.z);
    int r = -1;
    do {
        uvec2 value = r < rows - 1 ? above : uvec2(0u);
        if (r >= 0 && r < rows) value = plus(value, own);
        if (r > 0) value = plus(value, below);
        add_to_pixel(light, strip.row + r, pixel, mask_step, value);
        r++;
    } while (r <= rows);
}
#endif

// The first cell that ends beyond x; cells are sorted.
uint cell_beyond(Strip strip, float x) {
    uint first = 0u;
    uint last = strip.count;
    do {
        uint middle = (first + last) / 2u;
        bool beyond = push.cells.at[strip.first + middle].x_high > x;
        last = beyond ? middle : last;
        first = beyond ? first : middle + 1u;
    } while (first < last);
    return first;
}

void main() {
    uint index = push.first_strip + gl_GlobalInvocationID.x;
    uint mask_step = push.first_step + gl_GlobalInvocationID.y * push.steps_each;
    uint last_step = min(mask_step + push.steps_each, push.last_step);
    if (gl_GlobalInvocationID.x >= push.strip_count || mask_step >= last_step) return;
    Light light = push.light_ref.at[0];
    Strip strip = push.strips.at[index];
    Column column = Columns(light.columns).at[strip.column];
    column.sample_offset += light.mask_move;
    column.aperture_offset -= light.landing_move;
    column.pixel_offset -= light.pixel_move;
    column.slope -= light.slope_move;
    // Rows of a block see the bars under one angle.
    float block = (floor(float(strip.row) / light.alike_rows) + 0.5) * light.alike_rows;
    float row_z = (block - light.middle_row) * light.row_slope;

    Mask mask = light.sample_mask;
    Mask behind = light.detector_mask;
    bool masked = mask.present != 0u;
    bool barred = behind.present != 0u;
    float sec = secant(column.slope, row_z);
    float behind_blur = barred ? light.spot : light.pixel_spot;
    Bars bars = bars_of(mask, column.slope, sec, behind_blur / light.magnification);
    Bars bars_behind = bars_of(behind, column.slope, sec, light.spot);
    column.sample_offset -= bars.lattice_shift;
    column.aperture_offset -= bars_behind.lattice_shift;
    float leak = bars.leak;
    float leak_behind = bars_behind.leak;
    vec2 soft = vec2(bars.variance, bars_behind.variance);

    // Faint light stays in its pixel.
    float faint = 0.0;
    if (masked && leak > NEGLIGIBLE && leak < FAINT) {
        faint = leak * strip.light * light.weight * (strip.bottom - strip.top)
            * (leak_behind + bars_behind.open * (barred ? open_part(behind) : 1.0));
    }
    // More of it is summed once for all mask steps, behind the last.
    bool leaks = masked && leak >= FAINT;
    // A source without extent, or cells in the plane of the mask: the cut is sharp.
    bool sharp = light.shift <= 0.0;
    float reach = 6.5 * light.shift;
    Aperture ends = Aperture(push.cells.at[strip.first].x_low,
                             push.cells.at[strip.first + strip.count - 1u].x_high);
    // How far light of the strip lands from where it stands.
    float growth = light.magnification + strip.bend;
    float blur = max(light.spot * light.spot + soft.y, light.pixel_spot * light.pixel_spot);
    blur = sqrt(blur + growth * growth * soft.x + strip.spread);
    float low_landing = strip.low_landing + column.pixel_offset - 6.5 * blur;
    float high_landing = strip.high_landing + column.pixel_offset + 6.5 * blur;
    // Far outside the detector there is nothing to sum.
    int first_pixel = -column.pixel;
    int last_pixel = int(light.column_count) - 1 - column.pixel;
    uint turn = mask_step;
    uint last_turn = last_step + (leaks && mask_step == 0u ? 1u : 0u);

    do {
        mask_step = turn < last_step ? turn : push.steps;
        bool at_all_steps = mask_step == push.steps;
        float offset = 0.0;
        int from = 0;
        int apertures = 0;
        float lit_low = ends.low;
        float lit_high = ends.high;
        if (!at_all_steps && bars.open > 0.0) {
            offset = Offsets(light.offsets).at[mask_step] - column.sample_offset;
            float edge = bars.reach + reach;
            from = int(ceil((ends.low - offset - edge) / mask.period));
            int to = int(floor((ends.high - offset + edge) / mask.period));
            apertures = max(to - from + 1, 0) * int(mask.count * bars.layers);
            lit_low = max(lit_low, float(from) * mask.period + offset - edge);
            lit_high = min(lit_high, float(to) * mask.period + offset + edge);
        }
        bool lit = lit_high > lit_low;
        int low_pixel = 0;
        int high_pixel = 0;
        if (lit) {
            low_pixel = int(floor((light.magnification * lit_low + low_landing) / light.pixel + 0.5));
            high_pixel = int(floor((light.magnification * lit_high + high_landing) / light.pixel + 0.5));
        }
        if (faint > 0.0) {
            low_pixel = min(low_pixel, 0);
            high_pixel = max(high_pixel, 0);
        }
        low_pixel = max(low_pixel, first_pixel);
        high_pixel = min(high_pixel, last_pixel);
#ifdef FAR
        if (faint > 0.0) {
            Cell cell = push.cells.at[strip.first];
            spread_over_rows(light, strip, cell, column.pixel, mask_step, faint);
        }
#else
        // Three pixels in registers, those that light reaches or else the own and its neighbours.
        int base = high_pixel < low_pixel + 3 ? low_pixel : -1;
        vec3 left = vec3(0.0), middle = vec3(0.0), right = vec3(0.0);
        left.y = base == 0 ? faint : 0.0;
        middle.y = base == -1 ? faint : 0.0;
        right.y = base == -2 ? faint : 0.0;
        // Of these, those with light.
        int first_lit = faint > 0.0 ? 0 : base + 3;
        int last_lit = faint > 0.0 ? 0 : base - 1;
#endif
        // What the bars leak, of every cell, or each layer of each aperture with the cells that it
        // lets light through.
        int n = at_all_steps ? -1 : 0;
        Place place = Place(from, 0u);
        uint layer_index = 0u;
        do {
            uint i = n < 0 ? 0u : strip.count;
            float beyond = 1e30;
            float centre = 0.0;
            Aperture aperture = Aperture(0.0, 0.0);
            Layer layer = Layer(leak, 0.0, 0.0, 0.0);
            if (n >= 0 && n < apertures) {
                layer = layer_of(bars, layer_index);
                aperture = aperture_of(mask, place);
                centre = float(place.period) * mask.period + offset;
                layer_index++;
                if (layer_index == bars.layers) {
                    place = next_place(mask, place);
                    layer_index = 0u;
                }
                // Of the cells of averaged masks it is narrower.
                Edges widest = edges_of(mask, bars, layer, aperture, centre, column.slope,
                                        light.cell_plane, source_spot(light), 0.0);
                i = cell_beyond(strip, widest.low - reach);
                beyond = widest.high + reach;
            }
            // A cell and a pixel at a time: where a driver runs every branch, invocations would
            // wait for the one whose cell reaches most pixels.
            Cell cell;
            Piece piece;
            int q = 0;
            int last = -1;
            int home = 0;
            do {
                if (q > last && i < strip.count) {
                    cell = push.cells.at[strip.first + i];
                    // Cells of several energies may share an interval.
                    uint next = min(i + 1u, strip.count - 1u);
                    bool is_last = next == i || push.cells.at[strip.first + next].x_low >= beyond;
                    i = is_last ? strip.count : next;
                    float from_x = cell.x_low;
                    float to_x = cell.x_high;
                    Edges edges = Edges(from_x, to_x, 0.0, 0.0);
                    bool cut = false;
                    if (n >= 0) {
                        edges = edges_of(mask, bars, layer, aperture, centre, column.slope,
                                         light.cell_plane, source_spot(light), cell.sample_shade);
                        cut = !sharp && (edges.low + reach > from_x || edges.high - reach < to_x);
                        if (sharp) {
                            from_x = max(from_x, edges.low);
                            to_x = min(to_x, edges.high);
                        }
                    }
                    bool passes = edges.high > edges.low && edges.high + reach > cell.x_low
                        && edges.low - reach < cell.x_high && to_x > from_x;
                    float share = passes ? layer.share : 0.0;
                    vec2 softness = vec2(layer.variance, soft.y);
                    piece = piece_of(light, strip, cell, from_x, to_x, share, softness);
                    if (cut) {
                        cut_by(piece, from_x, to_x, edges, light.shift);
                        piece.sample_lean = mask.thickness * bars.slope * cell.sample_lean / (to_x - from_x);
                    }
                    float span = abs(piece.half_width) + 6.5 * max(piece.blur, piece.pixel_blur);
                    float landing = piece.middle + column.pixel_offset - piece.pixel_shift;
                    float first_landing = landing - span;
                    float last_landing = landing + span;
                    vec2 passing = between_edges(piece);
                    float middle_landing = landing + 0.5 * (passing.x + passing.y) * piece.half_width;
                    home = int(floor(middle_landing / light.pixel + 0.5));
                    if (barred && leak_behind < FAINT) {
                        // Only pixels with an aperture in reach, and that of faint light.
                        ivec2 reached = periods_in_reach(behind, bars_behind, column, piece);
                        float to_edges = column.pixel_offset - piece.pixel_shift - column.aperture_offset;
                        first_landing = max(first_landing,
                                            float(reached.x) * behind.period - bars_behind.reach + to_edges);
                        last_landing = min(last_landing,
                                           float(reached.y) * behind.period + bars_behind.reach + to_edges);
                    }
                    q = int(floor(first_landing / light.pixel + 0.5));
                    last = int(floor(last_landing / light.pixel + 0.5));
                    if (leak_behind >= NEGLIGIBLE) {
                        q = min(q, home);
                        last = max(last, home);
                    }
                    q = max(q, low_pixel);
                    last = share > 0.0 ? min(last, high_pixel) : q - 1;
                }
                if (q <= last) {
                    float edge = (float(q) - 0.5) * light.pixel - column.pixel_offset + piece.pixel_shift;
                    float value = piece.amount * response(light, column, bars_behind, piece, edge,
                                                          edge + light.pixel, q == home);
                    if (!(value > 0.0)) value = 0.0;
#ifdef FAR
                    spread_over_rows(light, strip, cell, column.pixel + q, mask_step, value);
#else
                    vec3 rows = value * vec3(cell.above, 1.0 - cell.above - cell.below, cell.below);
                    left += q == base ? rows : vec3(0.0);
                    middle += q == base + 1 ? rows : vec3(0.0);
                    right += q == base + 2 ? rows : vec3(0.0);
                    bool waits = value > 0.0 && q >= base && q <= base + 2;
                    first_lit = waits ? min(first_lit, q) : first_lit;
                    last_lit = waits ? max(last_lit, q) : last_lit;
                    if (value > 0.0 && !waits) {
                        flush(light, strip, column.pixel + q, mask_step, rows);
                    }
#endif
                    q++;
                }
            } while (i < strip.count || q <= last);
            n++;
        } while (n < apertures);
#ifndef FAR
        int q = first_lit;
        do {
            vec3 waiting = q == base ? left : (q == base + 1 ? middle : right);
            if (q <= last_lit) flush(light, strip, column.pixel + q, mask_step, waiting);
            q++;
        } while (q <= last_lit);
#endif
        turn++;
    } while (turn < last_turn);
}
