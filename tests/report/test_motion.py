"""The page of one manoeuvre."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.measures.criteria import criterion_rows, judge_criteria, measure_rows
from shipid.measures.spiral import helm_levels
from shipid.report import motion
from shipid.report.figure import MOST_LINE_POINTS, even_places
from shipid.report.motion import ManoeuvreContent, write_manoeuvre
from shipid.report.paths import outline_at
from shipid.simulation.standard import standard_manoeuvres
from tests.measures.made_records import RECORDS, every
from tests.report.test_page import Page
from tests.report.views import views

TRIALS = standard_manoeuvres()


def content(kind: str, name: str = "a ship") -> ManoeuvreContent:
    record = every(RECORDS[kind](), 0.5)
    columns = {key: getattr(record, key) for key in ("t", "north", "east", "psi", "u", "v", "r", "helm")}
    shaft = np.zeros(len(record.t)) if record.shaft is None else record.shaft
    measures, points = TRIALS[kind].measures(record), helm_levels(record)
    return ManoeuvreContent(
        title=f"{name}: {kind}",
        name=kind,
        first=TRIALS[kind].first,
        log=pd.DataFrame({**columns, "shaft": shaft}),
        measures=pd.DataFrame(measure_rows(measures, 120.0)),
        criteria=pd.DataFrame(criterion_rows(judge_criteria(kind, measures, 120.0))),
        drive_unit="rpm",
        outline=np.array([[60.0, 0.0], [40.0, 10.0], [-60.0, 10.0], [-60.0, -10.0], [40.0, -10.0]]),
        levels=pd.DataFrame(
            {"helm": points.helm, "rate": points.rate} if kind == "spiral" else {"helm": [], "rate": []}
        ),
        provenance={"Vessel": name},
        command="shipid manoeuvre",
    )


@pytest.mark.parametrize("kind", TRIALS)
def test_every_kind_has_a_page_with_its_first_measures(kind: str, tmp_path: Path) -> None:
    text = write_manoeuvre(content(kind, "<b>a ship</b>"), tmp_path / "new" / "page.html").read_text()
    page = Page(text)
    assert not page.open
    assert "<b>a ship" not in text
    anchors = {attributes.get("id") for _, attributes, _ in page.elements}
    words = " ".join(line for _, line in page.all("li", "td", "th"))
    for measure in TRIALS[kind].first:
        assert measure in words.lower()
    assert ("spiral" in anchors) == (kind == "spiral")


def test_the_answer_has_the_digits_of_the_table() -> None:
    shown = content("spiral")
    helm = shown.measures["measure"].eq("neutral helm")
    shown = replace(shown, measures=shown.measures.assign(value=shown.measures["value"].mask(helm, -0.0248)))
    assert "Neutral helm: −0.025 deg" in shown.answer[0].text
    assert "−0.025" in [row[1].text for row in motion.measures_table(shown).rows]
    still = shown.measures.assign(value=shown.measures["value"].mask(helm, -1e-9))
    assert "Neutral helm: 0.00 deg" in replace(shown, measures=still).answer[0].text


def test_answer_counts_the_criteria_that_are_judged() -> None:
    shown = content("zigzag")
    assert shown.answer[1].text == "3 of 3 criteria of IMO MSC.137(76) are met."
    worse = shown.criteria.assign(verdict=["met", "not met", "not judged"])
    assert replace(shown, criteria=worse).answer[1].text == "1 of 2 criteria of IMO MSC.137(76) are met."
    for notes, words in ((["in ballast"] * 3, "met; in ballast."), (["in ballast", "", ""], "met.")):
        assert replace(shown, criteria=shown.criteria.assign(note=notes)).answer[1].text.endswith(words)
    table = motion.criteria_table(replace(shown, criteria=worse))
    assert [row[4].bad for row in table.rows] == [False, True, False]


def test_a_missing_measure_says_why_in_its_row() -> None:
    shown = content("zigzag")
    assert "why missing" not in motion.measures_table(shown).columns
    spoiled = shown.measures.copy()
    spoiled.loc[spoiled["measure"] == "period", ["value", "note"]] = [np.nan, "too short"]
    table = motion.measures_table(replace(shown, measures=spoiled))
    row = next(row for row in table.rows if row[0].text == "period")
    assert (row[1].text, row[4].text, row[4].bad) == ("–", "too short", True)
    assert "period: not reached" in replace(shown, measures=spoiled).answer[0].text


def test_ships_are_drawn_to_scale_where_they_were() -> None:
    """Bow and stern of an outline lie on the heading, the bow half a length ahead; starboard of east is south."""
    shape = np.array([[60.0, 0.0], [-60.0, 0.0], [0.0, 9.0]])
    drawn = outline_at(shape, np.array([10.0, 20.0, np.pi / 2]))
    np.testing.assert_allclose(drawn[:3], [[10.0, 80.0], [10.0, -40.0], [1.0, 20.0]], atol=1e-9)


@pytest.mark.parametrize("kind", ["zigzag", "stop", "spiral"])
def test_lines_are_in_the_units_of_their_axes(kind: str) -> None:
    shown = content(kind)
    shown = replace(shown, log=shown.log.assign(psi=shown.log["psi"] + 1.0, shaft=np.linspace(-1, 2, len(shown.log))))
    panels = views(motion.histories_figure(shown))[""]
    lines = {str(trace["name"]): np.asarray(trace["y"]) for panel in panels for trace in panel.data}
    log = shown.log.iloc[even_places(len(shown.log), MOST_LINE_POINTS)]
    expected = {"heading": np.degrees(log["psi"] - log["psi"].iloc[0]), "helm": np.degrees(log["helm"])}
    expected |= {"ahead, u": log["u"], "to starboard, v": log["v"], "yaw rate, r": np.degrees(log["r"])}
    for name, values in {**expected, "shaft": 60 * log["shaft"]}.items():
        np.testing.assert_allclose(lines[name], values, rtol=1e-5, atol=1e-5, err_msg=name)
    if kind == "spiral":
        figure = motion.spiral_figure(shown)
        (trace,) = views(figure)[""][0].data
        for axis, column in (("x", "helm"), ("y", "rate")):
            np.testing.assert_allclose(trace[axis], np.degrees(shown.levels[column]), rtol=1e-5, atol=1e-6)
