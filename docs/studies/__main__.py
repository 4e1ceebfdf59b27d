"""`PYTHONPATH=docs python -m studies NAME`: pages of the documentation that commands write, and committed results."""

from collections.abc import Callable, Mapping

import typer

from studies import (
    contour_classes,
    depth_profiles,
    generated,
    ghosts_figure,
    lane_changes,
    layers_figure,
    limits_figure,
    size_by_radar,
    vehicle_figure,
)
from studies.calibration import page as calibration
from studies.closed_loop import page as closed_loop
from studies.comparison import committed, refresh
from studies.comparison import page as comparison
from studies.consistency import page as consistency
from studies.contours import page as contours
from studies.drivers import page as drivers
from studies.faults import page as faults
from studies.htg_tables import page as htg_tables
from studies.learned import page as learned
from studies.modes import page as modes
from studies.partial_view import page as partial_view
from studies.persistence import page as persistence
from studies.probes import page as probes
from studies.regret import page as regret
from studies.rigs import figure as rigs_figure
from studies.rigs import range_rates, sensitivity
from studies.speed import page as speed
from studies.standing import page as standing
from studies.traffic import page as traffic

STUDIES: Mapping[str, Callable[..., None]] = {
    "calibration": calibration.main,
    "closed-loop": closed_loop.main,
    "comparison": comparison.main,
    "consistency": consistency.main,
    "contours": contours.main,
    "faults": faults.main,
    "ghosts": ghosts_figure.main,  # a picture for docs/ghosts.md
    "htg-tables": htg_tables.main,
    "limits": limits_figure.main,  # a picture for docs/methods/radar.md
    "layers": layers_figure.main,  # pictures for docs/layers.md
    "learned-policies": learned.main,
    "modes": modes.main,
    "partial-view": partial_view.main,
    "persistence": persistence.main,
    "probes": probes.main,
    "regret": regret.main,
    "speed": speed.main,
    "standing-returns": standing.main,
    "traffic": traffic.main,
    "radars": rigs_figure.main,  # a picture for docs/radars.md
    "vehicles": vehicle_figure.main,  # a picture for docs/methods
    # committed results that pages show
    "refresh": refresh.main,
    "verdicts": committed.main,
    "drivers": drivers.main,  # and a picture for docs/traffic.md
    "surround": sensitivity.main,
    "size-by-radar": size_by_radar.main,
    "range-rates": range_rates.main,
    # models and numbers that trackers and rigs come with
    "contour-classes": contour_classes.main,
    "depth-profiles": depth_profiles.main,
    "lane-changes": lane_changes.main,
    # what the documentation says about the registries
    "generated": generated.main,
}

app = typer.Typer(
    help="Pages of the documentation, docs/NAME.md each, and the results that they show.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)
for name, study in STUDIES.items():
    app.command(name)(study)

if __name__ == "__main__":
    app()
