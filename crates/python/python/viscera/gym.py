"""Gymnasium environments: tissue to move, to feel and to grasp.

>>> import gymnasium, viscera.gym
>>> environment = gymnasium.make("viscera/TissueRetraction-v0")
>>> many = gymnasium.make_vec("viscera/Palpation-v0", num_envs=8)

Each comes as a single environment and as a vector environment, whose worlds are computed side by side on threads.
Lengths are metres, forces newtons. Actions are between -1 and 1. The same seed and the same actions give the same
bits on any machine. Needs the optional extra ``viscera[gym]``.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ._viscera import Scene, Worlds

try:
    import gymnasium
except ImportError:
    raise ImportError("viscera.gym needs Gymnasium: pip install 'viscera[gym]'") from None

from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

Array = NDArray[Any]
Observation = dict[str, NDArray[np.float32]]
Truths = NDArray[np.bool_]

# Frames of 1/120 s in one action.
FRAMES = 4

# Force at which an episode ends, unless the caller says otherwise [N].
MAX_FORCE = 3.0


class Task:
    """What an environment does in all its worlds at once: subclasses say what is there and what is wanted."""

    name: ClassVar[str]
    scene: ClassVar[str]
    actions: ClassVar[int]
    max_steps: ClassVar[int] = 100

    def __init__(self, count: int, threads: int | None, max_force: float) -> None:
        """In so many worlds."""
        text = Scene.parse(self.scene, name=self.name)
        self.worlds = Worlds(text, count, threads=threads)
        self.count = count
        self.max_force = max_force
        self.steps = np.zeros(count, dtype=np.int64)
        self.generators = [np.random.default_rng() for _ in range(count)]

    # What subclasses say.

    def spaces(self) -> gymnasium.spaces.Dict:
        """Of one world's observation."""
        raise NotImplementedError

    def begin(self, chosen: Truths) -> None:
        """Makes up what is different in each episode, of worlds that were set back."""
        raise NotImplementedError

    def act(self, actions: Array) -> None:
        """Leads what the hand leads through the next frame."""
        raise NotImplementedError

    def observe(self) -> Observation:
        """What is seen of all worlds."""
        raise NotImplementedError

    def reward(self) -> Array:
        """Of all worlds, at most 0 but for what ends an episode well."""
        raise NotImplementedError

    def force(self) -> Array:
        """The force on the tissue in all worlds [N], shape (n, 3)."""
        raise NotImplementedError

    def has_succeeded(self) -> Truths:
        """Which worlds have done what was wanted."""
        return np.zeros(self.count, dtype=bool)

    # The same in all.

    def reset(self, chosen: Truths, seeds: list[int | None] | None = None) -> None:
        """Begins an episode in the worlds that are chosen."""
        if seeds is not None:
            for number, seed in enumerate(seeds):
                if chosen[number] and seed is not None:
                    self.generators[number] = np.random.default_rng(seed)
        self.worlds.reset(mask=chosen)
        self.steps[chosen] = 0
        self.begin(chosen)

    def draw(self, chosen: Truths, low: Array, high: Array) -> Array:
        """Numbers at random for the worlds that are chosen, from each one's own generator; others get NaN."""
        drawn: Array = np.full((self.count, len(low)), np.nan)
        for number in np.flatnonzero(chosen):
            drawn[number] = self.generators[number].uniform(low, high)
        return drawn

    def step(self, actions: Array) -> tuple[Array, Truths, Truths]:
        """One action in all worlds: rewards, which have ended, which were cut off."""
        for _ in range(FRAMES):
            self.act(actions)
            self.worlds.step()
        self.steps += 1
        force = np.linalg.norm(self.force(), axis=1)
        failed = (self.worlds.status >= 2) | ~np.isfinite(force) | (force > self.max_force)
        succeeded = self.has_succeeded() & ~failed
        reward = np.where(failed, -10.0, self.reward() + 10.0 * succeeded)
        ended = failed | succeeded
        return reward, ended, ~ended & (self.steps >= self.max_steps)

    def info(self) -> dict[str, Array]:
        """What is known beside observations."""
        return {"status": self.worlds.status, "force": np.linalg.norm(self.force(), axis=1)}


def box(low: float, high: float, *shape: int) -> gymnasium.spaces.Box:
    """Numbers between two, in single precision."""
    return gymnasium.spaces.Box(low, high, shape, dtype=np.float32)


def rounded(seen: dict[str, Array]) -> Observation:
    """Observations in single precision."""
    return {key: value.astype(np.float32) for key, value in seen.items()}


class End:
    """The far end of a body along x, in all worlds."""

    def __init__(self, worlds: Worlds, body: str) -> None:
        """Of a body at rest."""
        self.worlds, self.body = worlds, body
        rest = worlds.positions[body][0]
        self.vertices = np.flatnonzero(rest[:, 0] > rest[:, 0].max() - 1e-6)
        self.rest: Array = rest[self.vertices].mean(axis=0)

    def displacement(self) -> Array:
        """From rest [m], shape (n, 3)."""
        moved: Array = self.worlds.positions[self.body][:, self.vertices].mean(axis=1) - self.rest
        return moved


class TissueRetraction(Task):
    """A flap of tissue is held at one end and taken by a soft grip at the other: bring that end to a goal, gently."""

    name = "TissueRetraction"
    actions = 3
    scene = """
title = "Tissue retraction"
time = { frame = "1/120 s", velocity_factor = 0.98 }

[[body]]
name = "flap"
shape = "block"
size = ["50 mm", "30 mm", "10 mm"]
cells = [5, 3, 1]
material = { young = "5 kPa", poisson = 0.45 }

[[fixing]]
name = "root"
body = "flap"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }

[solver]
method = "explicit"
"""

    # Where the goal may be, from where the end is at rest [m].
    LOW = np.array([-0.02, -0.01, 0.0])
    HIGH = np.array([0.005, 0.01, 0.03])
    # The fastest the grip is led, in a frame [m].
    FASTEST = 5e-4

    def spaces(self) -> gymnasium.spaces.Dict:
        """Where the grip is led and how the end is displaced from rest, the goal, the grip's force."""
        way = box(-0.2, 0.2, 3)
        return gymnasium.spaces.Dict(
            {"grip": way, "end": way, "goal": way, "force": box(-100.0, 100.0, 3)}
        )

    def __init__(self, count: int, threads: int | None, max_force: float) -> None:
        """In so many worlds."""
        super().__init__(count, threads, max_force)
        self.end = End(self.worlds, "flap")
        self.grip: Array = np.zeros((count, 3))
        self.goal = np.zeros((count, 3))
        self.hold = -1

    def begin(self, chosen: Truths) -> None:
        """Takes hold, and draws a goal."""
        hold = self.worlds.take_hold(
            "flap",
            point=self.end.rest,
            count=len(self.end.vertices),
            stiffness="100 N/m",
            mask=chosen,
        )
        self.hold = hold
        self.grip[chosen] = 0.0
        self.goal[chosen] = self.draw(chosen, self.LOW, self.HIGH)[chosen]

    def act(self, actions: Array) -> None:
        """Leads the grip."""
        self.grip += self.FASTEST * np.clip(actions, -1.0, 1.0)
        self.grip = np.clip(self.grip, -0.1, 0.1)
        self.worlds.lead(self.hold, self.grip)

    def observe(self) -> Observation:
        """See `spaces`."""
        seen = {
            "grip": self.grip,
            "end": self.end.displacement(),
            "goal": self.goal,
            "force": self.force(),
        }
        return rounded(seen)

    def distance(self) -> Array:
        """From the goal [m]."""
        distance: Array = np.linalg.norm(self.end.displacement() - self.goal, axis=1)
        return distance

    def reward(self) -> Array:
        """Minus the distance in centimetres."""
        return -100.0 * self.distance()

    def force(self) -> Array:
        """Of the grip."""
        return self.worlds.hold_force(self.hold)

    def has_succeeded(self) -> Truths:
        """Within a millimetre of the goal."""
        near: Truths = self.distance() < 1e-3
        return near


class Palpation(Task):
    """A probe glides over tissue in which a stiff lump lies, somewhere: find it by touch."""

    name = "Palpation"
    actions = 3
    scene = """
title = "Palpation"
time = { frame = "1/120 s", velocity_factor = 0.98 }
world = { gravity = 0 }

[[body]]
name = "tissue"
shape = "block"
size = ["60 mm", "60 mm", "20 mm"]
cells = [6, 6, 2]
material = { young = "5 kPa", poisson = 0.45 }
region = [
    { label = 1, sphere = { center = ["15 mm", "15 mm", "12 mm"], radius = "8 mm" }, young = "5 kPa" },
    { label = 2, sphere = { center = ["45 mm", "15 mm", "12 mm"], radius = "8 mm" }, young = "5 kPa" },
    { label = 3, sphere = { center = ["15 mm", "45 mm", "12 mm"], radius = "8 mm" }, young = "5 kPa" },
    { label = 4, sphere = { center = ["45 mm", "45 mm", "12 mm"], radius = "8 mm" }, young = "5 kPa" },
]

[[fixing]]
name = "table"
body = "tissue"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }

[[tool]]
name = "probe"
kind = "probe"
radius = "6 mm"
length = "60 mm"
position = ["30 mm", "30 mm", "27 mm"]
friction = 0.1

[solver]
method = "explicit"
"""

    PLACES = np.array([[0.015, 0.015], [0.045, 0.015], [0.015, 0.045], [0.045, 0.045]])
    START = np.array([0.03, 0.03, 0.027])
    # The fastest the probe is led, in a frame [m].
    FASTEST = np.array([5e-4, 5e-4, 2e-4])
    LOW = np.array([0.006, 0.006, 0.020])
    HIGH = np.array([0.054, 0.054, 0.030])

    def __init__(self, count: int, threads: int | None, max_force: float) -> None:
        """In so many worlds."""
        super().__init__(count, threads, max_force)
        self.probe: Array = np.tile(self.START, (count, 1))
        self.lump = np.zeros(count, dtype=np.int64)
        self.felt: Array = np.zeros((count, 4))

    def spaces(self) -> gymnasium.spaces.Dict:
        """Where the probe is from the middle, the force on it, how stiff it felt where it has been."""
        return gymnasium.spaces.Dict(
            {"probe": box(-0.1, 0.1, 3), "force": box(-100.0, 100.0, 3), "felt": box(0.0, 1e4, 4)}
        )

    def begin(self, chosen: Truths) -> None:
        """Puts the lump somewhere."""
        drawn = self.draw(chosen, np.zeros(1), np.full(1, 4.0))[chosen, 0]
        self.lump[chosen] = np.minimum(drawn.astype(np.int64), 3)
        young = np.where(np.arange(4) == self.lump[:, None], 50e3, 5e3)
        keys = [f"body.tissue.region.{number}.young" for number in range(4)]
        self.worlds.update({key: young[:, number] for number, key in enumerate(keys)}, mask=chosen)
        self.probe[chosen] = self.START
        self.felt[chosen] = 0.0

    def act(self, actions: Array) -> None:
        """Leads the probe."""
        self.probe += self.FASTEST * np.clip(actions, -1.0, 1.0)
        self.probe = np.clip(self.probe, self.LOW, self.HIGH)
        self.worlds.move_tool("probe", self.probe)

    def observe(self) -> Observation:
        """See `spaces`. Stiffness is force over depth [N/m], the largest that was felt near each place."""
        force = self.force()
        depth = np.maximum(0.026 - self.probe[:, 2], 5e-4)
        stiffness = np.maximum(-force[:, 2], 0.0) / depth
        near = np.linalg.norm(self.probe[:, None, :2] - self.PLACES, axis=2) < 0.008
        self.felt = np.where(near, np.maximum(self.felt, stiffness[:, None]), self.felt)
        seen = {
            "probe": self.probe - [0.03, 0.03, 0.02],
            "force": force,
            "felt": np.clip(self.felt, 0.0, 1e4),
        }
        return rounded(seen)

    def reward(self) -> Array:
        """Minus the distance from the lump in centimetres."""
        goal = self.PLACES[self.lump]
        distance: Array = np.linalg.norm(self.probe[:, :2] - goal, axis=1)
        return -100.0 * distance

    def force(self) -> Array:
        """Of the probe."""
        return self.worlds.force("probe")


class GraspAndPull(Task):
    """Jaws stand open over the end of a strip: close them, lock, and pull it up without tearing at it."""

    name = "GraspAndPull"
    actions = 4
    scene = """
title = "Grasp and pull"
time = { frame = "1/120 s", velocity_factor = 0.98 }
world = { gravity = 0 }

[[body]]
name = "strip"
shape = "block"
size = ["60 mm", "12 mm", "6 mm"]
cells = [10, 2, 1]
material = { young = "8 kPa", poisson = 0.45 }

[[fixing]]
name = "root"
body = "strip"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }

[[tool]]
name = "jaws"
kind = "grasper"
jaw_size = ["10 mm", "5 mm", "14 mm"]
jaw_gap = "4 mm"
position = ["78 mm", "6 mm", "3 mm"]
rotation_axis = [0, 1, 0]
rotation_angle = "90 deg"
friction = 0.8
jaw = [{ time = 0, angle = "40 deg" }]

[solver]
method = "explicit"
"""

    START = np.array([0.078, 0.006, 0.003])
    OPEN = np.deg2rad(40.0)
    # The fastest the jaws are led [m] and turned [rad] in a frame.
    FASTEST = 4e-4
    FASTEST_TURN = np.deg2rad(0.8)
    # Below this they lock [rad].
    SHUT = np.deg2rad(6.0)
    # How far the strip's end is to be lifted [m].
    LIFT = 0.015
    max_steps = 150

    def __init__(self, count: int, threads: int | None, max_force: float) -> None:
        """In so many worlds."""
        super().__init__(count, threads, max_force)
        self.end = End(self.worlds, "strip")
        self.jaws: Array = np.tile(self.START, (count, 1))
        self.opening: Array = np.full(count, self.OPEN)

    def spaces(self) -> gymnasium.spaces.Dict:
        """Where the jaws are from where they began, how far open, how the end is displaced, the force on it."""
        way = box(-0.2, 0.2, 3)
        opening = box(0.0, 2.0, 1)
        return gymnasium.spaces.Dict(
            {"jaws": way, "opening": opening, "end": way, "force": box(-100.0, 100.0, 3)}
        )

    def begin(self, chosen: Truths) -> None:
        """Jaws begin a little off."""
        offset = self.draw(chosen, np.array([-0.002, -0.002, 0.0]), np.array([0.002, 0.002, 0.0]))
        self.jaws[chosen] = self.START + offset[chosen]
        self.opening[chosen] = self.OPEN

    def act(self, actions: Array) -> None:
        """Leads the jaws; the last number closes them. Shut they lock, and open again they let go."""
        actions = np.clip(actions, -1.0, 1.0)
        self.jaws += self.FASTEST * actions[:, :3]
        self.jaws = np.clip(self.jaws, self.START - 0.06, self.START + 0.06)
        self.opening = np.clip(self.opening - self.FASTEST_TURN * actions[:, 3], 0.0, self.OPEN)
        self.worlds.move_tool("jaws", self.jaws)
        self.worlds.open_jaws("jaws", self.opening)
        self.worlds.lock_jaws("jaws", self.opening < self.SHUT)

    def observe(self) -> Observation:
        """See `spaces`."""
        seen = {
            "jaws": self.jaws - self.START,
            "opening": self.opening[:, None],
            "end": self.end.displacement(),
            "force": self.force(),
        }
        return rounded(seen)

    def reward(self) -> Array:
        """Minus what is missing of the lift, in centimetres."""
        missing: Array = np.maximum(self.LIFT - self.end.displacement()[:, 2], 0.0)
        return -100.0 * missing

    def force(self) -> Array:
        """Of the jaws."""
        return self.worlds.force("jaws")

    def has_succeeded(self) -> Truths:
        """Lifted."""
        lifted: Truths = self.end.displacement()[:, 2] > self.LIFT
        return lifted


TASKS: dict[str, type[Task]] = {
    task.name: task for task in (TissueRetraction, Palpation, GraspAndPull)
}


def _seeds(seed: int | None, count: int) -> list[int | None] | None:
    """A seed for each world, from one."""
    if seed is None:
        return None
    return [int(state) for state in np.random.SeedSequence(seed).generate_state(count)]


class TissueEnv(gymnasium.Env[Any, Any]):
    """One world of a task."""

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["rgb_array"],
        "render_fps": 30,
    }

    def __init__(
        self, task: str, render_mode: str | None = None, max_force: float = MAX_FORCE
    ) -> None:
        """A task by its name; an episode ends where a force is above `max_force` [N]."""
        self.task = TASKS[task](1, 1, max_force)
        self.render_mode = render_mode
        self.observation_space = self.task.spaces()
        self.action_space = box(-1.0, 1.0, self.task.actions)

    def _observe(self) -> Observation:
        return {key: value[0] for key, value in self.task.observe().items()}

    def _info(self) -> dict[str, Any]:
        return {key: value[0] for key, value in self.task.info().items()}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begins an episode."""
        super().reset(seed=seed)
        self.task.reset(np.ones(1, dtype=bool), _seeds(seed, 1))
        return self._observe(), self._info()

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """One action of four frames."""
        reward, ended, cut = self.task.step(np.asarray(action, dtype=np.float64)[None])
        observation = self._observe()
        return observation, float(reward[0]), bool(ended[0]), bool(cut[0]), self._info()

    def render(self) -> Any:
        """A picture, shape (480, 640, 3)."""
        return self.task.worlds.image(0)


class TissueVectorEnv(gymnasium.vector.VectorEnv[Any, Any, Any]):
    """Many worlds of a task.

    A world that has ended begins anew in the same step; its last observation is in `info`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "autoreset_mode": AutoresetMode.SAME_STEP,
        "render_modes": ["rgb_array"],
        "render_fps": 30,
    }

    def __init__(
        self,
        task: str,
        num_envs: int = 1,
        threads: int | None = None,
        render_mode: str | None = None,
        max_force: float = MAX_FORCE,
    ) -> None:
        """So many worlds, on so many threads (one for each processor where it is not given)."""
        self.task = TASKS[task](num_envs, threads, max_force)
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.single_observation_space = self.task.spaces()
        self.single_action_space = box(-1.0, 1.0, self.task.actions)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begins an episode in all worlds, or in those where `options["reset_mask"]` is true."""
        chosen: Truths = np.ones(self.num_envs, dtype=bool)
        if options is not None and "reset_mask" in options:
            chosen = np.asarray(options["reset_mask"], dtype=bool)
        seeds = seed if isinstance(seed, list) else _seeds(seed, self.num_envs)
        self.task.reset(chosen, seeds)
        return self.task.observe(), self.task.info()

    def step(self, actions: Array) -> tuple[Observation, Array, Array, Array, dict[str, Any]]:
        """One action of four frames in each world."""
        reward, ended, cut = self.task.step(np.asarray(actions, dtype=np.float64))
        observation, info = self.task.observe(), dict[str, Any](self.task.info())
        done = ended | cut
        if done.any():
            info["final_obs"] = {key: value.copy() for key, value in observation.items()}
            info["_final_obs"] = done
            self.task.reset(done)
            observation = self.task.observe()
        return observation, reward, ended, cut, info

    def render(self) -> Any:
        """A picture of each world."""
        return tuple(self.task.worlds.image(number) for number in range(self.num_envs))


for _name in TASKS:
    gymnasium.register(
        id=f"viscera/{_name}-v0",
        entry_point="viscera.gym:TissueEnv",
        vector_entry_point="viscera.gym:TissueVectorEnv",
        kwargs={"task": _name},
    )
