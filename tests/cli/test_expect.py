"""`shipid expect`: an answer from particulars, from a study, and one line where they are wrong."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.running import ended, output_of


def test_the_first_line_is_the_answer_and_the_last_one_its_limit():
    lines = output_of("expect", "--length", 120, "--speed", 7, "--kind", "template", "--runs", 12).splitlines()
    assert lines[0].startswith("With 12 runs and this physics (template), expect the path to err by ")
    assert lines[-1].startswith("Simulated ships taught this law (")


def test_programs_get_rows_and_provenance():
    given = ["expect", "--length", 120, "--speed", 7, "--A", 40, "--runs", 0, "--runs", 8, "--json"]
    answer = json.loads(output_of(*given))
    first, last = answer["expected"]
    assert {key: value for key, value in first.items() if "ratio" not in key} == {
        **{"physics": "A 40.00 m", "N_D": 0},
        **{"H": 40.0, "low": 40.0, "high": 40.0},
    }
    assert last["ratio_low"] < last["ratio"] < last["ratio_high"]
    assert answer["comparison"].startswith("On the same ship ")
    assert 0 < last["low"] < last["H"] < last["high"]
    assert answer["law"]["ships"] > 2
    assert answer["warnings"] == []


def test_a_study_is_foretold_at_more_runs(tiny_run: Path):
    answer = json.loads(ended("expect", "--study", tiny_run, "--json", "--kind", "template")[1])
    assert answer["warnings"][0].startswith("extrapolated: ship lengths ahead 0.437, ")
    assert {row["physics"] for row in answer["expected"]} == {"right", "wrong-1", "wrong-2", "none", "template"}
    runs = sorted({row["N_D"] for row in answer["expected"]})
    assert runs == [runs[0], 2 * runs[0], 4 * runs[0]]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("--length 120", "--speed: missing: give --length and --speed, or --vessel, or --study"),
        (
            "--length 120 --speed 7 --kind guess",
            "kind: 'guess' is no kind: give one of model-test, identified, nominal",
        ),
        ("--vessel otter --sea calm", "--sea: goes with --length and --speed"),
        ("--length 120 --speed 7 --A 4 --kind template --kind none", "--A: is that of one physics"),
        ("--length 120 --speed 7 --law no.json", "no.json: cannot be read"),
        ("--vessel no-ship", "no-ship"),
        ("--vessel otter --length 3", "--length: --vessel has its own: leave one of the two out"),
        ("--study no-run --ahead 3", "--ahead: --study has its own: leave one of the two out"),
    ],
)
def test_a_wrong_argument_is_one_line(arguments: str, words: str):
    code, _, error = ended("expect", *arguments.split())
    assert code == 1
    assert words in error
    assert len(error.splitlines()) == 1
