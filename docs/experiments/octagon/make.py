#!/usr/bin/env python3
"""Writes the octagon as meshes: octagon.stl of 32 triangles, and rough.stl, the same in 32,768 whose
vertices are moved by a Gaussian until facets lean by 0.001. usage: make.py DIR. Needs numpy."""

import pathlib
import sys

import numpy as np

RADIUS, HEIGHT = 5.0, 4.0  # mm
LEAN = 1e-3  # rms of the slopes of facets, in either direction


def octagon():
    corner = [RADIUS * np.array([np.cos(a), np.sin(a)]) for a in np.arange(8) * np.pi / 4]
    triangles = []
    for a, b in zip(corner, corner[1:] + corner[:1]):
        low, high = -HEIGHT / 2, HEIGHT / 2
        triangles += [[[*a, low], [*b, low], [*b, high]], [[*a, low], [*b, high], [*a, high]]]
        triangles += [[[0, 0, high], [*a, high], [*b, high]], [[0, 0, low], [*b, low], [*a, low]]]
    return np.array(triangles)


def refined(triangles):
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    return np.concatenate([np.stack(part, axis=1) for part in parts])


def normals(triangles):
    n = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return n / np.linalg.norm(n, axis=1)[:, None]


def rough(triangles):
    flat = normals(triangles)
    places, index = np.unique(np.round(triangles.reshape(-1, 3), 9), axis=0, return_inverse=True)
    push = np.random.default_rng(1).normal(size=places.shape)
    amplitude = 1e-4  # mm
    for _ in range(3):
        moved = (places + amplitude * push)[index.reshape(-1)].reshape(-1, 3, 3)
        lean = np.sqrt(np.mean(np.sum((normals(moved) - flat) ** 2, axis=1)) / 2)
        amplitude *= LEAN / lean
    print(f"vertices moved by {1e6 * amplitude:.1f} nm, facets lean by {lean:.2e}")
    return moved


def write(path, triangles):
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    rows = np.zeros(len(triangles), record)
    rows["normal"], rows["corners"] = normals(triangles), triangles
    path.write_bytes(b"octagon, mm".ljust(80) + np.uint32(len(rows)).tobytes() + rows.tobytes())


folder = pathlib.Path(sys.argv[1])
smooth = octagon()
fine = smooth
for _ in range(5):
    fine = refined(fine)
print(f"{len(smooth)} and {len(fine)} triangles")
write(folder / "octagon.stl", smooth)
write(folder / "rough.stl", rough(fine))
