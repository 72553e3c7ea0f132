#version 330 core
// A photon as it is stored (pmviewer/maps/record.py), decoded here.
uniform mat4 view;
uniform mat4 projection;
uniform float size;
uniform int colour_by;      // 0 power, 1 bounces, 2 light
uniform vec2 power_range;   // logarithms (base 2) of the brightest channel, dim and bright end
uniform vec3 bounce_palette[8];
uniform vec3 light_palette[8];

in vec3 position;
in uint direction_and_flags;
in uvec2 power_and_light;

flat out vec3 hue;

float decode(uint code) {
    return code == 0u ? 0.0 : uintBitsToFloat((code << 13u) + (80u << 23u));
}

void main() {
    if (colour_by == 0) {
        vec3 power = vec3(decode(power_and_light.x & 0xFFFFu), decode(power_and_light.x >> 16u),
                          decode(power_and_light.y & 0xFFFFu));
        float peak = max(max(power.r, power.g), power.b);
        float level = clamp((log2(max(peak, 1e-30)) - power_range.x) / max(power_range.y - power_range.x, 1e-3), 0.0, 1.0);
        hue = peak > 0.0 ? pow(power / peak, vec3(1.0 / 2.2)) * mix(0.55, 1.0, level) : vec3(0.35);
    } else if (colour_by == 1) {
        hue = bounce_palette[min(int(direction_and_flags & 63u), 7)];
    } else {
        hue = light_palette[int((power_and_light.y >> 16u) % 8u)];
    }
    gl_Position = projection * view * vec4(position, 1.0);
    // Photons lie on surfaces: draw them a hair in front, or the tessellation of round shapes hides half of them.
    gl_Position.z -= 2e-4 * gl_Position.w;
    gl_PointSize = size;
}
