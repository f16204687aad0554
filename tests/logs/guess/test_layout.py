"""How logs are written that nobody has seen: encodings, separators, headers, marks of thousands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DataError
from shipid.logs.formats import TextFormat
from shipid.logs.guess.sniff import recognise_log
from shipid.logs.guess.words import name_parts
from shipid.logs.readers import read_log_table
from tests.logs.guess.conftest import TABLE, T, log_of, sniff, text


@pytest.mark.parametrize(
    ("content", "form"),
    [
        (text(), {"separator": ",", "decimal": ".", "skip_rows": 0}),
        (text(";"), {"separator": ";", "decimal": "."}),
        (text(";", ","), {"separator": ";", "decimal": ","}),
        (text("\t"), {"separator": "\t"}),
        (
            "\n".join(",".join(f'"{cell}"' for cell in line.split(";")) for line in text(";", ",").splitlines()),
            {"separator": ",", "decimal": ","},
        ),
        (text(above="Trial of the ship\nof last May\n"), {"separator": ",", "skip_rows": 2}),
        (
            "s,m,deg\n".join(text().split("\n", 1)).replace("psis", "psi\ns"),
            {"skip_rows": 2, "names": ["time [s]", "N [m]", "psi [deg]"]},
        ),
        (
            text(" ", above="# by numpy.savetxt\n# time N psi\n", header=False),
            {"separator": "whitespace", "skip_rows": 2, "names": ["time", "N", "psi"]},
        ),
        (
            text("\t", above="%\ttime\tN\tpsi\n%\ts\tm\tdeg\n", header=False),
            {"skip_rows": 2, "names": ["time [s]", "N [m]", "psi [deg]"]},
        ),
        (
            text("\t", above="% time N psi\n% s m deg\n", header=False),
            {"skip_rows": 2, "names": ["time [s]", "N [m]", "psi [deg]"]},
        ),
        (text(above="# time,N,psi\n", header=False), {"skip_rows": 0}),
        (
            text(" ", above="# time [s] N [m] psi [deg]\n", header=False),
            {"skip_rows": 1, "names": ["time[s]", "N[m]", "psi[deg]"]},
        ),
    ],
)
def test_a_text_log_is_recognised(content: str, form: dict[str, object], tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text(content)
    sniffed = recognise_log(file)
    assert sniffed.form.items() >= form.items()
    np.testing.assert_allclose(sniffed.t, T)
    assert [name_parts(name) for name in sniffed.columns] == [("n",), ("psi",)]
    np.testing.assert_allclose(list(sniffed.columns.values()), [1.5 * T, 30.0 + T])


def test_a_log_without_a_header_has_numbers_or_the_names_that_are_given(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text(text(header=False))
    numbered = recognise_log(file)
    assert numbered.form["header"] is False
    assert all(name.isdecimal() for name in numbered.columns)
    assert list(recognise_log(file, ("clock", "N", "psi")).columns) == ["N", "psi"]


@pytest.mark.parametrize(
    ("encoding", "expected"),
    [("utf-8", "utf-8"), ("utf-8-sig", "utf-8-sig"), ("cp1252", "cp1252"), ("utf-16", "utf-16")],
)
def test_encodings(encoding: str, expected: str, tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_bytes(text(table=TABLE.rename(columns={"psi": "psi [°]"})).encode(encoding))
    sniffed = recognise_log(file)
    assert sniffed.form["encoding"] == expected
    assert "psi [°]" in sniffed.columns


@pytest.mark.parametrize(
    ("names", "encoding"),
    [
        (("時刻", "船首方位", "舵角"), "cp932"),
        (("时间", "艏向", "舵角"), "gb18030"),
        (("시간", "선수방위", "타각"), "cp949"),
        (("Время", "Курс", "Угол руля"), "cp1251"),
        (("時刻", "船首方位", "舵角"), "utf-8"),
    ],
)
def test_encodings_of_other_scripts(names: tuple[str, ...], encoding: str, tmp_path: Path) -> None:
    table = TABLE.set_axis(names, axis=1)
    (tmp_path / "log.csv").write_bytes(text(table=table).encode(encoding))
    sniffed = recognise_log(tmp_path / "log.csv")
    assert (sniffed.form["encoding"], sniffed.clock["from"]) == (encoding, names[0])
    assert tuple(sniffed.columns) == names[1:]
    pd.testing.assert_frame_equal(
        read_log_table(tmp_path / "log.csv", TextFormat(encoding=encoding), names[0]), table.astype(str)
    )


@pytest.mark.parametrize("last", ["°C", "°", "C°C "])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_an_encoding_does_not_depend_on_the_last_letters(last: str, end: str, tmp_path: Path) -> None:
    """Four bytes were cut off, perhaps in a letter of two: a log in utf-8 that ends so was taken for cp1252."""
    lines = text(table=TABLE.assign(unit=last)).splitlines()
    (tmp_path / "log.csv").write_bytes((end.join(lines) + end).encode())
    assert recognise_log(tmp_path / "log.csv").form["encoding"] == "utf-8"


def test_a_separator_between_quotes_is_part_of_a_name(tmp_path: Path) -> None:
    """Such a header was taken for no header, and columns were called by their numbers."""
    names = ["time", "Rudder angle [deg, + port]", "x, y", "n"]
    rows = "".join(f"{t},{t % 7},1.5,{t * t}\n" for t in range(50))
    header = ",".join(f'"{name}"' if "," in name else name for name in names)
    (tmp_path / "log.csv").write_text(f"{header}\n{rows}")
    sniffed = recognise_log(tmp_path / "log.csv")
    assert list(sniffed.columns) == names[1:]
    assert "header" not in sniffed.form


POSITIONS = {
    "letter before": "{letter} {degrees} {minutes:07.4f}",
    "seconds": "{degrees}°{whole}'{seconds:06.3f}\"{letter}",
}


@pytest.mark.parametrize("separator", ["\t", ","])
@pytest.mark.parametrize(("style", "others"), [("letter before", 1), ("seconds", 6)])
def test_blanks_in_positions_separate_nothing(style: str, separator: str, others: int, tmp_path: Path) -> None:
    """With tabs between the columns, the minutes were read as the position; with commas, few columns as no table."""
    draw = np.random.default_rng([*style.encode(), others])
    places = np.array([63.44, 10.4]) + np.cumsum(draw.normal(0.0, 1e-5, (80, 2)), axis=0)
    lines = [separator.join(["Time", "Lat", "Lon", *(f"value {k}" for k in range(others))])]
    for k, pair in enumerate(places):
        written = []
        for angle, letter, digits in zip(pair, "NE", (2, 3), strict=True):
            minutes = angle % 1 * 60
            parts = {"letter": letter, "degrees": f"{int(angle):0{digits}d}", "minutes": minutes}
            parts |= {"whole": int(minutes), "seconds": minutes % 1 * 60}
            written.append(POSITIONS[style].format(**parts))
        lines.append(separator.join([f"2024-05-14 08:0{k // 60}:{k % 60:02d}", *written, *["1.5"] * others]))
    file = tmp_path / "log.csv"
    file.write_text("Trial of the ship, 14 May\n\n" + "\n".join(lines) + "\n")
    sniffed = recognise_log(file)
    assert sniffed.form["separator"] == separator
    assert "header" not in sniffed.form
    np.testing.assert_allclose(np.stack([sniffed.columns["Lat"], sniffed.columns["Lon"]]).T, places, atol=1e-6)


def test_the_header_again_and_lines_of_words_are_left_out(tmp_path: Path) -> None:
    lines = ["time,north,heading", *(f"{k},{2 * k},0.1" for k in range(60))]
    file = log_of(tmp_path, [*lines[:20], "# zigzag", *lines[20:40], lines[0], *lines[40:]])
    sniffed = recognise_log(file)
    assert sniffed.form["ragged"] == "drop"
    assert sniffed.notes == (
        "lines that repeat the header or have another number of cells are left out: 2, the first is line 21",
    )
    np.testing.assert_array_equal(sniffed.t, np.arange(60.0))
    with pytest.raises(DataError, match="repeats the header: remove the line") as caught:
        read_log_table(log_of(tmp_path, [*lines[:40], lines[0], *lines[40:]]), TextFormat(), "time")
    assert caught.value.path == "line 41"


@pytest.mark.parametrize(
    ("above", "names"),
    [
        ("time,GPS,\n,N,psi\n", ["time", "GPS N", "GPS psi"]),
        ("time,GPS,\n,North,Heading\ns,m,deg\n", ["time [s]", "GPS North [m]", "GPS Heading [deg]"]),
        ("time,North,Heading\nT01,AI02,AI03\n", ["time", "North", "Heading"]),
        ("T01,AI02,AI03\ntime,North,Heading\n", None),
        ("time,Wind,Wind\n,Speed,Direction\n", ["time", "Wind Speed", "Wind Direction"]),
        ("time,North,Heading\ns,m,deg\nDOUBLE,DOUBLE,DOUBLE\n", ["time [s]", "North [m]", "Heading [deg]"]),
        ("s,m,deg\ntime,North,Heading\n", ["time [s]", "North [m]", "Heading [deg]"]),
        ("Trial,Ada,\ntime,North,Heading\n", None),
    ],
)
def test_names_in_several_lines(above: str, names: list[str] | None, tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text(text(above=above, header=False))
    sniffed = recognise_log(file)
    assert sniffed.form.get("names") == names
    assert [sniffed.clock["from"], *sniffed.columns] == (names or ["time", "North", "Heading"])
    np.testing.assert_allclose(list(sniffed.columns.values()), [1.5 * T, 30.0 + T])


@pytest.mark.parametrize(
    ("decimal", "mark", "separator"),
    [
        (".", ",", ";"),
        (".", "'", ","),
        (",", "\u00a0", "\t"),
        (".", ",", ","),
    ],
)
@pytest.mark.parametrize("digits", [0, 2])
def test_marks_of_thousands_are_read(decimal: str, mark: str, separator: str, digits: int, tmp_path: Path) -> None:
    """Also of whole numbers, as 1,800 rpm, where the positions show which sign is the decimal one."""

    def written(value: float) -> str:
        text = f"{value:,.{digits}f}"
        return text.replace(",", "#").replace(".", decimal).replace("#", mark)

    large = np.round(7_034_120.4 + 97.3 * T * (-1) ** np.arange(len(T)), digits) if digits else np.round(1800 + 3 * T)
    table = TABLE.assign(lat=63.4399978 + 1e-5 * T, N=[written(one) for one in large])
    sniffed = sniff(tmp_path, table, sep=separator, decimal=decimal)
    assert sniffed.form.items() >= {"decimal": decimal, "thousands": mark, "separator": separator}.items()
    np.testing.assert_allclose(sniffed.columns["N"], large)
    np.testing.assert_allclose(sniffed.columns["lat"], table["lat"])


@pytest.mark.parametrize("decimal", [".", ","])
def test_three_decimals_are_no_groups(decimal: str, tmp_path: Path) -> None:
    """1,800 is 1.8 where nothing in the log says that it is 1800."""
    table = TABLE.assign(time=TABLE["time"] + 1.0)
    sniffed = sniff(tmp_path, table, sep=";", decimal=decimal, float_format="%.3f")
    assert "thousands" not in sniffed.form
    np.testing.assert_allclose(list(sniffed.columns.values()), [1.5 * T, 30.0 + T])
