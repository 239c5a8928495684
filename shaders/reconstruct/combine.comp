// Vectors of an iterative method, value by value. A workgroup has a chunk of them, whose values its
// threads take in turn.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/CombinePush.glsl"

float combined(float a, float b) {
    // No fused multiply-add: a sum rounds as two operations on every device.
    precise float sum = a + push.factor * b;
    precise float product = a * b;
    switch (push.kind) {
    case COMBINE_SUM: return sum;
    case COMBINE_PRODUCT: return product;
    case COMBINE_BOUND: return a > 0.0 ? a : 0.0;
    case COMBINE_WHERE: return b > push.factor ? a : 0.0;
    default: return a > push.factor ? 1.0 / a : 0.0;
    }
}

void main() {
    uint first = gl_WorkGroupID.x * CHUNK;
    uint end = min(first + CHUNK, push.count);
    for (uint n = first + gl_LocalInvocationID.x; n < end; n += GROUP) {
        push.to.at[n] = combined(push.a.at[n], push.b.at[n]);
    }
}
