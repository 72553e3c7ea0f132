#version 330 core
uniform mat4 view;
uniform mat4 projection;

in vec3 position;
in uint direction_and_flags;
in uvec2 power_and_light;

out vec3 end_hue;

#include "photon.glsl"

void main() {
    end_hue = photon_hue(direction_and_flags, power_and_light);
    gl_Position = projection * view * vec4(position, 1.0);
    gl_Position.z -= 2e-4 * gl_Position.w;
}
