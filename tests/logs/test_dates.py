"""Dates and times of day in every way in which logs have them, and moments as dates."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DataError
from shipid.logs.dates import date_texts, format_date, format_moment, format_span, parse_dates, read_days, time_texts
from shipid.logs.guess.sniff import recognise_log
from shipid.logs.importing import import_log, read_mapping
from tests.logs.conftest import T, import_written, mapping_with

DATED = ('from = "time"', 'from = "time"\nunit = "date"')


def test_dates(log: pd.DataFrame, tmp_path: Path) -> None:
    since = pd.Timestamp("2022-10-27T08:00:00Z")
    log = log.assign(time=[(since + pd.Timedelta(seconds=t)).isoformat() for t in log["time"]])
    frame = import_written(mapping_with(tmp_path, "", DATED), log, tmp_path).frame
    np.testing.assert_allclose(frame["t"] - 1666857600.0, T, atol=1e-5)  # date -u -d 2022-10-27T08:00 +%s


@pytest.mark.parametrize(
    ("style", "unix"),
    [
        ("%d.%m.%Y %H:%M:%S.%f", True),
        ("%Y/%m/%d %H:%M:%S.%f", True),
        ("%Y-%m-%d %H:%M:%S.%f", True),
        ("%d.%m.%y %H:%M:%S.%f", True),
        ("%d/%m/%Y %H:%M:%S.%f", True),
        ("%m/%d/%Y %H:%M:%S.%f", True),
        ("%m/%d/%Y %I:%M:%S.%f %p", True),
        ("%d-%m-%Y %I:%M:%S.%f %p", True),
        ("%d-%b-%Y %H:%M:%S.%f", True),
        ("%d %b %Y %H:%M:%S.%f", True),
        ("%y/%m/%d %H:%M:%S.%f", True),
        ("%d/%m/%Y, %H:%M:%S.%f", True),
        ("%m/%d/%Y, %I:%M:%S.%f %p", True),
        ("%Y%m%d%H%M%S.%f", True),
        ("%Y%m%d%H%M%S%f", True),
        ("%Y%m%d_%H%M%S.%f", True),
        ("%Y%m%d %H:%M:%S.%f", True),
        ("%Y:%j:%H:%M:%S.%fZ", True),
        ("%d/%m/%YT%H:%M:%S.%f", True),
        ("%Y-%m-%d %H:%M:%S.%f UTC", True),
        ("%d.%m.%Y %H:%M:%S.%f GMT", True),
        ("%H:%M:%S.%f UTC", False),
        ("%H:%M:%S.%f", False),
        ("%I:%M:%S.%f %p", False),
    ],
)
def test_dates_as_they_are_written(style: str, unix: bool) -> None:
    """From a minute before midnight; a time of day goes on after it."""
    moments = pd.Timestamp("2022-10-26T23:59:30.5") + pd.to_timedelta(T, "s")
    times = parse_dates(pd.Series(moments.strftime(style)))
    np.testing.assert_allclose(times, T + (1666828770.5 if unix else 86370.5), atol=1e-5)


@pytest.mark.parametrize("kind", ["int64", "float64"])
def test_dates_in_one_number(kind: str) -> None:
    moments = pd.Timestamp("2022-10-26T23:59:30") + pd.to_timedelta(np.arange(90), "s")
    times = parse_dates(pd.Series(moments.strftime("%Y%m%d%H%M%S").astype("int64").astype(kind)))
    assert times.tolist() == (1666828770 + np.arange(90)).tolist()


TWICE = {
    "date": "%Y-%m-%d %H:%M:%S.%f",
    "time of day": "%H:%M:%S.%f",
    "time of day, of twelve hours": "%I:%M:%S.%f %p",
    "hhmmss": "%H%M%S.%f",
    "whole minutes": "%H:%M",
}


@pytest.mark.parametrize("name", TWICE)
def test_an_hour_that_occurs_twice_is_refused(name: str, log: pd.DataFrame, tmp_path: Path) -> None:
    """Half a minute before the clocks of Berlin were set back to half a minute after."""
    style = TWICE[name]
    moments = pd.Timestamp("2024-10-27T00:59:30Z").tz_convert("Europe/Berlin") + pd.to_timedelta(T, "s")
    unit = "hhmmss" if name == "hhmmss" else "date"
    mapping = mapping_with(tmp_path, "", ('from = "time"', f'from = "time"\nunit = "{unit}"\nevery = 0.5'))
    message = "goes back from .*if it is local time, write UTC"
    with pytest.raises(DataError, match=message) as caught:
        import_written(mapping, log.assign(time=moments.strftime(style)), tmp_path)
    assert caught.value.path == "row 61"
    if name != "hhmmss":  # numbers that go back may be anything
        with pytest.raises(DataError, match=message) as caught:
            recognise_log(tmp_path / "log.csv")


@pytest.mark.parametrize("style", ["%d/%m/%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S"])
def test_of_day_and_month_that_is_taken_with_which_the_log_is_short(style: str) -> None:
    """From 5 June to 6 June, not from 6 May; and where nothing decides, the day comes first."""
    moments = pd.Timestamp("2025-06-05T23:59:00") + pd.to_timedelta(10.0 * np.arange(20), "s")
    times = parse_dates(pd.Series(moments.strftime(style)))
    np.testing.assert_allclose(np.diff(times), 10.0)
    one_day = parse_dates(pd.Series(["05/06/2025 10:00:00", "05/06/2025 10:00:01"]))
    assert format_date(one_day[0]) == "2025-06-05 10:00:00"
    assert format_date(times[0]) == "2025-06-05 23:59:00"


@pytest.mark.parametrize("damaged", ["08:06:99", "08:75:00", "25:10:00", "24:00:00", "08:00:61"])
@pytest.mark.parametrize("day", ["14.05.2024 ", ""])
def test_a_time_of_day_that_no_clock_shows_is_none(day: str, damaged: str) -> None:
    texts = pd.Series([f"{day}08:0{minute}:00" for minute in range(5)] + [day + damaged])
    assert np.isfinite(parse_dates(texts)).tolist() == [True] * 5 + [False]


def test_a_day_of_six_digits_is_no_date_alone() -> None:
    """131221 was the year 1312."""
    assert np.isnan(parse_dates(pd.Series(["131221 10:53:18", "131221 10:53:19"]))).all()


def test_noon_and_midnight_of_twelve_hours() -> None:
    texts = ["12:00:00 AM", "12:30:00 am", "1:00:00 AM", "12:00:00 PM", "12:15:00PM", "11:59:59 pm"]
    np.testing.assert_allclose(parse_dates(pd.Series(texts)), [0, 1800, 3600, 43200, 44100, 86399])


@pytest.mark.parametrize("zone", ["Z", "-0330"])
def test_a_date_without_a_zone_beside_others_with_one_is_refused(zone: str, log: pd.DataFrame, tmp_path: Path) -> None:
    """As UTC it would be hours off; with no zone anywhere every row is UTC."""
    moments = (pd.Timestamp("2024-05-14T08:00:00") + pd.to_timedelta(log["time"], "s")).dt.strftime(
        "%Y-%m-%dT%H:%M:%S.%f"
    )
    zoned = moments + zone
    assert np.isfinite(parse_dates(zoned)).all()
    assert np.isfinite(parse_dates(moments)).all()
    zoned[3] = moments[3]
    with pytest.raises(DataError, match=f"{moments[3]}' has no time zone, while other rows have one") as caught:
        import_written(mapping_with(tmp_path, "", DATED), log.assign(time=zoned), tmp_path)
    assert caught.value.path == "row 4"


@pytest.mark.parametrize("text", ["14.05.2024 08:00:00 +02:00", "1715731140.5", "080000", "2024-05-14:08:00"])
def test_a_time_that_cannot_be_read_is_shown(text: str, log: pd.DataFrame, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=rf"'{re.escape(text)}' is no date or time of day .* unit = \"s\"") as caught:
        import_written(mapping_with(tmp_path, "", DATED), log.assign(time=text), tmp_path)
    assert caught.value.path == "row 1"


def test_dates_in_columns_of_numbers() -> None:
    """What is no month, day or whole number is no date; two digits of a year are of 1969 to 2068."""
    year, month, day = [2024.0, 24.0, 68.0, 69.0, 2024.0, 2024.0, 2024.0, 2024.0], [12.0] * 8, [31.0] * 8
    month[4], day[5], day[6], year[7] = 13.0, 32.0, 1.5, np.nan
    texts = date_texts([np.array(one) for one in (year, month, day)])
    days = read_days(pd.concat([texts.iloc[:4], texts]))  # most of them can be read
    moments = [*["2024-12-31", "2024-12-31", "2068-12-31", "1969-12-31"] * 2, None, None, None, None]
    np.testing.assert_array_equal(days, (pd.to_datetime(moments) - pd.Timestamp(0)).total_seconds())
    of_year = read_days(date_texts([np.array([2024.0, 2024.0, 2024.0]), np.array([1.0, 366.0, 367.0])]))
    np.testing.assert_array_equal(of_year, [1704067200.0, 1735603200.0, np.nan])


def test_times_of_day_in_columns_of_numbers() -> None:
    """A leap second is the first of the next minute; hour 24, minute 60 and second 61 are none."""
    hour, minute, second = [23.0, 0.0, 24.0, 0.0, 0.0], [59.0, 7.0, 0.0, 60.0, 0.0], [59.25, 60.0, 0.0, 0.0, 61.0]
    texts = time_texts([np.array(one) for one in (hour, minute, second)])
    assert texts.fillna("").tolist() == ["23:59:59.250000", "00:08:00.000000", "", "", ""]
    assert time_texts([np.array([8.0]), np.array([5.0])]).tolist() == ["08:05:00.000000"]


DAYS = ("%Y%m%d", "%d%m%Y", "%d%m%y", "%y%m%d", "day of Excel")


@pytest.mark.parametrize(("numbers", "time"), [(True, "%H%M%S"), (False, "%H:%M:%S")])
@pytest.mark.parametrize("day", DAYS)
def test_a_date_in_one_number_beside_a_time_of_day(
    day: str, time: str, numbers: bool, log: pd.DataFrame, tmp_path: Path
) -> None:
    """Two sessions on two days, drawn: a day goes over, and numbers lose their leading zeros."""
    random = np.random.default_rng([DAYS.index(day), numbers])
    first = pd.Timestamp("2024-01-01") + pd.Timedelta(days=int(random.integers(0, 360)), seconds=86_385)
    later = np.where(np.arange(len(T)) < 60, 0, int(random.integers(3, 9)) * 86_400 - 3_600)
    moments = pd.Series(first + pd.to_timedelta(10 * T + later, unit="s"))
    days, times = moments.dt.strftime(day), moments.dt.strftime(time)
    if day == "day of Excel":
        since = (moments - pd.Timestamp("1899-12-30")) / pd.Timedelta("1D")
        days, times = np.floor(since).astype(int), (since % 1).round(12)
    log = log.assign(Date=days.astype(int) if numbers else days)
    log["time"] = times.astype(int) if numbers and time == "%H%M%S" and day != DAYS[-1] else times
    log.to_parquet(tmp_path / "log.parquet") if numbers else log.to_csv(tmp_path / "log.csv", index=False)
    file, form = (tmp_path / "log.parquet", 'kind = "parquet"') if numbers else (tmp_path / "log.csv", "")
    since = (moments - pd.Timestamp(0)) / pd.Timedelta("1s")
    mapping = mapping_with(tmp_path, form, ('from = "time"', 'from = "time"\nunit = "date"\ndate = "Date"'))
    np.testing.assert_allclose(import_log(read_mapping(mapping), file).frame["t"], since, atol=1e-5)
    sniffed = recognise_log(file)
    assert sniffed.clock == {"from": "time", "unit": "date", "date": "Date"}
    np.testing.assert_allclose(sniffed.t, since, atol=1e-5)


def test_times_of_day_that_go_back_are_of_the_next_day() -> None:
    """Trials of three days in one file, each from eight in the morning; a minute back is an error, and stays one."""
    hours = pd.Series(["08:00:00", "11:30:00", "08:15:00", "16:00:00", "08:05:00", "08:04:00"])
    times = parse_dates(hours)
    np.testing.assert_allclose(np.diff(times) / 3600, [3.5, 20.75, 7.75, 16 + 5 / 60, -1 / 60])


def test_a_moment_and_its_date() -> None:
    text = "2022-11-30 09:15:02"
    t = float(parse_dates(pd.Series([text]))[0])
    assert format_date(t) == text
    assert format_moment(t) == f"{text} UTC"
    assert format_span(t, t + 60.0) == f"{text} to 2022-11-30 09:16:02 UTC"


@pytest.mark.parametrize("t", [-5.0, 12.5, 9.99e7, 1e13, float("nan")])
def test_a_moment_without_a_date_is_seconds(t: float) -> None:
    """A damaged clock too: no date is beyond the year 9999."""
    assert format_moment(t) == f"{t:.10g} s"
    assert format_span(0.0, t) == f"0 to {t:.10g} s"
    assert format_span(t, 1.7e9).endswith(" s")


@pytest.mark.parametrize("style", ["%d.%m.%Y %H:%M:%S.%f", "%m/%d/%Y %I:%M:%S.%f %p", "%Y-%m-%d %I:%M:%S.%f %p"])
def test_whole_seconds_may_be_written_without_a_fraction(style: str) -> None:
    moments = pd.Timestamp("2024-02-01T10:00:00") + pd.to_timedelta(np.arange(1200) / 10, "s")
    texts = pd.Series(moments.strftime(style)).str.replace(".000000", "", regex=False)
    times = parse_dates(texts)
    np.testing.assert_allclose(np.diff(times), 0.1, atol=1e-5)
    np.testing.assert_array_equal(parse_dates(texts.astype("category")), times)
