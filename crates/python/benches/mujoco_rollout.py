"""How many environment steps a core does: worlds of viscera beside MuJoCo's rollout of the same mesh.

    python crates/python/benches/mujoco_rollout.py [repetitions]

A block is held at one side and sags under its weight, without tools, and does not look for itself. An environment step
is 1/30 s. Both are asked how far from the exact state of rest they are after 2 s, and how long an environment step
takes on one thread, turn by turn so that a busy machine slows both.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time

import mujoco
import mujoco.rollout
import numpy as np
import viscera as vi

YOUNG, POISSON, DENSITY = 10e3, 0.4, 1000.0
WORLDS = 64
# Of MuJoCo's flex [s]: it has come to rest after 2 s.
DAMPING = 0.01
BLOCKS = {75: (3, 5, 1), 1300: (5, 13, 4)}

SCENE = """
[time]
frame = "1/120 s"
duration = "2 s"
velocity_factor = 0.95

[world]
gravity = [0, 0, "-9.81 m/s^2"]

[[body]]
name = "block"
shape = "block"
size = [{size}]
cells = [{cells}]

[body.material]
model = "saint_venant_kirchhoff"
young = "{young} Pa"
poisson = {poisson}
density = "{density} kg/m^3"

[[fixing]]
name = "wall"
body = "block"
half_space = {{ point = [0, 0, 0], normal = [-1, 0, 0] }}

[contact]
self = false

[solver]
method = "explicit"
elements = "plain"
threads = 1
"""


def scene(cells: tuple[int, int, int]) -> vi.Scene:
    """A block of these cells, each a cube of 10 mm."""
    size = ", ".join(f'"{10 * n} mm"' for n in cells)
    text = SCENE.format(
        size=size,
        cells=", ".join(map(str, cells)),
        young=YOUNG,
        poisson=POISSON,
        density=DENSITY,
    )
    return vi.Scene.parse(text.replace('"1/120 s"', '"8.3333333 ms"'), name="block.toml")


def model(body: vi.Body, step: float) -> mujoco.MjModel:
    """The same mesh as a flex."""
    rest, tets = body.rest, body.tets
    edges = rest[tets[:, 1:]] - rest[tets[:, :1]]
    volumes = np.abs(np.linalg.det(edges)) / 6
    pins = " ".join(map(str, np.flatnonzero(rest[:, 0] < 1e-6)))
    points = " ".join(f"{x:.9g}" for x in rest.ravel())
    elements = " ".join(map(str, tets.ravel()))
    flex = mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <option timestep="{step}" gravity="0 0 -9.81" integrator="discrete"/>
          <size memory="200M"/>
          <worldbody>
            <flexcomp name="block" type="direct" dim="3" point="{points}" element="{elements}"
                      mass="{DENSITY * volumes.sum()}" radius="0.0005">
              <elasticity young="{YOUNG}" poisson="{POISSON}" damping="{DAMPING}"/>
              <contact contype="0" conaffinity="0" selfcollide="none"/>
              <edge equality="false"/>
              <pin id="{pins}"/>
            </flexcomp>
          </worldbody>
        </mujoco>""")
    # Every vertex a quarter of its tetrahedra, as here, in place of all vertices alike.
    masses = np.bincount(tets.ravel(), np.repeat(DENSITY * volumes / 4, 4))
    bodies = np.array(flex.flex_vertbodyid)
    free = bodies > 0
    flex.body_mass[bodies[free]] = masses[free]
    mujoco.mj_setConst(flex, mujoco.MjData(flex))
    return flex


def end_of(flex: mujoco.MjModel, seconds: float) -> np.ndarray:
    """Where vertices are after a time."""
    data = mujoco.MjData(flex)
    for _ in range(round(seconds / flex.opt.timestep)):
        mujoco.mj_step(flex, data)
    return np.array(data.flexvert_xpos)


def main() -> None:
    """Compares both on two meshes."""
    repetitions = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    # Where MuJoCo writes its warnings.
    os.chdir(tempfile.mkdtemp())
    print(f"MuJoCo {mujoco.__version__}, viscera {vi.__version__}, one thread each")
    for cells in BLOCKS.values():
        block = scene(cells)
        exact = vi.rest(block).positions("block")[0]
        sim = vi.Simulation(block)
        sim.advance(block.frame_count)
        body = sim["block"]
        sag = np.abs(exact - body.rest).max()
        ours = np.abs(body.positions - exact).max() / sag
        # Its implicit steps are stable at any length: as few as frames have, and more where these are not as accurate.
        for step in (1 / 120, 1 / 240, 1 / 480, 1 / 960):
            flex = model(body, step)
            theirs = np.abs(end_of(flex, 2.0) - exact).max() / sag
            if theirs < max(0.01, ours):
                break
        worlds = vi.Worlds(block, WORLDS, threads=1)
        data = mujoco.MjData(flex)
        state = np.zeros((WORLDS, mujoco.mj_stateSize(flex, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
        mujoco.mj_getState(flex, data, state[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
        state[:] = state[0]
        steps = round(1 / 30 / step)
        pool = mujoco.rollout.Rollout(nthread=1)
        times: list[tuple[float, float]] = []
        for _ in range(repetitions):
            begun = time.perf_counter()
            worlds.step(4)
            between = time.perf_counter()
            pool.rollout([flex] * WORLDS, [data], state, nstep=steps)
            times.append((between - begun, time.perf_counter() - between))
        best = np.array(times).min(axis=0) / WORLDS
        ratio = np.median([b / a for a, b in times])
        print(
            f"{len(body.tets)} tetrahedra: viscera {1 / best[0]:.0f} a second, {100 * ours:.2g} % from rest; "
            f"MuJoCo {1 / best[1]:.0f}, {100 * theirs:.2g} %, by steps of {1e3 * step:.2g} ms; "
            f"{ratio:.1f} times"
        )


if __name__ == "__main__":
    main()
