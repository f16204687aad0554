import pandas as pd

from shipid.data.checks import check_dataset
from shipid.data.contents import check_content
from shipid.data.dataset import read_dataset
from shipid.study.store import DATASET


def test_the_page_of_a_log_holds_its_runs_and_repairs(tiny_run):
    log = read_dataset(tiny_run / DATASET)
    repair = {"kind": "jump", "column": "north", "count": 3, "note": "interpolated"}
    log = type(log)(log.frame, {**log.metadata, "repairs": [repair], "source": {"file": "a.csv", "rows": 9}})
    checks = check_dataset(log)
    content = check_content("tiny", log, checks)
    assert list(pd.unique(content.tracks["run"])) == log.runs
    assert list(pd.unique(content.series["run"])) == log.runs
    assert content.repairs.to_dict("records") == [repair]
    assert content.provenance["log"] == "file a.csv, rows 9"
    assert content.provenance["rows"] == str(len(log.frame))
    assert content.answer[0].text.startswith(("All ", f"{int((~checks['ok'].astype(bool)).sum())} of "))
