"""Raw log folders drawn by seed, as crews and robots write them, with their truth, and a judge of drafted mappings.

`python -m tests.logs.raw_folders --seed S --count N` drafts and imports each and prints each failure and the table.
The motion is from the integrator of this file; nothing here is taken from the code that is judged.

A folder is *right*: the imported table has the motion, commands and wind of the truth in SI. *asked*: what is wrong or
missing stands in a question that names its true column, or the question is that of the hand of x and y and the true
answer by `--frame` makes it right. *refused* in one line. *marked*: wrong, but its line says UNSURE, a warning names
it, a question doubts the column that was taken without naming the true one, or the true answer is refused. *missing*:
a command or the wind is left out without a question. *crash*. *SILENT*: another motion or command without any of these.
"""

from __future__ import annotations

import argparse
import math
import re
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pymap3d
from typer.testing import CliRunner

Array = np.ndarray
DEGREE, KNOT = math.pi / 180, 1852 / 3600

# ------------------------------------------------------------------------------------------------- the motion


@dataclass(frozen=True)
class Craft:
    """A ship in numbers without dimension: tau = L / U is its time, U the speed at full thrust."""

    L: float
    U: float
    drive: str  # single, twin, twinrudder, azimuth, outboard
    n_max: float  # rev/s
    d_max: float  # rad
    surge: float
    turn: float
    inertia: float
    drift: float
    wash: float
    windage: float

    @property
    def tau(self) -> float:
        """Time to run its length, s."""
        return self.L / self.U


def draw_craft(random: np.random.Generator, drive: str, small: bool) -> Craft:
    """Draw a ship of 1 to 12 m, or of 8 to 300 m."""
    length = float(np.exp(random.uniform(*np.log([1, 12] if small else [8, 300]))))
    froude = random.uniform(0.3, 1.0) if drive == "outboard" and length < 15 else random.uniform(0.06, 0.32)
    speed = float(np.clip(froude * math.sqrt(9.81 * length), 0.1, 12.0))
    return Craft(
        L=length,
        U=speed,
        drive=drive,
        n_max=float(random.uniform(0.7, 1.3) * 30 / length**0.55),
        d_max=math.radians(random.choice([30, 35, 40, 45])),
        surge=random.uniform(1.5, 6.0),
        turn=random.uniform(0.9, 1.7),
        inertia=random.uniform(0.3, 0.8),
        drift=random.uniform(0.2, 0.45),
        wash=random.uniform(0.3, 0.7),
        windage=float(random.choice([0.0, 0.002, 0.006])),
    )


def rates(state: Array, order: Array, craft: Craft, weather: dict[str, float]) -> Array:
    """Time derivative of [north, east, psi, u, v, r, n1, n2, d]; velocities through the water, screws over n_max."""
    _, _, psi, u, v, r, n1, n2, d = state.tolist()
    tau, speed = craft.tau, craft.U
    up, vp, rp = u / speed, v / speed, r * tau
    f1, f2 = (n * abs(n) * (1.0 if n > 0 else 0.6) for n in (n1, n2))
    thrust, cos, sin = (f1 + f2) / 2, math.cos(psi), math.sin(psi)
    if craft.drive in ("azimuth", "outboard"):
        ahead, side, lever = thrust * math.cos(d), 0.7 * thrust * math.sin(d), thrust
    elif craft.drive == "twin":
        ahead, side, lever = thrust, 0.0, 0.0
    else:
        lever = (1 - craft.wash) * up * abs(up) + craft.wash * max(f1 + f2, 0.0) / 2
        ahead, side = thrust - 0.3 * lever * math.sin(d) ** 2, 0.3 * lever * math.sin(d)
    yaw = craft.turn * lever * math.sin(d) + (0.7 if "twin" in craft.drive else 0.0) * (f1 - f2)
    wn, we = (weather["V_w"] * f(weather["beta_w"]) for f in (math.cos, math.sin))
    wn, we = wn - (u * cos - v * sin), we - (u * sin + v * cos)
    blow = craft.windage * math.hypot(wn, we) / speed**2
    du = (ahead - 0.15 * up - 0.85 * up * abs(up) - 0.4 * vp * vp * math.copysign(1, up)) / craft.surge
    du += 0.8 * vp * rp - 0.15 * rp * rp * up + blow * (wn * cos + we * sin)
    dv = (-1.2 * (vp + craft.drift * rp) * (abs(up) + 0.1) - 2.5 * vp * abs(vp) - side) / 1.8
    dv += 2 * blow * (-wn * sin + we * cos)
    dr = (yaw - rp * (abs(up) + 0.15) - 0.8 * rp * abs(rp) - 0.15 * vp * up) / craft.inertia
    scale = speed / tau
    return np.array(
        [
            u * cos - v * sin + weather["c_n"],
            u * sin + v * cos + weather["c_e"],
            r,
            du * scale,
            dv * scale,
            dr / tau**2,
            (order[0] - n1) / (0.15 * tau),
            (order[1] - n2) / (0.15 * tau),
            float(np.clip((order[2] - d) / (0.1 * tau), -1.2 / tau, 1.2 / tau)),
        ]
    )


Policy = Callable[[float, Array], tuple[float, float]]


def draw_policy(random: np.random.Generator, craft: Craft, kind: str, psi: float) -> Policy:
    """Orders (thrust -1..1, helm -1..1, both as shares) as a function of the time in the stretch and the state."""
    n = float(random.choice([0.5, 0.7, 0.85, 1.0]))
    helm = float(random.choice([-1, 1]) * random.uniform(0.3, 1.0))
    if kind == "turn":
        return lambda _t, _s: (n, helm)
    if kind == "zigzag":
        angle, side = random.choice([10, 15, 20]) * DEGREE, [float(np.sign(helm))]

        def zigzag(_t: float, state: Array) -> tuple[float, float]:
            if (state[2] - psi) * side[0] > angle:
                side[0] = -side[0]
            return n, side[0] * angle / craft.d_max

        return zigzag
    if kind == "stop":
        back = float(random.choice([0.0, -0.5, -0.8]))
        return lambda _t, s: ((back if s[3] > 0.05 * craft.U else 0.0), 0.0)
    if kind == "astern":
        return lambda _t, _s: (-0.6, 0.3 * helm)
    if kind == "rest":
        return lambda _t, _s: (0.0, 0.0)
    if kind == "mixed":
        table = random.uniform([0.2, -1], [1.0, 1], (40, 2))
        return lambda t, _s: tuple(table[int(t / (3 * craft.tau)) % 40])  # type: ignore[return-value]
    goal = psi + random.uniform(-0.6, 0.6)

    def steer(_t: float, state: Array) -> tuple[float, float]:
        error = (goal - state[2] + math.pi) % (2 * math.pi) - math.pi
        return n, float(np.clip(1.5 * error - 1.2 * craft.tau * state[5], -0.6, 0.6))

    return steer


def simulate_day(random: np.random.Generator, craft: Craft, dt: float, rows: int, weather: dict[str, float]) -> Array:
    """Rows every dt of [state, orders of n1, n2, d]: shape (rows, 12); Runge-Kutta of order 4, tau / 15 or finer."""
    steps = math.ceil(dt / (craft.tau / 15))
    h, out = dt / steps, np.zeros((rows, 12))
    state = np.array([0, 0, random.uniform(-3.1, 3.1), 0.6 * craft.U, 0, 0, 0.7, 0.7, 0], float)
    kinds = [*random.permutation(["turn", "zigzag", "turn", "steer", "mixed"]), "stop"]
    kinds += [*random.choice(["turn", "zigzag", "steer", "mixed", "stop", "rest", "astern"], 40)]
    until, policy, begun = -1.0, None, 0.0
    for row in range(rows):
        now = row * dt
        if now > until:
            kind = str(kinds.pop(0))
            policy, begun = draw_policy(random, craft, kind, state[2]), now
            until = now + craft.tau * (random.uniform(12, 30) if kind != "rest" else random.uniform(5, 15))
            kinds.append(kind)
        assert policy is not None
        thrust, helm = policy(now - begun, state)
        if craft.drive == "twin":
            order = np.clip([thrust + 0.5 * helm, thrust - 0.5 * helm, 0.0], -1, 1)
        else:
            order = np.array([thrust, thrust, helm * craft.d_max])
        out[row] = [*state, *order]
        for _ in range(steps):
            a = rates(state, order, craft, weather)
            b = rates(state + h / 2 * a, order, craft, weather)
            c = rates(state + h / 2 * b, order, craft, weather)
            state = state + h / 6 * (a + 2 * b + 2 * c + rates(state + h * c, order, craft, weather))
    return out


# ------------------------------------------------------------------------------------------------- the words

#: what crews call a column, by language: names of one cell are equal choices
WORDS = {
    "en": {
        "time": ["Time", "UTC", "Timestamp"],
        "date": ["Date"],
        "lat": ["Latitude", "Lat", "GPS Lat"],
        "lon": ["Longitude", "Lon", "GPS Lon"],
        "x": ["North", "Northing", "Pos N"],
        "y": ["East", "Easting", "Pos E"],
        "psi": ["Heading", "HDG", "Gyro", "True heading", "HDT", "Gyro heading"],
        "cog": ["COG", "Course over ground", "Course", "Track made good"],
        "sog": ["SOG", "Speed over ground", "Speed", "GPS speed"],
        "u": ["u", "Surge speed", "Long. speed", "Vx body"],
        "v": ["v", "Sway speed", "Trans. speed", "Vy body"],
        "vn": ["Vel N", "North velocity", "Vn"],
        "ve": ["Vel E", "East velocity", "Ve"],
        "r": ["ROT", "Rate of turn", "Yaw rate", "r"],
        "delta": ["Rudder", "Rudder angle", "Helm", "Rud ang", "Rudder position"],
        "n": ["RPM", "Shaft speed", "Prop RPM", "Propeller revs", "Shaft rev"],
        "alpha": ["Azimuth", "Pod angle", "Thruster angle", "Steering angle"],
        "port": ["Port", "PS", "P"],
        "starboard": ["Stbd", "SB", "S"],
        "V_w": ["Wind speed", "TWS", "Wind spd"],
        "beta_w": ["Wind direction", "TWD", "Wind dir"],
        "order": ["order", "cmd", "setpoint"],
        "decoys": [
            "Depth",
            "Battery V",
            "Oil temp",
            "Fuel rate",
            "Roll",
            "Pitch",
            "HDOP",
            "Sats",
            "Record no",
            "Status",
        ],
    },
    "de": {
        "time": ["Zeit", "Uhrzeit"],
        "date": ["Datum"],
        "lat": ["Breite", "Geogr. Breite"],
        "lon": ["Länge", "Geogr. Länge"],
        "x": ["Nord", "Position Nord"],
        "y": ["Ost", "Position Ost"],
        "psi": ["Steuerkurs", "Kreisel", "Heading", "Vorausrichtung"],
        "cog": ["Kurs über Grund", "KüG", "COG"],
        "sog": ["Fahrt über Grund", "FüG", "Geschwindigkeit"],
        "u": ["Längsgeschwindigkeit", "u"],
        "v": ["Quergeschwindigkeit", "v"],
        "vn": ["Geschw. Nord"],
        "ve": ["Geschw. Ost"],
        "r": ["Drehrate", "Wendegeschwindigkeit", "Gierrate"],
        "delta": ["Ruderwinkel", "Ruderlage", "Ruder"],
        "n": ["Drehzahl", "Wellendrehzahl", "Propellerdrehzahl"],
        "alpha": ["Azimutwinkel", "Gondelwinkel"],
        "port": ["BB", "Backbord"],
        "starboard": ["StB", "Steuerbord"],
        "V_w": ["Windgeschwindigkeit", "Wind"],
        "beta_w": ["Windrichtung"],
        "order": ["Soll"],
        "decoys": ["Tiefe", "Batteriespannung", "Öltemperatur", "Verbrauch", "Rollwinkel", "Zähler", "Status"],
    },
    "no": {
        "time": ["Tid", "Klokkeslett"],
        "date": ["Dato"],
        "lat": ["Breddegrad", "Bredde"],
        "lon": ["Lengdegrad", "Lengde"],
        "x": ["Nord"],
        "y": ["Øst"],
        "psi": ["Heading", "Gyro", "Baugretning"],
        "cog": ["Kurs over grunn", "COG"],
        "sog": ["Fart over grunn", "Fart"],
        "u": ["Fart langskips"],
        "v": ["Fart tverrskips"],
        "vn": ["Fart nord"],
        "ve": ["Fart øst"],
        "r": ["Svinghastighet", "ROT", "Girhastighet"],
        "delta": ["Rorvinkel", "Ror"],
        "n": ["Turtall", "Omdreininger", "Akselturtall"],
        "alpha": ["Azimutvinkel", "Thrustervinkel"],
        "port": ["BB", "Babord"],
        "starboard": ["SB", "Styrbord"],
        "V_w": ["Vindstyrke", "Vindhastighet"],
        "beta_w": ["Vindretning"],
        "order": ["ordre", "settpunkt"],
        "decoys": ["Dybde", "Batterispenning", "Oljetemp", "Rull", "Stamp", "Teller"],
    },
    "nl": {
        "time": ["Tijd"],
        "date": ["Datum"],
        "lat": ["Breedtegraad", "Breedte"],
        "lon": ["Lengtegraad", "Lengte"],
        "x": ["Noord"],
        "y": ["Oost"],
        "psi": ["Heading", "Gyrokoers", "Voorliggende koers"],
        "cog": ["Grondkoers", "Koers over de grond"],
        "sog": ["Grondsnelheid", "Snelheid over de grond", "Vaart"],
        "u": ["Langssnelheid"],
        "v": ["Dwarssnelheid"],
        "vn": ["Snelheid noord"],
        "ve": ["Snelheid oost"],
        "r": ["Draaisnelheid", "Bochtsnelheid"],
        "delta": ["Roerhoek", "Roerstand", "Roer"],
        "n": ["Toerental", "Astoerental", "Schroeftoeren"],
        "alpha": ["Azimuthoek"],
        "port": ["BB", "Bakboord"],
        "starboard": ["SB", "Stuurboord"],
        "V_w": ["Windsnelheid"],
        "beta_w": ["Windrichting"],
        "order": ["gevraagd"],
        "decoys": ["Diepte", "Accuspanning", "Olietemp", "Helling", "Teller"],
    },
    "fr": {
        "time": ["Heure", "Temps"],
        "date": ["Date"],
        "lat": ["Latitude"],
        "lon": ["Longitude"],
        "x": ["Nord"],
        "y": ["Est"],
        "psi": ["Cap", "Cap vrai", "Cap gyro"],
        "cog": ["Route fond", "Route sur le fond"],
        "sog": ["Vitesse fond", "Vitesse surface fond", "Vitesse"],
        "u": ["Vitesse longitudinale"],
        "v": ["Vitesse transversale"],
        "vn": ["Vitesse nord"],
        "ve": ["Vitesse est"],
        "r": ["Taux de giration", "Vitesse de giration", "Vitesse de lacet"],
        "delta": ["Angle de barre", "Barre", "Safran"],
        "n": ["Régime", "Tours hélice", "Régime arbre"],
        "alpha": ["Angle azimut", "Orientation propulseur"],
        "port": ["Bd", "Bâbord"],
        "starboard": ["Td", "Tribord"],
        "V_w": ["Vitesse vent", "Vitesse du vent"],
        "beta_w": ["Direction vent", "Direction du vent"],
        "order": ["consigne"],
        "decoys": ["Profondeur", "Tension batterie", "Temp huile", "Roulis", "Tangage", "Compteur"],
    },
    "es": {
        "time": ["Hora", "Tiempo"],
        "date": ["Fecha"],
        "lat": ["Latitud"],
        "lon": ["Longitud"],
        "x": ["Norte"],
        "y": ["Este"],
        "psi": ["Rumbo verdadero", "Proa", "Rumbo giro"],
        "cog": ["Rumbo sobre el fondo", "Derrota"],
        "sog": ["Velocidad sobre el fondo", "Velocidad"],
        "u": ["Velocidad longitudinal"],
        "v": ["Velocidad transversal"],
        "vn": ["Velocidad norte"],
        "ve": ["Velocidad este"],
        "r": ["Velocidad de giro", "Velocidad de guiñada"],
        "delta": ["Ángulo de timón", "Timón"],
        "n": ["Revoluciones", "RPM eje", "RPM hélice"],
        "alpha": ["Ángulo azimut"],
        "port": ["Br", "Babor"],
        "starboard": ["Er", "Estribor"],
        "V_w": ["Velocidad viento"],
        "beta_w": ["Dirección viento"],
        "order": ["orden"],
        "decoys": ["Profundidad", "Tensión batería", "Temp aceite", "Balance", "Contador"],
    },
    "it": {
        "time": ["Ora", "Tempo"],
        "date": ["Data"],
        "lat": ["Latitudine"],
        "lon": ["Longitudine"],
        "x": ["Nord"],
        "y": ["Est"],
        "psi": ["Prora", "Prora vera", "Heading"],
        "cog": ["Rotta fondo", "Rotta vera"],
        "sog": ["Velocità fondo", "Velocità"],
        "u": ["Velocità longitudinale"],
        "v": ["Velocità trasversale"],
        "vn": ["Velocità nord"],
        "ve": ["Velocità est"],
        "r": ["Velocità di accostata", "Velocità di imbardata"],
        "delta": ["Angolo timone", "Timone", "Angolo di barra"],
        "n": ["Giri elica", "Giri asse", "Giri"],
        "alpha": ["Angolo azimutale"],
        "port": ["Sx", "Sinistra"],
        "starboard": ["Dx", "Dritta"],
        "V_w": ["Velocità vento"],
        "beta_w": ["Direzione vento"],
        "order": ["ordine"],
        "decoys": ["Profondità", "Tensione batteria", "Temp olio", "Rollio", "Contatore"],
    },
    "sv": {
        "time": ["Tid", "Klockslag"],
        "date": ["Datum"],
        "lat": ["Latitud", "Breddgrad"],
        "lon": ["Longitud", "Längdgrad"],
        "x": ["Nord"],
        "y": ["Ost"],
        "psi": ["Gyrokurs", "Stäv", "Heading"],
        "cog": ["Kurs över grund"],
        "sog": ["Fart över grund"],
        "u": ["Fart långskepps"],
        "v": ["Fart tvärskepps"],
        "vn": ["Fart nord"],
        "ve": ["Fart ost"],
        "r": ["Girhastighet", "Girvinkelhastighet"],
        "delta": ["Rodervinkel", "Roder"],
        "n": ["Varvtal", "Axelvarvtal"],
        "alpha": ["Azimutvinkel"],
        "port": ["BB", "Babord"],
        "starboard": ["SB", "Styrbord"],
        "V_w": ["Vindhastighet"],
        "beta_w": ["Vindriktning"],
        "order": ["order", "börvärde"],
        "decoys": ["Djup", "Batterispänning", "Oljetemp", "Rullning", "Räknare"],
    },
    "pt": {
        "time": ["Hora"],
        "date": ["Data"],
        "lat": ["Latitude"],
        "lon": ["Longitude"],
        "x": ["Norte"],
        "y": ["Leste"],
        "psi": ["Proa", "Aproamento"],
        "cog": ["Rumo no fundo", "Rumo sobre o fundo"],
        "sog": ["Velocidade no fundo"],
        "u": ["Velocidade longitudinal"],
        "v": ["Velocidade transversal"],
        "vn": ["Velocidade norte"],
        "ve": ["Velocidade leste"],
        "r": ["Taxa de guinada", "Velocidade de guinada"],
        "delta": ["Ângulo do leme", "Leme"],
        "n": ["Rotações", "Rotação hélice"],
        "alpha": ["Ângulo azimute"],
        "port": ["BB", "Bombordo"],
        "starboard": ["BE", "Estibordo"],
        "V_w": ["Velocidade vento"],
        "beta_w": ["Direção vento"],
        "order": ["ordem"],
        "decoys": ["Profundidade", "Tensão bateria", "Temp óleo", "Balanço", "Contador"],
    },
}
#: what robots call theirs
ROBOTS = {
    "ros": {
        "time": ["%time", "header.stamp", "stamp"],
        "secs": ["header.stamp.secs", "header.stamp.sec"],
        "nsecs": ["header.stamp.nsecs", "header.stamp.nanosec"],
        "x": ["pose.pose.position.x", "odom/pose/pose/position/x"],
        "y": ["pose.pose.position.y", "odom/pose/pose/position/y"],
        "q": ["pose.pose.orientation.", "odom/pose/pose/orientation/"],
        "psi": ["yaw", "pose.yaw"],
        "u": ["twist.twist.linear.x"],
        "v": ["twist.twist.linear.y"],
        "r": ["twist.twist.angular.z"],
        "delta": ["cmd.rudder", "rudder_cmd", "steering.angle"],
        "n": ["cmd.rpm", "thruster.rpm", "motor_rpm"],
        "alpha": ["pod_angle", "azimuth.angle"],
        "port": ["left", "port"],
        "starboard": ["right", "stbd"],
        "decoys": ["header.seq", "pose.pose.position.z", "battery.voltage", "imu.linear_acceleration.x", "cpu_temp"],
    },
    "px4": {
        "time": ["timestamp", "timestamp_us"],
        "x": ["x", "vehicle_local_position.x", "local_x"],
        "y": ["y", "vehicle_local_position.y", "local_y"],
        "q": ["q[", "vehicle_attitude.q[", "q_", "att_q"],
        "psi": ["heading", "vehicle_local_position.heading"],
        "vn": ["vx", "vehicle_local_position.vx"],
        "ve": ["vy", "vehicle_local_position.vy"],
        "r": ["rollspeed_z", "xyz[2]", "gyro_rad[2]"],
        "delta": ["rudder_angle", "actuator_rudder"],
        "n": ["esc.rpm", "esc_rpm"],
        "alpha": ["tilt_angle"],
        "port": ["port", "left"],
        "starboard": ["starboard", "right"],
        "decoys": ["z", "eph", "battery_status.voltage_v", "xyz[0]", "xyz[1]", "baro_temp_celcius"],
    },
    "ardu": {
        "time": ["TimeUS"],
        "lat": ["POS.Lat", "GPS.Lat", "lat"],
        "lon": ["POS.Lng", "GPS.Lng", "lon"],
        "psi": ["ATT.Yaw", "AHR2.Yaw", "yaw"],
        "sog": ["GPS.Spd", "ground_speed"],
        "cog": ["GPS.GCrs", "ground_course"],
        "r": ["IMU.GyrZ", "RATE.Y", "gyro_z"],
        "delta": ["RCOU.C1", "servo1_raw", "steer_pwm"],
        "n": ["RCOU.C3", "servo3_raw", "throttle_pwm"],
        "alpha": ["RCOU.C1", "servo1_raw", "steer_pwm"],
        "port": ["left", "port"],
        "starboard": ["right", "stbd"],
        "decoys": ["GPS.NSats", "GPS.HDop", "BAT.Volt", "BARO.Temp", "ATT.Roll", "ATT.Pitch", "GPS.Alt"],
    },
}
LABELS = {
    "deg": ["deg", "°"],
    "rad": ["rad"],
    "kn": ["kn", "kts", "knots"],
    "m/s": ["m/s"],
    "km/h": ["km/h"],
    "deg/min": ["deg/min", "°/min"],
    "deg/s": ["deg/s", "°/s"],
    "rad/s": ["rad/s"],
    "rpm": ["rpm", "1/min"],
    "rev/s": ["rev/s", "1/s", "rps"],
    "%": ["%"],
    "us": ["us", "µs"],
    "N": ["N"],
    "m": ["m"],
    "s": ["s"],
    "ddmm": ["ddmm.mmmm"],
}
#: what a decoy does, by its name: a voltage, a counter, a constant, a motion of waves; any other drifts
DECOYS = [
    r"^(?!.*(batt|volt|spenn|spann|spänn|tens|record|zähl|teller|cont|compt|räkn|seq|stat|sats|roll|pitch|rull|stamp|balan"
    r"|tang|hell|xyz|accel)).",
    r"batt|volt|spenn|spann|spänn|tens",
    r"record|zähl|teller|cont|compt|räkn|seq",
    r"stat|sats",
    r".",
]
SI = {"deg": DEGREE, "kn": KNOT, "km/h": 1 / 3.6, "deg/min": DEGREE / 60, "deg/s": DEGREE, "rpm": 1 / 60}


# ------------------------------------------------------------------------------------------------- the folder


@dataclass(frozen=True)
class Signal:
    """What a correct mapping says of one quantity: SI = sign x factor x column (in unit) + offset."""

    columns: tuple[str, ...]
    unit: str
    sign: int = 1
    factor: float = 1.0
    offset: float = 0.0
    more: tuple[tuple[str, Any], ...] = ()
    free_scale: bool = False  # the log cannot tell how much one unit is: any positive factor is right


@dataclass
class Recording:
    """The truth of one file: t [s] from its start, its series in SI, and what its clock shows at the start."""

    file: Path
    t: Array
    truth: dict[str, Array]
    starts: tuple[float, ...]


@dataclass
class RawFolder:
    """A drawn folder, or a single file, with its truth."""

    path: Path
    craft: Craft
    lever: tuple[float, float]
    sigma: dict[str, float]
    signals: dict[str, Signal]
    recordings: list[Recording] = field(default_factory=list)
    cannot: tuple[str, ...] = ()
    frame: str = ""
    vessel: Path | None = None
    mapping: dict[str, Any] = field(default_factory=dict)
    words: str = ""
    clock: tuple[str, ...] = ()


def dress(random: np.random.Generator, name: str, unit: str, style: dict[str, Any]) -> str:
    """Write the name of a column in the style of a log, with its unit where the style has one."""
    bare = style["units"] in ("none", "row") or not unit
    label = "" if bare else style.setdefault(unit, str(random.choice(LABELS[unit])))
    parts = re.split(r"[\s.]+", name)
    cases = {
        "caps": name.upper(),
        "camel": parts[0].lower() + "".join(p.capitalize() for p in parts[1:]),
        "snake": "_".join(p.lower() for p in parts),
        "hungarian": "f" + "".join(p[:1].upper() + p[1:] for p in parts),
        "prefix": "NAV_" + "_".join(parts),
    }
    name = cases.get(style["case"], name)
    if not label:
        return name
    word = label.replace("/", "p").replace("°", "deg").replace("%", "pct")
    return name + {"[]": f" [{label}]", "()": f" ({label})", "_": f"_{word}", ",": f" {label}"}[style["units"]]


def cells(values: Array, digits: int) -> list[str]:
    """Numbers as text with so many decimals."""
    return [f"{value:.{digits}f}" for value in values]


class Writer:
    """Collects the columns of a folder's files: name -> one list of cells a file; units beside them."""

    def __init__(self, random: np.random.Generator, words: dict[str, list[str]], style: dict[str, Any]) -> None:
        self.random, self.words, self.style = random, words, style
        self.units: dict[str, str] = {}
        self.series: dict[str, list[list[str]]] = {}
        self.names: dict[str, str] = {}
        self.chosen: dict[str, int] = {}

    def name(self, key: str, unit: str = "", extra: str = "", keep: bool = False) -> str:
        """Name of a quantity in this log: chosen once, distinct."""
        if key + extra not in self.names:
            spoken = self.words.get(key, [key])
            word = spoken[self.chosen.setdefault(key, int(self.random.integers(len(spoken)))) % len(spoken)]
            joined = f"{word} {extra}".strip() if self.style["robot"] != "ardu" else f"{extra} {word}".strip()
            full = joined.replace(" ", "_") if self.style["robot"] else dress(self.random, joined, unit, self.style)
            full = word if keep else full
            while full in self.units:
                full += "_2"
            self.names[key + extra] = full
            self.units[full] = unit
        return self.names[key + extra]

    def add(self, name: str, text: list[str]) -> None:
        """Append the cells of the next file."""
        self.series.setdefault(name, []).append(text)


def draw_raw_folder(seed: int, root: Path) -> RawFolder:
    """Draw a folder of raw logs by its seed and write it below a root."""
    random = np.random.default_rng([seed, 59])
    family = str(random.choice(["crew", "lab", "ros", "px4", "ardu"], p=[0.5, 0.17, 0.12, 0.1, 0.11]))
    robot = family if family in ROBOTS else ""
    drives = (
        ["single", "twin", "outboard", "twinrudder"] if robot else ["single", "single", "twinrudder", "azimuth", "twin"]
    )
    craft = draw_craft(random, str(random.choice(drives)), bool(robot) or (family == "lab" and random.random() < 0.6))
    dt = max((d for d in (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0) if d <= craft.tau / random.uniform(4, 12)), default=0.05)
    files = int(random.choice([1, 1, 1, 2, 3, 4, 5, 6]))
    rows = int(np.clip(random.uniform(180, 350) * craft.tau / dt / files, 500 if files > 1 else 900, 6000))
    breeze = float(random.choice([0, 2, 5, 9])) * min(1.0, craft.L / 8)
    weather = {"V_w": breeze, "beta_w": random.uniform(-math.pi, math.pi)}
    drift, way = random.choice([0, 0.03, 0.1]) * craft.U, random.uniform(-math.pi, math.pi)
    weather |= {"c_n": drift * math.cos(way), "c_e": drift * math.sin(way)}
    language = "en" if robot else str(random.choice(list(WORDS), p=[0.44, *[0.07] * 8]))
    units = str(random.choice(["[]", "()", "_", ",", "row", "none"], p=[0.25, 0.2, 0.15, 0.05, 0.15, 0.2]))
    cases = ["plain", "caps", "camel", "snake", "hungarian", "prefix"]
    case = str(random.choice(cases, p=[0.4, 0.15, 0.13, 0.17, 0.07, 0.08]))
    style = {"robot": robot, "units": "none" if robot else units, "case": "plain" if robot else case}
    writer = Writer(random, ROBOTS[robot] if robot else WORDS[language], style)
    quality = float(random.choice([0.2, 1.0, 2.0]))
    sigma = {
        "position": min(quality * (0.003 * craft.L + 0.005), 1.5),
        "psi": quality * random.uniform(0.03, 0.25) * DEGREE,
        "velocity": quality * 0.006 * craft.U,
        "r": quality * 0.008 / craft.tau,
    }
    lever = (0.0, 0.0)
    if random.random() < 0.2:
        lever = (random.uniform(-0.35, 0.35) * craft.L, random.uniform(-0.1, 0.1) * craft.L)
    name = f"{seed:04d}-{family}-{language}"
    folder = RawFolder(root / name, craft, lever, sigma, {}, words=f"{family} {language} {craft.drive} {style['case']}")
    choices = draw_choices(random, family, craft, writer, folder)
    stems = draw_stems(random, files)
    start = datetime(
        2024, int(random.integers(1, 13)), int(random.integers(1, 29)), int(random.integers(6, 18)), tzinfo=UTC
    )
    start += timedelta(seconds=int(random.integers(0, 3000)))
    folder.path.mkdir(parents=True)
    for index in range(files):
        table = simulate_day(random, craft, dt, rows, weather)
        begin = start + timedelta(seconds=math.ceil(index * rows * dt + 300 * index))
        swap = choices["exchanged"] == index and {"psi", "cog"} <= set(writer.names)
        if swap:
            writer.names["psi"], writer.names["cog"] = writer.names["cog"], writer.names["psi"]
        record = write_columns(random, table, dt, begin, weather, writer, folder, choices)
        if swap:
            writer.names["psi"], writer.names["cog"] = writer.names["cog"], writer.names["psi"]
            folder.cannot += ("in one file heading and course are exchanged",)
        record.file = folder.path / f"{stems[index]}{choices['ending']}"
        folder.recordings.append(record)
    write_files(random, writer, folder, choices)
    if random.random() < 0.5:
        folder.vessel = folder.path.with_suffix(".vessel.toml")
        folder.vessel.write_text(vessel_text(craft), encoding="utf-8")
    return folder


def draw_stems(random: np.random.Generator, count: int) -> list[str]:
    """Names of files without their ending."""
    pattern = str(random.choice(["run_{:02d}", "Test{}", "trial-{}", "2024-05-{:02d}_log", "ZZ_{:03d}", "leg {}"]))
    return [pattern.format(index + 1) for index in range(count)]


def draw_choices(
    random: np.random.Generator, family: str, craft: Craft, writer: Writer, folder: RawFolder
) -> dict[str, Any]:
    """Draw how this log says what it says, and write the true signals into the folder."""
    unit, robot = writer.style["units"] != "none", writer.style["robot"]
    pick = {
        "ros": {"position": "xy", "heading": str(random.choice(["xyzw", "xyzw", "math"])), "velocity": "flu"},
        "px4": {"position": "xy_ned", "heading": str(random.choice(["wxyz", "radpi"])), "velocity": "earth"},
        "ardu": {"position": "e7" if random.random() < 0.4 else "geo", "heading": "deg360", "velocity": "sog"},
        "lab": {
            "position": str(random.choice(["ne", "ne", "zup"])),
            "heading": str(random.choice(["deg360", "deg180", "radpi", "rad2pi"])),
            "velocity": str(random.choice(["body", "body", "none", "earth"])),
        },
        "crew": {
            "position": str(random.choice(["geo", "geo", "geo", "ddmm", "utm", "ne"])),
            "heading": str(random.choice(["deg360", "deg360", "deg360", "deg180", "rad2pi"])),
            "velocity": str(random.choice(["sog", "sog", "sog", "none", "body"])),
        },
    }[family]
    clocks = {
        "ros": ["epoch_s", "epoch_ns", "secs_nsecs", "elapsed"],
        "px4": ["boot_us"],
        "ardu": ["boot_us"],
        "lab": ["elapsed", "elapsed", "elapsed_ms"],
        "crew": [
            "iso",
            "iso",
            "local",
            "date_time",
            "hhmmss",
            "epoch_s",
            "epoch_ms",
            "elapsed",
            "excel",
            "time_of_day",
        ],
    }[family]
    pick["clock"] = str(random.choice(clocks))
    if pick["position"] == "zup":
        pick["heading"] = str(random.choice(["math", "math_deg"]))
    pick["separator"] = str(random.choice([",", ";", "\t", "|"], p=[0.55, 0.27, 0.13, 0.05])) if not robot else ","
    comma = pick["separator"] in (";", "\t") and random.random() < 0.55
    pick["decimal"] = "," if comma else "."
    pick["encoding"] = "cp1252" if random.random() < 0.2 and not robot else "utf-8"
    pick["ending"] = str(random.choice([".csv", ".csv", ".txt", ".dat"])) if not robot else ".csv"
    pick["rot"] = (
        str(random.choice(["deg/min", "deg/s", "rad/s", ""], p=[0.4, 0.25, 0.2, 0.15])) if not robot else "rad/s"
    )
    pick["speed"] = str(random.choice(["kn", "kn", "kn", "m/s", "km/h"])) if family == "crew" else "m/s"
    pick["wind"] = family == "crew" and random.random() < 0.45
    pick["wind_unit"] = str(random.choice(["m/s", "kn"]))
    pick["wind_apparent"] = pick["wind"] and random.random() < 0.35
    pick["slow"] = str(random.choice(["", "", "hold", "blank"])) if not robot else ""
    pick["heading_missing"] = family == "crew" and pick["velocity"] == "sog" and random.random() < 0.05
    pick["exchanged"] = 1 if family == "crew" and pick["heading"] == "deg360" and random.random() < 0.15 else -1
    pick["origin"] = (random.uniform(-60, 68), random.uniform(-150, 170))
    pick["lag"] = random.choice([0, 0.05]) * craft.tau
    signals, name, cannot = folder.signals, writer.name, []
    match pick["position"]:
        case "geo" | "e7" | "ddmm":
            unit_of = "ddmm" if pick["position"] == "ddmm" else "deg"
            factor = 1e-7 if pick["position"] == "e7" else 1.0
            for key, axis in (("lat", "latitude"), ("lon", "longitude")):
                signals[axis] = Signal((name(key, unit_of),), unit_of, factor=factor)
        case "xy":  # x east, y north
            signals["north"], signals["east"] = Signal((name("y", "m"),), "m"), Signal((name("x", "m"),), "m")
            cannot.append("hand of x and y")
            folder.frame = "ros"
        case "zup":
            writer.words = writer.words | {"x": ["x", "X", "Pos X"], "y": ["y", "Y", "Pos Y"]}
            signals["north"], signals["east"] = Signal((name("x", "m"),), "m"), Signal((name("y", "m"),), "m", sign=-1)
            cannot.append("hand of x and y")
            folder.frame = "zup"
        case _:
            signals["north"], signals["east"] = Signal((name("x", "m"),), "m"), Signal((name("y", "m"),), "m")
            folder.frame = "ned"
    unit_of = "deg" if pick["heading"].startswith("deg") or pick["heading"] == "math_deg" else "rad"
    wrap = (("wrap", True),)
    if pick["heading"] in ("xyzw", "wxyz"):
        base = str(random.choice(writer.words["q"]))
        tails = list(pick["heading"]) if pick["heading"] == "xyzw" else ["0", "1", "2", "3"]
        names = [base + tail + ("]" if base.endswith("[") else "") for tail in tails]
        writer.units |= dict.fromkeys(names, "")
        pick["quaternion"] = names
        columns = tuple(names if pick["heading"] == "xyzw" else [*names[1:], names[0]])  # x, y, z, w
        turned = {"sign": -1, "offset": math.pi / 2} if pick["heading"] == "xyzw" else {}
        signals["psi"] = Signal(columns, "quaternion", more=wrap, **turned)  # type: ignore[arg-type]
    elif pick["heading"] == "math":
        east = folder.frame == "ros"
        signals["psi"] = Signal((name("psi", "rad"),), "rad", -1, offset=math.pi / 2 if east else 0.0, more=wrap)
    elif pick["heading"] == "math_deg":
        signals["psi"] = Signal((name("psi", "deg"),), "deg", -1, more=wrap)
    elif pick["heading_missing"]:
        cannot.append("heading")
    else:
        signals["psi"] = Signal((name("psi", unit_of),), unit_of, more=wrap)
    speed = pick["speed"]
    up = -1 if folder.frame in ("ros", "zup") else 1
    match pick["velocity"]:
        case "sog":
            signals["speed"] = Signal((name("sog", speed),), speed)
            signals["course"] = Signal((name("cog", "deg"),), "deg", more=wrap)
        case "flu" | "body":
            signals["u"], signals["v"] = Signal((name("u", "m/s"),), "m/s"), Signal((name("v", "m/s"),), "m/s", up)
        case "earth":
            if family == "lab" and folder.frame == "zup":
                pick["velocity"] = "none"
            else:
                earth = (("frame", "earth"),)
                signals["u"] = Signal((name("vn", "m/s"),), "m/s", more=earth)
                signals["v"] = Signal((name("ve", "m/s"),), "m/s", more=earth)
    if pick["rot"]:
        signals["r"] = Signal((name("r", pick["rot"]),), pick["rot"], up)
    draw_commands(random, craft, writer, folder, pick, cannot)
    if pick["wind"]:
        more = (("relative", True),) if pick["wind_apparent"] else ()
        if language_of_wind := (writer.words.get("V_w") and writer.words is WORDS["en"] and pick["wind_apparent"]):
            writer.words = writer.words | {"V_w": ["App wind speed", "AWS"], "beta_w": ["App wind angle", "AWA"]}
        pick["wind_said"] = bool(language_of_wind)
        signals["V_w"] = Signal((name("V_w", pick["wind_unit"]),), pick["wind_unit"])
        signals["beta_w"] = Signal((name("beta_w", "deg"),), "deg", more=(("direction", "from"), *more, *wrap))
        cannot += ["true or apparent wind"] * (not pick["wind_said"]) + ["unit of the wind"] * (not unit)
    folder.cannot = tuple(cannot)
    return pick


def draw_commands(
    random: np.random.Generator,
    craft: Craft,
    writer: Writer,
    folder: RawFolder,
    pick: dict[str, Any],
    cannot: list[str],
) -> None:
    """Draw how the orders of the screws and of the helm are written; `pick["commands"]`: SI series -> cells."""
    robot, label = writer.style["robot"], writer.style["units"] != "none"
    screws = {"single": [("propeller", "")], "outboard": [("outboard", "")]}.get(
        craft.drive, [("port", "port"), ("starboard", "starboard")]
    )
    kind = {"ardu": ["us"], "ros": ["rpm", "share", "N", "rev/s"], "px4": ["rpm", "share"]}.get(
        robot, ["rpm", "rpm", "rpm"]
    )
    kind = [*kind, "%", "rev/s"] if not robot and label else kind
    unit = str(random.choice(kind))
    span = craft.n_max
    pick["commands"] = commands = {}
    words = {
        "share": ["throttle", "motor_cmd", "thrust_cmd"],
        "N": ["thrust_newton", "thrust_N"],
        "%": ["Throttle", "Lever"],
    }
    if unit in words and (robot or random.random() < 0.5):
        writer.words = writer.words | {"n": words[unit]}
    if unit == "rev/s" and robot:
        writer.words = writer.words | {"n": ["rps", "prop_rev_per_s"]}
    pick["unsigned"] = unit == "rpm" and not robot and random.random() < 0.06
    newton = float(random.uniform(0.3, 2) * craft.L**2.5)
    forms = {"us": ("rev/s", span / 400, -3.75 * span), "share": ("rev/s", span, 0.0), "%": ("rev/s", span / 100, 0.0)}
    forms["N"] = ("N", newton, 0.0)
    for position, (component, side) in enumerate(screws):
        extra = str(random.choice(writer.words[side])) if side else ""
        column = writer.name("n", {"share": ""}.get(unit, unit), extra)
        said, factor, zero = forms.get(unit, (unit, 1.0, 0.0))
        signal = Signal((column,), said, 1, factor, zero, free_scale=unit in forms)
        folder.signals[f"{component}.n"] = signal
        commands[f"{component}.n"] = (column, unit, 6 + position)
    if pick["unsigned"]:
        cannot.append("sense of the shaft")
    if unit in forms:
        cannot.append("scale of the thrust")
    if craft.drive == "twin":
        return
    azimuth = craft.drive in ("azimuth", "outboard")
    helm = {"ardu": ["us"], "ros": ["rad", "deg"], "px4": ["rad", "share"]}.get(robot, ["deg", "deg", "deg", "rad"])
    unit = str(random.choice([*helm, "%"] if not robot and label else helm))
    sense = int(random.choice([1, 1, -1]))
    for component, side in screws if craft.drive == "azimuth" else [("outboard" if azimuth else "rudder", "")]:
        key = "alpha" if azimuth else "delta"
        extra = next((w for w in writer.words.get(side, []) if "n" + w in writer.names), "")
        column = writer.name(key, {"share": ""}.get(unit, unit), extra)
        sign = sense if not azimuth else -sense  # alpha > 0 turns to port, helm > 0 to starboard
        factor = craft.d_max / {"us": 400, "share": 1, "%": 100}.get(unit, craft.d_max)
        free, zero = unit in ("us", "share", "%"), -1500 * factor * sign if unit == "us" else 0.0
        signal = Signal((column,), "rad" if free else unit, sign, factor, zero, free_scale=free)
        folder.signals[f"{component}.{key}"] = signal
        commands[f"{component}.{key}"] = (column, unit, 8)
    pick["sense"] = sense
    pick["order_too"] = not robot and random.random() < 0.2
    if pick["order_too"]:
        writer.name(key, unit, str(writer.words["order"][0]))


def hold(values: Array, every: int) -> Array:
    """Each value stays for so many rows."""
    return values[(np.arange(len(values)) // every) * every]


def write_columns(
    random: np.random.Generator,
    table: Array,
    dt: float,
    begin: datetime,
    weather: dict[str, float],
    writer: Writer,
    folder: RawFolder,
    pick: dict[str, Any],
) -> Recording:
    """Write the cells of one file and return its truth."""
    craft, names, add = folder.craft, writer.names, writer.add
    t, psi = np.arange(len(table)) * dt, table[:, 2]
    cos, sin = np.cos(psi), np.sin(psi)
    ahead = table[:, 3] + weather["c_n"] * cos + weather["c_e"] * sin
    across = table[:, 4] - weather["c_n"] * sin + weather["c_e"] * cos
    truth = {"north": table[:, 0], "east": table[:, 1], "psi": psi, "u": ahead, "v": across, "r": table[:, 5]}
    x, y = folder.lever
    north, east = table[:, 0] + x * cos - y * sin, table[:, 1] + x * sin + y * cos
    ahead, across = ahead - y * table[:, 5], across + x * table[:, 5]
    size, sigma = len(t), folder.sigma
    slow = 4 if pick["slow"] and dt < 0.6 else 1
    noise = lambda key: random.normal(0, sigma[key], size)  # noqa: E731
    north, east = north + noise("position"), east + noise("position")
    fine = 9 if craft.L < 6 else 7
    offset = (
        (random.uniform(-50, 50), random.uniform(-50, 50)) if pick["position"] in ("xy", "xy_ned", "zup") else (0, 0)
    )
    match pick["position"]:
        case "geo" | "e7" | "ddmm":
            lat, lon, _ = pymap3d.ned2geodetic(north, east, 0, *pick["origin"], 0)
            lat, lon = hold(lat, slow), hold(lon, slow)
            for key, value in (("lat", lat), ("lon", lon)):
                if pick["position"] == "e7":
                    add(names[key], [str(round(v * 1e7)) for v in value])
                elif pick["position"] == "ddmm":
                    minutes = np.trunc(value) * 100 + (value - np.trunc(value)) * 60
                    add(names[key], cells(minutes, fine - 1))
                else:
                    add(names[key], cells(value, fine))
        case "xy":
            add(names["x"], cells(east + offset[0], 4))
            add(names["y"], cells(north + offset[1], 4))
        case "zup":
            add(names["x"], cells(north + offset[0], 4))
            add(names["y"], cells(-east + offset[1], 4))
        case "utm":
            add(names["x"], cells(6.4e6 + 0.9996 * north, 3))
            add(names["y"], cells(4.2e5 + 0.9996 * east, 3))
        case _:
            add(names["x"], cells(north + offset[0], 4))
            add(names["y"], cells(east + offset[1], 4))
    heading = psi + noise("psi")
    turn = np.mod(heading, 2 * np.pi)
    centred = lambda a: np.mod(a + np.pi, 2 * np.pi) - np.pi  # noqa: E731
    if pick["heading"] in ("xyzw", "wxyz"):
        half = (np.pi / 2 - heading if pick["heading"] == "xyzw" else heading) / 2
        roll = random.normal(0, 0.004, size)
        w, z = np.cos(half), np.sin(half)
        flip = np.where(w < 0, -1, 1)
        quaternion = {"w": w * flip, "x": roll, "y": roll[::-1], "z": z * flip}
        for column, key in zip(pick["quaternion"], pick["heading"], strict=True):
            add(column, cells(quaternion[key], 6))
    elif pick["heading"] == "math":
        add(names["psi"], cells(centred((np.pi / 2 if folder.frame == "ros" else 0) - heading), 5))
    elif pick["heading"] == "math_deg":
        add(names["psi"], cells(centred(-heading) / DEGREE, 3))
    elif "psi" in names:
        value = {
            "deg360": turn / DEGREE,
            "deg180": centred(heading) / DEGREE,
            "rad2pi": turn,
            "radpi": centred(heading),
        }
        add(names["psi"], cells(value[pick["heading"]], 2 if pick["heading"].startswith("deg") else 4))
    back = np.clip(np.arange(size) - round(float(pick["lag"]) / dt), 0, None)
    vn = (ahead * cos - across * sin)[back] + noise("velocity")
    ve = (ahead * sin + across * cos)[back] + noise("velocity")
    small = 3 if craft.U < 2 else 2
    match pick["velocity"]:
        case "sog":
            add(names["sog"], cells(hold(np.hypot(vn, ve), slow) / SI.get(pick["speed"], 1), small))
            add(names["cog"], cells(np.mod(hold(np.arctan2(ve, vn), slow) / DEGREE, 360), 1))
        case "flu" | "body":
            up = -1 if folder.frame in ("ros", "zup") else 1
            add(names["u"], cells(ahead + noise("velocity"), 4))
            add(names["v"], cells(up * across + noise("velocity"), 4))
        case "earth":
            add(names["vn"], cells(vn, 4))
            add(names["ve"], cells(ve, 4))
    if "r" in names:
        up = -1 if folder.frame in ("ros", "zup") else 1
        add(
            names["r"],
            cells(up * (table[:, 5] + noise("r")) / SI.get(pick["rot"], 1), 5 if pick["rot"] == "rad/s" else 2),
        )
    for key, (column, unit, index) in pick["commands"].items():
        share = table[:, index] if index == 8 else table[:, index + 3]  # the helm is measured, screws are ordered
        signal = folder.signals[key]
        if index == 8:
            truth[key] = share if "delta" in key else -share
            raw = pick["sense"] * share / craft.d_max
            sounding = random.normal(0, 0.004, size)
            digits = {"deg": 1, "rad": 4, "%": 1, "share": 3}.get(unit, 0)
            full = {"deg": craft.d_max / DEGREE, "rad": craft.d_max, "%": 100, "us": 400, "share": 1}[unit]
            add(column, cells((raw + sounding) * full + (1500 if unit == "us" else 0), digits))
        else:
            truth[key] = share * craft.n_max
            worth = np.abs(share) if pick["unsigned"] else share
            full = {"rpm": 60 * craft.n_max, "rev/s": craft.n_max, "%": 100, "us": 400, "share": 1}.get(unit, 0)
            value = worth * np.abs(worth) * signal.factor if unit == "N" else worth * full
            digits = {"rpm": 1, "rev/s": 3, "%": 1, "share": 3, "N": 2}.get(unit, 0)
            add(column, cells(value + (1500 if unit == "us" else 0), digits))
    for key, column in names.items():
        if pick.get("order_too") and key in ("delta" + writer.words["order"][0], "alpha" + writer.words["order"][0]):
            unit = next(unit for _, unit, index in pick["commands"].values() if index == 8)
            full = {"deg": craft.d_max / DEGREE, "rad": craft.d_max, "%": 100}[unit]
            add(column, cells(pick["sense"] * table[:, 11] / craft.d_max * full, 2))
    if pick["wind"]:
        wn = weather["V_w"] * math.cos(weather["beta_w"]) + 0.08 * weather["V_w"] * random.normal(size=size)
        we = weather["V_w"] * math.sin(weather["beta_w"]) + 0.08 * weather["V_w"] * random.normal(size=size)
        truth["V_w"], truth["beta_w"] = np.hypot(wn, we), np.unwrap(np.arctan2(we, wn))
        bow = 0.0
        if pick["wind_apparent"]:
            wn, we = wn - (truth["u"] * cos - truth["v"] * sin), we - (truth["u"] * sin + truth["v"] * cos)
            bow = psi
        add(names["V_w"], cells(np.hypot(wn, we) / SI.get(pick["wind_unit"], 1), 2))
        add(names["beta_w"], cells(np.mod((np.arctan2(we, wn) + np.pi - bow) / DEGREE, 360), 1))
    if pick["slow"] == "blank" and slow > 1:
        for key in ("lat", "lon", "sog", "cog"):
            if key in names:
                last = writer.series[names[key]][-1]
                last[:] = [cell if row % slow == 0 else "" for row, cell in enumerate(last)]
    add_decoys(random, writer, size, heading, pick)
    starts = write_clock(writer, pick, t, begin, dt)
    return Recording(folder.path, t, truth, starts)


def add_decoys(random: np.random.Generator, writer: Writer, size: int, heading: Array, pick: dict[str, Any]) -> None:
    """Add columns that are no motion: voltages, temperatures, counters, constants, a filtered copy."""
    if "decoys" not in pick:
        words = writer.words["decoys"]
        chosen = random.choice(words, int(random.integers(0, min(6, len(words)))), replace=False)
        kinds = [next(kind for kind, form in enumerate(DECOYS) if re.search(form, word, re.I)) for word in chosen]
        pick["decoys"] = [(str(w), 3 if random.random() < 0.1 else kind) for w, kind in zip(chosen, kinds, strict=True)]
        filtered = "psi" in writer.names and pick["heading"] == "deg360" and random.random() < 0.12
        pick["filtered"] = writer.names["psi"] + "_filt" if filtered else ""  # of every file: one may exchange names
        writer.names |= {word: word for word, _ in pick["decoys"]}
        writer.units |= {word: "" for word, _ in pick["decoys"]}
    for word, kind in pick["decoys"]:
        walk = np.cumsum(random.normal(0, 0.01, size))
        wave = 1.2 * np.sin(0.7 * np.arange(size)) + random.normal(0, 0.4, size)
        values = [60 + 3 * walk, 24.3 + 0.1 * walk, np.arange(size, dtype=float), np.full(size, 3.0), wave]
        writer.add(word, cells(values[kind], 0 if kind in (2, 3) else 2))
    if pick["filtered"]:
        smooth = pd.Series(heading).ewm(alpha=0.5).mean().to_numpy()
        writer.add(pick["filtered"], cells(np.mod(smooth / DEGREE, 360), 2))


def write_clock(writer: Writer, pick: dict[str, Any], t: Array, begin: datetime, dt: float) -> tuple[float, ...]:
    """Write the column or columns of the clock; return what seconds it may show at the start."""
    epoch, midnight = begin.timestamp(), begin.hour * 3600 + begin.minute * 60 + begin.second
    digits = 0 if dt >= 1 else 2
    stamps = [begin + timedelta(seconds=round(float(s), 3)) for s in t]
    cut = None if digits else -7
    kind = pick["clock"]
    unit = {"elapsed": "s"}.get(kind, "")
    if kind == "secs_nsecs":
        for key in ("secs", "nsecs"):
            writer.name(key)
        whole = np.floor(np.round(t, 3)).astype(int)
        writer.add(writer.names["secs"], [str(int(epoch) + int(s)) for s in whole])
        writer.add(writer.names["nsecs"], [str(int(1e6) * int(v)) for v in np.round((np.round(t, 3) - whole) * 1000)])
        return tuple(epoch + shift / 10 for shift in range(-9, 10))  # whole seconds alone are late by a part of one
    name = writer.name("time", unit)
    boot = 9_000_000
    text = {
        "iso": lambda: [s.strftime("%Y-%m-%d %H:%M:%S.%f")[:cut] for s in stamps],
        "local": lambda: [s.strftime("%d.%m.%Y %H:%M:%S.%f")[:cut] for s in stamps],
        "date_time": lambda: [s.strftime("%H:%M:%S.%f")[:cut] for s in stamps],
        "time_of_day": lambda: [s.strftime("%H:%M:%S.%f")[:cut] for s in stamps],
        "hhmmss": lambda: [s.strftime("%H%M%S.%f")[: cut or -4] for s in stamps],
        "epoch_s": lambda: [f"{epoch + s:.{digits}f}" for s in t],
        "epoch_ms": lambda: [str(round((epoch + s) * 1000)) for s in t],
        "epoch_ns": lambda: [str(round(epoch) * 10**9 + round(s * 1000) * 10**6) for s in t],
        "boot_us": lambda: [str(boot + round(s * 1e6)) for s in t],
        "elapsed": lambda: cells(t, max(digits, 1)),
        "elapsed_ms": lambda: [str(round(s * 1000)) for s in t],
        "excel": lambda: cells((epoch + t) / 86400 + 25569, 9),
    }[kind]()
    if kind == "date_time":
        writer.add(writer.name("date"), [s.strftime("%d.%m.%Y") for s in stamps])
    writer.add(name, text)
    return {"boot_us": (boot / 1e6,), "elapsed": (0.0,), "elapsed_ms": (0.0,)}.get(kind, (epoch, float(midnight)))


CLOCKS = {
    "iso": "date", "local": "date", "date_time": "date", "time_of_day": "date", "hhmmss": "hhmmss", "epoch_s": "s",
    "epoch_ms": "ms", "epoch_ns": "ns", "boot_us": "us", "elapsed": "s", "elapsed_ms": "ms", "excel": "excel",
}  # fmt: skip


def write_files(random: np.random.Generator, writer: Writer, folder: RawFolder, pick: dict[str, Any]) -> None:
    """Write the files with head lines, holes and missing cells, one of another kind, and the true mapping."""
    names = list(writer.series)
    first = [n for key in ("date", "time", "secs", "nsecs") if (n := writer.names.get(key)) in names]
    rest = [n for n in names if n not in first]
    if random.random() < 0.4:
        rest = [str(n) for n in random.permutation(rest)]
    order = [*first, *rest]
    head = int(random.choice([0, 0, 0, 1, 3])) if not writer.style["robot"] else 0
    separator, decimal = pick["separator"], pick["decimal"]
    holes, missing = random.random() < 0.25, random.random() < 0.2 and not writer.style["robot"]
    for index, record in enumerate(folder.recordings):
        columns = {name: list(writer.series[name][index]) for name in order}
        size = len(record.t)
        if decimal == ",":
            dotted = {n for n in first if pick["clock"] in ("iso", "local", "date_time", "time_of_day")}
            columns = {n: c if n in dotted else [v.replace(".", ",") for v in c] for n, c in columns.items()}
        if missing and "sog" in writer.names:
            for row in random.choice(size, 6, replace=False):
                columns[writer.names["sog"]][row] = str(pick.setdefault("hole", random.choice(["", "NaN", "-"])))
        keep = np.ones(size, bool)
        if holes:
            at = int(random.integers(size // 4, size // 2))
            keep[at : at + int(random.integers(30, 80))] = False
        lines = ["# vessel log", "# operator: bridge", "# all times UTC"][:head]
        lines.append(separator.join(order))
        if writer.style["units"] == "row":
            labels = [LABELS.get(writer.units.get(n, ""), ["-"])[0] for n in order]
            lines.append(separator.join(labels))
        lines += [separator.join(columns[n][row] for n in order) for row in np.flatnonzero(keep)]
        record.file.write_text("\n".join(lines) + "\n", encoding=pick["encoding"], errors="replace")
    other = random.random() < 0.15 and len(folder.recordings) > 1
    if other:
        kind = int(random.integers(3))
        texts = [
            "time,air pressure hPa,air temp C\n"
            + "".join(f"{60 * i},{1013 + 0.01 * i:.2f},{14.2:.1f}\n" for i in range(60)),
            "Notes of the day\nWe left the quay at nine. The third run was disturbed by a ferry.\n",
            "channel;gain;offset\nrudder;1.0;0.0\nshaft;1.0;0.0\n",
        ]
        ending = folder.recordings[0].file.suffix if kind != 1 else ".txt"
        (folder.path / (["weather", "notes", "calibration"][kind] + ending)).write_text(texts[kind])
        folder.cannot += ("one file is of another kind",)
    folder.clock = tuple(first)
    folder.mapping = true_mapping(writer, folder, pick, head, order)
    if len(folder.recordings) == 1:
        folder.path = folder.recordings[0].file


def true_mapping(
    writer: Writer, folder: RawFolder, pick: dict[str, Any], head: int, order: list[str]
) -> dict[str, Any]:
    """Write the mapping document that is right for this folder; empty where the form cannot say it."""
    newton = any(signal.unit == "N" for signal in folder.signals.values())
    exchanged = any("exchanged" in word for word in folder.cannot)
    if pick["clock"] not in CLOCKS or pick["heading_missing"] or pick["unsigned"] or newton or exchanged:
        return {}
    document: dict[str, Any] = {"name": "truth"}
    if len(folder.recordings) > 1:
        document["source"] = {"runs": f"*{pick['ending']}"}
        others = [
            p.name for p in folder.recordings[0].file.parent.iterdir() if p not in [r.file for r in folder.recordings]
        ]
        document["source"] |= {"skip": [o for o in others if o.endswith(pick["ending"])]} if others else {}
    document["format"] = {"separator": pick["separator"], "decimal": pick["decimal"], "encoding": pick["encoding"]}
    document["format"] |= {"skip_rows": head, "missing": ["", "NaN", "-"]}
    if writer.style["units"] == "row":
        document["format"] |= {"header": False, "names": order, "skip_rows": head + 2}
    document["clock"] = {"from": writer.names["time"], "unit": CLOCKS[pick["clock"]], "max_gap": 10 * folder.craft.tau}
    if pick["clock"] == "date_time":
        document["clock"]["date"] = writer.names["date"]
    if "latitude" in folder.signals:
        document["origin"] = dict(zip(("latitude", "longitude"), pick["origin"], strict=True))
    columns = document["columns"] = {}
    for name, signal in folder.signals.items():
        source = signal.columns[0] if len(signal.columns) == 1 else list(signal.columns)
        columns[name] = {"from": source, "unit": signal.unit} | dict(signal.more)
        columns[name] |= {"sign": signal.sign} if signal.sign != 1 else {}
        columns[name] |= {"factor": signal.factor} if signal.factor != 1 else {}
        columns[name] |= {"offset": signal.offset} if signal.offset else {}
    if ("u" not in folder.signals and "speed" not in folder.signals) or "r" not in folder.signals:
        craft, sigma = folder.craft, folder.sigma
        document["estimate"] = {
            "position": sigma["position"] + 1e-3,
            "heading_deg": sigma["psi"] / DEGREE + 0.01,
            "velocity": sigma["velocity"] + 1e-3,
            "rate_deg": sigma["r"] / DEGREE + 1e-3,
            "acceleration": 0.3 * craft.U / craft.tau,
            "angular_acceleration_deg": 0.6 / craft.tau**2 / DEGREE,
        }
    return document


def vessel_text(craft: Craft) -> str:
    """Write a vessel document with the names, the places and about the size of this ship."""
    L, m = craft.L, 100.0 * craft.L**3 * 0.12
    drag = m / L / craft.surge
    text = f'name = "Drawn"\ndof = 3\n[particulars]\nL_pp = {L:.3f}\nU_0 = {craft.U:.3f}\n[constants]\nrho = 1025.0\n'
    text += f'[inertia]\nm = {m:.4g}\nI_z = {m * (0.25 * L) ** 2:.4g}\nx_G = 0.0\n[added_mass]\ncoriolis = "none"\n'
    text += f"X_udot = {-0.05 * m:.4g}\nY_vdot = {-0.8 * m:.4g}\nN_rdot = {-0.7 * m * (0.25 * L) ** 2:.4g}\n"
    text += (
        f'[hull.derivatives]\n"X_u|u|" = {-drag:.4g}\n"Y_v|u|" = {-1.2 * m / L:.4g}\n"N_r|u|" = {-0.1 * m * L:.4g}\n'
    )
    single = {"single": "propeller", "outboard": "outboard"}.get(craft.drive)
    for name in [single] if single else ["port", "starboard"]:
        side = {"port": -0.15, "starboard": 0.15}.get(name, 0.0) * L
        text += f"[thruster.{name}]\nx = {-0.45 * L:.3f}\ny = {side:.3f}\n"
        if craft.drive in ("azimuth", "outboard"):
            text += f'kind = "azimuth"\nz = {0.02 * L:.3f}\nD_p = {0.06 * L:.4f}\nk_T = 1.0\nk_astern = 0.65\n'
            text += "J_t = 0.06\nJ_min = -0.3\nJ_max = 1.4\nJy_max = 0.6\nk_over = 0.5\nk_over2 = 0.12\nk_under = 0.1\n"
            text += f'k_side = 0.6\nk_sideJ = 0.4\n[thruster.{name}.K_x]\n"1" = 0.45\nJ = -0.3\n'
            text += f"[thruster.{name}.K_y]\ny = -0.3\n"
        else:
            text += f'kind = "quadratic"\nT_nn = {drag * craft.U**2 / craft.n_max**2 / (1 if single else 2):.4g}\n'
    if craft.drive in ("single", "twinrudder"):
        text += f'[thruster.rudder]\nkind = "rudder_coefficients"\nbehind = "{single or "port"}"\n'
        text += '"Y_|c|cdelta" = -0.003\n"N_|c|cdelta" = 0.0015\n'
    return text


# ------------------------------------------------------------------------------------------------- the judge


def match_recording(folder: RawFolder, rows: pd.DataFrame) -> tuple[Recording, Array] | None:
    """Find the file and the start of the clock of one imported run: by time, then by the heading that fits best."""
    best: tuple[float, Recording, Array] | None = None
    for record in folder.recordings:
        for start in record.starts:
            t = rows["t"].to_numpy() - start
            slack = 2 * (record.t[1] - record.t[0])
            if t[0] < -slack or t[-1] > record.t[-1] + slack or len(t) < 5:
                continue
            rate = np.interp(t, record.t, record.truth["psi"])
            misfit = float(np.mean(np.abs(np.sin((rows["psi"].to_numpy() - rate) / 2))))
            path = np.gradient(np.interp(t, record.t, record.truth["north"])) - np.gradient(rows["north"].to_numpy())
            misfit += float(np.sqrt(np.mean(path**2))) / folder.craft.L * 0.1
            if best is None or misfit < best[0]:
                best = misfit, record, t
    return best and (best[1], best[2])


def wrong_signals(folder: RawFolder, table: pd.DataFrame) -> dict[str, str]:
    """Compare an imported table with the truth: signal -> what is wrong with it; empty where all is right."""
    parts = []
    for _, rows in table.groupby("run", sort=False):
        if len(rows) >= 5:
            found = match_recording(folder, rows)
            if found is None:
                return {"clock": f"times {rows['t'].iloc[0]:.6g} to {rows['t'].iloc[-1]:.6g} are in no file"}
            record, t = found
            values = {key: np.interp(t, record.t, series) for key, series in record.truth.items()}
            parts.append((rows, pd.DataFrame(values)))
    size, speed, sigma = folder.craft.L, folder.craft.U, folder.sigma
    error = {key: [] for key in ("position", "psi", "u", "v", "r")}
    for rows, true in parts:
        for key, value in motion_errors(folder, rows, true).items():
            error[key].append(value)
    if not parts:
        return {"clock": "no run of five rows"}
    imported = pd.concat([rows for rows, _ in parts], ignore_index=True)
    true = pd.concat([values for _, values in parts], ignore_index=True)
    rms = {key: float(np.sqrt(np.mean(np.concatenate(value) ** 2))) for key, value in error.items()}
    rms["psi"] = max(float(np.sqrt(np.mean(value**2))) for value in error["psi"])  # a single file counts
    spread = {key: float(np.sqrt(np.mean(true[key] ** 2))) for key in ("u", "v", "r")}
    extent = float(np.ptp(true["north"]) + np.ptp(true["east"]))
    limits = {
        "position": 0.23 * size + 4 * sigma["position"] + 0.004 * extent,
        "psi": 4 * DEGREE + 4 * sigma["psi"],
        "u": 0.12 * spread["u"] + 4 * sigma["velocity"],
        "v": 0.5 * spread["v"] + 0.04 * speed + 4 * sigma["velocity"],
        "r": 0.3 * spread["r"] + 4 * sigma["r"],
    }
    faults = {
        key: f"{key} errs by {rms[key]:.3g}, allowed {limits[key]:.3g}" for key in limits if not rms[key] < limits[key]
    }
    for key in true.columns:
        if "." in key and (fault := command_fault(folder, key, imported, true[key].to_numpy())):
            faults[key] = fault
    if "V_w" in true and "V_w" not in imported:
        faults["wind"] = "missing"
    elif "V_w" in true and float(true["V_w"].mean()) > 0.5:
        wrong = imported["V_w"].to_numpy() * np.exp(1j * imported["beta_w"].to_numpy())
        wrong = wrong - true["V_w"].to_numpy() * np.exp(1j * true["beta_w"].to_numpy())
        scale = float(np.sqrt(np.mean(true["V_w"] ** 2)))
        if np.sqrt(np.mean(np.abs(wrong) ** 2)) > 0.3 * scale + 0.1 * speed:
            faults["wind"] = f"wind errs by {np.sqrt(np.mean(np.abs(wrong) ** 2)):.3g} of {scale:.3g} m/s"
    return faults


def motion_errors(folder: RawFolder, rows: pd.DataFrame, true: pd.DataFrame) -> dict[str, Array]:
    """Errors of one run in SI; a point of the ship between origin and antenna, and a little more, is free."""
    got = {key: rows[key].to_numpy() for key in ("north", "east", "psi", "u", "v", "r")}
    turn = got["psi"] - true["psi"].to_numpy()
    cos, sin = np.cos(true["psi"].to_numpy()), np.sin(true["psi"].to_numpy())
    ones, zero, r = np.ones(len(rows)), np.zeros(len(rows)), true["r"].to_numpy()
    (x, y), slack = folder.lever, 0.12 * folder.craft.L
    north, east = got["north"] - true["north"].to_numpy(), got["east"] - true["east"].to_numpy()
    bounds = [(min(0.0, at) - slack, max(0.0, at) + slack) for at in (x, y)]
    design = np.concatenate([np.stack([ones, zero, cos, -sin], 1), np.stack([zero, ones, sin, cos], 1)])
    fit = np.linalg.lstsq(design, np.concatenate([north, east]), rcond=None)[0]
    ahead, aside = (float(np.clip(value, *limit)) for value, limit in zip(fit[2:], bounds, strict=True))
    north, east = north - ahead * cos + aside * sin, east - ahead * sin - aside * cos
    v, u = got["v"] - true["v"].to_numpy(), got["u"] - true["u"].to_numpy()
    square = max(float(r @ r), 1e-30)
    v = v - float(np.clip(v @ r / square, *bounds[0])) * r
    u = u - float(np.clip(u @ r / square, -bounds[1][1], -bounds[1][0])) * r
    return {
        "position": np.hypot(north - np.median(north), east - np.median(east)),
        "psi": np.angle(np.exp(1j * turn)),
        "u": u,
        "v": v,
        "r": got["r"] - r,
    }


SIDES = {"port": ("port", "left"), "starboard": ("starboard", "stbd", "right")}
KINDS = {"n": ("n", "thrust", "force", "throttle", "pitch"), "alpha": ("alpha", "delta"), "delta": ("delta", "alpha")}


def command_fault(folder: RawFolder, key: str, table: pd.DataFrame, true: Array) -> str:
    """What is wrong with a command of the imported table; empty where one of its columns is right."""
    component, _, kind = key.partition(".")
    other = {"port": "starboard", "starboard": "port"}.get(component)
    candidates = [name for name in table.columns if name.rpartition(".")[2] in KINDS[kind] and "." in name]
    if other:
        candidates = [name for name in candidates if not any(word in name.lower() for word in SIDES[other])]
    told = ["missing"]
    for name in candidates:
        turned = -1.0 if name.rpartition(".")[2] != kind and kind in ("alpha", "delta") else 1.0
        value, free = turned * table[name].to_numpy(), folder.signals[key].free_scale
        shapes = [true] if not free or kind != "n" else [true, true * np.abs(true)]
        faults = [series_fault(value, shape, free) for shape in shapes]
        if not all(faults):
            return ""
        told = [f"{name}: {faults[0]}"]
    return told[-1]


def series_fault(value: Array, true: Array, free: bool) -> str:
    """Compare two series: slope, zero and scatter; with a free scale any positive slope is right."""
    reach = float(np.max(np.abs(true)))
    if np.std(true) < 0.02 * reach or reach == 0:
        level = float(np.mean(true))
        return (
            ""
            if free or abs(np.mean(value) - level) <= 0.1 * max(reach, 1e-9)
            else f"{np.mean(value):.3g} for {level:.3g}"
        )
    slope, zero = np.polyfit(true, value, 1)
    if not np.isfinite(slope) or slope <= 0:
        return f"the sense is wrong (slope {slope:.2g})"
    if not free and not 0.85 < slope < 1.15:
        return f"{slope:.3g} times the truth"
    if abs(zero) > 0.1 * slope * reach:
        return f"zero {zero / slope / reach:.2g} of the reach away"
    scatter = np.std(value - slope * true - zero) / slope / np.std(true)
    return "" if scatter < 0.5 else f"another series (scatter {scatter:.2g})"


@dataclass(frozen=True)
class Verdict:
    """How a draft ended: one of the words of the head of this file, with the reason."""

    word: str
    reason: str
    questions: int


def run_command(*arguments: object) -> tuple[int, str, bool]:
    """Status, output and whether the command broke, of `shipid ...` in this process."""
    from shipid.cli import app  # the command of the user; all else here is independent of shipid

    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    kinds = [kind.__name__ for kind in type(result.exception).__mro__]
    text = f"{result.output} {result.exception if result.exit_code else ''}"
    return result.exit_code, text, not {"NoneType", "SystemExit", "ShipidError"} & set(kinds)


def import_draft(folder: RawFolder, place: Path, *options: object) -> tuple[str, dict[str, str], str]:
    """Draft and import: the draft's text, the wrong signals, and the refusal or crash, if any."""
    draft, out = place / "draft.toml", place / "draft.parquet"
    for file in (draft, out):
        file.unlink(missing_ok=True)
    vessel = ["--vessel", folder.vessel] if folder.vessel else []
    status, text, broke = run_command("data", "import", "--guess", folder.path, *vessel, *options, "--out", draft)
    if broke or not draft.exists():
        return "", {}, ("crash: " if broke else "refused: ") + " ".join(text.split())[-300:]
    words = draft.read_text(encoding="utf-8")
    status, text, broke = run_command("data", "import", draft, folder.path, "--out", out)
    if status or broke:
        return words, {}, ("crash: " if broke else "import refused: ") + " ".join(text.split())[-300:]
    return words, wrong_signals(folder, pd.read_parquet(out)), ""


def judge_folder(folder: RawFolder, place: Path) -> Verdict:
    """Draft a mapping as a user would, import with it unread, and judge."""
    words, faults, refusal = import_draft(folder, place)
    questions = [line for line in words.splitlines() if line.startswith("# ?")]
    told, count = "\n".join(questions), len(questions)
    if refusal.startswith("crash"):
        return Verdict("crash", refusal, count)
    if refusal:
        named = words and any(
            names_a_column(folder, told, key) for key in ("clock", "position", "psi", *folder.signals)
        )
        return Verdict("asked" if named else "refused", refusal, count)
    reason = "; ".join(f"{key}: {value}" for key, value in faults.items())
    if faults and folder.frame and "--frame" in told:
        _, again, refusal = import_draft(folder, place, "--frame", folder.frame)
        reason += (
            f"; with --frame {folder.frame}: {refusal or '; '.join(f'{k}: {v}' for k, v in again.items()) or 'right'}"
        )
        if refusal.startswith("crash") or not (refusal or again):
            return Verdict("crash" if refusal else "asked", reason, count)
        faults = faults if refusal else again
    if not faults:
        return Verdict("right", "", count)
    roots = [key for key in ("clock", "position", "psi") if key in faults and question_answers(folder, key, told)]
    follows = {key for key, value in faults.items() if roots and ("." not in key or "sense" in value)}
    left = {
        key: value for key, value in faults.items() if key not in follows and not question_answers(folder, key, told)
    }
    if not left:
        return Verdict("marked" if refusal else "asked", reason, count)
    silent = [key for key, value in left.items() if value != "missing"]
    silent = [key for key in silent if not (key in ("u", "v", "r") and {"position", "psi"} & set(silent))] or silent
    warned = "\n".join(line for line in words.splitlines() if line.startswith("# !"))
    drafted = re.findall(r"(?m)^\[columns\.([^]]*)\](.*)\nfrom = (.*)$", words)
    unmarked = []
    for key in silent:
        mine = [(note, source) for name, note, source in drafted if name.strip('"') in judged_columns(key)]
        doubted = any(f"'{column}'" in told for _, source in mine for column in re.findall(r'"([^"]*)"', source))
        if not (doubted or question_answers(folder, key, warned) or any("UNSURE" in note for note, _ in mine)):
            unmarked.append(key)
    return Verdict("SILENT" if unmarked else "marked" if silent else "missing", reason, count)


def judged_columns(key: str) -> tuple[str, ...]:
    """Columns of a mapping that a judged quantity comes from."""
    groups = {
        "position": ("north", "east", "latitude", "longitude"),
        "psi": ("psi", "course"),
        "u": ("u", "v", "speed", "course"),
        "v": ("u", "v", "speed", "course"),
        "wind": ("V_w", "beta_w"),
    }
    return groups.get(key, (key,))


def names_a_column(folder: RawFolder, text: str, key: str) -> bool:
    """Whether a text names a true column of a quantity: as a whole word, a short one in quotes."""
    sources = [folder.signals[name].columns for name in judged_columns(key) if name in folder.signals]
    names = [name for columns in sources for name in columns] if key != "clock" else folder.clock
    forms = [
        rf"(?<!\w){re.escape(n)}(?!\w)" if len(n) > 3 else rf"['\"`]{re.escape(n)}( \[.*?\])?['\"`]" for n in names
    ]
    return any(re.search(form, text) for form in forms)


def question_answers(folder: RawFolder, key: str, text: str) -> bool:
    """Whether a question covers a wrong quantity: it names its column; or it is the standing one of apparent wind."""
    standing = key == "wind" and "true or apparent wind" in folder.cannot and "apparent" in text
    return standing or names_a_column(folder, text, key)


def judge_many(seed: int, count: int, root: Path) -> Iterator[tuple[RawFolder, Verdict]]:
    """Draw, draft and judge so many folders."""
    for number in range(count):
        folder = draw_raw_folder(seed * 1000 + number, root)
        place = root / f"work-{number}"
        place.mkdir()
        yield folder, judge_folder(folder, place)


def main() -> None:
    """Print a line a folder and the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--keep", type=Path, help="folder for the logs; default: a temporary one, failures are kept")
    options = parser.parse_args()
    root = options.keep or Path(tempfile.mkdtemp(prefix="raw-folders-"))
    table: Counter[str] = Counter()
    by_family: dict[str, Counter[str]] = {}
    questions = 0
    for folder, verdict in judge_many(options.seed, options.count, root):
        table[verdict.word] += 1
        by_family.setdefault(folder.words.split()[0], Counter())[verdict.word] += 1
        questions += verdict.questions
        if verdict.word == "right" and not options.keep:
            place = folder.path if folder.path.is_dir() else folder.path.parent
            shutil.rmtree(place)
        else:
            cannot = f" [cannot tell: {', '.join(folder.cannot)}]" if folder.cannot else ""
            print(f"{verdict.word:8} {folder.path} ({folder.words}){cannot} {verdict.reason}", flush=True)
    words = ["right", "asked", "refused", "marked", "missing", "crash", "SILENT"]
    print(f"\n{'':10}" + "".join(f"{word:>9}" for word in words))
    for family, counts in sorted(by_family.items()):
        print(f"{family:10}" + "".join(f"{counts[word]:>9}" for word in words))
    print(f"{'all':10}" + "".join(f"{table[word]:>9}" for word in words))
    print(f"{questions / options.count:.1f} questions a folder; folders in {root}")


if __name__ == "__main__":
    main()
