"""All logs of a folder as one table: a row a run, with its settings and its summary, by rerun's own catalogue server.

Needs the extra `tables`, which brings the query engine of the server.
"""

from pathlib import Path

import pandas as pd

OURS = ("property:run:", "property:summary:")  # groups of properties that our logs have


def run_table(folder: str | Path) -> pd.DataFrame:
    """Settings and summary of every log (.rrd) in a folder, one row a run; columns of trackers begin with their name.

    Raises:
        ValueError: no log in the folder, or the extra is not installed.
    """
    folder = Path(folder).absolute()
    if not any(folder.glob("*.rrd")):
        raise ValueError(f"folder {folder} holds no .rrd log; `testbed run --out {folder}` writes one")
    try:
        import datafusion  # noqa: F401  (the server fails late and unclearly without it)
        import rerun.server
    except ImportError:
        raise ValueError("the query engine is missing; install it with `pip install -e '.[tables]'`") from None
    with rerun.server.Server(host="127.0.0.1", datasets={"runs": str(folder)}) as server:
        client = server.client()  # must outlive the query
        found = client.get_dataset("runs").segment_table().to_pandas()
    ours = [name for name in found.columns if name.startswith(OURS)]
    table = pd.DataFrame({name.split(":", 2)[2]: found[name].map(_plain) for name in ours})
    return table.set_index(found["rerun_segment_id"].rename("run")).sort_index()


def _plain(cell: object) -> object:
    """The value in a list of one; longer lists, such as that of the trackers, as text."""
    values = [] if cell is None else list(cell) if hasattr(cell, "__iter__") and not isinstance(cell, str) else [cell]
    return values[0] if len(values) == 1 else ", ".join(map(str, values)) if values else None
