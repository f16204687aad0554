from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.hybrid.units import VaryingInputs, mirror_matrix, solve_ridges

POINT = {"motion_scale": 2.0, "command_scale": 3.0, "wind_scale": 4.0, "offset": 1.0}
MIRROR = {"u": 1, "v": -1, "r": -1, "port.n": 1, "port.alpha": -1}


@pytest.fixture
def table():
    rng = np.random.default_rng(0)
    return {name: rng.normal(1.0, 2.0, 50) for name in MIRROR} | {"psi.steady": np.ones(50)}


def side(table):
    both = {name: values for name, values in table.items() if name in MIRROR}
    return both | {name.replace("port", "starboard"): values for name, values in both.items() if "port" in name}


def test_even_units_do_not_feel_the_mirror_and_odd_ones_change_sign(table):
    here = side(table)
    units = VaryingInputs.of(here, mirror=True).draw(POINT, 12, 0)
    image = {name: MIRROR[name.replace("starboard", "port")] * values for name, values in here.items()}
    (even, odd), (even_image, odd_image) = units.parts(here), units.parts(image)
    assert even.shape == (50, 13)
    assert odd.shape == (50, 12)
    np.testing.assert_allclose(even, even_image, atol=1e-12)
    np.testing.assert_allclose(odd, -odd_image, atol=1e-12)
    assert np.abs(odd).max() > 0.01
    plain, _ = replace(units, reflection=None).parts(here)
    np.testing.assert_allclose(even[:, 1:] + odd, plain[:, 1:], atol=1e-12)  # halves of the same units


def test_weights_and_offsets_are_drawn_apart_with_the_scales_of_their_inputs(table):
    units = VaryingInputs.of(table, mirror=False).draw({**POINT, "offset": 0.7}, 4000, 0)
    scale = [POINT["command_scale" if name.startswith("port") else "motion_scale"] for name in units.normaliser.names]
    drawn = np.vstack([units.weight, units.offset])
    np.testing.assert_allclose(drawn.std(axis=1), [*(1 / np.array(scale)), 0.7], rtol=0.05)
    np.testing.assert_allclose(np.corrcoef(drawn), np.eye(len(drawn)), atol=0.06)


def test_a_ridge_regression_is_the_normal_equations():
    rng = np.random.default_rng(1)
    features, targets, penalty = rng.normal(size=(40, 4)), rng.normal(size=(40, 2)), np.array([1.0, 2.0, 0.5, 1.0])
    for ridge, weights in zip((1e-3, 2.0), solve_ridges(features, targets, (1e-3, 2.0), penalty), strict=True):
        gram = features.T @ features / 40 + ridge * np.diag(penalty**2)
        np.testing.assert_allclose(weights, np.linalg.solve(gram, features.T @ targets / 40), atol=1e-10)


RNG = np.random.default_rng(3)


def columns(*names: str) -> dict[str, np.ndarray]:
    return {name: RNG.normal(size=20) for name in names}


def features(*names: str) -> dict[str, tuple[str, ...]]:
    return {name: (name,) for name in names}


AZIMUTHS = ("u", "v", "r", "v_rw", "port.n", "starboard.n", "port.alpha", "starboard.alpha")


def test_the_mirror_changes_signs_and_sides() -> None:
    """Surge and shafts as they are, sway, yaw and angles the other way; port and starboard change places."""
    here = columns(*AZIMUTHS)
    matrix = mirror_matrix(here, features(*AZIMUTHS))
    image = dict(zip(AZIMUTHS, (np.stack(list(here.values()), axis=1) @ matrix).T, strict=True))
    for name, sign in (("u", 1), ("v", -1), ("r", -1), ("v_rw", -1)):
        np.testing.assert_array_equal(image[name], sign * here[name])
    for signal, sign in (("n", 1), ("alpha", -1)):
        np.testing.assert_array_equal(image[f"port.{signal}"], sign * here[f"starboard.{signal}"])
        np.testing.assert_array_equal(image[f"starboard.{signal}"], sign * here[f"port.{signal}"])


@pytest.mark.parametrize("names", [AZIMUTHS, ("u", "v", "r", "propeller.n", "rudder.delta")])
def test_a_mirror_of_the_mirror_is_the_thing(names: tuple[str, ...]) -> None:
    matrix = mirror_matrix(columns(*names), features(*names))
    np.testing.assert_array_equal(matrix @ matrix, np.eye(len(names)))


def test_words_inside_names_are_sides_too() -> None:
    names = ("main-left.n", "main-right.n")
    matrix = mirror_matrix(columns(*names), features(*names))
    np.testing.assert_array_equal(matrix, [[0.0, 1.0], [1.0, 0.0]])


def test_units_at_the_ends_stand_on_the_middle_line() -> None:
    names = ("fore.n", "fore.alpha", "aft.n", "aft.alpha")
    np.testing.assert_array_equal(mirror_matrix(columns(*names), features(*names)), np.diag([1.0, -1.0, 1.0, -1.0]))


def test_one_input_may_stand_for_several_columns() -> None:
    """Shafts that turn alike are one input: its image is itself."""
    shaft = RNG.normal(size=20)
    here = {"u": RNG.normal(size=20), "port.n": shaft, "starboard.n": shaft}
    matrix = mirror_matrix(here, {"u": ("u",), "n": ("port.n", "starboard.n")})
    np.testing.assert_array_equal(matrix, np.eye(2))


@pytest.mark.parametrize(
    "names",
    [
        ("u", "port.alpha"),  # the other unit is not measured
        ("u", "bow.n"),  # a tunnel drives sideways by its shaft
        ("u", "port-tunnel.n", "starboard-tunnel.n"),
        ("u", "port.n", "starboard.n", "bowthruster.n"),
        ("u", "port.n", "starboard.n", "SternThruster1.n"),
        ("u", "port.n", "starboard.n", "thruster_aft.n"),
        ("u", "m1.n", "m2.n"),  # which of them is to port, no name says
        ("u", "port.n", "left.n", "starboard.n", "right.n"),
    ],
)
def test_inputs_without_an_image_have_no_mirror(names: tuple[str, ...]) -> None:
    assert mirror_matrix(columns(*names), features(*names)) is None


def test_a_bow_unit_that_turns_has_a_mirror() -> None:
    names = ("bow.n", "bow.alpha")
    np.testing.assert_array_equal(mirror_matrix(columns(*names), features(*names)), np.diag([1.0, -1.0]))


def test_a_column_left_out_must_be_its_image() -> None:
    """A constant that is no input does not stop the mirror where it is symmetrical, and does where it is not."""
    here = columns("u") | {"port.n": np.full(20, 2.0), "starboard.n": np.full(20, 2.0)}
    np.testing.assert_array_equal(mirror_matrix(here, features("u")), [[1.0]])
    assert mirror_matrix({**here, "port.n": np.full(20, 1.0)}, features("u")) is None
    for other, mirrored in ((2.0, True), (1.0, False)):  # names without a side
        unsided = {"u": here["u"], "m1.n": np.full(20, 2.0), "m2.n": np.full(20, other)}
        assert (mirror_matrix(unsided, features("u")) is not None) == mirrored


def test_a_tunnel_that_rests_takes_no_mirror_away() -> None:
    here = columns("u", "v", "propeller.n", "rudder.delta") | {"bow.n": np.zeros(20)}
    matrix = mirror_matrix(here, features("u", "v", "propeller.n", "rudder.delta"))
    np.testing.assert_array_equal(matrix, np.diag([1.0, -1.0, 1.0, -1.0]))
