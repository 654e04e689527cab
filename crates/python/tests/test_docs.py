"""Examples and the Python code in the documentation do what they say."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent
ROOT = PACKAGE.parent.parent


def snippets(page: Path) -> list[str]:
    """Blocks of Python code of a page."""
    return re.findall(r"^```python\n(.*?)^```", page.read_text(), flags=re.M | re.S)


def run(code: str, folder: Path) -> str:
    """Runs code in a folder of its own; what it prints."""
    environment = {**os.environ, "PYTHONWARNINGS": "error"}
    command = [sys.executable, "-c", code]
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=folder, env=environment, check=False
    )
    assert done.returncode == 0, code + done.stderr
    return done.stdout


@pytest.mark.parametrize("example", sorted(path.name for path in (PACKAGE / "examples").iterdir()))
def test_examples_run(example: str, tmp_path: Path) -> None:
    if example == "mujoco_arm.py":
        pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    assert run((PACKAGE / "examples" / example).read_text(), tmp_path)


PAGES = ["README.md", "crates/python/README.md"]
PAGES += [f"docs/{name}.md" for name in ("python", "robots", "learning", "measuring")]


@pytest.mark.parametrize("page", PAGES)
def test_code_in_the_documentation_runs(page: str, tmp_path: Path) -> None:
    blocks = snippets(ROOT / page)
    assert blocks
    # Each page is read from its top: later blocks use what earlier ones made.
    run("\n".join(blocks), tmp_path)


def test_an_arm_and_tissue_push_alike(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    said = run((PACKAGE / "examples" / "mujoco_arm.py").read_text(), tmp_path)
    arm, tissue, short = (float(number) for number in re.findall(r"(\d+\.\d+) (?:N|mm)", said))
    # To the digits that it prints; and the arm's own spring of 400 N/m.
    assert arm == pytest.approx(tissue, abs=1.5e-3)
    assert tissue > 0.1
    assert short == pytest.approx(1e3 * arm / 400.0, abs=0.01)


def test_the_force_controller_reaches_its_force(tmp_path: Path) -> None:
    said = run((PACKAGE / "examples" / "robot.py").read_text(), tmp_path)
    (force,) = re.findall(r"presses with ([\d.]+) N", said)
    assert float(force) == pytest.approx(1.0, abs=0.02)


def test_the_notebook_runs_and_finds_the_stiffness(tmp_path: Path) -> None:
    notebook = json.loads((ROOT / "docs" / "identify.ipynb").read_text())
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    said = run("\n".join("".join(cell["source"]) for cell in cells), tmp_path)
    (value, low, high) = re.findall(r"young = (\d+\S*), 95 % between (\S+) and (\S+)", said)[0]
    assert float(low) < float(value) < float(high)
    assert float(low) < 5100.0 < float(high)
    # What it shows is what it says.
    shown = [part["text"] for cell in cells for part in cell["outputs"] if "text" in part]
    assert next(line for text in shown for line in text if "young" in line) in said
