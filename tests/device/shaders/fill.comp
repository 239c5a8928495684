// Writes a counted pattern through a device address.

#ifndef FACTOR
#define FACTOR 1
#endif

layout(local_size_x = 64) in;

struct Entry {
    uint index;
    vec3 value;
};

layout(buffer_reference, scalar) writeonly buffer Entries {
    Entry entry[];
};

layout(push_constant, scalar) uniform FillPush {
    Entries entries;
    uint count;
    float scale;
} push;

void main() {
    uint row = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint i = row * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (i >= push.count) {
        return;
    }
    push.entries.entry[i].index = i * FACTOR;
    push.entries.entry[i].value = vec3(float(i) * push.scale, 1.0, 2.0);
}
