"""The words that names of columns are made of, in a few languages, and how well a name fits each meaning.

A name is cut into parts: `GPS_Lat` is gps, lat; `ShaftRPM_port` is shaft, rpm, port; `Ruderwinkel` is ruder, winkel.
Parts that say a unit, a side, a sensor or a number are set aside. A name fits a meaning by the share of its other parts
that a phrase of the meaning explains.
"""

from __future__ import annotations

import re
import unicodedata
from functools import cache

from shipid.physics.signals import SIGNALS

PHRASES: dict[str, str] = {
    "latitude": ("lat, phi gps, latitude, breite, breitengrad, bredde, breddegrad, latitud, latitudine, geogr breite"),
    "longitude": (
        "lon, lambda gps, lambda, long, lng, longitude, laenge, laengengrad, lengde, lengdegrad, longitud, geogr laenge"
    ),
    "north": (
        "n, north, northing, pos north, pos n, north pos, x 0, x n, x ned, x earth, eta 1, x e, nord, "
        "nordwert, hochwert, utm n, utm north, utm y, nord pos, norte, xn, ned x, ned n, ned north, delta "
        "north, dist north"
    ),
    "east": (
        "e, east, easting, pos east, pos e, east pos, y 0, y n, y ned, y earth, eta 2, y e, ost, ostwert, "
        "rechtswert, utm e, utm east, utm x, oest, oestlig, este, ye, ned y, ned e, ned east, delta east, "
        "dist east"
    ),
    "x": "x, pos x, x pos, odom x, x coordinate, enu x, local x",
    "y": "y, pos y, y pos, odom y, y coordinate, enu y, local y",
    "psi": (
        "psi, heading, hdg, hdt, head, gyro, compass, kompass, kreisel kurs, kreisel, steuer kurs, "
        "vorauskurs, yaw, yaw angle, yaw pos, yaw 0, gier winkel, gir vinkel, kurs vinkel, baug retning, ship "
        "heading, gyro heading, compass heading, gyro hdg, kurs, course, eta 3, eta 6, theta z, rumbo, cap, "
        "styrt kurs, hehdt, bow angle"
    ),
    "speed": (
        "sog, speed, spd, speed over ground, ground speed, ship speed, u, v, fahrt, fahrt ueber grund, fueg, "
        "fug, geschwindigkeit, fart, fart over grunn, vtg sog, vg, v g, velocity, groundspeed, vitesse, "
        "velocidad, uog, speed og, hastighet, gps speed, abs speed, total speed"
    ),
    "course": (
        "cog, course, crs, track, course over ground, track angle, kurs ueber grund, kueg, kug, kurs, kurs "
        "over grunn, chi, vtg cog, course og, tmg, course made good, track made good, ground course, bahn "
        "winkel"
    ),
    "u": (
        "u, surge, surge vel, surge speed, v long, long speed, long vel, speed long, vel x, v x, nu 1, speed "
        "fwd, fwd speed, forward speed, speed forward, forward vel, ahead speed, speed ahead, laengs "
        "geschwindigkeit, v laengs, fahrt laengs, jag hastighet, fart langs, x dot, body u, u body, v fwd, "
        "vel long, long fart, speed x, v surge"
    ),
    "v": (
        "v, sway, sway vel, sway speed, v trans, trans speed, lat speed, lateral speed, speed trans, speed "
        "lat, vel y, v y, nu 2, speed stbd, speed starboard, transverse speed, quer geschwindigkeit, v quer, "
        "fahrt quer, svai hastighet, fart tvers, y dot, body v, v body, v lat, vel lat, v stbd, athwart "
        "speed, lateral vel, trans vel, tvers fart, drift speed, speed y, v sway"
    ),
    "velocity_north": (
        "vn, v n, v north, vel north, vel n, north vel, north speed, speed north, geschwindigkeit nord, v "
        "nord, hastighet nord, x dot, ned vel n, vel x, v x, speed n, enu vel y, nord fart"
    ),
    "velocity_east": (
        "ve, v e, v east, vel east, vel e, east vel, east speed, speed east, geschwindigkeit ost, v ost, "
        "hastighet oest, v oest, y dot, ned vel e, vel y, v y, speed e, enu vel x, oest fart"
    ),
    "r": (
        "r, rot, yaw rate, rate of turn, turn rate, rate turn, gyro z, gyro rate, w z, omega z, psi dot, nu "
        "6, nu 3, yaw vel, yaw speed, dreh rate, dreh geschwindigkeit, gier geschwindigkeit, gier rate, "
        "giring hastighet, sving rate, gir rate, girrate, ang vel z, angular velocity z, heading rate, hdg "
        "rate, wende geschwindigkeit, d psi, gir hastighet"
    ),
    "phi": "phi, roll, roll angle, heel, heel angle, roll winkel, kraengung, rull, krengning, eta 4",
    "theta": "theta, pitch, pitch angle, trim, trim angle, stampf winkel, trimm, stamp, eta 5",
    "p": "p, roll rate, nu 4, gyro x, omega x",
    "q": "q, pitch rate, nu 5, gyro y, omega y",
    "V_w": (
        "wind, wind speed, wind spd, wind vel, tws, true wind speed, v w, v wind, wind geschwindigkeit, vind "
        "hastighet, vind fart, wind force, aws, rel wind speed, app wind speed, apparent wind speed, relative "
        "wind speed"
    ),
    "beta_w": (
        "wind direction, wind dir, wind angle, twd, twa, true wind direction, beta w, gamma w, wind richtung, "
        "vind retning, wind from, awa, rel wind angle, app wind angle, apparent wind angle, relative wind "
        "angle, rel wind dir, relative wind direction, wind winkel"
    ),
    "delta": (
        "delta, rudder, rudder angle, rudder position, rudder pos, rsa, rud, rud ang, rud angle, helm, helm "
        "angle, ruder, ruder winkel, ruder lage, ror, ror vinkel, delta r, dr, d r, rudder ang, timon, flap "
        "angle, steering angle"
    ),
    "alpha": (
        "alpha, azimuth, azi, azimuth angle, azi angle, azi ang, azipod, azipod angle, pod angle, pod, "
        "thruster angle, thruster azimuth, azimut, azimut winkel, gondel winkel, schottel winkel, asimut, "
        "asimut vinkel, alpha t, nozzle angle, thrust angle, thruster direction, pod azimuth, azimuth vinkel, "
        "azi dir"
    ),
    "n": (
        "n, rpm, shaft, shaft rpm, shaft speed, prop rpm, propeller rpm, propeller speed, prop speed, engine "
        "rpm, me rpm, main engine rpm, engine speed, main engine speed, revs, rev, prop revs, propeller revs, "
        "dreh zahl, propeller dreh zahl, wellen dreh zahl, motor dreh zahl, tur tall, propell tur tall, aksel "
        "tur tall, rps, n p, n prop, thruster rpm, thruster speed, pod rpm, revolutions, shaft revolutions, n "
        "shaft, motor speed, motor rpm, n engine, propeller, prop, engine, azi rpm, azimuth rpm, umdrehungen, "
        "revoluciones, turns"
    ),
    "pitch": "cpp, cpp pitch, prop pitch, propeller pitch, pitch ratio, p d",
    "thrust": (
        "thrust, t prop, propeller thrust, prop thrust, shaft thrust, thrust p, schub, propeller schub, wellen schub, "
        "skyvekraft, poussee, empuje, thrust force"
    ),
    "torque": (
        "torque, q, q prop, shaft torque, propeller torque, prop torque, dreh moment, drehmoment, wellen drehmoment, "
        "dreiemoment, akselmoment, couple, par motor, moment shaft"
    ),
    "normal_force": (
        "rudder force, rudder normal force, normal force, f n, fn, ruder normalkraft, ruder kraft, rorkraft"
    ),
}
"""Meaning -> phrases, parts of a name separated by blanks, without accents. The names of `SIGNALS` count, too."""
OTHERS = (
    "stw, log speed, speed log, doppler log, speed through water, water speed, v log, vbw, log spd, fahrt "
    "durchs wasser, fdw, fart gjennom vann, power, shaft power, leistung, effekt, moment, engine torque, fuel, "
    "fuel rate, fuel flow, depth, water depth, wasser tiefe, dybde, draft, "
    "draught, draft fwd, draft aft, draught aft, draught fwd, tiefgang, tauchung, temp, temperature, air "
    "temp, temperatur, water temp, hdop, pdop, vdop, num sat, nsat, sats, satellites, heave, hiv, acc, acc x, "
    "acc y, acc z, acceleration, a x, a y, a z, pressure, humidity, voltage, current, set, drift, load, wave, "
    "wave height, height, altitude, alt, age, quality, status, mode, alarm, xte, cross track error, dist, "
    "distance, waypoint, index, row, count, id, no, nr, bow thruster, tunnel thruster, roll acc, pitch acc, x "
    "force, y force, variation, deviation, magnetic variation, geoid, force, mass, current speed, current "
    "direction, z, depth m"
)
"""Phrases of columns that no dataset takes."""
ORDERS = frozenset(
    (
        "befehl c cmd command commanded d demand des desired goal oensket onsket ord order ordered ordre ref "
        "reference req request set setpoint setpunkt setting soll sp target want wanted"
    ).split()
)
"""Parts that say what is ordered, not what is."""
WIND_WORDS = {"true": "true tws twd", "apparent": "aws awa app apparent rel relative"}
"""Parts that say which wind a column has. `twa` does not: it is the true wind, from the bow."""
SOURCES = frozenset(
    (
        "act actual ahrs angle avg data deg dgnss dgps est estimated fb feedback filt filtered gga gnss gpgga "
        "gprmc gps ground imu ins ist m mean meas measured measurement mru nav navigation odom of own pos "
        "posicion posisjon position raw rel rtk sensor ship signal sim standort t the true val value vessel "
        "vtg wert"
    ).split()
)
"""Parts that say where a value comes from, and nothing of what it is."""
UNIT_PARTS = frozenset(("deg degs dpm dps grad kmh kn knots kt kts knm min mps ms nm pct rad rads rps sec").split())
"""Parts that are a unit at the end of a name."""
SIDE_WORDS = {
    "port": "port|ps|bb|babord|backbord|p|prt|portside|left",
    "starboard": "starboard|stbd|sb|stb|styrbord|steuerbord|s|stb|strbd|right|star",
    "stern": "stern",
    "bow": "bow",
    "fore": "fore|fwd",
    "aft": "aft",
    "main": "main",
}
_LETTERS = {"ψ": "psi", "δ": "delta", "φ": "phi", "ϕ": "phi", "θ": "theta", "χ": "chi", "α": "alpha", "ω": "omega"}
_LETTERS |= {"β": "beta", "ä": "ae", "ö": "oe", "ü": "ue", "ø": "oe", "å": "aa", "æ": "ae", "ß": "ss", "Ψ": "psi"}
_LETTERS |= {"Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "Ø": "Oe", "Å": "Aa", "λ": "lambda", "°": " deg "}
SYNONYMS = {"velocity": "vel", "position": "pos", "pos": "pos", "longitudinal": "long", "transversal": "trans"}
SYNONYMS |= {"transverse": "trans", "lateral": "lat", "forward": "fwd", "velocities": "vel", "degrees": "deg"}
LONGEST_WORD = 80  # letters: a longer one is not cut
LEAST = 0.45  # share of a name that a phrase explains, before the name counts as fitting


def parts_of(name: str) -> tuple[str, ...]:
    """Return the parts of a name in lower case, without text in brackets; accents and Greek are spelt out."""
    bare = re.sub(r"[\[(][^\])]*[\])]?", " ", name)
    text = unicodedata.normalize("NFKD", "".join(_LETTERS.get(letter, letter) for letter in bare))
    text = "".join(letter for letter in text if not unicodedata.combining(letter))
    text = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[A-Za-z])(?=\d)|(?<=\d)(?=[A-Za-z])", " ", text)
    words = [word for word in re.split(r"[^A-Za-z0-9]+", text.lower()) if word]
    return tuple(SYNONYMS.get(part, part) for word in words for part in _cut(word))


def wind_kind(name: str) -> str:
    """Whether the name of a column of wind says `true` or `apparent`; empty where it says neither, or both."""
    parts = set(parts_of(name))
    kinds = [kind for kind, words in WIND_WORDS.items() if parts & set(words.split())]
    return kinds[0] if len(kinds) == 1 else ""


@cache
def _vocabulary() -> frozenset[str]:
    phrases = [*PHRASES.values(), OTHERS]
    words = {word for phrase in phrases for word in phrase.replace(",", " ").split()}
    return frozenset(word for word in words | ORDERS | SOURCES | set(SYNONYMS) if len(word) > 2)


@cache
def _cut(word: str) -> tuple[str, ...]:
    """Cut a word that is no known one into known words, such as `ruderwinkel`; return it whole where it cannot be."""
    known = _vocabulary()
    if word in known or not 6 <= len(word) <= LONGEST_WORD:
        return (word,)
    best: dict[int, tuple[str, ...]] = {0: ()}
    for end in range(1, len(word) + 1):
        options = [(*before, word[start:end]) for start, before in best.items() if word[start:end] in known]
        if options:
            best[end] = min(options, key=len)
    return best.get(len(word), (word,))


@cache
def _phrases() -> dict[str, tuple[tuple[str, ...], ...]]:
    def cut(text: str) -> tuple[tuple[str, ...], ...]:
        return tuple(tuple(SYNONYMS.get(word, word) for word in phrase.split()) for phrase in text.split(","))

    return {meaning: cut(text) for meaning, text in PHRASES.items()} | {"": cut(OTHERS)}


def is_order(name: str) -> bool:
    """Whether a name says that its column is an order or a set point, not what was measured."""
    parts = parts_of(name)
    return len(parts) > 1 and bool(ORDERS & set(parts[1:] if len(parts[0]) == 1 else parts))


def side_of(name: str) -> str | None:
    """Return the side or place in a name, such as `port`; None if there is none."""
    parts = set(parts_of(name)) | set(re.split(r"[^a-z]+", name.lower()))
    for side, words in SIDE_WORDS.items():
        if len(parts - {""}) > 1 and set(words.split("|")) & parts:
            return side
    return None


@cache
def fits(name: str) -> dict[str, float]:
    """Return how well a name fits each meaning, 0 to 1: `{"psi": 1.0}`; the empty meaning is a column of no use.

    Orders and set points fit commands only.
    """
    parts = list(parts_of(name))
    order = is_order(name)
    aside = (
        {word for words in SIDE_WORDS.values() for word in words.split("|")} | SOURCES | (ORDERS if order else set())
    )
    while len(parts) > 1 and parts[-1] in UNIT_PARTS:
        parts.pop()
    content = [part for part in parts if part not in aside and not part.isdigit()]
    meanings: dict[str, float] = {}
    for meaning, phrases in _phrases().items():
        best = max((_covered(phrase, parts, content, aside) for phrase in phrases), default=0.0)
        row = SIGNALS.get(meaning)
        if order and row is not None and row.role != "command":
            best = 0.0
        if best >= LEAST:
            meanings[meaning] = best
    for meaning, row in SIGNALS.items():
        if row.names and meaning not in meanings and not order and re.fullmatch(row.names, "_".join(parts)):
            meanings[meaning] = 0.9
    return meanings


def _covered(phrase: tuple[str, ...], parts: list[str], content: list[str], aside: set[str]) -> float:
    """Return the share of the letters of a name that a phrase explains; 0 if the name lacks a word of it."""
    if not set(phrase) <= set(parts):
        return 0.0
    left = [part for part in content if part not in phrase]
    letters = sum(len(word) for word in phrase)
    extra = sum(len(part) for part in left)
    known_aside = 0.02 * sum(part in aside and part not in phrase for part in parts)
    return letters / (letters + extra) - known_aside
