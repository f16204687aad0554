"""Judge the guess on raw folders of made-up teams, by what every column truly is."""

from __future__ import annotations

from typing import Any

import numpy as np

from shipid.errors import ShipidError
from shipid.logs.guess.clues import LIKELY, Clue, Suggestion
from shipid.logs.guess.columns import Guess, guess
from shipid.logs.guess.defects import OTHER
from shipid.logs.guess.draft import ENABLED, draft_text
from shipid.logs.importing import import_log
from shipid.logs.mapping import read_mapping, to_si
from tests.logs.drawn_logs import Verdict
from tests.strangers_raw import RawColumn, RawStranger

OFF_SCALE, OFF_ANGLE = 0.03, 5.0  # relative; deg
LATE, ARM, TURNED, FACTOR = 0.6, 0.15, 3.0, 0.05  # s, of the length, deg, relative: of repairs that are switched on
FIXED = {"latitude": "lat", "longitude": "lon", "u": "u", "v": "v", "r": "r", "speed": "sog", "course": "cog"}
SHARES = ("%", "us", "share")  # units of commands
MIRRORED = {"east", "psi", "r", "v"}  # change sign where a frame is taken for its mirror image


def judge_raw(stranger: RawStranger, **known: Any) -> Verdict:
    """Guess with what people know, import as drafted, compare every column and the runs with the truth."""
    try:
        guessed = guess(stranger.folder, **known)
    except ShipidError as error:
        return Verdict("reported", (f"refused: {error.message}",))
    file = stranger.folder.parent / f"{stranger.folder.name}-draft.toml"
    file.write_text(draft_text(guessed), encoding="utf-8")
    try:
        names = import_log(read_mapping(file), guessed.file).runs
    except ShipidError as error:
        return Verdict("reported", (f"not imported: {error.path or ''}: {error.message}",))
    wrong = [*_columns(guessed, stranger), *_repairs(guessed, stranger), *_runs(guessed, stranger, len(names))]
    if not wrong:
        return Verdict("right", ())
    word = "reported" if all(seen for seen, _ in wrong) else "silent"
    return Verdict(word, tuple(f"{seen or 'SILENT'}: {reason}" for seen, reason in wrong))


def _columns(guessed: Guess, stranger: RawStranger) -> list[tuple[str, str]]:
    """What is wrong with the columns, and how the draft says so.

    "asked" where a question names the right column or unit, or is about a sign; "doubted" where one is about something
    else of this column, or it is only unsure; "missing" where it is not read; empty where nothing is said.
    """
    units = {column.header: column for column in stranger.columns}
    asked = {
        name: " ".join(question.sentence for question in guessed.questions if name in question.about)
        for name in {name for question in guessed.questions for name in question.about}
    }
    parts = guessed.sniffed.in_parts  # a position that its letters alone say has the name of its column in front
    drafted = {
        column.name: (
            column,
            _truth(
                units,
                (parts.get(column.source) or (column.source,))[0]
                if len(parts.get(column.source, "1")) == 1
                else column.source,
            ),
        )
        for column in guessed.columns
    }
    psi, psi_true = drafted["psi"]
    mirror = _product(psi, psi_true) < 0
    wrong: list[tuple[str, str]] = []
    if mirror:
        wrong.append(("asked" if set(asked) & {"psi", "north", "east"} else "", "the frame is mirrored"))
    for name, (column, true) in drafted.items():
        fault = _fault(name, column, true, mirror)
        if not fault:
            continue
        said = " ".join(asked[one] for one in {name, name.rpartition(".")[2]} & asked.keys())
        if fault.startswith("from"):
            fits = [one for one in stranger.columns if not _fault(name, column, one, mirror).startswith("from")]
            right = {one.header for one in fits}
        else:
            right = {true.unit} if true is not None and "times" in fault and "times -" not in fault else set()
        word = "asked" if said and (not right or any(one in said for one in right)) else "doubted"
        wrong.append((word if said or column.confidence < LIKELY else "", f"{name}: {fault}"))
    present = {column.signal.removeprefix("actual.") for column in stranger.columns}
    read = {
        one.removeprefix("actual.")
        for _, true in drafted.values()
        if true is not None
        for one in (true.signal, *true.also)
    }
    commands = sorted(signal for signal in present if signal.endswith((".delta", ".n", ".alpha")))
    for signal in (one for one in commands if one not in read):
        headers = [one.header for one in stranger.columns if one.signal.removeprefix("actual.") == signal]
        named = any(header in asked.get(signal.rpartition(".")[2], "") for header in headers)
        wrong.append(("asked" if named else "missing", f"{signal} is not read"))
    if "r" in present and "r" not in drafted:
        wrong.append(("missing", "r is not read"))
    if {"sog", "cog"} <= present and not {"speed", "u"} & set(drafted):
        wrong.append(("missing", "speed and course are not read"))
    if {"u", "v"} <= present and not {"speed", "u"} & set(drafted):
        wrong.append(("missing", "u and v are not read"))
    return wrong


def _truth(units: dict[str, RawColumn], source: str) -> RawColumn | None:
    """The true column: its header, or its header with the unit of the row below in brackets."""
    found = units.get(source) or units.get(source.rpartition(" [")[0])
    return found or next((one for header, one in units.items() if source.startswith(f"{header} [")), None)


def _product(column: Suggestion, true: RawColumn | None) -> float:
    """Imported value over the true one, 1 if unit and sign are right."""
    if true is None:
        return 0.0
    factor = float(column.extra.get("sign", 1)) * float(column.extra.get("factor", 1.0))
    if curve := column.extra.get("curve"):
        factor *= float(np.sign(curve[-1][1] - curve[0][1]))
    return float(factor * to_si(column.unit, column.name) * true.scale)


def _fault(name: str, column: Suggestion, true: RawColumn | None, mirror: bool) -> str:
    """What is wrong with one column of the draft; empty if nothing is."""
    if true is None:
        return f"from {column.source!r}, which is not in the files"
    signals = {one.removeprefix("actual.") for one in (true.signal, *true.also)}
    kind = name.rpartition(".")[2]
    if name == "V_w":
        return "" if true.signal in ("aws", "tws", "V_w") else f"from {column.source!r}"
    if name == "beta_w":
        relative = true.signal in ("awa", "twa")
        fits = relative == bool(column.extra.get("relative")) and true.signal in ("awa", "twa", "wind_from")
        return "" if fits else f"from {column.source!r}"
    if kind in ("thrust", "torque"):
        if not true.signal.startswith(f"{kind}."):
            return f"from {column.source!r}, which is {true.signal or 'nothing'}"
        wanted = 1.0
    elif "." in name:
        side = next((side for side in ("port", "starboard") if name.startswith(side)), "")
        of_side = not side or any(one.startswith(side) for one in signals) or len(signals) > 1
        if not of_side or not any(one.endswith(f".{kind}") for one in signals):
            return f"from {column.source!r}, which is {true.signal or 'nothing'}"
        wanted = -1.0 if mirror and kind in ("delta", "alpha") else 1.0
        if any(one.startswith("bow.") for one in signals) != name.startswith("bow"):
            return f"from {column.source!r}, which is {true.signal}"
    else:
        earth = column.extra.get("frame") == "earth"
        expected = {"u": "vn", "v": "ve"}.get(name, name) if earth else FIXED.get(name, name)
        if true.signal != expected:
            return f"from {column.source!r}, which is {true.signal or 'nothing'}"
        wanted = -1.0 if mirror and name in MIRRORED else 1.0
    product = _product(column, true)
    if name in ("phi", "theta", "p", "q", "w", "z"):  # their sign is not known from the log
        product, wanted = abs(product), 1.0
    if true.unit in SHARES:  # the log does not say what all of it is
        product = float(np.sign(product))
    if abs(product - wanted) > OFF_SCALE:
        return f"from {column.source!r}, times {product:.3g} in place of {wanted:g}"
    if name == "psi":
        turn = float(column.extra.get("sign", 1)) * true.offset + float(column.extra.get("offset", 0.0))
        off = float(np.degrees(np.angle(np.exp(1j * turn * to_si(column.unit, "psi")))))
        return f"turned by {off:.1f} deg" if abs(off) > OFF_ANGLE else ""
    return ""


def _repairs(guessed: Guess, stranger: RawStranger) -> list[tuple[str, str]]:
    """Repairs that are switched on and mend what was not broken; of two that are late, what is between them counts."""
    on = [one for one in guessed.findings if one.repair is not None and one.confidence >= ENABLED]
    late = {one.repair["signal"]: one.repair["seconds"] for one in on if one.repair and one.repair["kind"] == "latency"}
    return [("", fault) for finding in on if (fault := _needless(finding, guessed, stranger, late))]


def _needless(finding: Clue, guessed: Guess, stranger: RawStranger, delays: dict[str, float]) -> str:
    repair: dict[str, Any] = finding.repair or {}
    units = {column.header: column for column in stranger.columns}
    used = {column.name: _truth(units, column.source) for column in guessed.columns}

    def late(*names: str) -> float:
        found = [one.late + one.held / 2 for name in names if (one := used.get(name)) is not None]
        return float(np.mean(found)) if found else 0.0

    match repair["kind"]:
        case "latency":
            place, moves = late("north", "east", "latitude"), late("u", "speed", "v", "course")
            wanted = {"position": place, "velocity": moves, "heading": late("psi"), "yaw rate": late("r")}
            base = {"position": moves, "velocity": place, "heading": late("r"), "yaw rate": late("psi")}
            due = wanted[repair["signal"]] - base[repair["signal"]]
            off = repair["seconds"] - delays.get(OTHER[repair["signal"]], 0.0) - due
            return f"latency of {repair['signal']} off by {off:.2g} s" if abs(off) > LATE else ""
        case "scale":
            off = repair["factor"] - 1
            return f"{repair['columns']} times {repair['factor']}" if abs(off) > FACTOR else ""
        case "heading_offset":
            turn = np.degrees(repair["offset"])
            return f"heading turned by {turn:.1f} deg" if abs(turn) > TURNED else ""
        case "lever_arm":
            sensors = [one.at for name in ("north", "latitude") if (one := used.get(name)) is not None]
            moving = [one.at for name in ("u", "speed") if (one := used.get(name)) is not None]
            if sensors and moving:
                off = repair["x"] - (sensors[0] - moving[0])
                if abs(off) > ARM * float(stranger.known["length"]):
                    return f"lever arm {off:+.1f} m off"
    return ""


def _runs(guessed: Guess, stranger: RawStranger, count: int) -> list[tuple[str, str]]:
    """Whether there are as many runs as in the files that were read; files left out are named in the draft."""
    out = [one for one in stranger.files if one.path in guessed.source.skipped]
    wrong = [("missing", f"{len(out)} of {len(stranger.files)} files are left out")] if out else []
    wanted = sum(len(one.runs) for one in stranger.files if one not in out)
    if wanted and count != wanted:
        wrong.append(("", f"{count} runs in place of {wanted}"))
    return wrong
