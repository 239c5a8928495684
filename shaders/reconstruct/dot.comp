// Scalar products of chunks of two vectors, as sums of two f32 each. A workgroup has a chunk; its threads
// sum in a fixed order, and their sums are added pair by pair, so that no bit depends on the scheduling.
// Values are divided by powers of two near the largest of the chunk first: squares of small values lie
// beyond the range of f32.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/DotPush.glsl"
#include "physics/twofold.glsl"

// Bits of the largest absolute values of both vectors, and of the largest value of the first.
shared uint largest_a;
shared uint largest_b;
shared uint most_a;
shared float highs[GROUP];
shared float lows[GROUP];

float first_value(uint n) {
    float value = push.a.at[n];
    if (push.is_weighted == 0u) return value;
    precise float weighted = value * push.weights.at[n];
    return weighted;
}

Twofold plus_product(Twofold sum, float a, float b) {
    Twofold product = two_product(a, b);
    Twofold more = two_sum(sum.high, product.high);
    precise float low = sum.low + (more.low + product.low);
    return Twofold(more.high, low);
}

// Exponent of a number with these bits, within the range of normal numbers.
int exponent_of(uint bits) { return clamp(int(bits >> 23) - 127, -126, 126); }

float power_of_two(int exponent) { return uintBitsToFloat(uint(exponent + 127) << 23); }

void main() {
    uint thread = gl_LocalInvocationID.x;
    uint begin = gl_WorkGroupID.x * DOT_CHUNK;
    uint end = min(begin + DOT_CHUNK, push.count);
    if (thread == 0u) {
        largest_a = 0u;
        largest_b = 0u;
        most_a = 0u;
    }
    barrier();
    uint a = 0u, b = 0u;
    float most = 0.0;
    for (uint n = begin + thread; n < end; n += GROUP) {
        float value = first_value(n);
        a = max(a, floatBitsToUint(abs(value)));
        b = max(b, floatBitsToUint(abs(push.b.at[n])));
        if (value > most) most = value;
    }
    atomicMax(largest_a, a);
    atomicMax(largest_b, b);
    atomicMax(most_a, floatBitsToUint(most));
    barrier();
    ivec2 exponents = ivec2(exponent_of(largest_a), exponent_of(largest_b));
    vec2 scale = vec2(power_of_two(-exponents.x), power_of_two(-exponents.y));
    Twofold sum = Twofold(0.0, 0.0);
    for (uint n = begin + thread; n < end; n += GROUP) {
        sum = plus_product(sum, first_value(n) * scale.x, push.b.at[n] * scale.y);
    }
    highs[thread] = sum.high;
    lows[thread] = sum.low;
    barrier();
    for (uint half_way = GROUP / 2u; half_way > 0u; half_way >>= 1) {
        if (thread < half_way) {
            Twofold both = add(Twofold(highs[thread], lows[thread]),
                Twofold(highs[thread + half_way], lows[thread + half_way]));
            highs[thread] = both.high;
            lows[thread] = both.low;
        }
        barrier();
    }
    if (thread == 0u) {
        int exponent = exponents.x + exponents.y;
        push.sums.at[gl_WorkGroupID.x] =
            DotSum(highs[0], lows[0], exponent, uintBitsToFloat(most_a));
    }
}
