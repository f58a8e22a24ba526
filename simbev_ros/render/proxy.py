"""Coarse stand-ins for meshes, for shadows that are too coarse themselves to show the difference."""

from dataclasses import replace

import numpy as np

from simbev_ros.assets.mesh import Mesh


def coarse_mesh(mesh: Mesh, cell_m: float) -> Mesh:
    """The mesh with the vertices in each cubic cell, part by part, merged into their mean.

    Triangles that collapse and those that coincide with another are left out.
    """
    cells = np.column_stack([np.floor(mesh.vertices / cell_m).astype(np.int64), mesh.part])
    _, first, cluster = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    cluster = cluster.reshape(-1)
    count = np.bincount(cluster)[:, None]
    sums = np.stack([np.bincount(cluster, weights=axis) for axis in mesh.vertices.T], axis=1)
    triangles = cluster[mesh.triangles]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    _, kept = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    return replace(
        mesh,
        vertices=(sums / count).astype(np.float32),
        normals=mesh.normals[first],
        uv=mesh.uv[first],
        color=mesh.color[first],
        material=mesh.material[first],
        tag=mesh.tag[first],
        part=mesh.part[first],
        triangles=triangles[np.sort(kept)].astype(np.int32),
    )
