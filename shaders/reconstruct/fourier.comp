// Discrete Fourier transforms of planes, pass by pass (Stockham), and the filter 1/|k|. Two planes of a
// volume are the real and the imaginary part of one of complex numbers: a real filter that is even keeps
// them apart.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/FourierPush.glsl"

vec2 number_at(uint n) { return vec2(push.from.at[2u * n], push.from.at[2u * n + 1u]); }

void write(uint n, vec2 number) {
    push.to.at[2u * n] = number.x;
    push.to.at[2u * n + 1u] = number.y;
}

vec2 times(vec2 a, vec2 b) { return vec2(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x); }

// A root of one: exp(-2 pi i n / numbers of a line), or its conjugate.
vec2 root(uint n) {
    uint at = n << (push.log_roots - push.log_numbers);
    vec2 forward = vec2(push.roots.at[2u * at], push.roots.at[2u * at + 1u]);
    return push.is_inverse != 0u ? vec2(forward.x, -forward.y) : forward;
}

// The lower bits of a number.
uint low_bits(uint n, uint bits) { return n & ((1u << bits) - 1u); }

// 1/|k| of a number of a plane.
float filter_at(uint x, uint y) {
    uvec2 at = uvec2(x, y);
    uvec2 size = uvec2(1u << push.log_wide, 1u << push.log_high);
    vec2 frequency = vec2(min(at, size - at)) / vec2(size);
    return 1.0 / (max(length(frequency), push.least) * float(size.x) * float(size.y));
}

// A number of a line; those behind the valid ones are 0.
vec2 input_at(uint start, uint n, uint column) {
    if (n >= push.valid) return vec2(0.0);
    vec2 number = number_at(start + (n << push.log_stride));
    return push.is_filtered != 0u ? number * filter_at(column, n) : number;
}

// Joins the transforms of 2^log_joined numbers, two or four at a time. Lines are rows, or columns if
// `log_stride` is not 0. Sides are powers of two: items have their places by bits.
void join(uint item) {
    uint log_radix = push.kind == FOURIER_PAIRS ? 1u : 2u;
    uint log_part = push.log_numbers - log_radix;
    uint part = 1u << log_part;
    uint column = low_bits(item, push.log_stride);
    uint n = low_bits(item >> push.log_stride, log_part);
    uint line = item >> (push.log_stride + log_part);
    uint row = 0u;
    if (push.log_stride == 0u) {
        row = low_bits(line, push.log_high - 1u);
        if (row >= push.size_y) return;
        line >>= push.log_high - 1u;
    }
    uint start = (line << (push.log_wide + push.log_high)) + (row << push.log_wide) + column;
    uint k = low_bits(n, push.log_joined);
    uint turn = k << (log_part - push.log_joined);
    uint to = start + ((((n - k) << log_radix) + k) << push.log_stride);
    uint by = 1u << (push.log_joined + push.log_stride);
    vec2 a = input_at(start, n, column);
    vec2 b = times(input_at(start, n + part, column), root(turn));
    if (log_radix == 1u) {
        write(to, a + b);
        write(to + by, a - b);
        return;
    }
    vec2 c = times(input_at(start, n + 2u * part, column), root(2u * turn));
    vec2 d = times(input_at(start, n + 3u * part, column), root(3u * turn));
    vec2 even = a + c, odd = a - c, sum = b + d, change = b - d;
    vec2 turned = push.is_inverse != 0u ? vec2(-change.y, change.x) : vec2(change.y, -change.x);
    write(to, even + sum);
    write(to + by, odd + turned);
    write(to + 2u * by, even - sum);
    write(to + 3u * by, odd - turned);
}

// Two planes of a volume become one of complex numbers, or the way back; items cover a quarter of a plane,
// which contains all voxels.
void pack(uint item) {
    uint x = low_bits(item, push.log_wide - 1u);
    uint y = low_bits(item >> (push.log_wide - 1u), push.log_high - 1u);
    uint pair = item >> (push.log_wide + push.log_high - 2u);
    if (x >= push.size_x || y >= push.size_y) return;
    uint number = (((pair << push.log_high) + y) << push.log_wide) + x;
    uint first = (2u * pair * push.size_y + y) * push.size_x + x;
    uint second = first + push.size_x * push.size_y;
    if (push.kind == FOURIER_PACK) {
        float other = second < push.voxels ? push.from.at[second] : 0.0;
        write(number, vec2(push.from.at[first], other));
        return;
    }
    vec2 both = number_at(number);
    push.to.at[first] = both.x;
    if (second < push.voxels) push.to.at[second] = both.y;
}

void work(uint item) {
    if (push.kind == FOURIER_PACK || push.kind == FOURIER_UNPACK) {
        pack(item);
    } else {
        join(item);
    }
}

void main() {
    uint apart = gl_NumWorkGroups.x * FOURIER_CHUNK;
    for (uint first = gl_WorkGroupID.x * FOURIER_CHUNK; first < push.count; first += apart) {
        uint end = min(first + FOURIER_CHUNK, push.count);
        for (uint item = first + gl_LocalInvocationID.x; item < end; item += GROUP) work(item);
    }
}
