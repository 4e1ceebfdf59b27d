"""Profiles of sensors learned from detections of known vehicles."""

import numpy as np
import pytest

from studies.depth_profiles import Known, fit, log_density
from trackers.geometry import unit
from trackers.scan import DepthProfile


def drawn(profile, rng, G=6000, noise=0.08):
    """Detections (G) drawn from the model: even along the face that is chosen, at a depth behind it or from inside."""
    size = np.stack([rng.uniform(3.6, 10, G), rng.uniform(1.6, 2.5, G)], -1)
    sight = unit(rng.uniform(-np.pi, np.pi, G))
    shown = np.abs(sight) ** (1 - profile.grazing) * size[:, ::-1]
    axis = (rng.random(G) > shown[:, 0] / shown.sum(-1)).astype(int)  # 0: through an end, 1: through a side
    g = np.arange(G)
    L = size[g, axis]
    depth = rng.normal(profile.depth, profile.depth_std, G) * np.abs(sight[g, axis]) ** profile.slant
    mean = profile.inside_depth * np.abs(sight[g, axis])
    x = rng.random(G)
    deep = -mean * np.log1p(-x * -np.expm1(-L / mean)) if np.isfinite(profile.inside_depth) else x * L
    behind = np.where(rng.random(G) < profile.inside, deep, depth)
    xy = np.empty((G, 2))
    xy[g, axis] = -np.sign(sight[g, axis]) * (L / 2 - behind)
    xy[g, 1 - axis] = size[g, 1 - axis] * (rng.random(G) - 0.5)
    std = np.hypot(noise, profile.surface_std)
    return Known(xy + rng.normal(0, std, xy.shape), sight, size, np.full(xy.shape, noise**2))


@pytest.mark.parametrize(
    "truth",
    [
        pytest.param(DepthProfile(inside=0.25, depth=0.2, depth_std=0.1, grazing=0.3), marks=pytest.mark.slow),
        DepthProfile(inside=0.5, inside_depth=0.8, depth=0.1, depth_std=0.05, grazing=0.6, slant=0.0),
    ],
)
def test_the_profile_that_detections_were_drawn_from_is_found_again(truth):
    z = drawn(truth, np.random.default_rng(0))
    got, value = fit(z, DepthProfile(), rounds=2)
    assert got.inside == pytest.approx(truth.inside, abs=0.06)
    assert got.depth == pytest.approx(truth.depth, abs=0.05)
    assert got.grazing == pytest.approx(truth.grazing, abs=0.1)
    assert got.slant == pytest.approx(truth.slant, abs=0.25)
    if np.isfinite(truth.inside_depth):
        assert got.inside_depth == pytest.approx(truth.inside_depth, rel=0.25)
    assert value >= log_density(truth, z).mean()


def test_the_density_of_known_detections_has_mass_one():
    x, y = np.meshgrid(np.linspace(-6, 6, 241), np.linspace(-4, 4, 161), indexing="ij")
    xy = np.stack([x.ravel(), y.ravel()], -1)
    G = len(xy)
    for profile in (DepthProfile(), DepthProfile(inside=0.6, inside_depth=0.6)):
        z = Known(xy, np.tile(unit(0.6), (G, 1)), np.tile([4.5, 1.8], (G, 1)), np.full((G, 2), 0.01))
        mass = np.exp(log_density(profile, z)).sum() * 0.05 * 0.05
        assert mass == pytest.approx(0.99 + 0.01 * 12 * 8 / 48, abs=0.02)
