#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Judges temperatures at edges and feet of bodies by CalculiX.

Each scene is a concrete body on an asphalt road through a summer morning, 08:00 to 11:30. This program makes the
geometry, the place of the sun, the shadows and the mesh on its own, lets `ccx` solve the conduction, and compares
`emit probe` (method cached, model foster) and `emit solve --dimension 3` at the middles of the faces of that mesh. It
takes nothing from emitd but the two tables of temperatures.

So that both sides have the same surroundings, weather is stated in numbers (air, film, long-wave radiation, direct sun
alone), faces do not exchange radiation (thermal.exchange = false), and the surroundings reflect no sun and are as warm
as the sky. Walls of a cavity radiate to the temperature of the cavity in CalculiX and in `emit solve`.

It needs ccx (Debian: calculix-ccx), numpy and the programs of a build: TEST_BIN_DIR and EMIT_DATA_DIR name their
folders. Without ccx or numpy it says so and ends with 77, the code of a skipped test.
"""
import argparse
import csv
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import time

SKIPPED = 77
try:
    import numpy as np
except ImportError:
    print("skipped: numpy is not installed")
    sys.exit(SKIPPED)

STEFAN_BOLTZMANN = 5.670374419e-8
DURATION_S = 12600
LATITUDE_DEG = 48.56
LONGITUDE_DEG = 11.26
EPOCH_UTC = "2014-06-21T06:00:00Z"
JULIAN_DAY_0 = 2456829.75  # of the epoch
INITIAL_K = 293.15
SKY_K = 285.0
FILM_W_M2_K = 12.0
EMISSIVITY = 0.9
ROAD_ABSORPTANCE = 0.9
ROAD_LAYERS = [(0.15, 0.7, 2120.0, 920.0), (0.35, 1.5, 2000.0, 950.0)]
CONCRETE = (1.28, 2300.0, 878.0)
ROAD_HALF_M = 1.5
WEATHER_STEP_S = 300
COMPARED_M = 0.3  # distance from the body up to which the road is compared
AXES = "xyz"


def air_k(time_s):
    return 291.5 + 5.4 * time_s / DURATION_S


def direct_w_m2(time_s):
    return 640.0 + 220.0 * time_s / DURATION_S


def to_sun(time_s):
    """Direction to the sun, east, north, up: low-precision formulas of the Astronomical Almanac (0.01 degree)."""
    days = JULIAN_DAY_0 - 2451545.0 + time_s / 86400.0
    mean_longitude = math.radians((280.460 + 0.9856474 * days) % 360.0)
    anomaly = math.radians((357.528 + 0.9856003 * days) % 360.0)
    longitude = mean_longitude + math.radians(1.915 * math.sin(anomaly) + 0.020 * math.sin(2.0 * anomaly))
    obliquity = math.radians(23.439 - 4e-7 * days)
    right_ascension = math.atan2(math.cos(obliquity) * math.sin(longitude), math.cos(longitude))
    declination = math.asin(math.sin(obliquity) * math.sin(longitude))
    sidereal = math.radians((280.46061837 + 360.98564736629 * days + LONGITUDE_DEG) % 360.0)
    hour_angle = sidereal - right_ascension
    latitude = math.radians(LATITUDE_DEG)
    return np.array([-math.cos(declination) * math.sin(hour_angle),
                     math.sin(declination) * math.cos(latitude)
                     - math.cos(declination) * math.cos(hour_angle) * math.sin(latitude),
                     math.sin(declination) * math.sin(latitude)
                     + math.cos(declination) * math.cos(hour_angle) * math.cos(latitude)])


class Scene:
    """A body of concrete boxes on a road, with a box cut out of it as its cavity."""

    def __init__(self, name, boxes, layer_m, absorptance, cavity=None):
        self.name = name
        self.boxes = [np.array(box, float) for box in boxes]  # rows: low and high corner, m
        self.layer_m = layer_m
        self.absorptance = absorptance
        self.cavity = None if cavity is None else np.array(cavity, float)

    def in_body(self, p):
        """Whether points lie in the concrete."""
        inside = np.zeros(p.shape[:-1], bool)
        for low, high in self.boxes:
            inside |= ((p > low) & (p < high)).all(axis=-1)
        return inside & ~self.in_cavity(p)

    def in_cavity(self, p):
        if self.cavity is None:
            return np.zeros(p.shape[:-1], bool)
        low, high = self.cavity
        return ((p > low) & (p < high)).all(axis=-1)

    def outer_planes(self, axis):
        """Coordinates of the outer faces of the body along an axis, m."""
        return sorted({round(float(v), 9) for box in self.boxes for v in box[:, axis]})

    def planes(self, axis):
        """Coordinates of all faces of the body along an axis, m."""
        inner = [] if self.cavity is None else [round(float(v), 9) for v in self.cavity[:, axis]]
        return sorted({*self.outer_planes(axis), *inner})


def centred(x, y, z):
    return [[-0.5 * x, -0.5 * y, 0.0], [0.5 * x, 0.5 * y, z]]


def scenes():
    out = []
    for absorptance in (0.3, 0.9):
        def add(name, *args, a=absorptance, **more):
            out.append(Scene(f"{name}-a{a}", *args, a, **more))
        add("hollow20", [centred(1.0, 0.8, 0.6)], 0.2, cavity=[[-0.3, -0.2, 0.0], [0.3, 0.2, 0.4]])
        add("floored15", [centred(0.7, 0.9, 0.5)], 0.15, cavity=[[-0.2, -0.3, 0.15], [0.2, 0.3, 0.35]])
        add("solid", [centred(0.6, 0.4, 0.3)], 0.2)
        add("wall", [centred(1.6, 0.2, 0.4)], 0.1)
        add("step", [centred(0.8, 0.6, 0.2), [[-0.4, -0.3, 0.0], [0.0, 0.3, 0.45]]], 0.2)
    return out


def graded(first_m, last_m, from_low, from_high, least_m, growth, most_m):
    """Lines between two planes, in cells that grow from the planes that count."""
    cells_low, cells_high = [], []
    left = last_m - first_m
    one_sided = from_low != from_high
    size_low = least_m if from_low else math.inf
    size_high = least_m if from_high else math.inf
    while left > 1e-9:
        # Past what is compared cells may be as great as they like.
        far = one_sided and last_m - first_m - left > COMPARED_M
        size = min(size_low, size_high, math.inf if far else most_m)
        if left < 1.6 * size:
            cells_low.append(left)
            break
        if size_low <= size_high:
            cells_low.append(size)
            size_low = growth * size
        else:
            cells_high.append(size)
            size_high = growth * size
        left -= size
    return first_m + np.concatenate([[0.0], np.cumsum(cells_low + cells_high[::-1])])


class Mesh:
    """Structured hexahedra of a scene: cells of a tensor grid that are road or concrete, and their open faces."""

    def __init__(self, scene, least_m, growth, most_m):
        lines = []
        for axis in range(3):
            planes = scene.planes(axis)
            if axis < 2:
                planes = [-ROAD_HALF_M] + planes + [ROAD_HALF_M]
            else:
                depths = np.cumsum([layer[0] for layer in ROAD_LAYERS])
                planes = sorted({*[-float(d) for d in depths], 0.0, *planes})
            parts = []
            for low, high in zip(planes[:-1], planes[1:]):
                # Cells grow away from faces of the body, from the road, and from nothing else.
                features = {round(v, 9) for v in scene.outer_planes(axis)} | ({0.0} if axis == 2 else set())
                most = most_m if axis < 2 or low >= 0.0 else 0.2
                parts.append(graded(low, high, round(low, 9) in features, round(high, 9) in features, least_m, growth,
                                    most)[:-1])
            lines.append(np.concatenate(parts + [[planes[-1]]]))
        self.lines = lines
        shape = [len(line) - 1 for line in lines]
        middles = np.stack(np.meshgrid(*[0.5 * (line[1:] + line[:-1]) for line in lines], indexing="ij"), axis=-1)
        body = scene.in_body(middles)
        road = middles[..., 2] < 0.0
        depths = np.cumsum([layer[0] for layer in ROAD_LAYERS])
        self.kind = np.where(road, np.minimum(np.searchsorted(depths, -middles[..., 2]), len(depths) - 1),
                             np.where(body, len(depths), -1))
        self.cavity = scene.in_cavity(middles)
        cells = np.argwhere(self.kind >= 0)
        self.cell_number = np.zeros(shape, int)
        self.cell_number[tuple(cells.T)] = np.arange(1, len(cells) + 1)
        self.cells = cells
        # Number the corners that cells have.
        steps = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
        corners = cells[:, None, :] + steps[None]
        used, inverse = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        self.nodes_m = np.stack([lines[a][used[:, a]] for a in range(3)], axis=-1)
        self.connectivity = inverse.reshape(-1, 8) + 1
        self.faces = self.find_faces()

    # Faces of C3D8: number, and the corners on it.
    SIDES = {(2, -1): (1, (0, 1, 2, 3)), (2, 1): (2, (4, 5, 6, 7)), (1, -1): (3, (0, 1, 4, 5)),
             (0, 1): (4, (1, 2, 5, 6)), (1, 1): (5, (2, 3, 6, 7)), (0, -1): (6, (0, 3, 4, 7))}

    def find_faces(self):
        faces = []
        shape = self.kind.shape
        for number, cell in enumerate(self.cells, 1):
            road = self.kind[tuple(cell)] < len(ROAD_LAYERS)
            for (axis, sign), (side, corners) in self.SIDES.items():
                if road and (axis, sign) != (2, 1):
                    continue
                beyond = cell.copy()
                beyond[axis] += sign
                inside = 0 <= beyond[axis] < shape[axis]
                if inside and self.kind[tuple(beyond)] >= 0:
                    continue
                low = np.array([self.lines[a][cell[a]] for a in range(3)])
                high = np.array([self.lines[a][cell[a] + 1] for a in range(3)])
                low[axis] = high[axis] = (high if sign > 0 else low)[axis]
                faces.append({"cell": number, "side": side, "axis": axis, "sign": sign, "road": road, "low": low,
                              "high": high, "nodes": self.connectivity[number - 1][list(corners)],
                              "cavity": bool(inside and self.cavity[tuple(beyond)])})
        return faces


def sunlit_frac(scene, mesh, times_s, points):
    """Shares of the sun's disc seen from the open faces, by time and face: rays of points on each face."""
    faces = mesh.faces
    low = np.array([f["low"] for f in faces])
    high = np.array([f["high"] for f in faces])
    normal = np.zeros((len(faces), 3))
    for i, f in enumerate(faces):
        normal[i, f["axis"]] = f["sign"]
    way = (np.arange(points) + 0.5) / points
    out = np.zeros((len(times_s), len(faces)))
    cavity = np.array([f["cavity"] for f in faces])
    radius = math.radians(0.2666)
    disc = [(0.0, 0.0)] + [(0.7071 * math.cos(a), 0.7071 * math.sin(a))
                           for a in np.arange(6) * math.pi / 3.0]
    for t, time_s in enumerate(times_s):
        sun = to_sun(time_s)
        facing = (normal @ sun > 0.0) & ~cavity
        index = np.nonzero(facing)[0]
        # Rays start at points of the two axes in the face.
        starts = []
        for u in way:
            for v in way:
                share = np.zeros((len(index), 3))
                for k, i in enumerate(index):
                    first, second = [a for a in range(3) if a != faces[i]["axis"]]
                    share[k, first], share[k, second] = u, v
                starts.append(low[index] + share * (high[index] - low[index]) + 1e-7 * normal[index])
        starts = np.concatenate(starts)
        east = np.cross([0.0, 0.0, 1.0], sun)
        east /= np.linalg.norm(east)
        up = np.cross(sun, east)
        seen = np.zeros(len(starts))
        for x, y in disc:
            to = sun + math.tan(radius) * (x * east + y * up)
            hidden = np.zeros(len(starts), bool)
            for box in scene.boxes:
                with np.errstate(divide="ignore"):
                    a = (box[0] - starts) / to
                    b = (box[1] - starts) / to
                begin = np.minimum(a, b).max(axis=1)
                end = np.maximum(a, b).min(axis=1)
                hidden |= (end > np.maximum(begin, 0.0) + 1e-9)
            seen += ~hidden / len(disc)
        out[t, index] = seen.reshape(points * points, -1).mean(axis=0)
    return out


def write_table(file, name, values):
    file.write(f"*AMPLITUDE, NAME={name}\n")
    for i in range(0, len(values), 4):
        file.write(", ".join(f"{t:.1f}, {v:.6g}" for t, v in values[i:i + 4]) + "\n")


def run_ccx(scene, mesh, folder, step_s, threads):
    """Writes the input of ccx, runs it, and returns temperatures of nodes by time, K, and the shares of the sun."""
    step_times = np.arange(0.0, DURATION_S + 1.0, 150.0)
    sun = sunlit_frac(scene, mesh, step_times, 4)
    name = scene.name
    absorptance = [ROAD_ABSORPTANCE if f["road"] else scene.absorptance for f in mesh.faces]
    with open(folder / f"{name}.inp", "w") as file:
        file.write("*NODE, NSET=ALL\n")
        for i, p in enumerate(mesh.nodes_m, 1):
            file.write(f"{i}, {p[0]:.9g}, {p[1]:.9g}, {p[2]:.9g}\n")
        kinds = mesh.kind[tuple(mesh.cells.T)]
        for kind in range(len(ROAD_LAYERS) + 1):
            file.write(f"*ELEMENT, TYPE=C3D8, ELSET=KIND{kind}\n")
            for number in np.nonzero(kinds == kind)[0]:
                file.write(f"{number + 1}, " + ", ".join(str(n) for n in mesh.connectivity[number]) + "\n")
            k, rho, c = ROAD_LAYERS[kind][1:] if kind < len(ROAD_LAYERS) else CONCRETE
            file.write(f"*MATERIAL, NAME=M{kind}\n*CONDUCTIVITY\n{k}\n*DENSITY\n{rho}\n*SPECIFIC HEAT\n{c}\n")
            file.write(f"*SOLID SECTION, ELSET=KIND{kind}, MATERIAL=M{kind}\n")
        bottom = np.nonzero(mesh.nodes_m[:, 2] < mesh.lines[2][0] + 1e-9)[0] + 1
        surface = sorted({int(n) for f in mesh.faces for n in f["nodes"]})
        for label, nodes in (("BOTTOM", bottom), ("SURFACE", surface)):
            file.write(f"*NSET, NSET={label}\n")
            for i in range(0, len(nodes), 12):
                file.write(", ".join(str(n) for n in nodes[i:i + 12]) + "\n")
        file.write(f"*PHYSICAL CONSTANTS, ABSOLUTE ZERO=0, STEFAN BOLTZMANN={STEFAN_BOLTZMANN}\n")
        file.write(f"*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL, {INITIAL_K}\n")
        # The flux into each lit face is a table of its own, unless another face has the same one.
        tables = {}
        for i, face in enumerate(mesh.faces):
            if face["cavity"]:
                continue
            series = []
            for t, time_s in enumerate(step_times):
                cosine = max(0.0, face["sign"] * float(to_sun(time_s)[face["axis"]]))
                series.append((time_s, round(absorptance[i] * direct_w_m2(time_s) * cosine * sun[t, i], 3)))
            if any(v > 0.0 for _, v in series):
                tables.setdefault(tuple(series), []).append(face)
        for number, series in enumerate(tables):
            write_table(file, f"SUN{number}", series)
        write_table(file, "AIR", [(t, air_k(t)) for t in step_times])
        file.write(f"*STEP, INC=100000\n*HEAT TRANSFER, DIRECT, SOLVER=ITERATIVE CHOLESKY\n{step_s}, {DURATION_S}\n")
        file.write(f"*BOUNDARY\nBOTTOM, 11, 11, {INITIAL_K}\n")
        for number, faces in enumerate(tables.values()):
            file.write(f"*DFLUX, AMPLITUDE=SUN{number}\n")
            for face in faces:
                file.write(f"{face['cell']}, S{face['side']}, 1.\n")
        file.write("*FILM, AMPLITUDE=AIR\n")
        for face in mesh.faces:
            if not face["cavity"]:
                file.write(f"{face['cell']}, F{face['side']}, 1., {FILM_W_M2_K}\n")
        file.write("*RADIATE\n")
        for face in mesh.faces:
            far_k = INITIAL_K if face["cavity"] else SKY_K
            file.write(f"{face['cell']}, R{face['side']}, {far_k}, {EMISSIVITY}\n")
        file.write(f"*NODE PRINT, NSET=SURFACE, FREQUENCY={int(1800 / step_s)}\nNT\n*END STEP\n")
    environment = dict(os.environ, OMP_NUM_THREADS=str(threads), CCX_NPROC_EQUATION_SOLVER=str(threads))
    done = subprocess.run([shutil.which("ccx"), name], cwd=folder, env=environment, capture_output=True, text=True)
    (folder / f"{name}.log").write_text(done.stdout + done.stderr)
    if "Job finished" not in done.stdout:
        raise SystemExit(f"{name}: ccx did not finish; see {folder / (name + '.log')}")
    out = {}
    now = None
    for line in (folder / f"{name}.dat").read_text().splitlines():
        words = line.split()
        if "time" in words:
            now = round(float(words[-1]))
            out[now] = np.full(len(mesh.nodes_m), math.nan)
        elif len(words) == 2 and now is not None:
            out[now][int(words[0]) - 1] = float(words[1])
    return out, step_times, sun


def quads_of(scene):
    """Faces of the body as emitd gets them: those of the boxes' cells, corners counter-clockwise from outside."""
    planes = [scene.planes(axis) for axis in range(3)]
    middles = np.stack(np.meshgrid(*[0.5 * (np.array(p[1:]) + np.array(p[:-1])) for p in planes], indexing="ij"),
                       axis=-1)
    solid = np.pad(scene.in_body(middles), 1)
    quads = []
    for i, j, k in np.argwhere(solid):
        for axis in range(3):
            for sign in (-1, 1):
                beyond = [i, j, k]
                beyond[axis] += sign
                if solid[tuple(beyond)]:
                    continue
                low = np.array([planes[0][i - 1], planes[1][j - 1], planes[2][k - 1]])
                high = np.array([planes[0][i], planes[1][j], planes[2][k]])
                low[axis] = high[axis] = (high if sign > 0 else low)[axis]
                u, v = (axis + 1) % 3, (axis + 2) % 3
                corners = []
                for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    p = low.copy()
                    p[u], p[v] = (high if a else low)[u], (high if b else low)[v]
                    corners.append(p)
                quads.append(corners if sign > 0 else corners[::-1])
    return quads


def write_gltf(path, quads):
    """Writes faces for an object that heads north: x is west, y is up, z is north."""
    triangles = []
    for a, b, c, d in quads:
        triangles += [a, b, c, a, c, d]
    places = np.array([[-p[0], p[2], p[1]] for p in triangles], np.float32)
    path.with_suffix(".bin").write_bytes(places.tobytes())
    size = places.nbytes
    path.write_text(json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "materials": [{"name": "surface"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": len(places),
                       "min": places.min(axis=0).tolist(), "max": places.max(axis=0).tolist()}],
        "bufferViews": [{"buffer": 0, "byteLength": size}],
        "buffers": [{"byteLength": size, "uri": path.with_suffix(".bin").name}]}))


def write_scenario(scene, folder):
    write_gltf(folder / f"{scene.name}-body.gltf", quads_of(scene))
    half = ROAD_HALF_M
    write_gltf(folder / f"{scene.name}-road.gltf",
               [[(-half, -half, 0.0), (half, -half, 0.0), (half, half, 0.0), (-half, half, 0.0)]])
    with open(folder / f"{scene.name}.csv", "w") as file:
        file.write("time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,air_k,film_w_m2_k,environment_k\n")
        for t in range(0, DURATION_S + 1, WEATHER_STEP_S):
            file.write(f"{t},{direct_w_m2(t):.6g},0,{STEFAN_BOLTZMANN * SKY_K ** 4:.8g},{air_k(t):.8g},{FILM_W_M2_K},"
                       f"{SKY_K}\n")

    def layers(all_layers):
        return ", ".join(f"{{ thickness_m = {d}, conductivity_w_m_k = {k}, density_kg_m3 = {rho}, "
                         f"specific_heat_j_kg_k = {c} }}" for d, k, rho, c in all_layers)

    def material(name, absorptance, of):
        return (f'[[material]]\nname = "{name}"\nsolar_absorptance_frac = {absorptance}\n'
                f"emissivity_frac = {EMISSIVITY}\nbase_k = {INITIAL_K}\nlayers = [{layers(of)}]\n"
                "modes = [{ tau_s = 600, weight_frac = 0.5 }, { tau_s = 7000, weight_frac = 0.5 }]\n\n")

    path = folder / f"{scene.name}.toml"
    path.write_text(
        f'name = "{scene.name}"\nepoch_utc = {EPOCH_UTC}\ndefault_material = "road"\n'
        f"[place]\nlat_deg = {LATITUDE_DEG}\nlon_deg = {LONGITUDE_DEG}\nheight_m = 380.0\n"
        f'[weather]\nfile = "{scene.name}.csv"\n[atmosphere]\nenabled = false\n'
        f'[thermal]\nmodel = "foster"\nmethod = "cached"\nsteps = 84\nspacing = "uniform"\nfoster_modes = 4\n'
        f"initial_k = {INITIAL_K}\nhistory_start_s = 0.0\nspin_up_s = 0.0\nexchange = false\n"
        'surroundings_material = "black"\n'
        "[sensor]\nwidth_px = 640\nheight_px = 512\nfov_h_deg = 36.0\nposition_m = [-2.2, -2.6, 2.0]\n"
        "look_at_m = [0.0, 0.0, 0.2]\n"
        f'[[object]]\nname = "road"\nmaterial = "road"\ngltf = "{scene.name}-road.gltf"\n'
        f'[[object]]\nname = "body"\nmaterial = "body"\ngltf = "{scene.name}-body.gltf"\n\n'
        + material("road", ROAD_ABSORPTANCE, ROAD_LAYERS)
        + material("body", scene.absorptance, [(scene.layer_m, *CONCRETE)])
        + material("black", 1.0, ROAD_LAYERS))
    return path


def rim(scene, face, place):
    """Pieces of the edges and feet at which the face of the body in the plane of a place ends, as low and high ends."""
    axis = face["axis"]
    u, v = [a for a in range(3) if a != axis]
    planes = [scene.planes(u), scene.planes(v)]
    depth = np.zeros(3)
    depth[axis] = face["sign"] * 1e-4

    def in_face(i, j):
        if not (0 <= i < len(planes[0]) - 1 and 0 <= j < len(planes[1]) - 1):
            return False
        p = np.array(place, float)
        p[u] = 0.5 * (planes[0][i] + planes[0][i + 1])
        p[v] = 0.5 * (planes[1][j] + planes[1][j + 1])
        return bool(scene.in_body(p - depth)) and not scene.in_body(p + depth) and (p + depth)[2] > 0.0

    pieces = []
    for i in range(-1, len(planes[0])):
        for j in range(-1, len(planes[1])):
            for next_i, next_j in ((i + 1, j), (i, j + 1)):
                if in_face(i, j) == in_face(next_i, next_j):
                    continue
                low, high = np.array(place, float), np.array(place, float)
                low[u], high[u] = (planes[0][next_i],) * 2 if next_i > i else planes[0][i:i + 2]
                low[v], high[v] = (planes[1][next_j],) * 2 if next_j > j else planes[1][j:j + 2]
                pieces.append((low, high))
    return pieces


def distances(scene, mesh, at, faces):
    """Distances of points on faces from the nearest edge or foot of the body, m; of the road: from the body."""
    out = np.zeros(len(faces))
    rims = {}
    for i, (p, face) in enumerate(zip(at, faces)):
        if face["road"]:
            past = [np.maximum(np.maximum(box[0] - p, p - box[1]), 0.0) for box in scene.boxes]
            out[i] = min(math.hypot(q[0], q[1]) for q in past)
            continue
        plane = (face["axis"], face["sign"], round(float(p[face["axis"]]), 6))
        if plane not in rims:
            rims[plane] = rim(scene, face, p)
        out[i] = min(math.dist(np.clip(p, low, high), p) for low, high in rims[plane])
    return out


def temperatures(command, columns=("temperature_k",)):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(str(c) for c in command)}\n{done.stderr}")
    return [[float(row[c]) for c in columns] for row in csv.DictReader(done.stdout.splitlines())]


def compare(scene, options):
    folder = options.folder
    mesh = Mesh(scene, options.least_m, options.growth, options.most_m)
    print(f"{scene.name}: {len(mesh.nodes_m)} nodes, {len(mesh.cells)} cells", flush=True)
    kept = folder / f"{scene.name}-{options.least_m}-{options.growth}-{options.most_m}-{options.step_s}.npz"
    if kept.exists():
        data = np.load(kept)
        final, before, sun_then = data["final"], data["before"], data["sun"]
    else:
        start = time.monotonic()
        by_time, times, sun = run_ccx(scene, mesh, folder, options.step_s, options.threads)
        final, before = by_time[DURATION_S], by_time[DURATION_S - 1800]
        late = times >= DURATION_S - 1800
        sun_then = np.stack([sun[late].min(axis=0), sun[late].max(axis=0), sun[-1]])
        np.savez(kept, final=final, before=before, sun=sun_then)
        print(f"  ccx {time.monotonic() - start:.0f} s", flush=True)
    # Compare at the nodes inside open faces: all of the body, and the road near it.
    around = {}
    for i, face in enumerate(mesh.faces):
        for node in face["nodes"]:
            around.setdefault(int(node), []).append(i)
    faces, at, judge, sun = [], [], [], []
    for node, beside in sorted(around.items()):
        face = mesh.faces[beside[0]]
        kinds = {(mesh.faces[i]["axis"], mesh.faces[i]["road"]) for i in beside}
        if len(beside) < 4 or face["cavity"] or len(kinds) > 1:
            continue
        place = mesh.nodes_m[node - 1]
        if face["road"] and min(math.hypot(*np.maximum(np.maximum(b[0] - place, place - b[1]), 0.0)[:2])
                                for b in scene.boxes) > COMPARED_M + 1e-6:
            continue
        faces.append(face)
        at.append(place)
        judge.append(final[node - 1])
        shares = sun_then[:, beside]
        sun.append([shares[0].min(), shares[1].max(), shares[2].mean()])
    at, judge, sun = np.array(at), np.array(judge), np.array(sun)
    away = distances(scene, mesh, at, faces)
    road = np.array([f["road"] for f in faces])
    normals = np.zeros((len(faces), 3))
    for i, f in enumerate(faces):
        normals[i, f["axis"]] = f["sign"]
    points = folder / f"{scene.name}-at.csv"
    with open(points, "w") as file:
        file.write("x_m,y_m,z_m,nx,ny,nz,object\n")
        for p, n, is_road in zip(at, normals, road):
            file.write(",".join(f"{v:.9g}" for v in (*p, *n)) + f",{'road' if is_road else 'body'}\n")
    scenario = write_scenario(scene, folder)
    emit = pathlib.Path(os.environ["TEST_BIN_DIR"]) / "emit"
    results = {}
    if "cached" in options.sides:
        results["cached"] = temperatures([emit, "probe", scenario, "--at", points, "--time-s", DURATION_S])
    if "solve" in options.sides:
        solved = folder / f"{scene.name}-solved.csv"
        if not (options.keep_solved and solved.exists()):
            subprocess.run([str(c) for c in (emit, "solve", scenario, "--dimension", "3", "--refine", options.refine,
                                             "--rays", 16, "--at", points, "--at-out", solved, "--time-s",
                                             DURATION_S)], check=True, capture_output=True)
        with open(solved) as file:
            results["solve"] = [[float(row["temperature_k"])] for row in csv.DictReader(file)]
    changing = sun[:, 1] - sun[:, 0] > 0.02
    parts = {"roof and walls": ~road & (away > 0.1), "edges, corners (10 cm)": ~road & (away <= 0.1),
             "road 0..2 cm": road & (away <= 0.02) & ~changing, "road 2..20 cm": road & (away > 0.02) & (away <= 0.2)
             & ~changing, "road 20..30 cm": road & (away > 0.2) & ~changing, "road, moving shadow": road & changing}
    rows = []
    for side, table in results.items():
        off = np.array([row[0] for row in table]) - judge
        if not np.isfinite(off).all():
            print(f"  {side:6} {np.count_nonzero(~np.isfinite(off))} of {len(off)} points have no temperature and are "
                  "left out", flush=True)
        for part, where in parts.items():
            good = where & np.isfinite(off)
            if not good.any():
                continue
            d = off[good]
            rows.append((scene.name, side, part, len(d), d.mean(), math.sqrt((d * d).mean()),
                         np.percentile(np.abs(d), 99), np.abs(d).max()))
            print(f"  {side:6} {part:24} {len(d):5} mean {d.mean():+.3f} rms {rows[-1][5]:.3f} p99 {rows[-1][6]:.3f} "
                  f"max {rows[-1][7]:.3f}", flush=True)
        np.savez(folder / f"{scene.name}-{side}.npz", at=at, normals=normals, road=road, away=away, judge=judge,
                 off=off, sun=sun)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="scenes, or the beginnings of their names; default: all")
    parser.add_argument("--folder", type=pathlib.Path, default=pathlib.Path("calculix"), help="where files go")
    parser.add_argument("--least-m", type=float, default=0.004, help="cells at edges and surfaces, m")
    parser.add_argument("--growth", type=float, default=1.6, help="of cells away from them")
    parser.add_argument("--most-m", type=float, default=0.05, help="greatest cells near the body, m")
    parser.add_argument("--step-s", type=float, default=100.0, help="step of ccx, s; 1800 is a multiple of it")
    parser.add_argument("--refine", type=float, default=0.7, help="of emit solve")
    parser.add_argument("--sides", nargs="+", default=["cached", "solve"], choices=["cached", "solve"])
    parser.add_argument("--keep-solved", action="store_true", help="reuse tables of emit solve in the folder")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    options = parser.parse_args()
    if shutil.which("ccx") is None:
        print("skipped: ccx is not installed (Debian: calculix-ccx)")
        return SKIPPED
    options.folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for scene in scenes():
        if not options.names or any(scene.name.startswith(name) for name in options.names):
            rows += compare(scene, options)
    with open(options.folder / "errors.csv", "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["scene", "side", "part", "points", "mean_k", "rms_k", "p99_k", "max_k"])
        table.writerows([*row[:4], *[f"{v:.3f}" for v in row[4:]]] for row in rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
