"""What several tests need."""

from __future__ import annotations

import pytest
import viscera as vi

# A small block on a table, with a ball that comes down on it and jaws beside it.
BLOCK = """
title = "Block"
time = { duration = "0.5 s", velocity_factor = 0.9 }

[[body]]
name = "block"
shape = "block"
size = ["30 mm", "30 mm", "15 mm"]
cells = [4, 4, 2]
material = { young = "10 kPa", poisson = 0.4 }

[[fixing]]
name = "table"
body = "block"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }
"""

BALL = """
[[tool]]
name = "ball"
kind = "sphere"
radius = "6 mm"
position = ["15 mm", "15 mm", "22 mm"]
keys = [{ time = "0.2 s", translation = [0, 0, "-4 mm"] }]
"""

# As it is taken from a tray.
PROBE = """
[[tool]]
name = "probe"
kind = "probe"
radius = "4 mm"
length = "60 mm"
position = ["15 mm", "15 mm", "21 mm"]
"""

GRASPER = """
[[tool]]
name = "grasper"
kind = "grasper"
jaw_size = ["8 mm", "4 mm", "14 mm"]
jaw_gap = "2 mm"
position = ["80 mm", 0, "40 mm"]
jaw = [{ time = 0, angle = "50 deg" }]
"""


@pytest.fixture
def block() -> vi.Scene:
    """A block on a table."""
    return vi.Scene.parse(BLOCK, name="block.toml", settings={"solver.threads": 1})


@pytest.fixture
def pressed() -> vi.Scene:
    """A block on a table, and a ball that is pressed into it."""
    return vi.Scene.parse(BLOCK + BALL, name="pressed.toml", settings={"solver.threads": 1})
