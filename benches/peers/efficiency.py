#!/usr/bin/env python3
"""Error after equal CPU time, Penumbra beside Mitsuba 3 and, with `--cycles BPY`, Blender's Cycles: a Markdown table.

    benches/peers/efficiency.py HARNESS [--scenes cornell,softshadows] [--modes direct,path5] [--binary target/release/penumbra]

HARNESS is the folder with `renderers/` (its README says what Mitsuba needs), BPY that of the module `bpy`. One thread each, in turn, in one run.
RMSE against the harness's references, pixels that see a light left out, the reference's own variance subtracted.
"""
import argparse, json, os, subprocess, sys, tempfile
import numpy as np
import OpenEXR

parser = argparse.ArgumentParser()
parser.add_argument("harness")
parser.add_argument("--scenes", default="cornell,softshadows")
parser.add_argument("--modes", default="direct,path5")
parser.add_argument("--samplers", default="multijitter,ldsampler")
parser.add_argument("--seconds", default="0.5,2,8")
parser.add_argument("--cycles")
parser.add_argument("--binary", default="target/release/penumbra")
args = parser.parse_args()
renderers = os.path.join(os.path.abspath(args.harness), "renderers")
sys.path.insert(0, renderers)
import common

TIMES = [float(t) for t in args.seconds.split(",")]
SPPS = {"direct": "16,64,256,1024", "path5": "4,16,64,256"}


def settings_file(name, folder):
    """The harness's scene as one of ours; flat, since the peers shade flat."""
    scene, lines = common.scene(name), []
    for key, m in scene["materials"].items():
        lines.append(f"[material.{key}]\nbase_color = {m['rgb']}")
    for i, mesh in enumerate(scene["meshes"]):
        vertices, faces = common.obj(os.path.join(renderers, "scenes", mesh["obj"]))
        path = os.path.join(folder, f"{name}-{i}.obj")
        with open(path, "w") as out:
            out.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
            out.writelines(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces.tolist())
        lines.append(f"[[model]]\nfile = {json.dumps(path)}\nmaterial = {json.dumps(mesh['material'])}\nmatrix = {mesh['transform']}")
    for light in scene["lights"]:
        lines.append("[[light]]\nkind = \"parallelogram\"")
        lines += [f"{key} = {light[key]}" for key in ("corner", "edge_u", "edge_v", "radiance")]
    c = scene["camera"]
    lines.append(f"[camera]\nposition = {c['eye']}\ntarget = {c['target']}\nup = {c['up']}\nvertical_fov = {c['vfov_deg']}")
    lines.append(f"[render]\nresolution = [{c['width']}, {c['height']}]")
    path = os.path.join(folder, f"{name}.toml")
    with open(path, "w") as out:
        out.write("\n".join(lines) + "\n")
    return path


def read(path):
    channels = OpenEXR.File(path).channels()
    if "RGB" in channels:
        return channels["RGB"].pixels.astype(np.float64)
    return np.stack([channels[k].pixels for k in "RGB"], -1).astype(np.float64)


def ours(path, mode, seconds, reference, mask, variance, folder):
    squares = []
    for seed in range(3 if seconds < 4 else 2):
        image = os.path.join(folder, "out.exr")
        integrator = "direct" if mode == "direct" else "path"
        command = [args.binary, "render", path, "--time-limit", str(seconds), "--threads", "1", "--seed", str(seed)]
        command += ["--integrator", integrator, "--max-depth", str(common.MODES[mode] - 1), "-o", image, "-q"]
        subprocess.run(command, check=False)
        squares.append(((read(image) - reference)[mask] ** 2).mean() - variance)
    return float(np.sqrt(np.mean(squares)))


def mitsuba(name, mode, folder):
    """RMSE at TIMES, of the best sampler at each."""
    log = os.path.join(folder, "mitsuba.jsonl")
    command = [sys.executable, "run_mitsuba.py", "bench", "--threads", "1", "--scenes", name, "--modes", mode]
    command += ["--samplers", args.samplers, "--spps", SPPS[mode], "--json", log]
    subprocess.run(command, cwd=renderers, check=True, stdout=subprocess.DEVNULL)
    curves = {}
    for line in map(json.loads, open(log)):
        if (line["scene"], line["mode"]) == (name, mode):
            curves.setdefault(line["sampler"], []).append((line["cpu"], line["rmse"]))
    at = lambda curve, t: float(np.exp(np.interp(np.log(t), *np.log(np.array(sorted(curve))).T)))
    return [min(at(curve, t) for curve in curves.values()) for t in TIMES]


def cycles(name, mode, folder):
    """RMSE at TIMES. Its times hold loading and building: what each sample takes is the slope between the least and the most."""
    log = os.path.join(folder, "cycles.jsonl")
    command = [sys.executable, "run_cycles.py", "bench", "--threads", "1", "--scenes", name, "--modes", mode, "--seeds", "2"]
    command += ["--patterns", "TABULATED_SOBOL", "--spps", "1,4,16,64", "--json", log]
    subprocess.run(command, cwd=renderers, check=True, stdout=subprocess.DEVNULL, env=dict(os.environ, BPY_SITE=args.cycles))
    lines = [line for line in map(json.loads, open(log)) if (line["scene"], line["mode"]) == (name, mode)]
    errors, seconds = {}, {}
    for line in lines:
        errors.setdefault(line["spp"], []).append(line["rmse"])
        seconds.setdefault(line["spp"], []).append(line["cpu"])
    least, most = min(errors), max(errors)
    each = (min(seconds[most]) - min(seconds[least])) / (most - least)
    curve = sorted((each * spp, float(np.sqrt(np.mean(np.square(found))))) for spp, found in errors.items())
    return [float(np.exp(np.interp(np.log(t), *np.log(np.array(curve)).T))) for t in TIMES]


peers = {"Mitsuba": mitsuba} | ({"Cycles": cycles} if args.cycles else {})
with tempfile.TemporaryDirectory() as folder:
    heads = [f"{peer} | ratio" for peer in peers]
    print("| RMSE after | " + " | ".join(" | ".join([f"Penumbra {t:g} s", *heads]) for t in TIMES) + " |")
    print("|---|" + "---|" * ((1 + 2 * len(peers)) * len(TIMES)))
    for name in args.scenes.split(","):
        path = settings_file(name, folder)
        for mode in args.modes.split(","):
            reference, mask = common.ref(name, mode), common.mask(name)
            stored = np.load(common.ref_path(name, mode))
            variance = float(stored["rmse_est"]) ** 2 if "rmse_est" in stored else 0.0
            found = [peer(name, mode, folder) for peer in peers.values()]
            cells = []
            for t, theirs in zip(TIMES, zip(*found)):
                mine = ours(path, mode, t, reference, mask, variance, folder)
                cells.append(" | ".join([f"{mine:.2g}"] + [f"{their:.2g} | {(their / mine) ** 2:.2g}" for their in theirs]))
            print(f"| {name}, {mode} | " + " | ".join(cells) + " |", flush=True)
