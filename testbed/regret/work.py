"""All drives of a study: make what is missing, on many processes, until it is done or interrupted."""

from pathlib import Path
from time import perf_counter

from testbed.command_line.interruption import interruptible
from testbed.compare.runs.work import Progress, Tally, stage
from testbed.experiments.engine import Engine
from testbed.experiments.rows import is_made
from testbed.files import make_directory
from testbed.regret.curves import SCHEMA
from testbed.regret.drives import FOLDER, drive, drive_path, reads
from testbed.regret.study import Study, check, write_settings


def execute(study: Study, engine: Engine, progress: Progress | None = None) -> Tally:
    """Make all drives that the folder lacks, seed by seed; progress(done, total, what) after each.

    Ctrl-C or SIGTERM ends it when the drives that have begun are finished; the next call makes the rest.

    Raises:
        LookupError, ValueError, OSError: in one sentence, for what cannot be driven, see `study.check` and
            `engine.perform`.
    """
    check(study)
    out = Path(study.out)
    tally, start = Tally(), perf_counter()
    with interruptible() as request:
        write_settings(study)
        make_directory(out / FOLDER)
        missing = [task for task in study.tasks if not is_made(drive_path(task, out), task, SCHEMA)]
        tally.found = len(study.tasks) - len(missing)
        order = {seed: k for k, seed in enumerate(study.seeds)}  # what an interruption leaves are complete pairs
        work = [(task, study.settings, out) for task in sorted(missing, key=lambda task: order[task.seed])]
        for outcome in stage(drive, reads, work, engine, request, "drives", progress):
            tally.add(outcome)
    tally.wall = perf_counter() - start
    tally.exit_status = request.exit_status
    return tally
