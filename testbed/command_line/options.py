"""Arguments and options that several commands have, each under one name with one meaning."""

from pathlib import Path
from typing import Annotated

import typer

from trackers import DEFAULT

Scenario = Annotated[str, typer.Argument(help="A name of `testbed list scenarios`.")]
Trackers = Annotated[
    list[str] | None, typer.Option(help=f"Repeat for several; a planner uses the first. Without it: {DEFAULT}.")
]
EveryTracker = Annotated[list[str] | None, typer.Option(help="Repeat for several. Without it: all.")]
Radar = Annotated[str, typer.Option(help="A name of `testbed list radars`, or a file, see `testbed radar`.")]
Planner = Annotated[str, typer.Option(help="A name of `testbed list planners`.")]
Faults = Annotated[
    list[str] | None, typer.Option(help="All runs also with this fault of the radar; repeat for several, one by one.")
]
Seed = Annotated[int, typer.Option(help="Of all that is drawn at random; the same seed gives the same result.")]
Seeds = Annotated[str, typer.Option(help="0:20 for 0 to 19, a list 0,3,7, or one number.")]
Duration = Annotated[float | None, typer.Option(help="Seconds. Without it: the scenario's own.")]
After = Annotated[float | None, typer.Option(help="End a run so many seconds after the maneuver, or at its duration.")]
Drivers = Annotated[str, typer.Option(help="Of traffic: default, recorded, aggressive, calm, or a TOML file.")]
Fixes = Annotated[
    list[str] | None,
    typer.Option(help="Of a recording: COLUMN=HOW as it is to be read, such as range_rate=km/h. Repeat for several."),
]
Accept = Annotated[bool, typer.Option("--accept-implausible", help="Take what cannot be right too.")]
Columns = Annotated[
    str | None, typer.Option(help="Of tracks that are called otherwise: id=track_no,x=pos_x; or a TOML file of these.")
]
Tolerance = Annotated[float, typer.Option(help="Seconds from a scan within which a row of tracks is of it.")]
Interpolate = Annotated[
    bool, typer.Option("--interpolate", help="Tracks at scans between two of their rows, up to 0.5 s apart.")
]
Format = Annotated[str, typer.Option(help="Of the tables: parquet or csv.")]
Log = Annotated[str, typer.Option(help="What goes into the log: off, metrics or full.")]
Focus = Annotated[int | None, typer.Option(help="Vehicle whose page comes first in the log, such as 3 for veh_03.")]
Jobs = Annotated[int, typer.Option(help="Number of processes; -1 for one a core.")]
Dask = Annotated[str | None, typer.Option(help="Address of a Dask scheduler, in place of local processes.")]
Junit = Annotated[Path | None, typer.Option(help="Also write the findings to this file, as JUnit XML.")]
Results = Annotated[Path, typer.Option(help="Directory of the results; runs that lie there are kept.")]
Detections = Annotated[
    str, typer.Argument(help="sampler:RIG[:class], an .npz, a log, or the folder of real detections.")
]
Count = Annotated[int, typer.Option(help="Detections that the sampler draws.")]
NoMirror = Annotated[bool, typer.Option("--no-mirror", help="Do not add the mirror images, left for right.")]
