// Ray-query backend: the driver finds candidates, the shared test decides.

void query_begin(rayQueryEXT query, Beam beam) {
    vec3 origin = world_from_beam(beam, vec3(beam.x + beam.slope_x * beam.start, beam.start,
                                             beam.z + beam.slope_z * beam.start));
    vec3 direction = world_from_beam(beam, vec3(beam.slope_x, 1.0, beam.slope_z));
    rayQueryInitializeEXT(query, accelerationStructureEXT(sample_.acceleration),
                          gl_RayFlagsNoOpaqueEXT, 0xff, origin, 0.0, direction,
                          -2.0 * beam.start);
}

#ifdef ORDER_FREE
// Hands every candidate of the whole line to visit().
void walk_all(Beam beam, inout Sums sums, inout Run run) {
    Stretch stretch = stretch_of(beam);
    rayQueryEXT query;
    query_begin(query, beam);
    while (rayQueryProceedEXT(query)) {
        uint primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false));
        visit(beam, stretch, sample_.leaves.at[primitive], sums, run);
    }
}
#else
// The next crossing after (y, id) in the order (y, primitive).
bool next(Beam beam, float y, uint id, out Crossing crossing) {
    crossing = no_crossing();
    rayQueryEXT query;
    query_begin(query, beam);
    while (rayQueryProceedEXT(query)) {
        uint primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false));
        offer(beam, primitive, 0u, y, id, crossing);
    }
    return crossing.found;
}
#endif
