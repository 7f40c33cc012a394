#!/usr/bin/env python3
"""Writes more scenes for efficiency.py into a copy of the harness: benches/peers/more_scenes.py HARNESS

Then, in HARNESS/renderers: run_mitsuba.py ref --scenes kitchen,shop,leaves,office,tubes,field,kitchen12 --modes direct
--spp 512 --passes 12. The figures in the README are of these: none of them was looked at when methods and constants were chosen first.
"""
import os, sys
import numpy as np

sys.path.insert(0, os.path.join(os.path.abspath(sys.argv[1]), "renderers"))
from make_scenes import OUT, box, camera, light, mesh, obj, save, xf

rng = np.random.default_rng(7)
DATA = "../../data/"


def diffuse(r, g, b):
    return dict(type="diffuse", rgb=[r, g, b])


def aimed(at, size, target, rgb):
    """A lamp at a place that faces a target."""
    at = np.array(at, float)
    n = np.array(target, float) - at
    n /= np.linalg.norm(n)
    u = np.cross(n, (0, 1, 0) if abs(n[1]) < 0.99 else (1, 0, 0))
    u /= np.linalg.norm(u)
    u, v = u * size[0], np.cross(n, u) * size[1]
    return light(at - u / 2 - v / 2, u, v, rgb)


KITCHEN = dict(camera=camera((2.6, 1.6, 1.9), (0.2, 0.9, -0.9), 60.0), materials=dict(k=diffuse(0.6, 0.58, 0.55)),
               meshes=[mesh(DATA + "kitchen.obj", "k")], scale=5.0)
save("kitchen", lights=[aimed((0.8, 2.0, 0.3), (0.9, 0.5), (0.8, 0, 0.3), (9, 8, 7)),
                        aimed((2.9, 1.9, 0.0), (0.25, 0.25), (0.5, 0.8, -0.5), (20, 22, 30))], **KITCHEN)
panel = lambda i, j: light((-1.2 + 1.3 * i, 2.35, -1.6 + 1.5 * j), (0.25, 0, 0), (0, 0, 0.12), (20, 19, 17))
save("kitchen12", lights=[panel(i, j) for i in range(4) for j in range(3)], **KITCHEN)

# A car and a pot; a small bright lamp and a large dim one.
save("shop", camera=camera((4.5, 3.0, 6.5), (0, 1.0, 0), 40.0), scale=8.0,
     materials=dict(f=diffuse(0.5, 0.5, 0.52), c=diffuse(0.7, 0.2, 0.1), t=diffuse(0.8, 0.75, 0.6)),
     meshes=[mesh("soft_plane.obj", "f"), mesh(DATA + "legocar.obj", "c", xf(9.0, (-1.5, 1.16, 1.0), 0.6)),
             mesh(DATA + "teapot.obj", "t", xf(0.6, (1.6, 0, -0.8), 2.2))],
     lights=[aimed((3, 6, 3), (0.15, 0.15), (0, 0.5, 0), (700, 680, 600)), aimed((-5, 4, -1), (4, 3), (0, 0.5, 0), (2, 2.4, 3))])

# 4,000 leaves.
quads = []
for _ in range(4000):
    p = rng.normal(size=3)
    c = np.array([0, 2.2, 0]) + p / np.linalg.norm(p) * np.array([1.6, 1.0, 1.6]) * rng.random() ** (1 / 3)
    a = rng.normal(size=3)
    a /= np.linalg.norm(a)
    b = np.cross(a, rng.normal(size=3))
    a, b = a * 0.06, b / np.linalg.norm(b) * 0.04
    quads.append([c - a - b, c + a - b, c + a + b, c - a + b])
obj("leaves", quads)
save("leaves", camera=camera((0.5, 2.4, 7.0), (0, 1.5, 0), 40.0), scale=6.0,
     materials=dict(f=diffuse(0.55, 0.5, 0.45), l=diffuse(0.25, 0.5, 0.15)), meshes=[mesh("soft_plane.obj", "f"), mesh("leaves.obj", "l")],
     lights=[aimed((3, 7, 3), (1.0, 1.0), (0, 1, 0), (40, 38, 34)), aimed((-4, 3, 4), (2, 2), (0, 1, 0), (3, 4, 5))])

# A room with 40 boxes and 24 panels.
obj("office_room", [[(-6, 0, -6), (-6, 0, 6), (6, 0, 6), (6, 0, -6)], [(-6, 3, -6), (6, 3, -6), (6, 3, 6), (-6, 3, 6)],
                    [(-6, 0, -6), (6, 0, -6), (6, 3, -6), (-6, 3, -6)], [(-6, 0, -6), (-6, 3, -6), (-6, 3, 6), (-6, 0, 6)],
                    [(6, 0, -6), (6, 0, 6), (6, 3, 6), (6, 3, -6)]])
boxes = []
for _ in range(40):
    h = rng.uniform(0.2, 0.9)
    boxes += box((rng.uniform(-5, 5), h / 2, rng.uniform(-5, 4)), (rng.uniform(0.1, 0.4), h / 2, rng.uniform(0.1, 0.4)))
obj("office_boxes", boxes)
colour = lambda: tuple(float(c) for c in rng.uniform(0.5, 1, 3) * 6)
save("office", camera=camera((0, 1.7, 5.8), (0, 0.9, 0), 65.0), scale=10.0,
     materials=dict(w=diffuse(0.75, 0.73, 0.7), b=diffuse(0.4, 0.5, 0.6)),
     meshes=[mesh("office_room.obj", "w"), mesh("office_boxes.obj", "b")],
     lights=[light((-5 + 2 * i, 2.95, -4.5 + 3 * j), (0.8, 0, 0), (0, 0, 0.3), colour()) for i in range(6) for j in range(4)])

# A fence and the bunny beside long thin lamps.
fence = []
for i in range(24):
    fence += box((-3 + i * 0.26, 0.4, 0.0), (0.03, 0.4, 0.03))
obj("fence", fence)
save("tubes", camera=camera((2.5, 2.2, 4.5), (0, 0.3, 0), 42.0), scale=6.0,
     materials=dict(f=diffuse(0.6, 0.6, 0.6), p=diffuse(0.7, 0.5, 0.3)),
     meshes=[mesh("soft_plane.obj", "f"), mesh("fence.obj", "p"), mesh(DATA + "stanford-bunny.obj", "p", xf(8, (0, -0.264, 1.2)))],
     lights=[aimed((0, 0.5, -1.5), (4.0, 0.04), (0, 0.3, 0), (60, 50, 40)), aimed((-3, 1.2, 2.0), (0.05, 2.0), (0, 0.3, 0), (40, 50, 70))])

# Rough ground.
n = 180
x, z = np.meshgrid(np.linspace(-6, 6, n), np.linspace(-6, 6, n))
y = 0.25 * np.sin(2.1 * x) * np.cos(1.7 * z) + 0.12 * np.sin(5.3 * x + 1) * np.sin(4.7 * z) + 0.03 * rng.normal(size=x.shape)
with open(os.path.join(OUT, "field.obj"), "w") as out:
    out.writelines("v %.6g %.6g %.6g\n" % p for p in zip(x.ravel(), y.ravel(), z.ravel()))
    for a in (i * n + j + 1 for i in range(n - 1) for j in range(n - 1)):
        out.write(f"f {a} {a + n} {a + n + 1}\nf {a} {a + n + 1} {a + 1}\n")
save("field", camera=camera((0, 2.4, 7.5), (0, 0, 0), 45.0), scale=8.0, materials=dict(g=diffuse(0.5, 0.45, 0.35)),
     meshes=[mesh("field.obj", "g")],
     lights=[aimed((12, 5, -6), (1.0, 1.0), (0, 0, 0), (320, 300, 250)), aimed((-6, 8, 2), (5, 5), (0, 0, 0), (2, 3, 4))])
