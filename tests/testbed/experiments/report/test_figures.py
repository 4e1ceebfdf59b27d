"""Figures of a comparison: what is drawn, in which files, and the numbers behind the lines."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image
from scipy.stats import t as student

from testbed.experiments.compare import Comparison
from testbed.experiments.report import figure_style, figures
from testbed.experiments.series import BANDS, STEP, by_band, chosen, mean_over_seeds, over_time, ranked
from tests.testbed.experiments.made_results import make

ALL = {
    "distributions", "pairwise_gospa", "pairwise_rmse_position", "cost", "time_gospa", "time_position",
    "time_nees_position", "time_nis", "error_by_range", "error_by_visibility",
}  # fmt: skip


def plots(results):
    return list(figures.plots(results, {band: by_band(results, band) for band in BANDS}))


def test_every_figure_is_a_png_of_256_colours(report):
    drawn = sorted((report.parent / "figures").iterdir())
    assert {path.stem for path in drawn} == ALL
    for path in drawn:
        with Image.open(path) as image:
            assert (image.format, image.mode) == ("PNG", "P")
            assert len(image.getcolors()) <= 256


def test_every_figure_has_a_title_and_a_caption(results):
    assert all(d.title and d.caption.endswith(".") for d in plots(results))


def test_a_long_title_and_a_long_legend_widen_a_figure(tmp_path):
    figure = Figure(figsize=(1.0, 1.0))
    figure.suptitle("the title of a figure that is far wider than its panels")
    figure.legend(handles=[Line2D([], [], label=f"tracker {k}") for k in range(6)], ncols=6)
    figures.fit(figure)
    renderer = FigureCanvasAgg(figure).get_renderer()
    for part in (*figure.texts, *figure.legends):
        box = part.get_window_extent(renderer)
        assert box.x0 >= 0
        assert box.x1 <= figure.bbox.width


@pytest.mark.parametrize("seeds", [(3,), (0, 1, 2)])
def test_one_tracker_that_holds_nothing_is_drawn(tmp_path, seeds):
    comparison = Comparison(("cut-in",), ("blind",), seeds, out=str(tmp_path))
    names = {d.name for d in figures.draw(plots(make(comparison, blind="blind")), tmp_path)}
    assert names == {"distributions", "cost", "time_gospa", "time_position"}


def test_a_scenario_without_runs_has_no_panel(tmp_path):
    gone = tuple(("merge", t, s) for t in ("good", "bad") for s in (0, 1))
    comparison = Comparison(("cut-in", "merge"), ("good", "bad"), (0, 1), out=str(tmp_path))
    series, times = over_time(make(comparison, gone=gone), ("good", "bad"))
    assert {s.scenario for s in series} == {"cut-in"}
    assert {t.scenario for t in times} == {"cut-in"}


def test_the_reference_comes_first_then_the_best_in_gospa(tmp_path):
    names = tuple(f"t{k}" for k in range(8))
    gone = (("cut-in", "t0", 0), ("cut-in", "t0", 1))
    results = make(Comparison(("cut-in",), names, (0, 1), reference="t7", out=str(tmp_path)), gone=gone)
    gospa = results.runs.groupby("tracker")["gospa"].mean().drop("t7").sort_values()
    assert ranked(results) == ["t7", *gospa.index, "t0"]
    assert chosen(results) == ["t7", *gospa.index[:5]]


def test_phases_are_shaded_where_they_are(tmp_path):
    results = make(Comparison(("cut-in",), ("good",), (0, 1), out=str(tmp_path)))
    _, times = over_time(results, ("good",))
    assert [(t.phase, t.start, round(t.end, 6)) for t in times] == [("onset", 3.0, 3.8), ("during", 4.0, 5.8)]


def test_gospa_over_time_is_the_root_of_the_sum_over_a_look(tmp_path):
    results = make(Comparison(("cut-in",), ("good",), (0, 1, 2), out=str(tmp_path)))
    (series,) = (s for s in over_time(results, ("good",))[0] if s.quantity == "gospa")
    rows = results.rows(["seed", "time", "gospa2"])
    last = rows[rows["time"] > 8.0 - STEP + 1e-6].groupby(["seed", "time"])["gospa2"].sum() ** 0.5
    per_seed = last.groupby("seed").mean().to_numpy()
    assert series.time[-1] == 8.0 - STEP / 2
    assert series.mean[-1] == pytest.approx(per_seed.mean())
    half = student.ppf(0.975, 2) * per_seed.std(ddof=1) / np.sqrt(3)
    assert series.high[-1] - series.mean[-1] == pytest.approx(half)


def test_two_seeds_have_a_mean_but_no_band():
    mean, low, _, size = mean_over_seeds(np.array([[1.0, 3.0, np.nan], [np.nan, np.nan, np.nan]]))
    assert mean[0] == 2.0
    assert size.tolist() == [2, 0]
    assert np.isnan([mean[1], *low]).all()


@given(st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=12), st.randoms(use_true_random=False))
def test_bands_do_not_know_the_order_of_seeds_nor_those_that_are_missing(values, random):
    shuffled = [*values, np.nan]
    random.shuffle(shuffled)
    ours, theirs = (np.array(mean_over_seeds(np.array([v]))) for v in (values, shuffled))
    np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9)
    mean, low, high, _ = ours[:, 0]
    assert low <= mean <= high


def test_trackers_differ_in_more_than_their_colour():
    styles = figure_style.line_styles([f"tracker {k}" for k in range(20)])
    assert len({(one.color, str(one.linestyle)) for one in styles.values()}) == 20
    assert len({(one.color, one.marker) for one in styles.values()}) == 20


def test_a_grid_has_a_panel_for_each():
    for count in (1, 2, 4, 5, 13):
        figure, axes = figure_style.panels(count, (2.0, 1.0))
        rows, columns = axes[0].get_gridspec().get_geometry()
        assert rows * columns >= count > (rows - 1) * columns
        assert [axis.axison for axis in figure.axes] == [axis in axes for axis in figure.axes]
        assert len(axes) == count
