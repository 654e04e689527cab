"""Types: of the package, of its stubs beside what they describe, of these tests, of examples, benches and trainings."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent


def check(*words: str) -> None:
    """Runs a module of Python, which must be content."""
    command = [sys.executable, "-m", *words]
    done = subprocess.run(command, capture_output=True, text=True, cwd=HERE.parent, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_types_of_the_package_its_tests_and_examples() -> None:
    check("mypy", "--strict", "--cache-dir", "/dev/null", "-p", "viscera")
    check(
        "mypy", "--strict", "--cache-dir", "/dev/null", "tests", "examples", "benches", "training"
    )


def test_stubs_say_what_is_there() -> None:
    check("mypy.stubtest", "viscera._viscera")


def test_style() -> None:
    check("ruff", "check", "--no-cache", ".")
    check("ruff", "format", "--check", "--no-cache", ".")
