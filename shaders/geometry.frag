#version 330 core
// Headlight shading: the light sits at the eye, so whatever faces the camera is bright.
uniform float brightness;
in vec3 eye_position;
in vec3 eye_normal;
in vec3 surface;
out vec4 colour;

void main() {
    vec3 normal = dot(eye_normal, eye_normal) > 0.0 ? normalize(eye_normal) : vec3(0.0, 0.0, 1.0);
    float facing = abs(dot(normal, normalize(eye_position)));
    vec3 linear = surface * (0.12 + 0.88 * facing) * brightness;
    colour = vec4(pow(clamp(linear, 0.0, 1.0), vec3(1.0 / 2.2)), 1.0);
}
