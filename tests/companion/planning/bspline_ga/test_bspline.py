import numpy as np
import pytest

from companion.planning.bspline_ga import bspline


def clamped_knots(control_points: int) -> np.ndarray:
    return np.concatenate(([0.0, 0.0], np.linspace(0.0, 1.0, control_points - 1), [1.0, 1.0]))


@pytest.mark.parametrize("control_points", [3, 4, 5, 6, 8, 13])
@pytest.mark.parametrize("samples", [2, 5, 7, 101])
def test_the_curve_is_scipys(control_points, samples):
    from scipy.interpolate import BSpline  # large; only the workers that run this test load it

    control = np.random.default_rng(control_points).random((control_points, 2)) * 100.0
    expected = BSpline(clamped_knots(control_points), control, bspline.DEGREE)(np.linspace(0.0, 1.0, samples))
    assert np.abs(bspline.curve(control, samples) - expected).max() < 1e-10


@pytest.mark.parametrize("control_points", [3, 4, 7])
def test_the_curve_joins_the_ends(control_points):
    control = np.random.default_rng(0).random((control_points, 2))
    points = bspline.curve(control, 11)
    assert points[0] == pytest.approx(control[0]) and points[-1] == pytest.approx(control[-1])


def test_basis_values_are_shares():
    first, values = bspline.basis(6, 50)
    assert values.sum(axis=1) == pytest.approx(np.ones(50))
    assert (values >= -1e-12).all()
    assert first.min() == 0 and first.max() == 3


def test_no_samples_give_no_points():
    assert bspline.curve(np.zeros((4, 2)), 0).shape == (0, 2)
