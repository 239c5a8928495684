// Counts the crossings of parallel rays along +y with an acceleration structure given by address.
#extension GL_EXT_ray_query : require

layout(local_size_x = 64) in;

layout(buffer_reference, scalar) writeonly buffer Counts {
    uint count[];
};

layout(push_constant, scalar) uniform CrossingsPush {
    uvec2 scene;
    Counts counts;
    uint rays;
    float spacing;
} push;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.rays) {
        return;
    }
    vec3 origin = vec3((float(i) + 0.5) * push.spacing, -1.0, 0.25);
    rayQueryEXT query;
    rayQueryInitializeEXT(query, accelerationStructureEXT(push.scene), gl_RayFlagsNoneEXT, 0xffu,
                          origin, 0.0, vec3(0.0, 1.0, 0.0), 10.0);
    uint count = 0u;
    while (rayQueryProceedEXT(query)) {
        uint primitive = rayQueryGetIntersectionPrimitiveIndexEXT(query, false);
        count += 1u + 16u * primitive;
    }
    push.counts.count[i] = count;
}
