"""Batches of many courses: which jobs there are, who runs them, what is done already, and what came of it.

    sources -> planning -> jobs -> supervision -> a pool (local.py, cluster.py)
                  ^                    |
                  +------ records <----+----> reports

A `Job` is plain data and complete in itself: it can travel. `supervision.py` decides what runs, runs again or is
reused, and writes the records; it knows nothing of processes. A `JobPool` runs jobs, somewhere; it knows nothing of
records.
"""

import contextlib
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from airrace.errors import InputError, UsageError
from airrace.options import Option

if TYPE_CHECKING:
    from airrace.runs.batch.planning import BatchPlan, Sources
    from airrace.runs.batch.reports import BatchResult
    from airrace.runs.batch.supervision import JobPool

Sweeps = Mapping[str, str | Sequence[str | float]] | Sequence[str]
"""The values of keys: `{"rules.n_z_max": [9, 10]}`, `{"rules.n_z_max": "9:12:1"}` or `["rules.n_z_max=9:12:1"]`."""


def sweep_texts(sweep: Sweeps) -> list[str]:
    """Return sweeps as `key=values` texts, as `--sweep` takes them."""
    if not isinstance(sweep, Mapping):
        return [sweep] if isinstance(sweep, str) else list(sweep)
    texts: list[str] = []
    for key, values in sweep.items():
        texts.append(f"{key}={values if isinstance(values, str) else ','.join(map(str, values))}")
    return texts


@dataclass(frozen=True, kw_only=True)
class BatchOptions:
    """The options of the command `batch`, by its words; `optimize_many` says what they mean.

    `set` and `sweep` are `key=value` and `key=values` texts.
    """

    courses: Annotated[
        Sequence[str],
        Option("Track files, patterns such as 'tracks/*.yaml', names, or a batch.yaml.", "COURSES..."),
    ] = field(kw_only=False)
    aircraft: Annotated[
        Sequence[Path], Option("Fly every course with this aircraft; as often as you like.", "FILE")
    ] = ()
    settings: Annotated[Path | None, Option("Settings other than the defaults.", "FILE")] = None
    set: Annotated[
        Sequence[str],
        Option("Change one value, e.g. rules.n_z_max=9; as often as you like.", "KEY=VALUE"),
    ] = ()
    sweep: Annotated[
        Sequence[str],
        Option(
            "Fly every value of a key of --set: a list (0,5,10) or a range (first:last:step); several multiply.",
            "KEY=VALUES",
        ),
    ] = ()
    until: Annotated[
        str | None,
        Option("Last stage to run; by default the last available one.", "STAGE", completion="stages"),
    ] = None
    jobs: Annotated[
        int | None,
        Option("Jobs at a time; by default all cores, or threads of workers.", "N", min=1),
    ] = None
    output: Annotated[Path, Option("Where checkpoints and records lie.", "DIR", flags=("--output", "-o"))] = Path(
        "batch"
    )
    cluster: Annotated[str | None, Option("Fly on a dask.distributed cluster (tcp://scheduler:8786).", "ADDRESS")] = (
        None
    )
    timeout: Annotated[float | None, Option("Stop a job that takes longer.", "SECONDS", min=0.1)] = None
    retries: Annotated[int, Option("How often a job whose process crashed is tried again.", "N", min=0)] = 1
    retry_failed: Annotated[bool, Option("Fly jobs again that ended without a certified flight.")] = False
    force: Annotated[bool, Option("Fly all jobs again, from their start.", flags=("--force", "-f"))] = False

    def sources(self) -> "Sources":
        """Return the courses that are meant.

        Raises:
            InputError: a sweep is not valid.
            UsageError: there is no such stage, or no time for a job.
        """
        from airrace.runs.execute import ensure_time

        ensure_time(self.timeout)
        from airrace.runs.batch.planning import JobTemplate, find_sources, parse_sweeps
        from airrace.runs.execution_plan import stage_by_name

        template = JobTemplate(
            tuple(self.aircraft), self.settings, tuple(self.set), parse_sweeps(self.sweep), self.until
        )
        sources = find_sources(self.courses, template)
        for group in sources.groups:
            stage_by_name(group.template.until)
        return sources

    def plan(self, sources: "Sources") -> "BatchPlan":
        """Return the plan of the batch; see `planning.make_plan`."""
        from airrace.runs.batch.planning import make_plan
        from airrace.runs.batch.record import Repeat
        from airrace.runs.execution_plan import stage_by_name
        from airrace.runs.stored_inputs import library_versions

        repeat = Repeat.FAILED if self.retry_failed else Repeat.NONE
        if self.force:
            repeat = Repeat.ALL
        versions = ", ".join(f"{name} {number}" for name, number in library_versions().items())
        return make_plan(sources, self.output, until=stage_by_name(None).value, versions=versions, repeat=repeat)

    def pool(self) -> "JobPool":
        """Return what runs the jobs; a cluster is given as long to have a worker as a job has to end.

        Raises:
            UsageError: dask.distributed is not installed.
        """
        from airrace.runs.batch.local import JOB_COMMAND, LocalPool
        from airrace.runs.stored_inputs import library_versions
        from airrace.runtime.process import available_cores

        if self.cluster is None:
            return LocalPool(JOB_COMMAND, self.jobs or available_cores())
        try:
            from airrace.runs.batch.cluster import ClusterPool
        except ModuleNotFoundError as error:
            raise UsageError("--cluster needs dask.distributed: pip install 'airrace[cluster]'") from error
        return ClusterPool(self.cluster, JOB_COMMAND[1:], library_versions(), self.jobs, self.timeout)

    def checked_plan(self) -> "BatchPlan":
        """Return the plan, and refuse what `prepared` would refuse, but a cluster that does not answer.

        Raises:
            InputError, UsageError, StorageError: no job could run.
        """
        from airrace.runs.batch.record import ensure_folder

        sources = self.sources()
        self.pool()
        ensure_folder(self.output)
        return self.plan(sources)

    @contextlib.contextmanager
    def prepared(self) -> "Generator[tuple[BatchPlan, JobPool], None, None]":
        """Provide the plan of the batch and what runs its jobs, with the folder locked.

        Raises:
            InputError, UsageError, ClusterError, StorageError: no job can run.
        """
        from airrace.runs.batch.record import lock_folder

        sources = self.sources()
        with self.pool() as pool, lock_folder(self.output):
            yield self.plan(sources), pool


def optimize_many(
    tracks: str | Path | Sequence[str | Path],
    *,
    aircraft: str | Path | Sequence[str | Path] = (),
    winds: Mapping[str, str | Sequence[str | float]] | None = None,
    sweep: Sweeps = (),
    set: Mapping[str, str | int | float | bool] | Sequence[str] = (),
    settings: str | Path | None = None,
    until: str | None = None,
    jobs: int | None = None,
    output: str | Path = "batch",
    cluster: str | None = None,
    timeout: float | None = None,
    retries: int = 1,
    retry_failed: bool = False,
    force: bool = False,
) -> "list[BatchResult]":
    """Fly many courses, each with every aircraft, in every wind and with all swept values, as `airrace batch` does.

    Every combination is a job with a checkpoint of its own. A second call flies only what is not finished, or has
    changed.

    Examples:
        >>> winds = {"speed_kt": [10], "from_deg": [90, 270]}
        >>> results = airrace.optimize_many("half_cuban_eight", winds=winds, until="homotopy")
        >>> sorted(result.swept["environment.wind.from_deg"] for result in results)
        ['270', '90']
        >>> airrace.open(results[0].checkpoint)["homotopy"].name
        'homotopy'

    Args:
        tracks: track files, patterns, names of shipped courses, or batch files.
        aircraft: files or names; empty for what the tracks name.
        winds: values of `speed_kt`, `speed_m_s` and `from_deg`: a list, or a range `first:last:step`.
        sweep: values of any other keys, see `Sweeps`.
        set: single values for all jobs, see `optimize`.
        settings: a settings file; None for the defaults.
        until: the last stage, e.g. `point-mass`; None for the last one, `six-dof`.
        jobs: jobs at a time; None for all cores, or all threads of the cluster's workers.
        output: the folder of checkpoints and records.
        cluster: the address of a scheduler of dask.distributed; None for this computer.
        timeout: the longest wall time of a job, s; None for none.
        retries: how often a job is tried again whose process crashed.
        retry_failed: whether jobs are repeated that ended without a certified flight.
        force: whether all jobs are repeated from their start.

    Returns:
        One result per job, course by course, the fastest first. A job that fails is a result, too: its `state` and
        `message` say how it ended.

    Raises:
        InputError: a pattern, a batch file or a sweep is not valid.
        UsageError: no such stage, two jobs of one name, or a folder that another batch works in.
        ClusterError: the scheduler cannot be reached.
        StorageError: the system refused to write.
    """
    from airrace.runs.batch.reports import ranking_of
    from airrace.runs.batch.supervision import Watcher, supervise
    from airrace.runs.execution_plan import value_texts

    wind = {f"environment.wind.{key}": values for key, values in (winds or {}).items()}
    options = BatchOptions(
        courses=[str(track) for track in ([tracks] if isinstance(tracks, str | Path) else tracks)],
        aircraft=[Path(name) for name in ([aircraft] if isinstance(aircraft, str | Path) else aircraft)],
        settings=None if settings is None else Path(settings),
        set=value_texts(set),
        sweep=[*sweep_texts(wind), *sweep_texts(sweep)],
        until=until,
        jobs=jobs,
        output=Path(output),
        cluster=cluster,
        timeout=timeout,
        retries=retries,
        retry_failed=retry_failed,
        force=force,
    )
    with options.prepared() as (plan, pool):
        if plan.findings:
            raise InputError(list(plan.findings))
        return ranking_of(plan, supervise(plan, pool, options, Watcher()))
