// Rays of the random scheme: targets spread over each pixel, Gaussian source offsets.
#include "interface.glsl"

layout(local_size_x = GROUP) in;

#include "interface/RandomRaysPush.glsl"

#include "random/draw.glsl"

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= push.pixel_count * push.batch) return;
    IlluminationParams light = push.light_ref.at[0];
    Pixel pixel = push.pixels.at[index / push.batch];
    uint ray = push.first_ray + index % push.batch;
    Draw d = draw(light, pixel, push.pose, push.seed, ray, push.rays_per_pixel);
    vec2 centre = vec2(float(pixel.column) + 0.5 - 0.5 * float(light.column_count), 0.0)
        * light.column_pitch;
    centre.y = (light.middle_row - float(pixel.row) - 0.5) * light.row_pitch;
    vec2 slope = (centre + d.target - d.source) / light.detector;
    vec2 at = d.source + slope * light.rotation_distance;
    push.rays.at[index] = Ray(at.x, at.y, slope.x, slope.y, push.pose, d.key);
}
