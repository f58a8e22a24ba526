"""Plants: generators of trees and bushes, species by landscape, and a stock of ready meshes to plant from."""
