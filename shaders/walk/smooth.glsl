// Normals of the surface that facets stand for (docs/physics.md, "Smooth normals").

// The interpolated normal of the corners of a primitive where a ray along `direction` crosses its facet,
// beam frame. `normal_`: of the facet; if the interpolated one faces away it is moved to the horizon.
vec3 smooth_normal(Beam beam, uint primitive, Facet facet, vec3 normal_, vec3 direction) {
    uint leaf = primitive;
    bool placed_ = primitive >= sample_.sample_leaves;
    Placed placed;
    if (placed_) placed = placed_of(primitive, leaf);
    CornerNormals normals = sample_.normals;
    vec3 mean = vec3(0.0);
    vec3 weights = clamp(facet.edges / facet.area, 0.0, 1.0);
    for (uint corner = 0u; corner < 3u; corner++) {
        uint at = 9u * leaf + 3u * corner;
        mean += weights[corner] * vec3(normals.at[at], normals.at[at + 1u], normals.at[at + 2u]);
    }
    if (placed_) mean = turned(placed.rotation, mean / scales_of(placed));
    vec3 n = normalize(beam_from_world_direction(beam, mean));
    float side = dot(normal_, direction) < 0.0 ? -1.0 : 1.0;
    float length_ = length(direction);
    float along = side * dot(n, direction) / length_;
    if (along < HORIZON) n = normalize(n + side * (HORIZON - along) / length_ * direction);
    return n;
}

// Change of slope of a ray at a facet with this smooth normal, from medium delta_i to delta_r. The facet
// says where the ray is: one that the smooth normal reflects into the facet goes along its horizon.
vec2 smooth_bend(vec2 slope, vec3 normal_, vec3 smooth_, float delta_i, float delta_r,
                 out bool reflected) {
    vec2 bend = refract_slope(slope, smooth_, delta_i, delta_r, reflected);
    vec3 ahead = dot(normal_, vec3(slope.x, 1.0, slope.y)) < 0.0 ? -normal_ : normal_;
    bool passes = dot(ahead, vec3(slope.x + bend.x, 1.0, slope.y + bend.y)) > 0.0;
    if (reflected != passes) return bend;
    if (!reflected) return refract_slope(slope, normal_, delta_i, delta_r, reflected);
    reflected = false;
    vec3 i = normalize(vec3(slope.x, 1.0, slope.y));
    vec3 change = -dot(smooth_, i) * smooth_;
    return (vec2(change.x, change.z) - change.y * slope) / (i.y + change.y);
}
