import re

import pandas as pd

from shipid.report.logs import CheckContent, write_checks
from shipid.report.wording import set_sentence
from tests.report.test_page import NASTY, Page

CHECKS = pd.DataFrame(
    [
        {"check": "gap", "run": "a", "value": 1.0, "unit": "s", "limit": 3.0, "ok": True, "sentence": "fine"},
        {"check": "path", "run": NASTY, "value": 9.0, "unit": "m", "limit": 2.0, "ok": False, "sentence": NASTY},
    ]
)
RUNS = ["a", "a", NASTY, NASTY]
SERIES = pd.DataFrame(
    {"run": RUNS, "t": [1.7e9, 1.7e9 + 1, 0.0, 1.0], "r": 0.1, "psi_rate": [0.1, float("nan"), 0.1, 0.1]}
).assign(drift=[0.0, 1.0, 2.0, 3.0], u=1.0, v=0.0)
TRACKS = pd.DataFrame({"run": RUNS, "set": "the log", "north": [0.0, 1.0, 2.0, 3.0], "east": 0.0})
REPAIRS = pd.DataFrame(columns=["kind", "column", "count", "note"])


def content(name: str, checks: pd.DataFrame = CHECKS) -> CheckContent:
    return CheckContent(
        name=name, checks=checks, series=SERIES, tracks=TRACKS, repairs=REPAIRS, provenance={"log": name}
    )


def test_page_of_checks(tmp_path):
    file = write_checks(content(NASTY), tmp_path / "new" / "c.html")
    text = file.read_text()
    assert text.count(NASTY) == 0
    page = Page(text)
    assert not page.open
    assert not re.search(r'(src|href)="https?:', text.partition("* plotly.js (")[0])
    cells = [text for attributes, text in page.all("td") if "bad" in str(attributes.get("class")).split()]
    assert cells[0] == "failed"
    assert cells[1:] == [set_sentence(sentence) for sentence in CHECKS.sentence[~CHECKS.ok]], (
        "shown whole, not cut at its end"
    )
    sentences = [text for _, text in page.all("li")]
    assert any("1 of 2 checks failed, in 1 of 2 runs." in sentence for sentence in sentences)
    assert "shipid data check" in text


def test_a_log_in_order(tmp_path):
    file = write_checks(content("log", CHECKS.iloc[:1]), tmp_path / "c.html")
    assert "All 1 check of 1 run passed." in file.read_text()
