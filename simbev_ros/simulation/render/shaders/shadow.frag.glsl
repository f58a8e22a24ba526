#version 330
// Writes only depth.
void main() {}
