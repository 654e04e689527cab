"""MuJoCo in the two scenes of contact: a ball that is pressed into a block, and a block on an incline.

    python contact_peer.py press '{"size": "m", "depth": 4, "substeps": 4}'
    python contact_peer.py slide '{"angle": 26.9, "frames": 36}'
    python contact_peer.py base '{"size": "m", "law": "snh", "positions": "positions.txt"}'

In the benchmark's folder, with the meshes of `viscera-lab contact-scenes` in SOFTBENCH_CACHE. Prints one line, RESULT and
JSON: of MuJoCo forces at the ends of the last frames, the force that the deformed block itself leads to its base, acceleration,
way, and the processor time of a frame; `base` only tells the force of a block that another program has deformed.

The ball, a motion capture body, and the plane are rigid geometries; the block is a 3D flex of linear tetrahedra with one
slider triple per vertex, as in mujoco_peer.py. The flex's radius counts as part of the ball, and lifts the block off the
plane, so that where contact begins is the surface that the other simulators have.
"""
import json
import math
import os
import sys
import time

import mujoco
import numpy as np

sys.path.insert(0, os.getcwd())
import oracle  # noqa: E402

CACHE = os.environ["SOFTBENCH_CACHE"]
FRAME = 1 / 60
YOUNG, POISSON, DENSITY, GRAVITY = 1e4, 0.3, 1000.0, 9.81
RADIUS, FRICTION = 0.012, 0.5
# Frames: down, held; gravity turns, rest.
PRESSING, HELD = 60, 120
TURNING, RESTING = 30, 30
KEPT_VELOCITY = 0.9
COUNTED, UNTIMED, SKIPPED = 10, 3, 6
# CPU time [s] after which a run is broken off.
LONGEST = 300.0

USUAL = dict(size="s", depth=4.0, angle=0.0, frames=36, substeps=4, integrator="discrete", solref=None, solimp=None,
             cone=None, impratio=None, solver="Newton", iterations=100, tolerance=1e-8, flex_radius=1e-4)


def read_mesh(name):
    file = os.path.join(CACHE, name + ".txt")
    counts = np.loadtxt(file, max_rows=1, dtype=int)
    table = np.loadtxt(file, skiprows=1, max_rows=counts[0])
    tets = np.loadtxt(file, skiprows=1 + counts[0], dtype=np.int64)
    return np.ascontiguousarray(table[:, :3]), tets, np.flatnonzero(table[:, 3])


def build(X, T, fixed, presses, cfg):
    """The model, and the tissue by the benchmark's oracle."""
    tissue = oracle.Problem(X, T, material="stvk", E=YOUNG, nu=POISSON, rho=DENSITY, gravity=(0, 0, 0), fixed=fixed,
                            fixed_pos=X[fixed])
    s = mujoco.MjSpec()
    s.compiler.boundmass, s.compiler.boundinertia = 1e-15, 1e-18
    o = s.option
    o.timestep = FRAME / cfg["substeps"]
    o.gravity = [0, 0, 0 if presses else -GRAVITY]
    o.integrator = getattr(mujoco.mjtIntegrator, "mjINT_" + cfg["integrator"].upper())
    o.solver = getattr(mujoco.mjtSolver, "mjSOL_" + cfg["solver"].upper())
    o.iterations, o.tolerance = int(cfg["iterations"]), cfg["tolerance"]
    if cfg["cone"]:
        o.cone = getattr(mujoco.mjtCone, "mjCONE_" + cfg["cone"].upper())
    if cfg["impratio"]:
        o.impratio = cfg["impratio"]
    s.memory = 1 << 30
    contact = dict(contype=1, conaffinity=1, condim=1 if presses else 3)
    friction = [0 if presses else FRICTION, 0.005, 0.0001]
    geom = dict(contact, friction=friction)
    flex = dict(contact, friction=friction)
    for key in ("solref", "solimp"):
        if cfg[key]:
            flex[key] = geom[key] = cfg[key]
    if presses:
        body = s.worldbody.add_body(name="ball", mocap=True, pos=[0, 0, 1])
        body.add_geom(name="tool", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS - cfg["flex_radius"], 0, 0], **geom)
    else:
        s.worldbody.add_geom(name="tool", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1],
                             pos=[0, 0, -cfg["flex_radius"]], **geom)
    names, vert = [], []
    held = set(fixed.tolist())
    for i, p in enumerate(X):
        if i in held:
            names.append("world"); vert.extend(p)
            continue
        b = s.worldbody.add_body(name=f"v{i}", pos=p, mass=tissue.mass[i], inertia=[1e-12] * 3, ipos=[0, 0, 0],
                                 explicitinertial=True)
        for axis in np.eye(3):
            b.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        names.append(f"v{i}"); vert.extend((0.0, 0.0, 0.0))
    f = s.add_flex(name="soft", dim=3, radius=cfg["flex_radius"], young=YOUNG, poisson=POISSON, damping=0,
                   selfcollide=mujoco.mjtFlexSelf.mjFLEXSELF_NONE, **flex)
    f.vertbody, f.vert, f.elem = names, vert, T.ravel().tolist()
    return s.compile(), tissue


class Run:
    def __init__(self, presses, cfg):
        self.X, T, fixed = read_mesh(f"block-{cfg['size']}" if presses else "incline")
        self.m, self.tissue = build(self.X, T, fixed, presses, cfg)
        self.d = mujoco.MjData(self.m)
        mujoco.mj_forward(self.m, self.d)
        self.substeps, self.times, self.begin = cfg["substeps"], [], time.process_time()
        self.fixed, self.mass = fixed, self.tissue.mass / self.tissue.mass.sum()

    def frame(self, before_step):
        spent = 0.0
        for k in range(self.substeps):
            before_step((k + 1) / self.substeps)
            begin = time.process_time()
            mujoco.mj_step(self.m, self.d)
            spent += time.process_time() - begin
        self.times.append(1e3 * spent)
        if not np.isfinite(self.d.qpos).all() or np.abs(self.d.qpos).max() > 1000 or self.d.warning[
                mujoco.mjtWarning.mjWARN_BADQACC].number:
            raise ArithmeticError("diverged")
        if time.process_time() - self.begin > LONGEST:
            raise ArithmeticError("timeout")

    def positions(self):
        mujoco.mj_kinematics(self.m, self.d)
        mujoco.mj_flex(self.m, self.d)
        return self.d.flexvert_xpos.copy()

    def velocities(self):
        """Of vertices; those that are held have none."""
        v = np.zeros_like(self.X)
        v[np.setdiff1d(np.arange(len(self.X)), self.fixed)] = self.d.qvel.reshape(-1, 3)
        return v

    def force(self):
        """On the rigid body, in the last step [N]."""
        total, f = np.zeros(3), np.zeros(6)
        for i in range(self.d.ncon):
            contact = self.d.contact[i]
            mujoco.mj_contactForce(self.m, self.d, i, f)
            world = contact.frame.reshape(3, 3).T @ f[:3]
            total += -world if contact.geom[0] >= 0 else world
        return total

    def cost(self):
        return dict(cpu_ms=float(np.median(self.times[UNTIMED:])), contacts=int(self.d.ncon))


def press(cfg):
    run, forces = Run(True, cfg), []
    top = run.X[:, 2].max()
    middle = 0.5 * (run.X[:, :2].min(0) + run.X[:, :2].max(0))
    for frame in range(PRESSING + HELD):
        def move(part):
            share = min((frame + part) / PRESSING, 1)
            run.d.mocap_pos[0] = [*middle, top + RADIUS - 1e-3 * cfg["depth"] * share]
        run.frame(move)
        forces.append(run.force()[2])
        run.d.qvel *= KEPT_VELOCITY
    x = run.positions()
    base = run.tissue.forces(x)[run.fixed, 2].sum()
    touched = x[np.linalg.norm(x - run.d.mocap_pos[0], axis=1).argmin()]
    return dict(forces=forces[-COUNTED:], base_force=float(abs(base)),
                nearest_vertex_mm=float(1e3 * (np.linalg.norm(touched - run.d.mocap_pos[0]) - RADIUS)), **run.cost())


def slide(cfg):
    run = Run(False, cfg)
    angle = math.radians(cfg["angle"])
    slope = np.array([0.6, 0.8, 0.0])
    places, speeds = [], []
    for frame in range(TURNING + RESTING + cfg["frames"]):
        def turn(part):
            now = angle * min((frame + part) / TURNING, 1)
            run.m.opt.gravity[:] = GRAVITY * (math.sin(now) * slope - math.cos(now) * np.array([0, 0, 1]))
        run.frame(turn)
        if frame < TURNING + RESTING:
            run.d.qvel *= KEPT_VELOCITY
        else:
            places.append(run.mass @ run.positions() @ slope)
            speeds.append(run.mass @ run.velocities() @ slope)
    force = run.force()
    times = FRAME * np.arange(len(speeds))
    return dict(acceleration=float(np.polyfit(times[SKIPPED:], speeds[SKIPPED:], 1)[0]),
                way=float(places[-1] - places[SKIPPED]), ratio=float(np.hypot(*force[:2]) / abs(force[2])), **run.cost())


def base(asked):
    X, T, fixed = read_mesh(f"block-{asked['size']}")
    tissue = oracle.Problem(X, T, material=asked["law"], E=YOUNG, nu=POISSON, fixed=fixed, fixed_pos=X[fixed])
    force = tissue.forces(np.loadtxt(asked["positions"]))[fixed, 2].sum()
    print("RESULT " + json.dumps(dict(base_force=float(abs(force)))))


def main():
    presses = sys.argv[1] == "press"
    asked = json.loads(sys.argv[2])
    if sys.argv[1] == "base":
        return base(asked)
    unknown = set(asked) - set(USUAL)
    if unknown:
        raise SystemExit(f"no such settings: {unknown}")
    row = dict(status="ok", version=mujoco.__version__)
    try:
        row.update((press if presses else slide)({**USUAL, **asked}))
    except ArithmeticError as error:
        row["status"] = str(error)
    print("RESULT " + json.dumps(row), flush=True)


main()
