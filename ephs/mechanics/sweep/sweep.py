"""`sweep`: one model with many values of some numbers, in parallel."""

import os
import time
import uuid
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.runs.signals import check_mappings, check_options, times_of
from ephs.mechanics.runs.system_problem import system_signals
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.parameters import read
from ephs.mechanics.sweep.axes import MEMBER, Axes
from ephs.mechanics.sweep.job import DONE, Job, MemberBatch
from ephs.mechanics.sweep.outputs import outputs_of
from ephs.semantics.descriptor.descriptor import Input
from ephs.solve.equations.sparse import Index
from ephs.solve.posing.errors import OptionError, count_of, failing_at, number_of
from ephs.solve.posing.sampled import holding

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

    from ephs.semantics.systems.system import System

NOT_RUN = "not run"
"""Status of members not run because of an interruption."""
INSTANTS = 100
"""Default number of recorded intervals."""
BATCHES = 16
"""Batches per worker, for progress and load balancing."""
MOST = 256
"""Members in a batch at most."""
RETRIES = 5
"""Number of retries for members of a lost worker."""
_OPTIONS = ("method", "rtol", "atol", "step", "min_step", "max_step", "max_steps", "form", "inputs", "jumps", "options",
            "reference")  # fmt: skip


class SweepInterrupted(KeyboardInterrupt):
    """A sweep that the user stopped.

    Attributes
    ----------
    partial
        The table of what was run; the status of the others is ``"not run"``.
    """

    def __init__(self, partial: "xr.Dataset") -> None:
        super().__init__("interrupted; the results so far are in .partial")
        self.partial = partial


def sweep(
    model: "System | Scene",
    vary: "Mapping[str, ArrayLike]",
    until: float,
    *,
    t0: float = 0.0,
    save_at: "ArrayLike | None" = None,
    outputs: Sequence[str] | None = None,
    paired: bool = False,
    workers: int | None = None,
    client: Any = None,
    progress: Callable[[int, int, int], None] | None = None,
    **options: Any,
) -> "xr.Dataset":
    """Run a model with many values of its parameters or initial values.

    Members are independent: each equals the run of `ephs.simulate` within rounding, and is the same bit for bit on any
    worker. Members of a scene that differ in numbers only share one set of compiled tables, with explicit methods,
    constant inputs, and these outputs: coordinates and rates of joints at which no loop is cut, heat and work.

    Parameters
    ----------
    vary
        Path -> (n,) values: ``bodies.crank.mass``, ``joints.pin.friction``, ``joints.pin.rate``; of a system
        ``osc.pe.k``, and initial values such as ``osc.pe.q``; see `ephs.mechanics.scene.parameters`.
    until, t0
        End and start in s.
    save_at
        (k,) instants to keep, in s; by default 101 equidistant ones.
    outputs
        Names of outputs: ``joints.pin.coordinate``, ``bodies.crank.position``, ``thermal.housing.temperature``,
        ``energy``, the path of a state. By default coordinates and rates of all joints, heat and work; for a system
        all states.
    paired
        Member k takes the k-th value of every path. By default all combinations of the values are run.
    workers
        Number of threads; by default the number of cores.
    client
        A ``dask.distributed.Client`` to use instead; members of a lost worker are run by other workers.
    progress
        Called as progress(done, members, failed) after every batch.
    options
        Options of `ephs.simulate`: method, rtol, atol, step, form, inputs, …

    Returns
    -------
    xarray.Dataset
        Each output over the varied paths (or ``member``), ``t``, and its own components. Varied initial coordinates
        and rates of joints are called ``initial.joints.…``, as are other paths that are outputs. ``status`` is
        ``"done"`` or the reason of a failure, with NaN as outputs; ``steps`` and ``rejected`` are counts.

    Raises
    ------
    OptionError
        An option is unknown or not possible.
    SceneError, AssemblyError
        A path does not exist.
    SweepInterrupted
        The sweep was stopped; ``.partial`` is the table of the members that were run.
    """
    axes = Axes.of(vary, paired=paired)
    check_options(options, _OPTIONS)
    if client is not None and not callable(getattr(client, "submit", None)):
        raise OptionError("client", client, "a dask.distributed.Client")
    if progress is not None and not callable(progress):
        raise OptionError("progress", progress, "a function of (done, members, failed)")
    for path in axes.paths:
        read(model, path)
    threads = (os.cpu_count() or 1) if workers is None else count_of("workers", workers)
    start, end = number_of("t0", t0), number_of("until", until)
    if not (np.isfinite(end - start) and end != start):
        raise OptionError("until", until, f"a finite time other than t0 = {start:g} s")
    if save_at is None:
        save_at = start + (end - start) * np.arange(INSTANTS + 1) / INSTANTS
    times = times_of(save_at, start, end)
    if times is None or not times.size:
        raise OptionError("save_at", save_at, "at least one time in s")
    _check_inputs(model, options.get("inputs"), start, end)
    kept = outputs_of(model, outputs)
    job = Job(Job.document(model), axes, start, end, times, dict(options), kept, uuid.uuid4().hex, _own(model))
    count = len(axes.members)
    batches: list[MemberBatch] = []
    begin = time.perf_counter()
    run = _on_threads(job, count, threads) if client is None else _on_cluster(job, count, client)
    try:
        for batch in run:
            batches.append(batch)
            if progress is not None:
                failed = sum(text != DONE for found in batches for text in found.status)
                progress(sum(len(found.numbers) for found in batches), count, failed)
    except KeyboardInterrupt:
        raise SweepInterrupted(_table(job, batches, model, time.perf_counter() - begin)) from None
    finally:
        run.close()
    return _table(job, batches, model, time.perf_counter() - begin)


def _check_inputs(model: "System | Scene", inputs: Any, t0: float, until: float) -> None:
    """Refuse inputs that no member has, before the first one is run.

    Raises
    ------
    AssemblyError, OptionError
        An input has no port, a port no input, or one is no number.
    SimulationError
        A function of time has no value at the start.
    """
    check_mappings(inputs=inputs)
    given, _ = holding(inputs or {}, t0, until)
    if isinstance(model, Scene):
        problem = problem_of_scene(model, None, given)
        descriptor, signals = problem.descriptor, problem.signals
    else:
        descriptor, signals = model.descriptor(), system_signals(model, given)
    sizes = {slot.path: slot.quantity.space.dim for slot in descriptor.outer}
    with failing_at(t0):
        values = {
            path: Input(one.at(t0, {}) if one.constant or one.timed else np.zeros(sizes.get(path, 0)), one.effort)
            for path, one in signals.items()
        }
    descriptor.complete_inputs(values)


def _parts(count: int, workers: int) -> list[Index]:
    size = max(1, min(MOST, -(-count // (BATCHES * workers))))
    return [np.arange(at, min(at + size, count)) for at in range(0, count, size)]


def _on_threads(job: Job, count: int, threads: int) -> Generator[MemberBatch, None, None]:
    job.prepare()
    with ThreadPoolExecutor(threads) as pool:
        waiting: set[Future[MemberBatch]] = {pool.submit(job.run, part) for part in _parts(count, threads)}
        try:
            while waiting:
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in done)
        finally:
            for future in waiting:
                future.cancel()


def _on_cluster(job: Job, count: int, client: Any) -> Generator[MemberBatch, None, None]:
    """Run on a Dask cluster, which reassigns the batches of a lost worker.

    Where what all batches share is lost with it, and results that nobody had fetched, these are asked for again.
    """
    from distributed import as_completed

    missing = dict(enumerate(_parts(count, max(1, sum(client.nthreads().values())))))
    for attempt in range(RETRIES + 1):
        shared = client.scatter(job, broadcast=True)
        places = {
            client.submit(_batch, shared, part, pure=False, retries=RETRIES): place for place, part in missing.items()
        }
        try:
            for future in as_completed(places):
                try:
                    batch = future.result()
                except CancelledError:
                    if attempt == RETRIES:
                        raise
                    continue
                del missing[places[future]]
                yield batch
        finally:
            client.cancel([future for future in places if not future.done()])
        if not missing:
            return


def _batch(job: Job, numbers: Index) -> MemberBatch:
    return job.run(numbers)


def _table(job: Job, batches: Sequence[MemberBatch], model: "System | Scene", seconds: float) -> "xr.Dataset":
    """All batches as one dataset."""
    import xarray as xr

    axes, count, instants = job.axes, len(job.axes.members), job.save_at.size
    status = np.full(count, NOT_RUN, dtype=object)
    steps, rejected = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    for batch in batches:
        status[batch.numbers] = batch.status
        steps[batch.numbers], rejected[batch.numbers] = batch.steps, batch.rejected
    variables: dict[str, Any] = {}
    places: dict[str, Any] = {}
    names = axes.names([output.name for output in job.outputs])
    members = (MEMBER,) if axes.paired else names
    for i, output in enumerate(job.outputs):
        found = [(batch.numbers, batch.values[i]) for batch in batches if batch.values]
        width = len(output.labels.units)
        whole = np.full((count, instants, width), np.nan)
        for numbers, values in found:
            whole[numbers] = values
        dims = (*members, "t")
        whole = whole.reshape(*axes.shape, instants, width)
        attributes = {"units": output.labels.unit}
        if width == 1:
            variables[output.name] = (dims, whole[..., 0], attributes)
            continue
        variables[output.name] = ((*dims, output.labels.dimension), whole, attributes)
        places[output.labels.dimension] = list(output.labels.names)
    for name, values in (("status", status.astype(str)), ("steps", steps), ("rejected", rejected)):
        variables[name] = (members, values.reshape(axes.shape))
    coordinates = {
        name: (members if axes.paired else (name,), values) for name, values in zip(names, axes.values, strict=True)
    }
    times = ("t", job.save_at, {"units": "s"})
    attributes = {
        "model": getattr(model, "name", "system"), "members": count, "failed": int(np.sum(status != DONE)),
        "seconds": seconds, "t0": job.t0, "until": job.until,
    }  # fmt: skip
    return xr.Dataset(variables, {**coordinates, "t": times, **places}, attributes)


def _own(model: "System | Scene") -> tuple[type[Any], ...]:
    """Classes of a scene's elements of registered sections."""
    return tuple({type(each): None for _, _, each in model.all_elements()}) if isinstance(model, Scene) else ()
