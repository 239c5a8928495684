// Casts a reference to its own type, as no kernel may.

layout(local_size_x = 1) in;

layout(buffer_reference, scalar) buffer Numbers {
    uint at[];
};

layout(push_constant, scalar) uniform CastPush {
    Numbers numbers;
} push;

void main() {
    Numbers(push.numbers).at[0] = 1u;
}
