// Values of a sinogram, of sums along rays in slices: times the path from slice to slice, and differences
// of neighbours where the data are refraction angles. BACK: the transpose. Sums of two f32 keep the digits
// that a difference of neighbours loses.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/SinogramPush.glsl"
#include "physics/twofold.glsl"

Twofold absolute(float high, float low) {
    return high < 0.0 ? Twofold(-high, -low) : Twofold(high, low);
}

Twofold larger(Twofold a, Twofold b) {
    if (a.high == b.high) return a.low >= b.low ? a : b;
    return a.high > b.high ? a : b;
}

// Depth from slice to slice on the ray through a place in a row, m: one over the most slices per depth.
Twofold step_of(uint view, uint row, uint place) {
    StepLaw law = push.laws.at[view];
    vec3 high = vec3(push.places.at[2u * place]), low = vec3(push.places.at[2u * place + 1u]);
    vec3 from_middle = vec3(float(row) - 0.5 * float(push.rows - 1u));
    Twofold3 by_place = multiply(Twofold3(law.place_high, law.place_low), Twofold3(high, low));
    Twofold3 by_row = multiply(Twofold3(law.row_high, law.row_low), Twofold3(from_middle, vec3(0.0)));
    Twofold3 slices = add(add(Twofold3(law.high, law.low), by_place), by_row);
    Twofold most = larger(larger(absolute(slices.high.x, slices.low.x),
        absolute(slices.high.y, slices.low.y)), absolute(slices.high.z, slices.low.z));
    precise float inverse = 1.0 / most.high;
    Twofold product = two_product(inverse, most.high);
    precise float rest = ((1.0 - product.high) - product.low) - inverse * most.low;
    precise float correction = rest * inverse;
    return two_sum(inverse, correction);
}

Twofold left_of(uint row, uint column) {
    Slopes slopes = push.slopes.at[row * push.columns + column];
    return Twofold(slopes.left, slopes.left_low);
}

Twofold right_of(uint row, uint column) {
    Slopes slopes = push.slopes.at[row * push.columns + column];
    return Twofold(slopes.right, slopes.right_low);
}

#ifdef BACK
Twofold value_at(uint n) {
    float value = push.values.at[n];
    if (push.is_weighted == 0u) return Twofold(value, 0.0);
    precise float weighted = value * push.weights.at[n];
    return Twofold(weighted, 0.0);
}

float made(uint line, uint place) {
    uint row = line % push.rows;
    uint start = line * push.columns;
    Twofold sum = Twofold(0.0, 0.0);
    if (place < push.columns) sum = multiply(value_at(start + place), left_of(row, place));
    if (push.is_difference != 0u && place > 0u) {
        sum = add(sum, multiply(value_at(start + place - 1u), right_of(row, place - 1u)));
    }
    sum = multiply(sum, step_of(line / push.rows, row, place));
    return sum.high + sum.low;
}
#else
Twofold length_at(uint line, uint place) {
    Twofold ray = Twofold(push.rays.at[line * push.place_count + place], 0.0);
    return multiply(ray, step_of(line / push.rows, line % push.rows, place));
}

float made(uint line, uint column) {
    uint row = line % push.rows;
    Twofold sum = multiply(length_at(line, column), left_of(row, column));
    if (push.is_difference != 0u) {
        sum = add(sum, multiply(length_at(line, column + 1u), right_of(row, column)));
    }
    return sum.high + sum.low;
}
#endif

void main() {
    uint first = gl_WorkGroupID.x * CHUNK;
    uint end = min(first + CHUNK, push.count);
    for (uint n = first + gl_LocalInvocationID.x; n < end; n += GROUP) {
#ifdef BACK
        push.rays.at[n] = made(n / push.place_count, n % push.place_count);
#else
        push.values.at[n] = made(n / push.columns, n % push.columns);
#endif
    }
}
