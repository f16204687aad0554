from __future__ import annotations

import random
import shutil
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest
import tomlkit
from pydantic import BaseModel, ConfigDict, Field

from shipid import document as documents
from shipid.errors import DocumentError, ShipidError
from shipid.logs.mapping import read_mapping
from shipid.study.plan import read_plan
from shipid.vessel.load import load_vessel

NESTED: dict[str, Any] = {"a": {"b": 1, "c": [10, {"d": 2}]}, "e": "x"}


def test_every_leaf_is_got_by_its_path() -> None:
    for path, value in documents.document_leaves(NESTED):
        assert documents.value_at_path(NESTED, path) == value


def test_entries_of_a_list_are_selected_by_name() -> None:
    """Where one entry alone has the name; a number, or a name with dots, is written so that it is read back."""
    families = [{"name": "high"}, {"name": "a.b", "perturb": [{"factor": [1, 2]}]}, {"name": "7"}, {"members": 3}]
    study = {"family": families}
    for path, shown in (
        ("family.0.perturb", "family.high.perturb"),
        ("family.1.perturb.0.factor.1", 'family."a.b".perturb.0.factor.1'),
        ("family.2.name", "family.2.name"),
        ("family.3.members", "family.3.members"),
        ("family.9.members", "family.9.members"),
        ("grid.N_D.0", "grid.N_D.0"),
    ):
        assert documents.path_with_names(study, path) == shown
    twice = {"family": [{"name": "a"}, {"name": "a"}]}
    assert documents.path_with_names(twice, "family.1.name") == "family.1.name"
    changed = documents.replace_values(study, {"family.high.members": 2, 'family."a.b".perturb.0.factor': 3})
    assert changed["family"][0] == {"name": "high", "members": 2}
    assert changed["family"][1]["perturb"] == [{"factor": 3}]


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("family.hihg.members", "there is no 'hihg': did you mean 'high'?"),
        ("family.2", "there is no '2': valid: high, low"),
        ("step.x.y", "there is no 'x': nothing is defined there"),
    ],
)
def test_a_path_that_reaches_nothing_is_refused(path: str, message: str) -> None:
    study = {"family": [{"name": "high", "perturb": []}, {"name": "low"}], "step": 0.5}
    with pytest.raises(DocumentError) as caught:
        documents.replace_values(study, {path: 2}, "study.toml")
    assert str(caught.value) == f"study.toml: {path}: {message}"
    assert study == {"family": [{"name": "high", "perturb": []}, {"name": "low"}], "step": 0.5}


@pytest.mark.parametrize(
    ("pattern", "matches"),
    [
        ("hull.*", ["hull.Y_v", "hull.Y_v|v|"]),
        ("*.D_p", ["thruster.port.D_p", "thruster.starboard.D_p"]),
        ("thruster.*.D_p", ["thruster.port.D_p", "thruster.starboard.D_p"]),
        ("hull.Y_v|v|", ["hull.Y_v|v|"]),
        ("hull.Y_.", []),
        ("hull", []),
        ("*", ["hull.Y_v", "hull.Y_v|v|", "thruster.port.D_p", "thruster.starboard.D_p"]),
    ],
)
def test_match_takes_names_literally_but_for_the_star(pattern: str, matches: list[str]) -> None:
    paths = ["hull.Y_v", "hull.Y_v|v|", "thruster.port.D_p", "thruster.starboard.D_p"]
    assert documents.match_paths(pattern, paths) == matches


def test_digest_does_not_depend_on_the_order_of_keys() -> None:
    assert documents.digest_document({"a": 1, "b": {"c": 2.5, "d": 3}}) == documents.digest_document(
        {"b": {"d": 3, "c": 2.5}, "a": 1}
    )
    assert documents.digest_document({"a": 1}) != documents.digest_document({"a": 2})
    assert documents.digest_document({"a": 0.1}) != documents.digest_document({"a": 0.1 + 1e-17 + 2**-55})
    assert len(documents.digest_document({})) == 16


def test_read_refuses_what_is_no_document(tmp_path: Path) -> None:
    for content, remedy in ((b"a = 1\na = 2", "not valid TOML"), (b"a = \xff", "UTF-8"), (b"a =", "not valid TOML")):
        file = tmp_path / "x.toml"
        file.write_bytes(content)
        with pytest.raises(DocumentError, match=remedy) as caught:
            documents.read_document(file)
        assert caught.value.file == str(file)
    for name in ("secret", "secret.toml"):  # what another file names may be anything: nothing of it is shown
        for content in ("TOKEN=hunter2", "[hunter2]\n[hunter2]", "a = {hunter2=1,hunter2=2}", 'a = "hunter2\\u001b"'):
            (tmp_path / name).write_text(content)
            with pytest.raises(DocumentError) as caught:
                documents.read_document(tmp_path / name)
            assert "hunter2" not in str(caught.value)
    for missing in (tmp_path / "gone.toml", tmp_path):
        with pytest.raises(DocumentError, match="cannot be read"):
            documents.read_document(missing)


def test_the_place_that_is_no_toml_is_named() -> None:
    with pytest.raises(DocumentError, match=r"\(at line 2, column 9\)$"):
        documents.parse_toml("a = 1\nx_G = -3,4\nb = 2\n")


def test_find_prefers_the_folder_of_the_document(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "x.toml").write_text("a = 1")
    (tmp_path / "x.toml").write_text("a = 2")
    monkeypatch.chdir(tmp_path)
    assert documents.read_document(documents.find_document("./x.toml", "models", tmp_path / "here")) == {"a": 1}
    assert documents.read_document(documents.find_document("./x.toml", "models")) == {"a": 2}
    assert documents.find_document("gunnerus-28.9", "models").name == "gunnerus-28.9.toml"


class Inner(BaseModel):
    model_config = ConfigDict(extra="forbid")
    speed: float = Field(gt=0)
    depth: float | None = None


class Outer(BaseModel):
    model_config = ConfigDict(extra="forbid")
    inner: Inner
    rows: list[Inner] = []
    runs: tuple[Inner, ...] = ()


@pytest.mark.parametrize(
    ("data", "path", "message"),
    [
        ({"inner": {"speed": 1, "deep": 2}}, "top.inner.deep", "unknown key: did you mean 'depth'?"),
        ({"iner": {"speed": 1}, "inner": {"speed": 1}}, "top.iner", "did you mean 'inner'?"),
        ({"inner": {}}, "top.inner.speed", "missing"),
        ({"inner": {"speed": -1}}, "top.inner.speed", "-1: must be above 0"),
        ({"inner": {"speed": 1}, "rows": [{"speed": 1, "sped": 2}]}, "top.rows.0.sped", "did you mean 'speed'?"),
        ({"inner": {"speed": 1}, "runs": [{"speed": 1, "sped": 2}]}, "top.runs.0.sped", "did you mean 'speed'?"),
        ({"inner": 5}, "top.inner", "5: "),
    ],
)
def test_parse_says_where_what_and_what_would_be_right(data: Any, path: str, message: str) -> None:
    with pytest.raises(DocumentError) as caught:
        documents.parse_model(Outer, data, "x.toml", "top")
    assert caught.value.path == path
    assert message in str(caught.value)


class Numbers(BaseModel):
    count: int = 0
    share: float = Field(default=0.0, alias="part")
    pair: tuple[float, float] = (0.0, 1.0)
    by_name: dict[str, float] = {}
    on: bool = False
    inner: Inner | None = None


@pytest.mark.parametrize(
    ("data", "path", "value"),
    [
        ({"count": True}, "top.count", "True"),
        ({"part": "5"}, "top.part", "'5'"),
        ({"pair": [1.0, False]}, "top.pair.1", "False"),
        ({"by_name": {"a": "1e3"}}, "top.by_name.a", "'1e3'"),
        ({"inner": {"speed": True}}, "top.inner.speed", "True"),
    ],
)
def test_truth_values_and_texts_are_no_numbers(data: Any, path: str, value: str) -> None:
    with pytest.raises(DocumentError) as caught:
        documents.parse_model(Numbers, data, "x.toml", "top")
    assert (caught.value.path, caught.value.message) == (path, f"{value}: must be a number")
    assert documents.parse_model(Numbers, {"count": 1, "part": 2, "on": True}, "x.toml").on is True


READ = {"studies": read_plan, "models": load_vessel, "studies/mappings": lambda file: read_mapping(Path(file))}


@pytest.mark.parametrize(
    ("kind", "name"), [(kind, name) for kind in READ for name in documents.bundled_documents(kind)]
)
def test_no_number_of_a_document_may_be_a_truth_value_or_a_text(kind: str, name: str, tmp_path: Path) -> None:
    source, file = documents.bundled_documents(kind)[name], tmp_path / "changed.toml"
    document = documents.read_document(source)
    if (source.parent / "tables").is_dir():
        shutil.copytree(source.parent / "tables", tmp_path / "tables")
    file.write_text(tomlkit.dumps(document), encoding="utf-8")
    READ[kind](str(file))
    places = [path for path, _ in documents.document_leaves(document)]
    numbers = [path for path, value in documents.document_leaves(document) if type(value) in (int, float)]
    for path in random.Random(name).sample(numbers, min(len(numbers), 6)):
        for value in (True, "5"):
            changed = documents.replace_values(document, {path: value})
            if [place for place, _ in documents.document_leaves(changed)] == places:  # a key with dots is not one path
                file.write_text(tomlkit.dumps(changed), encoding="utf-8")
                with pytest.raises(ShipidError):
                    READ[kind](str(file))


def test_a_quoted_key_may_hold_dots() -> None:
    document = documents.replace_values({"sensors": {}}, {'sensors."port.n".noise': 0.1})
    assert document == {"sensors": {"port.n": {"noise": 0.1}}}
    assert documents.value_at_path(document, 'sensors."port.n".noise') == 0.1


@pytest.mark.parametrize(
    ("text", "remedy"),
    [
        ("a.b = 1979-05-27", "a.b: a date: give"),
        ("a = [1, 07:32:00]", "a.1: a time: give"),
        ("a = " + "[" * 2000 + "]" * 2000, "maximum recursion depth"),
        (".".join("a" * 2000) + " = 1", "nested too deep"),
        ("a = " + "9" * 400, "a: an integer beyond 1e+15"),
        ("a = " + "9" * 4301, "Exceeds the limit"),
        ("a = 1e308", "a: 1e+308: no quantity of a ship"),
        ("a = [1.0, -1e-101]", "a.1: -1e-101: no quantity of a ship"),
        ('a = "\\u001b[2J"', "a: text with a control character"),
        ('"\\u0007" = 1', "a name with a control character"),
    ],
)
def test_values_that_no_document_holds(text: str, remedy: str, tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_text(text)
    with pytest.raises(DocumentError) as caught:
        documents.read_document(file)
    line = str(caught.value)
    assert remedy.replace("\\\\", "\\") in line
    assert line.isprintable()


@pytest.mark.parametrize("value", [Decimal(3), {1}, b"x", object])
def test_objects_that_toml_has_not(value: Any) -> None:
    with pytest.raises(DocumentError, match=r"^a\.1: a \w+: give a number, a text, true or false, a list or a table$"):
        documents.check_values({"a": [1, value]}, None)


@pytest.mark.parametrize("value", ["inf", "-0.0", "1e24", "1e-100", "999999999999999", '"a\\n\\tb"', "[[[1]]]", "true"])
def test_values_that_documents_hold(value: str, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(f"a = {value}")
    assert "a" in documents.read_document(tmp_path / "a.toml")


def test_what_has_no_end_is_no_document() -> None:
    with pytest.raises(DocumentError, match="a device or a pipe"):
        documents.read_document("/dev/zero")


def test_names_are_as_short_as_is_clear() -> None:
    one_letter = ["inertia.m", "thruster.port.K_T.J", "hull.mmg.R_0"]
    assert documents.short_names(one_letter) == ("inertia.m", "K_T.J", "R_0")
    two_of_a_name = ["hull.derivatives.Y_v", "port.D_p", "starboard.D_p"]
    assert documents.short_names(two_of_a_name) == ("Y_v", "port.D_p", "starboard.D_p")


def test_a_name_that_is_too_long_is_no_file() -> None:
    with pytest.raises(DocumentError, match="no such file"):
        documents.find_document("a" * 300 + ".toml", "models")
