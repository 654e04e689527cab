"""Starts a program of the benchmark with more sizes than it has, and references for them.

    python runner.py peers/mujoco_peer.py --peer MujocoFlex --scene A --size n12 ...
    python runner.py unjudged peers/mujoco_peer.py --peer MujocoFlex --scene A --size u12 ...
    python runner.py references A n12 liver ...

In the benchmark's folder; `unjudged` looks for no state of rest of the same mesh, so that errors are NaN. Besides its
own sizes there are

  n12      a bar of 12 cells across
  u12      the same of tetrahedra in no order: SOFTBENCH_CACHE/u12.txt, as `viscera-lab bars` writes it
  liver    an organ of scene A: SOFTBENCH_CACHE/liver.txt, as `viscera-lab organs` writes it

The benchmark's reference motion takes hours on fine meshes. Where its small steps would move more than
MOST_WORK tetrahedra, the reference is the motion that the program VISCERA computes with its explicit method in
double precision, at a quarter of the stable step: another program, but no other simulator's.
"""
import json
import os
import runpy
import subprocess
import sys
import tempfile

import numpy as np

HERE = os.getcwd()
sys.path.insert(0, HERE)
sys.path.insert(0, os.path.join(HERE, "peers"))
import meshes  # noqa: E402
import scenes  # noqa: E402

CACHE = os.environ["SOFTBENCH_CACHE"]
# Tetrahedra times small steps: ten minutes or so.
MOST_WORK = 4e8
# Of an organ.
YOUNG, POISSON = 20e3, 0.45

# Vertices above which Newton's method begins where VISCERA has come to rest: from the rest shape it takes minutes.
MANY = 12000

own_build, own_trajectory = scenes.build, scenes.trajectory
own_solve = scenes.solve_static


def read_mesh(file):
    """Vertices with a mark of those that are held, and tetrahedra."""
    numbers = np.loadtxt(file, max_rows=1, dtype=int)
    return np.loadtxt(file, skiprows=1, max_rows=numbers[0]), np.loadtxt(file, skiprows=1 + numbers[0], dtype=np.int64)


def build(name, size, **over):
    """A scene of the benchmark, of any size."""
    if size[0] == "n":
        cells = int(size[1:])
        # A size of the benchmark's own has references already.
        size = next((known for known, of in meshes.BAR_N.items() if of == cells), size)
        meshes.BAR_N[size] = cells
    file = os.path.join(CACHE, size + ".txt")
    if size[0] == "u" and size[1:].isdigit():
        # The benchmark takes a mesh from here where it knows the name.
        known = os.path.join(CACHE, f"bar_{size}.npz")
        if not os.path.exists(known):
            table, T = read_mesh(file)
            np.savez_compressed(known, X=table[:, :3], T=T.astype(np.int32))
        return own_build(name, size, **over)
    if not os.path.exists(file):
        return own_build(name, size, **over)
    if name != "A":
        raise SystemExit("organs hang in gravity: scene A only")
    table, T = read_mesh(file)
    X, fixed = np.ascontiguousarray(table[:, :3]), np.flatnonzero(table[:, 3])
    low = np.argsort(X[:, 2])[: max(1, len(X) // 20)]
    bar = own_build("A", "xs")
    bar.update(size=size, X=X, T=T, fixed=fixed, moving_mask=np.zeros(len(fixed), bool), probe=np.sort(low),
               free=np.setdiff1d(np.arange(len(X)), fixed),
               E=over.get("E") or YOUNG, nu=over.get("nu") or POISSON)
    return bar


def small_steps(scene, material, frames):
    """How many the benchmark would take."""
    p = scene.problem(material)
    speed = np.sqrt((p.lam + 2 * p.mu) / p.rho)
    dt = 0.25 * (1.0 / np.linalg.norm(p.G, axis=2).max(1)).min() / speed
    return frames * scene.dt / dt


def trajectory(scene, material, frames=30, dt=None):
    """The reference motion of the probe, and whose it is."""
    if len(scene.T) * small_steps(scene, material, frames) <= MOST_WORK:
        return own_trajectory(scene, material, frames, dt)
    file = os.path.join(CACHE, f"motion_{scene.name}_{scene.size}_{scene.E:g}_{scene.nu:g}_{material}_{frames}.npy")
    if os.path.exists(file):
        return np.load(file)
    with tempfile.TemporaryDirectory() as folder:
        scenes.export(scene, os.path.join(folder, "scene"))
        settings = f"material={material},method=explicit,precision=f64,explicit_safety=0.25"
        subprocess.run([os.environ["VISCERA"], "bench-scene", "--scene", os.path.join(folder, "scene"), "--out", folder,
                        "--frames", str(frames), "--transient", "--cfg", settings], check=True)
        places = np.fromfile(os.path.join(folder, "frames.f64"), "<f8").reshape(frames, -1, 3)
    u = (places - scene.X)[:, scene.probe].mean(1)
    np.save(file, u)
    return u


def settled_by_program(scene, material):
    """Where the program comes to rest. Newton's method still has to find a residual of nothing from there."""
    with tempfile.TemporaryDirectory() as folder:
        scenes.export(scene, os.path.join(folder, "scene"))
        settings = f"material={material},precision=f64,accuracy=standard"
        subprocess.run([os.environ["VISCERA"], "bench-scene", "--scene", os.path.join(folder, "scene"), "--out", folder,
                        "--cfg", settings], check=True)
        return np.loadtxt(os.path.join(folder, "positions.txt"))


def references(name, sizes):
    """Rest and motion of these sizes; one line each."""
    for size in sizes:
        scene = build(name, size)
        for material in ("snh", "stvk"):
            begin = {}
            if len(scene.X) > MANY:
                begin["x0"] = settled_by_program(scene, material)
            scenes.solve_static = lambda p, **k: own_solve(p, **begin, **k)
            try:
                _, info = scenes.reference(scene, material)
                words = f"rest {'found' if info['converged'] else 'not found'} in {info['seconds']:.0f} s"
                words += f", {len(trajectory(scene, material))} frames of motion"
            except RuntimeError as error:
                words = f"none: {error}"
            print(name, size, material, len(scene.T), "tetrahedra:", words, flush=True)


scenes.build, scenes.trajectory = build, trajectory
if sys.argv[1] == "references":
    references(sys.argv[2], sys.argv[3:])
else:
    sys.argv = sys.argv[1:]
    if sys.argv[0] == "unjudged":
        sys.argv = sys.argv[1:]
        scenes.reference = lambda scene, material: (np.full_like(scene.X, np.nan), dict(converged=True))
    runpy.run_path(sys.argv[0], run_name="__main__")
