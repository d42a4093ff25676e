"""fieldgraft.blend against the equations written out in NumPy float64 (Blending-NeRF, eqs. 4–7)."""

from __future__ import annotations

import numpy as np
import pytest

fg = pytest.importorskip("fieldgraft", reason="the Python package is not built: ./dev build")


def written_out(density_o, color_o, delta, density_e, color_e, beta_density, beta_color):
    kept = (1 - beta_density) * density_o
    mixed = (1 - beta_color)[..., None] * color_o + beta_color[..., None] * color_e

    def alpha(density):
        return -np.expm1(-density * delta)

    def before(density):
        depth = np.cumsum(density * delta, -1)
        return np.exp(-(depth - density * delta))

    t = before(kept + density_e)
    a_o, a_e, a = alpha(kept), alpha(density_e), alpha(density_o)
    return {
        "color": ((t * a_o)[..., None] * mixed + (t * a_e)[..., None] * color_e).sum(1),
        "color_edit": ((t * (a_o * beta_color + a_e))[..., None] * color_e).sum(1),
        "added": (t * a_e).sum(1),
        "removed": ((before(kept) - before(density_o)) * a).sum(1) / a.sum(1),
        "changed": (t * a_o * beta_color).sum(1),
        "transmittance": np.exp(-((kept + density_e) * delta).sum(1)),
    }


def test_blend_is_the_papers_equations() -> None:
    rng = np.random.default_rng(3)
    rays, samples = 7, 33
    plain = rng.uniform(0, 1, (5, rays, samples))
    colors = rng.uniform(0, 1, (2, rays, samples, 3))
    density_o, density_e, delta = 6 * plain[0], 3 * plain[1], 0.01 + 0.1 * plain[2]
    expected = written_out(density_o, colors[0], delta, density_e, colors[1], plain[3], plain[4])
    got = fg.blend(density_o, colors[0], delta, density_e, colors[1], plain[3], plain[4])
    assert got.keys() == expected.keys()
    for name, value in expected.items():
        np.testing.assert_allclose(got[name], value, rtol=2e-5, atol=2e-6, err_msg=name)


def test_maps_of_operations_that_are_off_are_zero() -> None:
    one = np.ones((2, 4), np.float32)
    color = np.full((2, 4, 3), 0.25, np.float32)
    out = fg.blend(one, color, one)
    assert not out["added"].any() and not out["removed"].any() and not out["changed"].any()
    np.testing.assert_allclose(out["transmittance"], np.exp(-4), rtol=1e-6)
    np.testing.assert_allclose(out["color"], 0.25 * (1 - np.exp(-4)), rtol=1e-5)


def test_bad_shapes_and_names_are_said() -> None:
    one = np.ones((2, 4), np.float32)
    color = np.ones((2, 4, 3), np.float32)
    with pytest.raises(fg.InputError, match="delta"):
        fg.blend(one, color, np.ones((2, 5), np.float32))
    with pytest.raises(fg.InputError, match="sideways"):
        fg.blend(one, color, one, compositing="sideways")
