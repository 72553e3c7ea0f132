#version 330 core
uniform mat4 view;
uniform mat4 projection;
uniform float size;

in vec3 position;
in float level; // 0 to 1

flat out float bright;

void main() {
    bright = level;
    gl_Position = projection * view * vec4(position, 1.0);
    gl_PointSize = size;
}
