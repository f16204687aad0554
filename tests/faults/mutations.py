"""Mutations of TOML documents, drawn by seed: values that no one expects, and text that is no TOML any more."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from pathlib import Path

from shipid.document import bundled_documents

NASTY = [
    *("1979-05-27", "07:32:00", "1979-05-27T07:32:00Z", "1979-05-27T07:32:00", "true", "false", "nan", "inf", "-inf"),
    *("0", "-0.0", "-1", "0.5", "1e308", "-1e308", "1e-308", "5e-324", "1e30", "1e-9", "9223372036854775807"),
    *("9" * 25, "9" * 400, "9" * 4300, "9" * 5000, "-" + "9" * 400, "0x" + "f" * 300, "1e400", "1e-400"),
    *('""', '" "', '"nan"', '"1"', '"a/b"', '"../../x"', '"' + "n" * 245 + '"', '"' + "x" * 100_000 + '"'),
    *(
        '"\\u001b[2J\\u001b[31mred"',
        '"\\u0000"',
        '"\\u202eabc"',
        '"\\n\\r\\t"',
        '"\\U0001F6A2"',
        '"*"',
        '"[order >= 3]"',
    ),
    *("[]", "[[]]", "{}", "[{}]", "[1]", "[1, 2, 3]", "[3, 1]", '["a", 1]', "[nan, 1]", "[-50, 1e30]", "[1e-9, 1e-9]"),
    *("[" * 60 + "]" * 60, "[" * 700 + "]" * 700, "{a=" * 60 + "1" + "}" * 60, "{a=" * 700 + "1" + "}" * 700),
    *('"/dev/zero"', '"/dev/null"', '"./"', '"/"', '"none"', '"gunnerus-28.9"', '"./x.toml"', "[" + "1," * 3000 + "]"),
    '{kind = "none"}',
]
"""Values as TOML."""

_LINE = re.compile(r"^(\s*)([A-Za-z0-9_.\"'|-]+)(\s*=\s*)(.+?)\s*$")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")


def of_a_value(text: str, rng: random.Random) -> str:
    """Another value for one key."""
    return _with_line(text, rng, lambda m: m[1] + m[2] + m[3] + rng.choice(NASTY))


def of_a_number(text: str, rng: random.Random) -> str:
    """One number in a unit that is not meant, or of the other sign."""
    factor = 10.0 ** rng.choice([-15, -9, -6, -3, 3, 6, 9, 15]) if rng.random() < 0.6 else rng.choice([-1.0, 0.0, 57.3])

    def scaled(match: re.Match[str]) -> str:
        places = list(_NUMBER.finditer(match[4]))
        if not places:
            return match[0]
        place = rng.choice(places)
        value = factor * float(place[0])
        return match[1] + match[2] + match[3] + match[4][: place.start()] + repr(value) + match[4][place.end() :]

    return _with_line(text, rng, scaled)


def of_a_key(text: str, rng: random.Random) -> str:
    """One key misspelt, quoted, dotted, or full of control characters."""
    other = [
        lambda key: key + "x",
        lambda key: f"{key}.{key}",
        lambda _: '"\\u001b[2J"',
        lambda _: '""',
        lambda _: "a" * 300,
    ]
    return _with_line(text, rng, lambda m: m[1] + rng.choice(other)(m[2]) + m[3] + m[4])


def without_a_line(text: str, rng: random.Random) -> str:
    """One line less."""
    lines = text.splitlines()
    del lines[rng.randrange(len(lines))]
    return "\n".join(lines)


def with_a_line_twice(text: str, rng: random.Random) -> str:
    """One line twice, or in another place."""
    lines = text.splitlines()
    lines.insert(rng.randrange(len(lines)), rng.choice(lines))
    return "\n".join(lines)


def with_a_block(text: str, rng: random.Random) -> str:
    """A block or a key that was not there."""
    names = [m[1] for m in re.finditer(r"^\[+([^\]\n]+)\]+", text, re.MULTILINE)] or ["a"]
    head = rng.choice(["[{}]", "[[{}]]", "[{}.x]", "[{}.source]"]).format(rng.choice(names))
    return f"{text}\n{head}\nkind = {rng.choice(NASTY)}\n"


def of_bytes(text: str, rng: random.Random) -> bytes:
    """Bytes changed, cut off, or added."""
    content = bytearray(text.encode())
    kind = rng.randrange(4)
    if kind == 0:
        return bytes(content[: rng.randrange(len(content))])
    if kind == 1:
        return rng.choice([b"\xef\xbb\xbf", b"\xff\xfe", b"\x00", b"#" * 10**6]) + bytes(content)
    for _ in range(rng.choice([1, 3, 30])):
        content[rng.randrange(len(content))] = rng.randrange(256) if kind == 2 else rng.choice(b"[]{}=\"'.\n#0-")
    return bytes(content)


def _with_line(text: str, rng: random.Random, change: Callable[[re.Match[str]], str]) -> str:
    lines = text.splitlines()
    places = [(place, match) for place, line in enumerate(lines) if (match := _LINE.match(line))]
    place, match = rng.choice(places)
    lines[place] = change(match)
    return "\n".join(lines)


MUTATIONS: list[Callable[[str, random.Random], str | bytes]] = [
    *[of_a_value] * 6,
    *[of_a_number] * 4,
    of_a_key,
    without_a_line,
    with_a_line_twice,
    with_a_block,
    of_bytes,
]


def mutated(kind: str, seed: int) -> tuple[bytes, str]:
    """A document of a kind (`study`, `vessel` or `mapping`) with one to three mutations, and how it came about."""
    rng = random.Random(f"{kind} {seed}")
    sources = documents(kind)
    name = rng.choice(list(sources))
    content: str | bytes = sources[name].read_text(encoding="utf-8")
    words = [name]
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        mutation = rng.choice(MUTATIONS)
        words.append(mutation.__name__)
        if isinstance(content, bytes):
            break
        content = mutation(content, rng)
    return (content if isinstance(content, bytes) else content.encode()), " ".join(words)


def documents(kind: str) -> dict[str, Path]:
    """Sound documents of a kind."""
    bad = Path(__file__).parents[1] / "bad"
    if kind == "study":  # the small one often: it can be run
        plain = {f"plain {number}": bad / "studies" / "plain.toml" for number in range(4)}
        return bundled_documents("studies") | plain | {"rich": Path(__file__).parent / "rich.toml"}
    if kind == "vessel":
        return bundled_documents("models") | {"plain": bad / "vessels" / "plain.toml"}
    return bundled_documents("studies/mappings") | {
        f"plain {number}": bad / "logs" / "plain.toml" for number in range(4)
    }
