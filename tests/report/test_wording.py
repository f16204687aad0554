import math

from shipid.report.wording import (
    counted_text,
    difference_text,
    distance_text,
    ends_text,
    join_few_names,
    metres_text,
    number_text,
    scientific_text,
    set_sentence,
    shorten_name,
)


def test_three_digits():
    assert [number_text(x) for x in (0.834, 9.994, 9.996, 12.44, 99.96, 131.4)] == [
        "0.83",
        "9.99",
        "10.0",
        "12.4",
        "100",
        "131",
    ]
    assert number_text(-1.5) == "−1.50"
    small = {
        0.0994: "0.099", 0.0995: "0.10", 0.00834: "0.0083", 0.00996: "0.010", -0.00052: "−0.00052",
        0.000041: "0.000041", 0.0000066: "0.000007", 0.0000006: "0.000001", 0.0000004: "0.00", 0.0: "0.00",
    }  # fmt: skip
    assert {x: number_text(x) for x in small} == small, "a model of a metre errs by less"
    assert number_text(math.nan) == number_text(math.inf) == "–"
    assert metres_text(0.5) == "0.50 m"
    assert distance_text(963.2) == "963 m"
    assert distance_text(1240) == "1.2 km"


def test_digits_with_an_exponent():
    assert [scientific_text(x) for x in (803.0, -187500.0, 1.5e-7, 1e-8)] == [
        "803",
        "−1.875 × 10⁵",
        "1.5 × 10⁻⁷",
        "10⁻⁸",
    ]


def test_lists():
    assert join_few_names([]) == "none"
    assert join_few_names(["a"]) == "a"
    assert join_few_names(["a", "b"]) == "a and b"
    assert join_few_names(list("abcdef")) == "a, b, c and 3 more"
    assert counted_text(1, "run") == "1 run"
    assert counted_text(2412, "sample") == "2,412 samples"


def test_units_stay_with_their_numbers():
    assert set_sentence("H = 0.94 m, 5 models") == "H\u00a0=\u00a00.94\u00a0m, 5 models"


def test_a_long_name_loses_its_middle() -> None:
    assert shorten_name("moderate-observed-1", 12) == "moder…rved-1"
    for most in range(4, 24):
        assert len(shorten_name("moderate-observed-1", most)) == min(most, 19)


def test_a_sentence_is_set_with_signs_and_spaces() -> None:
    assert set_sentence("1.32 m -> 0.93 m: `shipid study rotate`") == "1.32\u00a0m → 0.93\u00a0m: “shipid study rotate”"
    assert set_sentence("by 1.4e-11 % or 2e+05, not 4b7ce53e-0c") == "by 1.4 × 10⁻¹¹\u00a0% or 2 × 10⁵, not 4b7ce53e-0c"
    assert set_sentence("90% of +-2 m [-0.2, 3-4], N-2") == "90\u00a0% of ±2\u00a0m [−0.2, 3-4], N-2"


def test_a_difference_and_its_interval_have_as_many_decimals() -> None:
    """`0.018 m [0.00, 3.42]` has digits that do not match."""
    assert difference_text(0.018, -0.004, 0.042) == "0.018 m [−0.004, 0.042]"
    assert difference_text(0.0003, -2.1, 2.14) == "0.00 m [−2.10, 2.14]", "nearly 0 in a wide interval"
    assert difference_text(9.8, 8.13, 11.52) == "9.8 m [8.1, 11.5]"
    assert ends_text(0.018, 3.42) == "0.02 to 3.42"
