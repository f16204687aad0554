"""The section and the page that compare methods."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.answer.methods import METHOD_COLUMNS, WITH_PHYSICS
from shipid.report.methods import MethodsContent, methods_figure, methods_table, sentences_on_methods, write_comparison
from tests.report.views import views


def frame(seed: int, conditions: tuple[str, ...] = ("calm", "rough"), failing: bool = True) -> pd.DataFrame:
    """Rows drawn by a seed; of method `c` some cells fail, of method `lost` all."""
    rng = np.random.default_rng(seed)
    rows = []
    for condition in conditions:
        for family in ("nominal", "none", WITH_PHYSICS):
            for N_D in (3, 30):
                for method in ("a", "b", "c", *(["lost"] if failing else [])):
                    H = float(rng.uniform(0.5, 9)) if method != "lost" else np.nan
                    difference = 0.0 if method == "a" else H - 3
                    failed = {"c": 1 if failing else 0, "lost": 4}.get(method, 0)
                    rows.append(
                        dict(zip(METHOD_COLUMNS, [condition, family, N_D, method, 4, failed, failed,
                                 1.7 * H, 3 * H, H, 2 * H, 2.0, 8.0, "a",
                             4 - failed, difference, difference - 0.5, difference + 0.4, 9, 5, 2, difference - 0.1,
                             difference + 0.1, np.nan, np.nan], strict=True))
                    )  # fmt: skip
    return pd.DataFrame(rows)


def content(rows: pd.DataFrame) -> MethodsContent:
    return MethodsContent(
        title="Which is <best>?", name="compared", frames={"methods": rows}, provenance={"study": "x"}
    )


def test_the_sentences_name_the_least_error_among_methods_that_never_failed() -> None:
    rows = frame(1)
    for sentence, condition in zip(sentences_on_methods(rows), ("calm", "rough"), strict=True):
        assert sentence.startswith(f"{condition.capitalize()}: with N_D = 3 ")
        for N_D in (3, 30):
            mine = rows[
                rows.condition.eq(condition) & rows.family.eq(WITH_PHYSICS) & rows.N_D.eq(N_D) & rows.failed.eq(0)
            ]
            assert f"with N_D = {N_D} {mine.loc[mine.H.idxmin()].method} errs least" in sentence
        assert sentence.count("c (1 of 4) and lost (4 of 4)") == 2


def three(H: tuple[float, float, float], **more: list[object]) -> str:
    """The sentence of three methods at one amount of data, differences are to `a`."""
    rows = frame(1, ("",), failing=False)
    rows = rows[rows.family.eq(WITH_PHYSICS) & rows.N_D.eq(3)].assign(
        H_end=5.0, H=H, difference=np.array(H) - H[0], **more
    )
    rows = rows.assign(low=rows.difference - 0.5, high=rows.difference + 0.5)
    (sentence,) = sentences_on_methods(rows)
    return sentence


def test_methods_that_err_alike_are_named_together() -> None:
    assert three((2.0, 2.0 * (1 + 1e-15), 2.5)) == (
        "With N_D = 3 a and b err alike, least in the mean over all foundations with physics, "
        "5.00 m at the horizon, H 2.00 m "
        "(c is next, its difference of H to a is 0.50 % [0.00, 1.00])."
    )
    assert (
        "b and c err alike, least in the mean over all foundations with physics, "
        "5.00 m at the horizon, H 1.00 m (their difference" in three((2, 1, 1))
    )


def test_a_method_that_lacks_a_cell_is_named() -> None:
    rivals = three((9.0, 2.0, 3.0), missing=[1, 0, 1], failed=[1, 0, 0])
    assert "b errs least in the mean over all foundations with physics, 5.00 m at the horizon, H 2.00 m" in rivals
    assert ", without a result: a (1 of 4) (left out: c," in rivals


@pytest.mark.parametrize("conditions", [("",), ("calm", "rough")])
def test_every_number_is_in_the_table_and_every_view_in_the_figure(conditions: tuple[str, ...]) -> None:
    rows = frame(2, conditions)
    drawn, printed = methods_figure(content(rows)), methods_table(content(rows))
    assert drawn is not None
    assert len(views(drawn)) == len(conditions) * 2
    assert all(len(panels) == 2 for panels in views(drawn).values())
    assert len(printed.rows) == len(rows)
    assert {len(row) for row in printed.rows} == {len(printed.columns)} == {len(printed.numeric)}
    for given, shown in zip(rows.to_dict("records"), printed.rows, strict=True):
        texts = [cell.text for cell in shown]
        assert given["method"] in texts
        assert ("–" if np.isnan(given["H"]) else f"{given['H']:.2f}") in texts
        assert any(cell.bad for cell in shown) == bool(given["failed"])


def test_the_table_says_how_many_cells_gave_no_result() -> None:
    """Of none it said `0 cells of 96 gave no result`."""
    rows = frame(1, ("",), failing=False)
    for count, said in ((0, "All 48 cells gave a result."), (1, "1 of 48 cells gave no result.")):
        printed = methods_table(content(rows.assign(failed=np.where(rows.index == 0, count, 0))))
        assert printed.takeaway.endswith(said)


def test_the_page_is_one_file_that_escapes_its_texts(tmp_path: Path) -> None:
    text = write_comparison(content(frame(3)), tmp_path / "report.html").read_text()
    assert "Which is &lt;best&gt;?" in text
    assert 'id="methods-table"' in text
