#version 330 core
uniform mat4 view;
uniform mat4 projection;
uniform float size;
uniform int only_shadow; // leave out shadow photons that the light reaches
uniform uint light_mask; // leave out points whose light, or what stands in its place, has no bit here

in vec3 position;
in uint direction_and_flags;
in uvec2 power_and_light;

flat out vec3 hue;

#include "photon.glsl"

void main() {
    hue = photon_hue(direction_and_flags, power_and_light);
    gl_Position = projection * view * vec4(position, 1.0);
    // Photons lie on surfaces: draw them a hair in front, or the tessellation of round shapes hides half of them.
    gl_Position.z -= 2e-4 * gl_Position.w;
    if (only_shadow == 1 && (direction_and_flags & HAD_DIFFUSE) == 0u) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    if ((light_mask >> ((power_and_light.y >> 16u) & 31u) & 1u) == 0u) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = size;
}
