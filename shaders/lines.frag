#version 330 core
uniform float size;
uniform float start_level; // brightness where a line starts
flat in vec3 hue;
noperspective in float across; // pixels from the middle
noperspective in float along;
out vec4 colour;

void main() {
    float cover = clamp(0.5 * size + 0.5 - abs(across), 0.0, 1.0);
    // Dark at the start and full at the end: which way light flew.
    colour = vec4(hue * mix(start_level, 1.0, along), 0.9 * cover);
}
