#version 330
// Geometry shader for cameras with lens distortion: passes each pixel its position within its triangle.
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;
in vec3 to_normal[];
in vec2 to_uv[];
in vec3 to_before[];
flat in uint to_instance[];
flat in uvec2 to_surface[];
flat in float to_lift[];

out vec3 v_normal;
out vec2 v_uv;
out vec3 v_before;
flat out uint v_instance;
flat out uvec2 v_surface;
out vec2 v_corner;      // x: 1 at the first corner; y: 1 at the second corner
flat out float v_lift;  // depth offset toward the camera, in 1 / depth

void main() {
    for (int corner = 0; corner < 3; ++corner) {
        gl_Position = gl_in[corner].gl_Position;
        v_normal = to_normal[corner];
        v_uv = to_uv[corner];
        v_before = to_before[corner];
        v_instance = to_instance[2];
        v_surface = to_surface[2];
        v_corner = vec2(corner == 0 ? 1.0 : 0.0, corner == 1 ? 1.0 : 0.0);
        v_lift = to_lift[2];
        EmitVertex();
    }
    EndPrimitive();
}
