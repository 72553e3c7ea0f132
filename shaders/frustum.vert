#version 330 core
uniform mat4 view;
uniform mat4 projection;
uniform vec3 tint;

in vec3 position;

out vec3 end_hue;

void main() {
    end_hue = tint;
    gl_Position = projection * view * vec4(position, 1.0);
}
