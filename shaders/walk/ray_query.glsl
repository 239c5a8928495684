// Ray-query backend: the driver finds candidates, the shared test decides.

#include "walk/bvh.glsl"

// Hands every candidate of the line from `near`, y, on to visit().
void traverse(Beam beam, float near, inout Gathered all) {
    near = max(near, beam.start);
    vec3 origin = world_from_beam(beam, vec3(beam.x + beam.slope_x * near, near,
                                             beam.z + beam.slope_z * near));
    vec3 direction = world_from_beam_direction(beam, vec3(beam.slope_x, 1.0, beam.slope_z));
    rayQueryEXT query;
    rayQueryInitializeEXT(query, accelerationStructureEXT(sample_.acceleration),
                          gl_RayFlagsNoOpaqueEXT, 0xff, origin, 0.0, direction,
                          -beam.start - near);
    while (rayQueryProceedEXT(query)) {
        candidate(beam, near, uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false)), all);
    }
}
