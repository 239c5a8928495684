#version 460
// Discrete Fourier transforms of planes, pass by pass (Stockham), and the filter 1/|k|. Two planes of a
// volume are the real and the imaginary part of one of complex numbers: a real filter that is even keeps
// them apart.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/FourierPush.glsl"

vec2 number_at(uint n) { return vec2(push.from.at[2u * n], push.from.at[2u * n + 1u]); }

void write(uint n, vec2 number) {
    push.to.at[2u * n] = number.x;
    push.to.at[2u * n + 1u] = number.y;
}

vec2 times(vec2 a, vec2 b) { return vec2(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x); }

// A root of one: exp(-2 pi i n / length), or its conjugate.
vec2 root(uint n) {
    uint at = n * (push.roots_count / push.numbers);
    vec2 forward = vec2(push.roots.at[2u * at], push.roots.at[2u * at + 1u]);
    return push.is_inverse != 0u ? vec2(forward.x, -forward.y) : forward;
}

// A number of a line; those behind the valid ones are 0.
vec2 input_at(uint start, uint n) {
    return n < push.valid ? number_at(start + n * push.stride) : vec2(0.0);
}

// Joins the transforms of `push.joined` numbers, two or four at a time.
void join(uint item) {
    uint radix = push.kind == FOURIER_PAIRS ? 2u : 4u;
    uint part = push.numbers / radix;
    uint n = item / push.stride % part;
    uint line = item / (push.stride * part);
    uint start = line / push.lines * push.wide * push.high + line % push.lines * push.wide
        + item % push.stride;
    uint k = n & (push.joined - 1u);
    uint turn = k * (part / push.joined);
    uint to = start + ((n - k) * radix + k) * push.stride;
    uint by = push.joined * push.stride;
    vec2 a = input_at(start, n);
    vec2 b = times(input_at(start, n + part), root(turn));
    if (radix == 2u) {
        write(to, a + b);
        write(to + by, a - b);
        return;
    }
    vec2 c = times(input_at(start, n + 2u * part), root(2u * turn));
    vec2 d = times(input_at(start, n + 3u * part), root(3u * turn));
    vec2 even = a + c, odd = a - c, sum = b + d, change = b - d;
    vec2 turned = push.is_inverse != 0u ? vec2(-change.y, change.x) : vec2(change.y, -change.x);
    write(to, even + sum);
    write(to + by, odd + turned);
    write(to + 2u * by, even - sum);
    write(to + 3u * by, odd - turned);
}

// Place of a voxel among the complex numbers, for voxels counted plane by plane, pair by pair.
uint place_of(uint voxel) {
    uint area = push.size_x * push.size_y;
    uint within = voxel % area;
    uint pair = voxel / (2u * area);
    return (pair * push.high + within / push.size_x) * push.wide + within % push.size_x;
}

void pack(uint item) {
    uint area = push.size_x * push.size_y;
    uint first = item / area * 2u * area + item % area;
    float second = first + area < push.voxels ? push.from.at[first + area] : 0.0;
    write(place_of(first), vec2(push.from.at[first], second));
}

void unpack(uint voxel) {
    uint part = voxel / (push.size_x * push.size_y) & 1u;
    push.to.at[voxel] = push.from.at[2u * place_of(voxel) + part];
}

void filter_number(uint n) {
    uvec2 at = uvec2(n % push.wide, n / push.wide % push.high);
    uvec2 size = uvec2(push.wide, push.high);
    vec2 frequency = vec2(min(at, size - at)) / vec2(size);
    float most = max(length(frequency), push.least);
    write(n, number_at(n) / (most * float(push.wide) * float(push.high)));
}

void work(uint item) {
    switch (push.kind) {
    case FOURIER_PACK: pack(item); break;
    case FOURIER_UNPACK: unpack(item); break;
    case FOURIER_FILTER: filter_number(item); break;
    default: join(item);
    }
}

void main() {
    uint apart = gl_NumWorkGroups.x * FOURIER_CHUNK;
    for (uint first = gl_WorkGroupID.x * FOURIER_CHUNK; first < push.count; first += apart) {
        uint end = min(first + FOURIER_CHUNK, push.count);
        for (uint item = first + gl_LocalInvocationID.x; item < end; item += GROUP) work(item);
    }
}
