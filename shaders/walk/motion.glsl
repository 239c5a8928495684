// How the sample is placed in a pose: vectors and points of the world and of the beam frame. Poses
// that turn the sample about z alone have kernels of their own: these pay nothing for the others.

#ifdef PLACED
#include "physics/twofold.glsl"

// What there is beside triangles and turns about z: KIND_ bits.
layout(constant_id = 0) const uint KINDS = 511u;
const bool MOVED = (KINDS & KIND_MOVED) != 0u;
#endif

// A ray in the beam frame of its pose.
struct Beam {
    float x; // at y = 0
    float z;
    float slope_x;
    float slope_z;
    float cos_angle;
    float sin_angle;
    float start;
    float analyser;
#ifdef PLACED
    PoseTransform pose;
#endif
};

void set_pose(inout Beam beam, PoseTransform pose) {
    beam.cos_angle = pose.x.x;
    beam.sin_angle = pose.x.y;
    beam.start = pose.start;
    beam.analyser = pose.analyser;
#ifdef PLACED
    beam.pose = pose;
#endif
}

// A ray without its pose.
Beam beam_of(Ray ray) {
    Beam beam;
    beam.x = ray.x;
    beam.z = ray.z;
    beam.slope_x = ray.slope_x;
    beam.slope_z = ray.slope_z;
    beam.cos_angle = 1.0;
    beam.sin_angle = beam.start = beam.analyser = 0.0;
    return beam;
}

Beam beam_of(Ray ray, PoseTransform pose) {
    Beam beam = beam_of(ray);
    set_pose(beam, pose);
    return beam;
}

vec3 beam_from_world_direction(Beam beam, vec3 v) {
#ifdef PLACED
    if (MOVED) {
        vec3 x = vec3(beam.pose.x.x, beam.pose.y.x, beam.pose.z.x);
        vec3 y = vec3(beam.pose.x.y, beam.pose.y.y, beam.pose.z.y);
        vec3 z = vec3(beam.pose.x.z, beam.pose.y.z, beam.pose.z.z);
        precise vec3 turned = v.x * x + v.y * y + v.z * z;
        return turned;
    }
#endif
    precise float x = v.x * beam.cos_angle + v.y * beam.sin_angle;
    precise float y = v.y * beam.cos_angle - v.x * beam.sin_angle;
    return vec3(x, y, v.z);
}

vec3 beam_from_world(Beam beam, vec3 point) {
    precise vec3 place = beam_from_world_direction(beam, point);
#ifdef PLACED
    if (MOVED) place += beam.pose.position;
#endif
    return place;
}

vec3 world_from_beam_direction(Beam beam, vec3 v) {
#ifdef PLACED
    if (MOVED) return v.x * beam.pose.x + v.y * beam.pose.y + v.z * beam.pose.z;
#endif
    return vec3(v.x * beam.cos_angle - v.y * beam.sin_angle,
                v.x * beam.sin_angle + v.y * beam.cos_angle, v.z);
}

vec3 world_from_beam(Beam beam, vec3 point) {
#ifdef PLACED
    if (MOVED) point = (point - beam.pose.position) - beam.pose.position_rest;
#endif
    return world_from_beam_direction(beam, point);
}

#ifdef PLACED
Twofold sum_of(Twofold3 v) {
    return add(add(twofold_x(v), twofold_y(v)), twofold_z(v));
}

// A point of the world in the beam frame of a pose that is no turn about z.
Twofold3 moved_from_world(PoseTransform pose, Twofold3 point) {
    Twofold x = sum_of(multiply(point, Twofold3(pose.x, pose.x_rest)));
    Twofold y = sum_of(multiply(point, Twofold3(pose.y, pose.y_rest)));
    Twofold z = sum_of(multiply(point, Twofold3(pose.z, pose.z_rest)));
    Twofold3 turned = Twofold3(vec3(x.high, y.high, z.high), vec3(x.low, y.low, z.low));
    return add(turned, Twofold3(pose.position, pose.position_rest));
}
#endif
