"""Raw folders of two dozen trades, drawn by seed, each with what it truly is: another author's than `raw_folders`.

`python -m tests.logs.foreign_folders --seed 1 --count 20` draws and judges them: right; asked, where the draft has a
question about all that is wrong; missing, where a column is not read; refused; silent.
"""

# ruff: noqa: E501

from __future__ import annotations

import argparse
import collections
import dataclasses
import datetime
import functools
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tests.logs.judged_raw import judge_raw

Array = NDArray[np.float64]
PER_SI = {
    "": 1.0, "m": 1.0, "ft": 1 / 0.3048, "cm": 100.0, "km": 1e-3, "rad": 1.0, "deg": 180 / np.pi, "rad/s": 1.0,
    "deg/s": 180 / np.pi, "deg/min": 180 / np.pi * 60, "m/s": 1.0, "kn": 3600 / 1852, "km/h": 3.6, "rpm": 60.0,
    "rev/s": 1.0,
}  # fmt: skip
SHARES = {"%": (100.0, 0.0), "us": (400.0, 1500.0), "share": (1.0, 0.0)}  # of a command: of its greatest, at zero
SPELT = {
    "deg": ("deg", "°", "degrees", "Deg"), "rad": ("rad",), "deg/s": ("deg/s", "°/s", "dps"), "rad/s": ("rad/s", "rad.s-1"),
    "deg/min": ("deg/min", "°/min"), "m/s": ("m/s", "mps", "m.s-1"), "kn": ("kn", "kts", "knots", "kt"), "m": ("m",),
    "km/h": ("km/h", "kmh"), "rpm": ("rpm", "RPM", "1/min"), "rev/s": ("rps", "Hz", "1/s"), "%": ("%", "pct"),
    "us": ("us", "PWM"), "ft": ("ft",), "cm": ("cm",), "km": ("km",),
}  # fmt: skip
FRAMES = {  # what the first and second axis are; sign of a heading; where it counts from [rad]
    "ned": ("north", 1, "east", 1, 1, 0.0),
    "enu": ("east", 1, "north", 1, 1, 0.0),
    "ros": ("east", 1, "north", 1, -1, np.pi / 2),
    "zup": ("north", 1, "east", -1, -1, 0.0),
}


@dataclasses.dataclass(frozen=True)
class Column:
    """What a column truly is: raw = scale x SI + offset, then wrapped, with noise, rounded; as in `judged_raw`."""

    header: str
    signal: str
    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0
    wrap: tuple[float, float] | None = None
    noise: float = 0.0
    decimals: int = 3
    late: float = 0.0
    held: float = 0.0
    at: float = 0.0
    also: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True)
class LogFile:
    """A file of the folder and the runs in it; none where the folder does not say how many there are."""

    path: str
    runs: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True)
class Folder:
    """A raw folder and its truth. known : what people know of the craft. story : how it was written."""

    seed: int
    folder: Path
    known: Mapping[str, float]
    files: tuple[LogFile, ...]
    columns: tuple[Column, ...]
    story: Mapping[str, Any]


@dataclasses.dataclass(frozen=True)
class Trade:
    """How one kind of people writes logs.

    words : signal -> names that they use; {} is the side. units : quantity -> units. frames : of x and y, or "geo".
    sides : words for port and starboard. clocks : kinds of `clock_cells`. own : whether names are kept as they are.
    """

    words: Mapping[str, Sequence[str]]
    units: Mapping[str, Sequence[str]]
    frames: Sequence[str] = ("geo",)
    sides: tuple[str, str] = ("port", "starboard")
    clocks: Sequence[str] = ("iso", "local", "epoch", "two")
    own: bool = False
    decimal: str = "."
    noise: Sequence[str] = ("good", "fair", "poor")


BRIDGE = {"angle": ("deg",), "rate": ("deg/min", "deg/s"), "speed": ("kn",), "steer": ("deg",), "shaft": ("rpm",),
          "length": ("m",), "wind": ("m/s", "kn")}  # fmt: skip
LAB = {"angle": ("deg", "rad"), "rate": ("deg/s", "rad/s"), "speed": ("m/s", "km/h"), "steer": ("deg", "rad"),
       "shaft": ("rpm", "rev/s"), "length": ("m",), "wind": ("m/s",)}  # fmt: skip
ROBOT = {**LAB, "angle": ("rad",), "rate": ("rad/s",), "speed": ("m/s",), "steer": ("rad", "deg", "us", "share"),
         "shaft": ("share", "%", "us", "rpm")}  # fmt: skip
TRADES: dict[str, Trade] = {
    "bridge": Trade({
        "lat": ("Latitude", "Lat", "GPS Lat"), "lon": ("Longitude", "Lon", "GPS Lon"), "psi": ("Heading", "Gyro", "HDG"),
        "r": ("ROT", "Rate of turn"), "sog": ("SOG", "Speed over ground"), "cog": ("COG", "Course over ground"),
        "stw": ("STW", "Log speed"), "delta": ("Rudder {}", "Rudder angle {}", "Rudder feedback {}"),
        "n": ("Shaft RPM {}", "RPM {}", "{} shaft speed"), "alpha": ("Azimuth {}", "{} azipod angle"),
        "aws": ("Rel. wind speed",), "awa": ("Rel. wind dir",), "order": ("Rudder order {}",), "set": ("AP set course",), "temp": ("Sea temp",), "fuel": ("Fuel rate",),
    }, BRIDGE, sides=("PS", "SB")),
    "vdr": Trade({
        "lat": ("GGA_Lat", "POS.Latitude"), "lon": ("GGA_Lon", "POS.Longitude"), "psi": ("HDT", "HDT_Heading"),
        "r": ("ROT", "ROT_RateOfTurn"), "u": ("VBW_LongGround", "VBW.GS_long"), "v": ("VBW_TransGround", "VBW.GS_trans"),
        "stw": ("VBW_LongWater",), "delta": ("RSA_{}", "RSA.Rudder.{}"), "order": ("ROR_{}",), "n": ("RPM_{}", "RPM.Shaft.{}"),
        "alpha": ("AZI_{}",), "aws": ("MWV_R_Speed",), "awa": ("MWV_R_Angle",), "depth": ("DPT_Depth",),
    }, BRIDGE, sides=("Port", "Stbd"), clocks=("iso", "two", "epoch ms"), own=True),
    "norsk": Trade({
        "lat": ("Breddegrad",), "lon": ("Lengdegrad",), "psi": ("Heading", "Gyrokurs"), "r": ("Svingrate", "Girhastighet"),
        "sog": ("Fart over grunn",), "cog": ("Kurs over grunn",), "delta": ("Rorvinkel {}", "Ror {}"),
        "n": ("Turtall {}", "Propellturtall {}"), "alpha": ("Asimutvinkel {}",), "temp": ("Sjøtemperatur",),
    }, BRIDGE, sides=("babord", "styrbord"), clocks=("german", "two", "local"), decimal=","),
    "deutsch": Trade({
        "lat": ("Breite", "geogr. Breite"), "lon": ("Länge", "geogr. Länge"), "psi": ("Kurs rw", "Vorausrichtung"),
        "r": ("Drehrate", "Wendegeschwindigkeit"), "sog": ("FüG", "Fahrt über Grund"), "cog": ("KüG", "Kurs über Grund"),
        "stw": ("FdW",), "delta": ("Ruderlage {}", "Ruderwinkel {}"), "order": ("Ruder Soll {}",), "set": ("Sollkurs",), "n": ("Drehzahl {}", "Wellendrehzahl {}"),
        "alpha": ("Azimutwinkel {}", "Ruderpropeller {} Winkel"), "temp": ("Wassertemp.",), "volt": ("Bordspannung",),
    }, BRIDGE, sides=("Bb", "Stb"), clocks=("german", "two", "german"), decimal=","),
    "francais": Trade({
        "lat": ("latitude",), "lon": ("longitude",), "psi": ("cap", "cap vrai"), "r": ("taux de giration", "vitesse de lacet"),
        "sog": ("vitesse fond",), "cog": ("route fond",), "delta": ("angle de barre {}", "safran {}"),
        "n": ("régime hélice {}", "tours hélice {}"), "alpha": ("azimut {}",), "temp": ("température eau",),
    }, BRIDGE, sides=("bâbord", "tribord"), clocks=("day first", "two"), decimal=","),
    "espanol": Trade({
        "lat": ("latitud",), "lon": ("longitud",), "psi": ("rumbo verdadero", "proa"), "r": ("velocidad de giro",),
        "sog": ("velocidad sobre el fondo",), "cog": ("rumbo sobre el fondo",), "delta": ("ángulo de timón {}", "timón {}"),
        "n": ("rpm hélice {}", "revoluciones {}"), "alpha": ("ángulo azimutal {}",), "temp": ("temp. agua",),
    }, BRIDGE, sides=("babor", "estribor"), clocks=("day first", "two"), decimal=","),
    "italiano": Trade({
        "lat": ("latitudine",), "lon": ("longitudine",), "psi": ("prora", "prua"), "r": ("velocità di accostata",),
        "sog": ("velocità al suolo",), "cog": ("rotta al suolo",), "delta": ("angolo timone {}", "timone {}"),
        "n": ("giri elica {}", "giri asse {}"), "alpha": ("angolo azimutale {}",), "volt": ("tensione batteria",),
    }, BRIDGE, sides=("sinistra", "dritta"), clocks=("day first", "two"), decimal=","),
    "nederlands": Trade({
        "lat": ("breedtegraad",), "lon": ("lengtegraad",), "psi": ("voorliggende koers", "heading"),
        "r": ("draaisnelheid", "bochtaanwijzer"), "sog": ("grondsnelheid", "snelheid over de grond"),
        "cog": ("grondkoers", "koers over de grond"), "delta": ("roerhoek {}", "roerstand {}"),
        "n": ("toerental {}", "schroeftoerental {}"), "alpha": ("azimuthoek {}",), "depth": ("diepte",),
    }, BRIDGE, sides=("bakboord", "stuurboord"), clocks=("german", "two"), decimal=","),
    "polski": Trade({
        "lat": ("szerokość",), "lon": ("długość",), "psi": ("kurs rzeczywisty", "kurs"), "r": ("prędkość kątowa",),
        "sog": ("prędkość nad dnem",), "cog": ("kąt drogi nad dnem",), "delta": ("wychylenie steru {}", "ster {}"),
        "n": ("obroty śruby {}",), "alpha": ("azymut pędnika {}",), "temp": ("temperatura",),
    }, BRIDGE, sides=("LB", "PB"), clocks=("german", "epoch"), decimal=","),
    "japanese": Trade({
        "lat": ("緯度",), "lon": ("経度",), "psi": ("船首方位",), "r": ("回頭角速度",), "sog": ("対地速力", "対地船速"),
        "cog": ("対地針路",), "delta": ("{}舵角",), "n": ("{}主機回転数", "{}プロペラ回転数"), "alpha": ("{}旋回角",),
        "temp": ("水温",),
    }, BRIDGE, sides=("左舷", "右舷"), clocks=("slashed", "two", "seconds")),
    "chinese": Trade({
        "lat": ("纬度",), "lon": ("经度",), "psi": ("艏向", "艏向角"), "r": ("转艏角速度", "角速度"), "sog": ("对地航速", "航速"),
        "cog": ("航迹向", "对地航向"), "delta": ("{}舵角",), "n": ("{}螺旋桨转速", "{}转速"), "alpha": ("{}方位角",),
        "volt": ("电池电压",),
    }, BRIDGE, sides=("左", "右"), clocks=("slashed", "epoch ms", "iso")),
    "ros odometry": Trade({
        "x": ("pose.pose.position.x", "field.pose.pose.position.x", "/odometry/filtered/pose/pose/position/x"),
        "y": ("pose.pose.position.y", "field.pose.pose.position.y", "/odometry/filtered/pose/pose/position/y"),
        "psi": ("yaw", "heading"), "quaternion": ("pose.pose.orientation.", "field.pose.pose.orientation."),
        "u": ("twist.twist.linear.x",), "v": ("twist.twist.linear.y",), "r": ("twist.twist.angular.z",),
        "delta": ("rudder_cmd.{}.data", "/{}/rudder/angle"), "n": ("{}_thrust_cmd", "/thrusters/{}/cmd.data"),
        "alpha": ("/{}_engine/angle.data",), "zero": ("pose.pose.position.z",), "set": ("desired_heading.data",), "ax": ("imu.linear_acceleration.x",),
    }, ROBOT, ("ros",), ("left", "right"), ("epoch ns", "sec nsec", "epoch"), own=True),
    "px4": Trade({
        "x": ("vehicle_local_position.x", "vehicle_local_position_0_x"), "y": ("vehicle_local_position.y", "vehicle_local_position_0_y"),
        "vx": ("vehicle_local_position.vx",), "vy": ("vehicle_local_position.vy",), "psi": ("vehicle_local_position.heading",),
        "r": ("vehicle_angular_velocity.xyz[2]",), "delta": ("actuator_outputs.rudder_{}", "servo_{}"),
        "n": ("actuator_motors.{}", "actuator_outputs.motor_{}"), "alpha": ("actuator_servos.{}_azimuth",), "volt": ("battery_status.voltage_v",),
    }, ROBOT, ("ned",), ("left", "right"), ("boot us",), own=True),
    "ardupilot": Trade({
        "lat": ("GPS.Lat",), "lon": ("GPS.Lng",), "sog": ("GPS.Spd",), "cog": ("GPS.GCrs",), "psi": ("ATT.Yaw",),
        "r": ("IMU.GyrZ",), "delta": ("RCOU.steering_{}", "RCOU.C1_rudder{}"), "n": ("RCOU.throttle_{}", "THR.{}"),
        "alpha": ("SRV.{}_azimuth",), "set": ("ATT.DesYaw",), "volt": ("BAT.Volt",), "temp": ("BARO.Temp",),
    }, {**ROBOT, "angle": ("deg",), "steer": ("us", "deg")}, ("geo",), ("left", "right"), ("boot us", "week"), own=True),
    "moos": Trade({
        "x": ("NAV_X",), "y": ("NAV_Y",), "psi": ("NAV_HEADING",), "sog": ("NAV_SPEED",), "cog": ("NAV_COURSE",),
        "r": ("NAV_YAW_RATE", "IMU_GYRO_Z"), "delta": ("DESIRED_RUDDER", "RUDDER_{}"), "n": ("DESIRED_THRUST_{}", "THRUST_{}"),
        "alpha": ("AZIMUTH_{}",), "set": ("DESIRED_HEADING",), "volt": ("BATTERY_VOLTAGE",), "depth": ("NAV_DEPTH",),
    }, {**LAB, "angle": ("deg",), "rate": ("deg/s",), "speed": ("m/s",), "steer": ("deg", "%"), "shaft": ("%",)},
        ("enu",), ("PORT", "STBD"), ("epoch", "seconds"), own=True),
    "survey": Trade({
        "east": ("Easting", "E", "Vessel CRP Easting"), "north": ("Northing", "N", "Vessel CRP Northing"),
        "psi": ("Gyro", "Heading"), "r": ("Turn rate",), "sog": ("Speed", "SOG"), "cog": ("CMG", "COG"),
        "delta": ("Rudder {}",), "n": ("RPM {}",), "alpha": ("Thruster {} azimuth",), "depth": ("Depth", "Altimeter"),
        "phi": ("Roll",), "theta": ("Pitch",), "kp": ("KP", "DCC"),
    }, BRIDGE, ("map",), ("Port", "Stbd"), ("two", "day first", "iso")),
    "yacht": Trade({
        "lat": ("Lat",), "lon": ("Lon",), "psi": ("HDG", "Hdg"), "sog": ("SOG",), "cog": ("COG",), "stw": ("BSP",),
        "r": ("ROT", "YawRate"), "delta": ("Rudder {}", "RUD {}"), "n": ("EngRPM {}",), "alpha": ("Drive {} angle",), "awa": ("AWA",),
        "aws": ("AWS",), "twa": ("TWA",), "tws": ("TWS",), "phi": ("Heel",), "theta": ("Trim",), "vmg": ("VMG",),
    }, {**BRIDGE, "rate": ("deg/s",), "wind": ("kn",)}, clocks=("excel", "slashed", "epoch ms"), own=True),
    "signalk": Trade({
        "lat": ("navigation.position.latitude",), "lon": ("navigation.position.longitude",), "psi": ("navigation.headingTrue",),
        "sog": ("navigation.speedOverGround",), "cog": ("navigation.courseOverGroundTrue",), "r": ("navigation.rateOfTurn",),
        "stw": ("navigation.speedThroughWater",), "delta": ("steering.rudderAngle{}",), "n": ("propulsion.{}.revolutions",),
        "alpha": ("propulsion.{}.azimuth",), "aws": ("environment.wind.speedApparent",), "awa": ("environment.wind.angleApparent",),
        "temp": ("environment.water.temperature",),
    }, {**LAB, "angle": ("rad",), "rate": ("rad/s",), "speed": ("m/s",), "steer": ("rad",), "shaft": ("rev/s",)},
        clocks=("iso", "epoch ms"), own=True),
    "student": Trade({
        "x": ("x", "X", "pos_x", "xpos"), "y": ("y", "Y", "pos_y", "ypos"), "psi": ("psi", "yaw", "heading", "theta_z"),
        "u": ("u", "surge", "surge_vel"), "v": ("v", "sway", "sway_vel"), "r": ("r", "yaw_rate", "omega"),
        "delta": ("delta{}", "rudder{}", "del{}_cmd"), "n": ("n{}", "rps_{}", "motor{}"), "alpha": ("alpha{}", "azi{}"),
        "set": ("psi_d",), "order": ("delta_cmd{}",), "volt": ("battery",), "ax": ("acc_x",),
    }, LAB, ("ned", "ros", "zup", "enu"), ("_p", "_s"), ("seconds", "ms", "epoch", "seconds"), noise=("none", "good", "fair")),
    "tank": Trade({
        "x": ("X0", "xG", "Xo"), "y": ("Y0", "yG", "Yo"), "psi": ("Psi", "PSI", "Heading"), "u": ("U", "u_G"), "v": ("V", "v_G"),
        "r": ("r", "Rdot", "YawRate"), "delta": ("Delta{}", "Rudder{}"), "n": ("n{}", "Propeller{}"), "alpha": ("POD{}",),
        "phi": ("Phi", "Roll"), "torque": ("Q",), "temp": ("T_water",),
    }, {**LAB, "speed": ("m/s",)}, ("ned", "zup"), ("P", "S"), ("seconds", "seconds", "ms"), noise=("none", "good")),
    "gazebo": Trade({
        "x": ("model_x", "world_pose_x", "gt_x"), "y": ("model_y", "world_pose_y", "gt_y"), "psi": ("model_yaw", "gt_yaw"),
        "quaternion": ("model_q", "gt_q"), "u": ("body_vx", "gt_surge"), "v": ("body_vy", "gt_sway"), "vx": ("world_vx",),
        "vy": ("world_vy",), "r": ("wz", "body_wz"), "delta": ("rudder_joint_{}",), "n": ("{}_thrust", "thruster_{}"),
        "alpha": ("{}_azimuth_joint",), "zero": ("model_z",),
    }, ROBOT, ("ros",), ("port", "stbd"), ("seconds", "sec nsec", "ms"), own=True, noise=("none", "good")),
    "dp": Trade({
        "north": ("DP_North", "Pos_N"), "east": ("DP_East", "Pos_E"), "psi": ("DP_Heading", "Gyro1"), "u": ("Surge_speed",),
        "v": ("Sway_speed",), "r": ("Yaw_rate", "ROT"), "delta": ("Rudder{}_fb",), "n": ("Thr_{}_rpm_fb", "Prop_{}_RPM"), "order": ("Rudder{}_sp",), "set": ("Heading_setpoint",),
        "alpha": ("Thr_{}_azi_fb",), "V_w": ("Wind_speed_true",), "wind_from": ("Wind_dir_true",), "phi": ("MRU_roll",), "theta": ("MRU_pitch",),
    }, {**BRIDGE, "rate": ("deg/s", "deg/min"), "speed": ("m/s", "kn")}, ("map",), ("port", "stbd"), ("iso", "epoch", "local")),
    "korean": Trade({
        "lat": ("위도",), "lon": ("경도",), "psi": ("선수방위",), "r": ("회두각속도", "선회율"), "sog": ("대지속력",), "cog": ("대지침로",),
        "delta": ("{}타각",), "n": ("{}회전수", "{}프로펠러 회전수"), "alpha": ("{}선회각",), "temp": ("수온",),
    }, BRIDGE, sides=("좌현", "우현"), clocks=("iso", "slashed", "seconds")),
    "russian": Trade({
        "lat": ("Широта",), "lon": ("Долгота",), "psi": ("Курс гирокомпаса", "Курс истинный"), "r": ("Угловая скорость",),
        "sog": ("Скорость относительно грунта", "Путевая скорость"), "cog": ("Путевой угол",), "delta": ("Угол руля {}", "Перо руля {}"),
        "n": ("Обороты винта {}", "Частота вращения {}"), "alpha": ("Азимут ВРК {}",), "temp": ("Температура воды",),
    }, BRIDGE, sides=("ЛБ", "ПБ"), clocks=("german", "two"), decimal=","),
}  # fmt: skip
QUANTITY = {"psi": "angle", "set": "angle", "cog": "angle", "phi": "angle", "theta": "angle", "awa": "angle", "twa": "angle", "r": "rate",
            "wind_from": "angle", "aws": "wind", "tws": "wind", "V_w": "wind"}  # fmt: skip
JUNK: dict[str, tuple[float, float]] = {  # mean and spread of columns that mean nothing here
    "temp": (11.0, 0.3), "fuel": (140.0, 9.0), "depth": (63.0, 12.0), "volt": (12.4, 0.1), "zero": (0.0, 0.02),
    "ax": (0.0, 0.05), "kp": (3.2, 0.8), "vmg": (2.0, 0.7), "torque": (0.12, 0.02),
}  # fmt: skip
NOISE = {"none": 0.0, "good": 0.3, "fair": 1.0, "poor": 2.5}  # times 0.25 m, 0.3 deg, 0.05 m/s, 0.1 deg/s


def move(rng: np.random.Generator, length: float, craft: str, minutes: float) -> pd.DataFrame:
    """Record of one run [SI], 20 rows in each length over speed: a first-order yaw with drift and loss of speed."""
    speed = rng.uniform(0.14, 0.3 if length > 12 else 0.45) * np.sqrt(9.81 * length)
    scale = length / speed
    step = scale / 20
    gain, lag, drift = rng.uniform(0.7, 1.6) / scale, rng.uniform(0.7, 2.2) * scale, rng.uniform(0.25, 0.45) * length
    n_max, most = rng.uniform(1.1, 1.8) * max(1.0, 12.0 / np.sqrt(length)), np.radians(35.0)
    count = int(np.clip(minutes * 60 / step, 900, 9000))
    kind, angle = str(rng.choice(["zigzag", "turn", "mixture"])), rng.choice([10, 15, 20, 30]) / 35
    current = rng.uniform(0.0, 0.08) * speed * np.exp(1j * rng.uniform(0, 2 * np.pi))
    psi, r, u, v, steer, where = rng.uniform(0, 2 * np.pi), 0.0, speed * 0.9, 0.0, 0.0, 0j
    order, load, start, rows = 0.0, 0.85, 0.0, []
    start = psi
    for row in range(count):
        clock = row / 20
        if kind == "zigzag" and clock > 3:
            order = (
                (order or angle)
                if abs(psi - start) < angle * most or np.sign(psi - start) != np.sign(order)
                else -angle * np.sign(psi - start)
            )
        elif kind == "turn" and clock > 3:
            order = angle * (1 if (clock // 25) % 2 else -1) * (clock % 25 > 4)
        elif kind == "mixture" and row % 60 == 0:
            order = float(rng.choice([0, 0, rng.uniform(-0.9, 0.9)]))
        if row % 240 == 0 and row:
            load = rng.uniform(0.5, 1.0)
        steer += float(np.clip(order - steer, -0.25, 0.25))
        twist = 0.35 * steer if craft == "differential" else 0.0
        shafts = np.array([load + twist, load - twist]) * n_max
        push = float(shafts.mean()) / n_max
        effect = steer * (0.4 * push + 0.6 * max(u, 0.0) / speed)
        rows.append((row * step, where.real, where.imag, psi, u, v, r, steer * most, *shafts, order * most))
        r += step / lag * (gain * effect - r * (1 + 0.6 * abs(r) * scale)) + rng.normal() * 0.004 / scale * np.sqrt(
            step / scale
        )
        v += step / (0.6 * scale) * (-drift * r - v)
        u += step / (2.5 * scale) * (1.1 * push * speed - u - 0.5 * abs(r) * scale * u)
        where += step * ((u + 1j * v) * np.exp(1j * psi) + current)
        psi += step * r
    record = pd.DataFrame(
        rows, columns=["t", "north", "east", "psi", "stu", "stv", "r", "steer", "port.n", "starboard.n", "order"]
    )
    water = (record["stu"] + 1j * record["stv"]).to_numpy()
    over = water * np.exp(1j * record["psi"].to_numpy()) + current
    body = over * np.exp(-1j * record["psi"].to_numpy())
    wind = rng.uniform(2, 11) * np.exp(1j * rng.uniform(0, 2 * np.pi)) * np.ones(count)  # blows towards
    gust = 0.5 * np.convolve(rng.normal(size=count + 40), np.ones(41) / np.sqrt(41), "valid")
    felt = (wind + gust - over) * np.exp(-1j * record["psi"].to_numpy())
    return record.assign(
        u=body.real, v=body.imag, vn=over.real, ve=over.imag, sog=np.abs(over), cog=np.angle(over), stw=record["stu"],
        V_w=np.abs(wind + gust), tws=np.abs(wind + gust), wind_from=np.angle(-wind), aws=np.abs(felt), awa=np.angle(-felt),
        twa=np.angle(-(wind + gust) * np.exp(-1j * record["psi"].to_numpy())), phi=0.02 * np.sin(record["t"] * 3 / scale), theta=0.008 * np.cos(record["t"] * 4 / scale),
        **{side + ".alpha": -record["steer"] for side in ("port", "starboard")},
        **{f"{way}{side}.delta": record[what] for side in ("rudder", "port", "starboard") for way, what in (("", "order"), ("actual.", "steer"))},
        set=record["psi"].iloc[np.arange(count) // 200 * 200].to_numpy() + 0.3,
        **{"main.n": record["port.n"] / 2 + record["starboard.n"] / 2, "n_max": n_max},
    )  # fmt: skip


def clock_cells(kind: str, t: Array, start: datetime.datetime) -> dict[str, list[str]]:
    """Header -> cells of a clock that begins at a date."""
    dates = [start + datetime.timedelta(seconds=round(float(one), 3)) for one in t]
    epoch = start.timestamp() + t
    milli = [f"{one.microsecond // 1000:03d}" for one in dates]
    match kind:
        case "iso":
            return {"timestamp": [f"{one:%Y-%m-%dT%H:%M:%S}.{ms}Z" for one, ms in zip(dates, milli, strict=True)]}
        case "local":
            return {"Time": [f"{one:%Y-%m-%d %H:%M:%S}.{ms}" for one, ms in zip(dates, milli, strict=True)]}
        case "german":
            return {"Zeit": [f"{one:%d.%m.%Y %H:%M:%S}.{ms}" for one, ms in zip(dates, milli, strict=True)]}
        case "day first":
            return {"Date/Time": [f"{one:%d/%m/%Y %H:%M:%S}.{ms}" for one, ms in zip(dates, milli, strict=True)]}
        case "slashed":
            return {"DateTime": [f"{one:%Y/%m/%d %H:%M:%S}.{ms}" for one, ms in zip(dates, milli, strict=True)]}
        case "two":
            return {
                "Date": [f"{one:%d.%m.%Y}" for one in dates],
                "Time": [f"{one:%H:%M:%S}.{ms}" for one, ms in zip(dates, milli, strict=True)],
            }
        case "excel":
            return {"Utc": [f"{one / 86400 + 25569:.8f}" for one in epoch]}
        case "epoch":
            return {"time": [f"{one:.3f}" for one in epoch]}
        case "epoch ms":
            return {"time_ms": [f"{one * 1e3:.0f}" for one in epoch]}
        case "epoch ns":
            return {"header.stamp": [f"{round(one * 1e3)}000000" for one in epoch]}
        case "sec nsec":
            ticks = [divmod(round(one * 1e3), 1000) for one in epoch]
            return {
                "header.stamp.secs": [f"{s}" for s, _ in ticks],
                "header.stamp.nsecs": [f"{ms}000000" for _, ms in ticks],
            }
        case "boot us":
            return {"TimeUS": [f"{(one + 41.7) * 1e6:.0f}" for one in t]}
        case "week":
            since = epoch - datetime.datetime(1980, 1, 6, tzinfo=datetime.UTC).timestamp() + 18
            return {
                "GPS.GWk": [f"{one // 604800:.0f}" for one in since],
                "GPS.GMS": [f"{one % 604800 * 1e3:.0f}" for one in since],
            }
        case "ms":
            return {"millis": [f"{one * 1e3:.0f}" for one in t]}
    return {"t": [f"{one:.3f}" for one in t]}


def choose_columns(
    rng: np.random.Generator, trade: Trade, frame: str, craft: str, n_max: float, length: float
) -> list[Column]:
    """The columns that a team logs of a craft, with what they truly are."""
    pick = lambda names: str(rng.choice(list(names)))  # noqa: E731
    used = {quantity: pick(names) for quantity, names in trade.units.items()}
    level = NOISE[pick(trade.noise)]
    first, s1, second, s2, turned, zero = FRAMES.get(frame, FRAMES["ned"])
    late, held = (float(pick(ages)) if level else 0.0 for ages in ((0.0, 0.0, 0.4), (0.0, 0.0, 0.0, 1.0)))
    gps = {"late": late, "held": held, "noise": min(0.25 * level, 0.05 + 0.02 * length)}
    away = np.array([5e5, 7e6]) if frame == "map" and rng.random() < 0.6 else np.zeros(2)
    style = pick(["plain", "snake", "upper", "lower"]) if not trade.own else "plain"
    found: list[Column] = []
    variant = int(rng.integers(6))

    def said(word: str) -> str:
        return trade.words[word][variant % len(trade.words[word])]

    def add(
        word: str,
        signal: str,
        quantity: str,
        *,
        side: str = "",
        sign: float = 1.0,
        offset: float = 0.0,
        noise: float = 0.0,
        **more: Any,
    ) -> None:
        unit = used.get(quantity, "")
        scale = sign * PER_SI.get(unit, 1.0)
        if unit in SHARES:
            share, middle = SHARES[unit]
            most = n_max if signal.endswith(".n") else np.radians(35.0)
            scale, offset = sign * share / most, middle
            more["also"] = (f"{signal.rpartition('.')[0]}.force",)
        name = " ".join(said(word).replace("{}", side).split()).strip("_ .").replace("__", "_")
        name = name.replace("//", "/").replace("..", ".")
        name = {"snake": name.replace(" ", "_"), "upper": name.upper(), "lower": name.lower()}.get(style, name)
        per = abs(PER_SI.get(unit, 1.0))
        digits = {"deg": 2, "rad": 4, "rad/s": 5, "deg/s": 3, "deg/min": 2, "us": 0, "%": 1, "rpm": 1}.get(unit, 3)
        found.append(
            Column(
                name,
                signal,
                unit,
                scale,
                offset * per if unit not in SHARES else offset,
                noise=noise * per,
                decimals=digits,
                **more,
            )
        )

    angle_wrap = pick(["turn", "half", "none"] if level == 0 else ["turn", "half"])

    def wrapped(quantity: str, kind: str) -> tuple[float, float] | None:
        full = 2 * np.pi * PER_SI[used[quantity]]
        return {"turn": (0.0, full), "half": (-full / 2, full / 2)}.get(kind)

    has = trade.words.__contains__
    if has("lat"):
        fix = {**gps, "noise": gps["noise"] / 111_000}
        found += [Column(said(word), word, "deg", 180 / np.pi, decimals=7, **fix) for word in ("lat", "lon")]
    for word, signal, sign, far in (
        ("x", first, s1, 0),
        ("y", second, s2, 0),
        ("north", "north", 1, away[1]),
        ("east", "east", 1, away[0]),
    ):
        if has(word):
            add(word, signal, "length", sign=sign, offset=far, **gps)
    if has("quaternion") and rng.random() < 0.6:
        stem = said("quaternion")
        found.extend(Column(f"{stem}{one}", f"quaternion {one}", decimals=6) for one in "xyzw")
    else:
        add(
            "psi",
            "psi",
            "angle",
            sign=turned,
            offset=zero,
            noise=np.radians(0.3) * level,
            wrap=wrapped("angle", angle_wrap),
        )
    world = has("vx") and (not has("u") or rng.random() < 0.5)
    body = has("u") and not world
    for word, signal, sign, there in (
        ("vx", "vn" if first == "north" else "ve", s1, world), ("vy", "ve" if first == "north" else "vn", s2, world),
        ("u", "u", 1, body), ("v", "v", turned, body), ("sog", "sog", 1, has("sog")), ("stw", "stw", 1, has("stw") and rng.random() < 0.5),
    ):  # fmt: skip
        if there:
            add(word, signal, "speed", sign=sign, noise=0.05 * level)
    if has("cog"):
        add("cog", "cog", "angle", noise=np.radians(0.8) * level, wrap=wrapped("angle", "turn"))
    if rng.random() < 0.8:
        add("r", "r", "rate", sign=turned, noise=np.radians(0.1) * level * min(3.0, 40 / length + 0.2))
    if rng.random() < 0.5:
        for word in ("aws", "awa", "twa", "tws", "V_w", "wind_from"):
            if has(word):
                half = word in ("awa", "twa")
                kind = QUANTITY[word]
                add(
                    word,
                    word,
                    kind,
                    wrap=wrapped("angle", "half" if half else "turn") if kind == "angle" else None,
                    noise=0.02,
                )
    if has("set") and rng.random() < 0.5:
        add("set", "set", "angle", sign=turned, offset=zero, wrap=wrapped("angle", "turn"))
    for word in ("phi", "theta"):
        if has(word) and rng.random() < 0.6:
            add(word, word, "angle")
    sign = float(rng.choice([1.0, -1.0]))
    port, starboard = trade.sides
    if craft in ("rudder", "two rudders"):
        for name, side in (("rudder", ""),) if craft == "rudder" else (("port", port), ("starboard", starboard)):
            add("delta", f"actual.{name}.delta", "steer", side=side, sign=sign, noise=np.radians(0.1) * level)
            if has("order") and rng.random() < 0.5:
                add("order", f"{name}.delta", "steer", side=side, sign=sign)
    if craft == "azimuth":
        for name, side in (("port", port), ("starboard", starboard)):
            add("alpha", f"{name}.alpha", "steer", side=side, sign=sign, noise=np.radians(0.1) * level)
    single = craft == "rudder" and rng.random() < 0.7
    for name, side in (("main", ""),) if single else (("port", port), ("starboard", starboard)):
        add("n", f"{name}.n", "shaft", side=side, noise=0.003 * n_max * level)
    for word, (mean, spread) in JUNK.items():
        if has(word) and rng.random() < 0.7:
            found.append(Column(said(word), "", offset=mean, noise=spread))
    return found


def cells(rng: np.random.Generator, column: Column, record: pd.DataFrame, decimal: str) -> list[str]:
    """The column as text, late, with noise, wrapped and rounded."""
    if column.signal.startswith("quaternion"):
        yaw = (np.pi / 2 - record["psi"].to_numpy()) / 2
        raw = {"x": 0 * yaw, "y": 0 * yaw, "z": np.sin(yaw), "w": np.cos(yaw)}[column.signal[-1]]
    else:
        true = record[column.signal].to_numpy(dtype=float) if column.signal else np.zeros(len(record))
        if column.late:
            true = np.interp(record["t"] - column.late, record["t"], true)
        raw = column.scale * true + column.offset
    raw = raw + column.noise * rng.normal(size=len(raw))
    if column.wrap:
        low, high = column.wrap
        raw = low + (raw - low) % (high - low)
    if column.held:
        raw = raw[np.searchsorted(record["t"], np.floor(record["t"] / column.held) * column.held)]
    return [f"{one:.{column.decimals}f}".replace(".", decimal) for one in raw]


def draw_folder(seed: int, parent: Path) -> Folder:
    """Draw a craft, its runs, and the team that logs them; write the folder."""
    rng = np.random.default_rng(seed)
    pick = lambda names: str(rng.choice(list(names)))  # noqa: E731
    team = pick(TRADES)
    trade = TRADES[team]
    robot = team in ("ros odometry", "px4", "ardupilot", "moos", "student", "tank", "gazebo", "signalk", "yacht")
    length = float(
        np.exp(rng.uniform(np.log(1.0), np.log(12.0))) if robot else np.exp(rng.uniform(np.log(12.0), np.log(300.0)))
    )
    craft = pick(
        ["rudder", "rudder", "two rudders", "azimuth", "differential"]
        if robot
        else ["rudder", "rudder", "two rudders", "azimuth"]
    )
    frame = pick(trade.frames)
    layout = pick(["one", "one", "one", "runs", "runs", "runs", "run column", "channels"])
    shared = int(rng.integers(2**31))
    count = 1 if layout in ("one", "channels") else int(rng.integers(3, 7))
    records = [move(np.random.default_rng([shared, one]), length, craft, rng.uniform(4, 15)) for one in range(count)]
    columns = choose_columns(rng, trade, frame, craft, float(records[0]["n_max"].iloc[0]), length)
    names = collections.Counter(column.header for column in columns)
    columns = [column for column in columns if names[column.header] == 1]
    home = np.radians([rng.uniform(-45, 65), rng.uniform(-170, 170)])
    start = datetime.datetime(
        2024,
        int(rng.integers(1, 13)),
        int(rng.integers(13, 28)),
        int(rng.integers(6, 18)),
        int(rng.integers(60)),
        tzinfo=datetime.UTC,
    )
    clock = pick(trade.clocks)
    decimal = trade.decimal if rng.random() < 0.7 else "."
    separator = ";" if decimal == "," or rng.random() < 0.15 else pick([",", ",", "\t"])
    units = (
        pick(["[]", "()", "row", "_", "none", "none"]) if not trade.own else pick(["none", "none", "none", "row", "[]"])
    )
    hole = pick(["", "NaN", "-", "N/A", "-999", "null", "***", "nan", "#N/A"])
    again = layout == "one" and rng.random() < 0.15
    preamble, footer, comment = rng.random() < 0.35, rng.random() < 0.2, pick(["#", "%", "//", ""])
    spelt = {unit: pick(words) for unit, words in SPELT.items()}

    def titled(column: Column) -> Column:
        unit = spelt.get(column.unit, "")
        shown = (
            {"[]": f" [{unit}]", "()": f" ({unit})", "_": "_" + unit.replace("/", "_per_")}.get(units, "")
            if unit
            else ""
        )
        return dataclasses.replace(column, header=column.header + shown)

    columns = [titled(column) for column in columns]
    turns = [one.header.removesuffix("x").rstrip(".") for one in columns if one.signal == "quaternion x"]
    yaw = [Column(f"{stem} yaw", "psi", "rad", -1.0, np.pi / 2) for stem in turns]
    for record in records:
        lat = home[0] + record["north"] / 6.367e6
        record["lat"], record["lon"] = lat, home[1] + record["east"] / (6.386e6 * np.cos(home[0]))
    folder = parent / f"foreign-{seed}"
    folder.mkdir(parents=True)

    def table(
        record: pd.DataFrame, chosen: Sequence[Column], since: float, extra: dict[str, str]
    ) -> tuple[list[str], list[str], list[list[str]]]:
        stamps = clock_cells(clock, record["t"].to_numpy() + since, start)
        if decimal == ",":
            stamps = {
                name: [
                    ",".join(one.rsplit(".", 1)) if clock in ("seconds", "epoch", "excel", "german") else one
                    for one in cell
                ]
                for name, cell in stamps.items()
            }
        written = [cells(rng, column, record, decimal) for column in chosen]
        for cell, column in zip(written, chosen, strict=True):
            if column.signal and not column.signal.startswith("quaternion") and rng.random() < 0.25:
                for row in rng.choice(len(cell), max(1, len(cell) // 150), replace=False):
                    cell[row] = hole
        heads = [*stamps, *extra, *(column.header for column in chosen)]
        below = [*("" for _ in stamps), *("" for _ in extra), *(spelt.get(column.unit, "") for column in chosen)]
        body = [
            list(row)
            for row in zip(
                *stamps.values(), *([value] * len(record) for value in extra.values()), *written, strict=True
            )
        ]
        return heads, below, body

    def write(path: str, parts: Sequence[tuple[list[str], list[str], list[list[str]]]]) -> None:
        heads, below, _ = parts[0]
        lines = []
        if preamble:
            said = {"#": "# ", "%": "% ", "//": "// ", "": ""}[comment]
            lines += [
                f"{said}Logger v2.{seed % 7}",
                f"{said}Vessel: L = {length:.1f} m",
                f"{said}Recorded {start:%Y-%m-%d}",
                *([] if comment else [""]),
            ]
        lines.append(separator.join(heads))
        lines += [separator.join(below)] if units == "row" else []
        lines += [separator.join(row) for _, _, body in parts for row in body]
        if again:  # the logger was switched off and on
            lines.insert(len(lines) * 2 // 3, separator.join(heads))
        lines += [f"{comment or '#'} end of log, {len(parts[0][2])} samples"] if footer else []
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("\n".join(lines) + "\n", encoding=encoding)

    encoding = pick(
        ["utf-8", "utf-8", "utf-8-sig"]
        if team in ("japanese", "chinese", "korean", "russian")
        else ["utf-8", "utf-8", "utf-8-sig", "utf-16"]
    )
    every = int(rng.choice([1, 2, 4])) if length < 12 else int(rng.choice([1, 2]))
    records = [record.iloc[::every].reset_index(drop=True) for record in records]
    pace = float(records[0]["t"].iloc[1]) * (2 if layout == "channels" else 1)  # of the slow rows nothing is held
    columns = [dataclasses.replace(one, held=one.held * (pace < one.held / 2)) for one in columns]
    ends = np.cumsum([0.0] + [float(record["t"].iloc[-1]) + 300.0 for record in records])
    files: list[LogFile] = []
    stem = pick(["run", "rec", "zz", "LOG", "trial-A"])
    match layout:
        case "one":
            write(pick(["log.csv", "data.txt", "trial_1.csv", "export.csv"]), [table(records[0], columns, 0.0, {})])
            files.append(LogFile("log.csv"))
        case "run column":
            label = pick(["run", "Run no", "test_id", "trial"])
            write("all_runs.csv", [table(one, columns, ends[k], {label: str(k + 1)}) for k, one in enumerate(records)])
            files.append(LogFile("all_runs.csv", tuple(str(k) for k in range(count))))
        case "channels":
            moving = [one for one in columns if one.signal in ("lat", "lon", "north", "east", "sog", "cog", "vn", "ve")]
            order = [one for one in columns if one.signal.endswith((".n", ".delta", ".alpha"))]
            rest = [one for one in columns if one not in moving and one not in order]
            for path, group, take in (("gps.csv", moving, 2), ("attitude.csv", rest, 1), ("actuators.csv", order, 3)):
                write(path, [table(records[0].iloc[take - 1 :: take].reset_index(drop=True), group, 0.0, {})])
                files.append(LogFile(path))
        case _:
            for k, one in enumerate(records):
                path = pick(["", "day1/"]) + f"{stem}_{k + 1:02d}.csv"
                write(path, [table(one, columns, ends[k] if clock not in ("seconds", "ms", "boot us") else 0.0, {})])
                files.append(LogFile(path, (str(k),)))
    if rng.random() < 0.4:
        (folder / pick(["README.txt", "notes.md", "config.yaml"])).write_text("see the wiki\n", encoding="utf-8")
    story = {"team": team, "craft": craft, "frame": frame, "layout": layout, "clock": clock, "units": units, "sep": separator,
             "decimal": decimal, "hole": hole, "preamble": preamble, "footer": footer, "again": again, "length": round(length, 1)}  # fmt: skip
    return Folder(seed, folder, {"length": length}, tuple(files), (*columns, *yaw), story)


def judge_seed(
    seed: int, draw: Callable[[int, Path], Folder] = draw_folder
) -> tuple[str, tuple[str, ...], Mapping[str, Any]]:
    """Draw and judge one folder: its word, the reasons, and its story."""
    parent = Path(tempfile.mkdtemp())
    try:
        drawn = draw(seed, parent)
        verdict = judge_raw(drawn)  # type: ignore[arg-type]
    finally:
        shutil.rmtree(parent)
    kinds = {reason.partition(":")[0] for reason in verdict.reasons}
    word = next((one for one in WORDS[::-1] if one in kinds), "refused") if kinds else "right"
    return word, verdict.reasons, drawn.story


WORDS = ("right", "asked", "doubted", "missing", "not imported", "refused", "SILENT")  # best first


def main(draw: Callable[[int, Path], Folder] = draw_folder) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--all", action="store_true", help="print every folder that is not right")
    asked = parser.parse_args()
    seeds = range(asked.seed, asked.seed + asked.count)
    with ProcessPoolExecutor(asked.jobs) as pool:
        judged = list(pool.map(functools.partial(judge_seed, draw=draw), seeds))
    counts = collections.Counter(word for word, _, _ in judged)
    print(f"{asked.count} folders:", ", ".join(f"{counts[word]} {word}" for word in WORDS))
    for seed, (word, reasons, story) in zip(seeds, judged, strict=True):
        if word != "right" and asked.all:
            print(f"- {seed} {word}; {', '.join(str(one) for one in story.values())}")
            print("\n".join(f"    {reason}" for reason in reasons))


if __name__ == "__main__":
    main()
