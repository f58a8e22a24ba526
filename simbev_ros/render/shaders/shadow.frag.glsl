#version 330
// Only depth is wanted.
void main() {}
