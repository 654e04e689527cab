"""Many trials of one scene with other settings: on threads, processes, or a cluster by Ray.

>>> import viscera as vi
>>> from viscera.sweep import grid, run
>>> trials = grid({"body.bar.material.young": [4e3, 8e3], "solver.substeps": [2, 4]})
>>> rows = run(vi.Scene.builtin("stretch"), trials, frames=2, measure=lambda s: {"time": s.time})
>>> len(rows)
4

A trial is a pure function of its settings: the same row on any machine, in any order, by any engine. A trial that
fails is a row with its reason in "error". With `resume` rows are kept in a file as they come, and a sweep that was
stopped goes on where it was: each row is known by a digest of everything that it depends on.
"""

from __future__ import annotations

import hashlib
import inspect
import itertools
import json
import os
import pickle
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent import futures
from pathlib import Path
from typing import Any, Literal, overload

import numpy as np

from ._errors import Error
from ._types import Path as PathLike
from ._viscera import Scene, Simulation, version

Trial = Mapping[str, Any]
Row = dict[str, Any]
Measure = Callable[[Simulation], Mapping[str, Any]]
Engine = Literal["threads", "processes", "ray"]

# What a row has beside settings and what was measured.
OWN = ("digest", "version", "bits", "error")


def grid(axes: Mapping[str, Iterable[Any]]) -> list[dict[str, Any]]:
    """All combinations of the values of some keys, the last key fastest."""
    values = [list(axis) for axis in axes.values()]
    return [dict(zip(axes, chosen, strict=True)) for chosen in itertools.product(*values)]


class Rows(Sequence[Row]):
    """The rows of a sweep, in the order of its trials."""

    def __init__(self, rows: Iterable[Row]) -> None:
        """Of dictionaries."""
        self._rows = list(rows)

    @overload
    def __getitem__(self, index: int) -> Row: ...
    @overload
    def __getitem__(self, index: slice) -> list[Row]: ...
    def __getitem__(self, index: int | slice) -> Row | list[Row]:
        """A row, or some."""
        return self._rows[index]

    def __len__(self) -> int:
        """How many there are."""
        return len(self._rows)

    @property
    def failed(self) -> list[Row]:
        """Rows of trials that failed."""
        return [row for row in self._rows if row["error"] is not None]

    def column(self, key: str) -> Any:
        """What all rows have at a key, as an array; None where a row has nothing there."""
        if not any(key in row for row in self._rows):
            known = sorted({key for row in self._rows for key in row})
            raise KeyError(f"no row has `{key}`; there are: {', '.join(known)}")
        return np.array([row.get(key) for row in self._rows])

    def columns(self) -> dict[str, list[Any]]:
        """All keys with what the rows have there."""
        keys = dict.fromkeys(key for row in self._rows for key in row)
        return {key: [row.get(key) for row in self._rows] for key in keys}

    def to_parquet(self, path: PathLike) -> None:
        """Writes a table that pandas, polars and DuckDB read. Needs the optional extra ``viscera[sweep]``."""
        try:
            import pyarrow  # type: ignore[import-not-found, import-untyped, unused-ignore]
            import pyarrow.parquet  # type: ignore[import-not-found, import-untyped, unused-ignore]
        except ImportError:
            raise ImportError("to_parquet needs PyArrow: pip install 'viscera[sweep]'") from None
        aside = Path(f"{os.fspath(path)}.part")
        aside.parent.mkdir(parents=True, exist_ok=True)
        columns = {}
        for key, values in self.columns().items():
            try:
                columns[key] = pyarrow.array(values)
            except pyarrow.ArrowException:
                # Values of several kinds, such as 5000 and "6 kPa": a column has one.
                columns[key] = pyarrow.array([v if v is None else str(v) for v in values])
        pyarrow.parquet.write_table(pyarrow.table(columns), aside)
        os.replace(aside, path)

    def __repr__(self) -> str:
        """How many, and how many failed."""
        return f"<viscera.sweep.Rows: {len(self)} rows, {len(self.failed)} failed>"


def run(
    scene: Scene,
    trials: Iterable[Trial],
    measure: Measure,
    *,
    frames: int | None = None,
    on: Engine = "threads",
    workers: int | None = None,
    resume: PathLike | None = None,
    progress: bool | Callable[[int, int], None] = False,
) -> Rows:
    """Runs a scene once for each trial and measures the end.

    `trials` are dictionaries of settings over those of the scene. Each is computed by one thread for `frames` frames
    (the scene's own number where it is not given); `measure` gets the simulation and returns what is to be known of it:
    numbers, texts, lists, arrays. `on` is "threads", "processes" or "ray"; for processes `measure` must be a function
    of a module, for Ray any function. `workers` are as many as there are processors where they are not given.

    `resume` names a file in which rows are kept as they come. `progress=True` prints how far it is; a function gets how
    many are done, and of how many.
    """
    if frames is not None and frames < 1:
        raise ValueError(f"frames must be 1 at least, not {frames}")
    if workers is not None and workers < 1:
        raise ValueError(f"workers must be 1 at least, not {workers}")
    given = [dict(trial) for trial in trials]
    frames = scene.frame_count if frames is None else frames
    jobs = [_Job(scene, trial, measure, frames) for trial in given]
    kept = _Kept(resume)
    rows: list[Row | None] = [kept.find(job.digest) for job in jobs]
    left = [number for number, row in enumerate(rows) if row is None]
    told = _teller(progress)
    done = len(jobs) - len(left)
    told(done, len(jobs))
    engine = {"threads": _on_threads, "processes": _on_processes, "ray": _on_ray}.get(on)
    if engine is None:
        raise ValueError(f'on="{on}": there are "threads", "processes" and "ray"')
    for number, row in engine([jobs[number] for number in left], workers or _processors()):
        rows[left[number]] = row
        kept.keep(row)
        done += 1
        told(done, len(jobs))
    return Rows(row for row in rows if row is not None)


class _Job:
    """One trial, which can be sent to another process."""

    def __init__(self, scene: Scene, trial: Trial, measure: Measure, frames: int) -> None:
        self.scene, self.trial, self.measure, self.frames = scene, trial, measure, frames
        settings = {key: _plain(value) for key, value in trial.items()}
        content = [version(), pickle.dumps(scene).hex(), settings, frames, _source(measure)]
        text = json.dumps(content, sort_keys=True)
        self.digest = hashlib.sha256(text.encode()).hexdigest()
        self.settings = settings

    def __call__(self) -> Row:
        """The trial's row."""
        row: Row = dict(self.settings)
        row.update(digest=self.digest, version=version(), bits=None, error=None)
        try:
            scene = self.scene.copy()
            scene.update({**self.trial, "solver.threads": 1})
            simulation = Simulation(scene)
            simulation.advance(self.frames)
            measured = {key: _plain(value) for key, value in self.measure(simulation).items()}
            taken = sorted(set(measured) & ({*self.settings, *OWN}))
            if taken:
                raise ValueError(f"measure returns `{taken[0]}`, which a row has already")
            row["bits"] = simulation.digest()
            row.update(measured)
        except Error as failure:
            row["error"] = str(failure)
        except Exception as failure:
            # Of the caller's own function: a row as well, so that one trial does not end a night's sweep.
            row["error"] = f"{type(failure).__name__}: {failure}"
        return row


def _plain(value: Any) -> Any:
    """As a table or a file has it."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return value


def _source(measure: Measure) -> str:
    """What a function does, as far as that can be told: another function is another sweep."""
    try:
        return inspect.getsource(measure)
    except (OSError, TypeError):
        code = getattr(measure, "__code__", None)
        return repr(measure) if code is None else code.co_code.hex() + repr(code.co_consts)


class _Kept:
    """Rows in a file, a line of JSON each; a line that was cut off is left out."""

    def __init__(self, path: PathLike | None) -> None:
        self.path = None if path is None else Path(path)
        self.rows: dict[str, Row] = {}
        self.lock = threading.Lock()
        if self.path is None:
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        whole = []
        if self.path.exists():
            for line in self.path.read_text().splitlines():
                try:
                    row = json.loads(line)
                    self.rows[row["digest"]] = row
                    whole.append(line + "\n")
                except (ValueError, KeyError, TypeError):
                    continue
        aside = self.path.with_name(self.path.name + ".part")
        aside.write_text("".join(whole))
        os.replace(aside, self.path)

    def find(self, digest: str) -> Row | None:
        return self.rows.get(digest)

    def keep(self, row: Row) -> None:
        if self.path is None:
            return
        # NaN is no JSON, but Python reads what it writes.
        line = json.dumps(row)
        with self.lock, self.path.open("a") as file:
            file.write(line + "\n")
            file.flush()


def _teller(progress: bool | Callable[[int, int], None]) -> Callable[[int, int], None]:
    """What tells of progress."""
    if callable(progress):
        return progress
    if not progress:
        return lambda done, count: None

    def tell(done: int, count: int) -> None:
        end = "\n" if done == count else ""
        print(f"\r{done} of {count} trials", end=end, file=sys.stderr, flush=True)

    return tell


def _processors() -> int:
    """Those that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _gather(pool: futures.Executor, jobs: list[_Job]) -> Iterator[tuple[int, Row]]:
    """Rows as they come; what has not begun is given up where nobody waits any more."""
    running = {pool.submit(job): number for number, job in enumerate(jobs)}
    try:
        for ended in futures.as_completed(running):
            yield running[ended], ended.result()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise


def _on_threads(jobs: list[_Job], workers: int) -> Iterator[tuple[int, Row]]:
    with futures.ThreadPoolExecutor(workers) as pool:
        yield from _gather(pool, jobs)


def _on_processes(jobs: list[_Job], workers: int) -> Iterator[tuple[int, Row]]:
    """Each process begins anew: threads do not come along in a fork.

    One that dies takes the trials that were under way with it; they are tried once more, alone, and then are rows with
    that as their reason.
    """
    import multiprocessing

    left = dict(enumerate(jobs))
    for is_last in (False, True):
        if not left:
            return
        # Alone the second time, so that only the trial that kills its process is to blame.
        context = multiprocessing.get_context("spawn")
        groups = [[number] for number in left] if is_last else [list(left)]
        for group in groups:
            with futures.ProcessPoolExecutor(1 if is_last else workers, context) as pool:
                running = {pool.submit(left[number]): number for number in group}
                for ended in futures.as_completed(running):
                    number = running[ended]
                    try:
                        row = ended.result()
                    except futures.process.BrokenProcessPool:
                        if not is_last:
                            continue
                        row = _lost(left[number], "its process died")
                    del left[number]
                    yield number, row


def _lost(job: _Job, reason: str) -> Row:
    """The row of a trial that nothing came back of."""
    return {
        **job.settings,
        "digest": job.digest,
        "version": version(),
        "bits": None,
        "error": reason,
    }


def _on_ray(jobs: list[_Job], workers: int) -> Iterator[tuple[int, Row]]:
    """On the cluster that Ray is connected to, or on this machine.

    A worker that dies is replaced, and its trial done again.
    """
    try:
        import ray  # type: ignore[import-not-found, import-untyped, unused-ignore]
    except ImportError:
        raise ImportError("on='ray' needs Ray: pip install 'viscera[ray]'") from None
    if not ray.is_initialized():
        ray.init(num_cpus=workers, log_to_driver=False)
    do: Any = ray.remote(num_cpus=1, max_retries=3)(lambda job: job())
    running = {do.remote(job): number for number, job in enumerate(jobs)}
    waiting = list(running)
    while waiting:
        ended, waiting = ray.wait(waiting)
        for reference in ended:
            number = running[reference]
            try:
                row = ray.get(reference)
            except ray.exceptions.RayError as failure:
                row = _lost(jobs[number], f"{type(failure).__name__}: its worker was lost")
            yield number, row
