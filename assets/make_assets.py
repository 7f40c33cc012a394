#!/usr/bin/env python3
"""Writes the meshes and pictures of this folder; the .toml files beside them are written by hand.

Plain Python 3, deterministic. Run it from anywhere: python3 assets/make_assets.py
"""
import base64
import json
import math
import os
import struct
import zlib

HERE = os.path.dirname(os.path.abspath(__file__))


def write(name, text):
    with open(os.path.join(HERE, name), "w", newline="\n") as file:
        file.write(text)


class Obj:
    """Collects an OBJ file. Faces are lists of positions; equal ones are written once."""

    def __init__(self, comment, library=None):
        self.lines = ["# " + comment] + (["mtllib " + library] if library else [])
        self.positions, self.normals, self.uvs = {}, {}, {}

    def use(self, material):
        self.lines.append("usemtl " + material)

    def name(self, name):
        self.lines.append("o " + name)

    def _index(self, table, keyword, values, digits):
        text = " ".join(("%.*f" % (digits, v + 0.0)).rstrip("0").rstrip(".") or "0" for v in values)
        text = " ".join("0" if word == "-0" else word for word in text.split(" "))
        if text not in table:
            table[text] = len(table) + 1
            self.lines.append(keyword + " " + text)
        return table[text]

    def face(self, points, normals=None, uvs=None):
        words = []
        for i, point in enumerate(points):
            word = str(self._index(self.positions, "v", point, 4))
            if normals or uvs:
                word += "/" + (str(self._index(self.uvs, "vt", uvs[i], 4)) if uvs else "")
            if normals:
                word += "/" + str(self._index(self.normals, "vn", normals[i], 3))
            words.append(word)
        self.lines.append("f " + " ".join(words))

    def save(self, name):
        write(name, "\n".join(self.lines) + "\n")


# ---- vectors -------------------------------------------------------------------------------------

def add(a, b):
    return tuple(x + y for x, y in zip(a, b))


def sub(a, b):
    return tuple(x - y for x, y in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a):
    length = math.sqrt(sum(x * x for x in a)) or 1.0
    return tuple(x / length for x in a)


# ---- shapes: (points, triangles as index triples) -------------------------------------------------

def ball(segments, rings, place):
    """A closed grid around the y axis; place(t, angle) gives the point, t from 0 (top) to 1 (bottom)."""
    points = [place(0.0, 0.0)]
    for ring in range(1, rings):
        points += [place(ring / rings, 2 * math.pi * s / segments) for s in range(segments)]
    points.append(place(1.0, 0.0))
    at = lambda ring, s: 1 + (ring - 1) * segments + s % segments
    triangles = []
    for s in range(segments):
        triangles.append((0, at(1, s), at(1, s + 1)))
        triangles.append((len(points) - 1, at(rings - 1, s + 1), at(rings - 1, s)))
        for ring in range(1, rings - 1):
            a, b, c, d = at(ring, s), at(ring + 1, s), at(ring + 1, s + 1), at(ring, s + 1)
            triangles += [(a, b, c), (a, c, d)]
    return points, triangles


def sphere_point(t, angle):
    y, r = math.cos(math.pi * t), math.sin(math.pi * t)
    return (r * math.sin(angle), y, r * math.cos(angle))


def cone(sides, levels, tip, base, radius, cap):
    """From `tip` to a circle of `radius` around `base`; `levels` rings, closed by a fan if `cap`."""
    axis = unit(sub(tip, base))
    side = unit(cross(axis, (0.3, 0.2, 1.0)))
    up = cross(axis, side)
    points = [tip]
    for level in range(1, levels + 1):
        # Slightly bent, so that it reads as horn or feather.
        t = level / levels
        centre = tuple(tip[i] + (base[i] - tip[i]) * t for i in range(3))
        r = radius * math.sqrt(t)
        for s in range(sides):
            a = 2 * math.pi * s / sides
            points.append(tuple(centre[i] + r * (math.cos(a) * side[i] + math.sin(a) * up[i]) for i in range(3)))
    triangles = [(0, 1 + s, 1 + (s + 1) % sides) for s in range(sides)]
    for level in range(levels - 1):
        for s in range(sides):
            a, b = 1 + level * sides + s, 1 + level * sides + (s + 1) % sides
            triangles += [(a, a + sides, b + sides), (a, b + sides, b)]
    if cap:
        points.append(base)
        first = 1 + (levels - 1) * sides
        triangles += [(len(points) - 1, first + (s + 1) % sides, first + s) for s in range(sides)]
    return points, triangles


def smooth(points, triangles):
    """Vertex normals, weighted by area."""
    sums = [(0.0, 0.0, 0.0)] * len(points)
    for triangle in triangles:
        a, b, c = (points[i] for i in triangle)
        normal = cross(sub(b, a), sub(c, a))
        for i in triangle:
            sums[i] = add(sums[i], normal)
    return [unit(normal) for normal in sums]


def outward(points, triangles):
    """Turns all triangles if the volume comes out negative."""
    volume = 0.0
    for triangle in triangles:
        a, b, c = (points[i] for i in triangle)
        volume += sum(x * y for x, y in zip(a, cross(b, c)))
    return triangles if volume > 0 else [(a, c, b) for a, b, c in triangles]


# ---- the bust: an owl, 968 triangles --------------------------------------------------------------

EYES = [(-0.32, 1.34, 0.47), (0.32, 1.34, 0.47)]


def owl_body(t, angle):
    """Head, neck and shoulders as one skin, closed under the floor: profile over t, hollows around the eyes, breast in front."""
    profile = [(0.0, 1.95, 0.0), (0.1, 1.86, 0.42), (0.22, 1.66, 0.72), (0.36, 1.36, 0.84), (0.48, 1.05, 0.74),
               (0.58, 0.84, 0.6), (0.68, 0.62, 0.7), (0.8, 0.36, 0.9), (0.8667, 0.08, 1.01), (0.9334, -0.2, 1.08), (1.0, -0.2, 0.0)]
    for (t0, y0, r0), (t1, y1, r1) in zip(profile, profile[1:]):
        if t <= t1 + 1e-9:
            f = (t - t0) / (t1 - t0)
            y, r = y0 + (y1 - y0) * f, r0 + (r1 - r0) * f
            break
    x, z = r * math.sin(angle), r * math.cos(angle)
    z *= 0.86 + 0.16 * math.exp(-((y - 0.45) / 0.3) ** 2) * max(0.0, math.cos(angle))
    for eye in EYES:
        distance = math.dist((x, y, z), eye)
        # A shallow dish with a raised rim: the facial disc.
        z -= 0.16 * math.exp(-(distance / 0.26) ** 2) if z > 0 else 0.0
        z += 0.05 * math.exp(-((distance - 0.45) / 0.18) ** 2) if z > 0 else 0.0
    return (x, y, z)


def bust():
    obj = Obj("An owl's head: 968 triangles, smooth normals", "bust.mtl")
    count = 0
    parts = [("body", "feather", ball(24, 15, owl_body))]
    for eye in EYES:
        parts.append(("eye", "eye", ball(12, 6, lambda t, a, e=eye: (
            e[0] + 0.23 * sphere_point(t, a)[0], e[1] + 0.23 * sphere_point(t, a)[2], e[2] + 0.23 * sphere_point(t, a)[1]))))
    for side in (-1, 1):
        parts.append(("ear", "feather", cone(8, 1, (0.7 * side, 2.15, 0.1), (0.45 * side, 1.62, 0.08), 0.24, True)))
    parts.append(("beak", "beak", cone(8, 2, (0.0, 0.96, 0.92), (0.0, 1.26, 0.5), 0.15, False)))
    for name, material, (points, triangles) in parts:
        triangles = outward(points, triangles)
        normals = smooth(points, triangles)
        obj.name(name)
        obj.use(material)
        current = material
        for triangle in triangles:
            if name == "eye":
                middle = max(points[i][2] for i in triangle) - max(p[2] for p in points)
                wanted = "pupil" if middle > -0.03 else "eye"
                if wanted != current:
                    obj.use(wanted)
                    current = wanted
            obj.face([points[i] for i in triangle], [normals[i] for i in triangle])
        count += len(triangles)
    assert count == 968, count
    obj.save("bust.obj")
    write("bust.mtl", """# colours are linear
newmtl feather
Kd 0.42 0.3 0.2
Ks 0.04 0.04 0.04
Ns 20
illum 2

newmtl eye
Kd 0.75 0.38 0.03
Ks 0.2 0.2 0.2
Ns 400
illum 2

newmtl pupil
Kd 0.01 0.01 0.01
Ks 0.3 0.3 0.3
Ns 800
illum 2

newmtl beak
Kd 0.5 0.35 0.12
Ks 0.15 0.15 0.15
Ns 80
illum 2
""")


# ---- small parts ----------------------------------------------------------------------------------

def plane():
    obj = Obj("A square of side 1 in the xz plane, facing up")
    obj.face([(-0.5, 0, 0.5), (0.5, 0, 0.5), (0.5, 0, -0.5), (-0.5, 0, -0.5)], None, [(0, 0), (1, 0), (1, 1), (0, 1)])
    obj.save("plane.obj")


def sphere():
    obj = Obj("A smooth ball of radius 1")
    points, triangles = ball(28, 14, sphere_point)
    for triangle in outward(points, triangles):
        corners = [points[i] for i in triangle]
        obj.face(corners, [unit(p) for p in corners])
    obj.save("sphere.obj")


def checker():
    """8 x 8 texels: grey squares, one coloured texel in each corner to show which way is up."""
    colours = {(0, 0): (220, 40, 30), (7, 0): (40, 170, 60), (0, 7): (40, 80, 220), (7, 7): (240, 200, 40)}
    rows = b""
    for y in range(8):
        rows += b"\0"
        for x in range(8):
            grey = 225 if (x + y) % 2 == 0 else 45
            rows += bytes(colours.get((x, y), (grey, grey, grey)))
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    header = struct.pack(">IIBBBBB", 8, 8, 8, 2, 0, 0, 0)
    with open(os.path.join(HERE, "checker.png"), "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


def box(obj, base, height, centre, turn):
    """A box of square base standing at `centre`, turned about y by `turn` radians; no bottom."""
    corners = []
    for dx, dz in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        x, z = dx * base / 2, dz * base / 2
        corners.append((centre[0] + x * math.cos(turn) + z * math.sin(turn), centre[2] - x * math.sin(turn) + z * math.cos(turn)))
    low, high = centre[1], centre[1] + height
    obj.face([(x, high, z) for x, z in reversed(corners)])
    for i in range(4):
        (x0, z0), (x1, z1) = corners[i], corners[(i + 1) % 4]
        obj.face([(x1, low, z1), (x0, low, z0), (x0, high, z0), (x1, high, z1)])


def star(centre, axis, tip, notch, points):
    """Triangles of a flat star that faces along `axis`."""
    side = unit(cross(axis, (0.0, 1.0, 0.0)))
    up = cross(side, axis)

    def at(i):
        a, r = math.pi * i / points, notch if i % 2 else tip
        return tuple(centre[j] + r * (math.sin(a) * side[j] + math.cos(a) * up[j]) for j in range(3))

    return [[centre, at(i + 1), at(i)] for i in range(2 * points)]


# A bay is this wide, high and deep; all are open to +z.
WIDE, HIGH, DEEP = 2.0, 2.4, 1.8
# Where lamps hang and what they are turned to, from the middle of the front of a bay's floor.
LAMP, LIT = (-0.68, 1.6, -0.4), (0.15, 0.5, -1.4)
# Where the sun of gallery.toml travels, and the bay it may enter.
SUN, SUN_COLUMN, SUN_ROW = (0.2, -0.7, -0.6), 2, 1


def canopy(obj):
    """Shades all bays from the sun but one, which has no roof either: their fronts, cast along the sun onto a rising plane."""
    slope = 2.5

    def cast(x, y):
        """Where the ray of the sun through (x, y, 0) meets z = slope * (height - roof)."""
        t = slope * (2 * HIGH - y) / (slope * SUN[1] - SUN[2])
        return (x + t * SUN[0], y + t * SUN[1], t * SUN[2])

    def shade(x0, x1, y0, y1):
        obj.face([cast(x0, y0), cast(x1, y0), cast(x1, y1), cast(x0, y1)])

    left, right, low, high = -0.3, 4 * WIDE, -0.3, 2 * HIGH
    hole = (SUN_COLUMN * WIDE + 0.15, (SUN_COLUMN + 1) * WIDE - 0.15, SUN_ROW * HIGH + 0.15, high)
    shade(left, right, low, hole[2])
    shade(left, hole[0], hole[2], high)
    shade(hole[1], right, hole[2], high)


def gallery():
    """Eight bays, four beside four, each with the same things to cast a shadow."""
    obj = Obj("Bays for one light each", "gallery.mtl")
    obj.name("bays")
    obj.use("wall")
    width, back = 4 * WIDE, -DEEP
    for row in range(3):
        for column in range(4):
            if (column, row) != (SUN_COLUMN, SUN_ROW + 1):
                x, y = column * WIDE, row * HIGH
                obj.face([(x, y, 0), (x + WIDE, y, 0), (x + WIDE, y, back), (x, y, back)])
    for row in range(2):
        low, high = row * HIGH, (row + 1) * HIGH
        obj.face([(0, low, back), (width, low, back), (width, high, back), (0, high, back)])
        for column in range(5):
            x = column * WIDE
            obj.face([(x, low, 0), (x, low, back), (x, high, back), (x, high, 0)])
    # Edges of the walls, so that the bays stay apart in the picture.
    trim = 0.025
    for column in range(5):
        x = column * WIDE
        obj.face([(x - trim, 0, 0), (x + trim, 0, 0), (x + trim, 2 * HIGH, 0), (x - trim, 2 * HIGH, 0)])
    for row in range(3):
        x, y = SUN_COLUMN * WIDE if row == SUN_ROW + 1 else width, row * HIGH
        obj.face([(0, y - trim, 0), (x, y - trim, 0), (x, y + trim, 0), (0, y + trim, 0)])
    obj.name("canopy")
    canopy(obj)
    obj.name("occluders")
    obj.use("occluder")
    for row in range(2):
        for column in range(4):
            x, y = WIDE * column + 0.5 * WIDE, HIGH * row
            # The pole that carries a ball, and a fence that leaves the wall.
            box(obj, 0.05, 1.0, (x - 0.15, y, -1.2), 0.0)
            for i in range(4):
                box(obj, 0.05, 0.42, (x + 0.38 + 0.12 * i, y, -1.7 + 0.24 * i), 0.0)
    obj.name("lamp")
    obj.use("lamp")
    for triangle in star((7 + LAMP[0], LAMP[1], LAMP[2]), unit(sub(LIT, LAMP)), 0.28, 0.11, 5):
        obj.face(triangle)
    obj.save("gallery.obj")
    write("gallery.mtl", """newmtl wall
Kd 0.7 0.7 0.7
illum 1

newmtl occluder
Kd 0.6 0.42 0.25
illum 1

newmtl lamp
Kd 0 0 0
Ke 110 103 91
illum 1
""")


# ---- the Cornell box ------------------------------------------------------------------------------
# Corners and colours as published by the Cornell University Program of Computer Graphics, in mm;
# the light is 0.2 mm below the ceiling instead of in a hole.

def block(height, base):
    top = [(x, height, z) for x, z in base]
    bottom = [(x, 0, z) for x, z in base]
    quads = [top, bottom[::-1]]
    for i in range(4):
        j = (i + 1) % 4
        quads.append([bottom[j], top[j], top[i], bottom[i]])
    return quads


CORNELL = [
    ("floor", "white", [[(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)]]),
    ("ceiling", "white", [[(556.0, 548.8, 0), (556.0, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)]]),
    ("back wall", "white", [[(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556.0, 548.8, 559.2)]]),
    ("right wall", "green", [[(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)]]),
    ("left wall", "red", [[(552.8, 0, 0), (549.6, 0, 559.2), (556.0, 548.8, 559.2), (556.0, 548.8, 0)]]),
    ("short block", "white", block(165.0, [(130, 65), (82, 225), (240, 272), (290, 114)])),
    ("tall block", "white", block(330.0, [(423, 247), (265, 296), (314, 456), (472, 406)])),
]
LIGHT = [(343.0, 548.6, 227.0), (343.0, 548.6, 332.0), (213.0, 548.6, 332.0), (213.0, 548.6, 227.0)]
COLOURS = {"white": (0.725, 0.71, 0.68), "red": (0.63, 0.065, 0.05), "green": (0.14, 0.45, 0.091)}


def cornell_obj():
    obj = Obj("The Cornell box, mm, without its light", "cornell.mtl")
    for name, material, quads in CORNELL:
        obj.name(name)
        obj.use(material)
        for quad in quads:
            obj.face(quad)
    obj.save("cornell.obj")
    write("cornell.mtl", "\n".join("newmtl %s\nKd %g %g %g\nillum 1\n" % ((name,) + rgb) for name, rgb in COLOURS.items()))


def cornell_gltf():
    data, views, accessors, meshes, nodes = b"", [], [], [], []

    def accessor(packed, kind, component, count, extra=None):
        nonlocal data
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(packed)})
        data += packed + b"\0" * (-len(packed) % 4)
        accessors.append(dict({"bufferView": len(views) - 1, "componentType": component, "count": count, "type": kind}, **(extra or {})))
        return len(accessors) - 1

    names = list(COLOURS) + ["light"]
    for name, material, quads in CORNELL + [("light", "light", [LIGHT])]:
        points = [p for quad in quads for p in quad]
        indices = [4 * q + i for q in range(len(quads)) for i in (0, 1, 2, 0, 2, 3)]
        bounds = {"min": [min(p[i] for p in points) for i in range(3)], "max": [max(p[i] for p in points) for i in range(3)]}
        position = accessor(b"".join(struct.pack("<3f", *p) for p in points), "VEC3", 5126, len(points), bounds)
        index = accessor(struct.pack("<%dH" % len(indices), *indices), "SCALAR", 5123, len(indices))
        primitive = {"attributes": {"POSITION": position}, "indices": index, "material": names.index(material)}
        meshes.append({"name": name, "primitives": [primitive]})
        nodes.append({"name": name, "mesh": len(meshes) - 1})
    for accessor_ in accessors:
        for key in ("min", "max"):
            if key in accessor_:
                accessor_[key] = [struct.unpack("<f", struct.pack("<f", v))[0] for v in accessor_[key]]
    materials = [{"name": name, "pbrMetallicRoughness": {"baseColorFactor": list(rgb) + [1], "metallicFactor": 0, "roughnessFactor": 1}}
                 for name, rgb in COLOURS.items()]
    # Radiance 17, 12, 4: factors may not exceed 1.
    materials.append({"name": "light", "emissiveFactor": [1, 12 / 17, 4 / 17],
                      "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0, "roughnessFactor": 1},
                      "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 17}}})
    room = len(nodes)
    nodes.append({"name": "room (mm)", "scale": [0.001] * 3, "children": list(range(room))})
    nodes.append({"name": "camera", "camera": 0, "translation": [0.278, 0.273, -0.8], "rotation": [0, 1, 0, 0]})
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_emissive_strength"],
        "scene": 0,
        "scenes": [{"nodes": [room, room + 1]}],
        "nodes": nodes, "meshes": meshes, "materials": materials, "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": len(data), "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": math.radians(39.3077), "znear": 0.01}}],
    }
    write("cornell.gltf", json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    for make in (bust, plane, sphere, checker, gallery, cornell_obj, cornell_gltf):
        make()
