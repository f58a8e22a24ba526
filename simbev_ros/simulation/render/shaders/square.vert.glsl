#version 330
// Squares of pixels, drawn as points: unlike two triangles, they have no diagonal along which pixels are shaded twice.
uniform vec2 target_px;
uniform float square_px;
uniform float layer;
in uvec2 in_square;  // its first pixel

void main() {
    vec2 middle = (vec2(in_square) + 0.5 * square_px) / target_px;
    gl_Position = vec4(2.0 * middle - 1.0, 2.0 * layer - 1.0, 1.0);
    gl_PointSize = square_px;
}
