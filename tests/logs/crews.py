"""Raw folders of two dozen crews, drawn by seed, each with what it truly is: by an author who had not read the search.

`python -m tests.logs.crews --seed 1 --count 20` draws and judges them, as `foreign_folders` does.
"""

# ruff: noqa: E501

from __future__ import annotations

import dataclasses
import datetime
import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pymap3d import ned2geodetic
from scipy.io import savemat

from tests.logs.foreign_folders import FRAMES, PER_SI, SHARES, Array, Column, Folder, LogFile, cells, main, move

UTC = datetime.UTC


@dataclasses.dataclass(frozen=True)
class Crew:
    """How one kind of people logs.

    words : signal -> names that they use, `|` between; {} is the side. units : of quantities. crafts : kinds of drive.
    length : of their craft [m], least and most. frames : of a position. clocks : kinds of `clock_cells`. junk : columns of
    no use, with mean and spread. styles : of a name, and of its unit. layouts : of the folder. sides : port, starboard.
    """

    words: Mapping[str, str]
    units: Mapping[str, str]
    crafts: str
    length: tuple[float, float]
    frames: str = "geo"
    clocks: str = "iso epoch two"
    junk: str = "battery voltage:12.4:0.2|temp:31:1.5"
    styles: str = "plain"
    layouts: str = "one one runs pause restart column channels sparse hours"
    sides: str = "port starboard"
    decimal: str = "."
    speeds: str = "sog,cog|sog,cog|sog|u,v|"
    files: str = "csv"


SEA = {
    "angle": "deg",
    "rate": "deg/min",
    "speed": "kn",
    "steer": "deg",
    "shaft": "rpm",
    "wind": "kn|m/s",
    "geo": "deg|ddmm|ddmm N|dms",
}
SURVEY = {
    "angle": "deg",
    "rate": "deg/s|deg/min",
    "speed": "m/s|kn",
    "steer": "deg",
    "shaft": "rpm",
    "wind": "m/s",
    "geo": "deg",
}
TANK = {
    "angle": "deg|rad",
    "rate": "deg/s|rad/s",
    "speed": "m/s",
    "steer": "deg|rad",
    "shaft": "rev/s|rpm",
    "wind": "m/s",
    "length": "m|m|cm",
}
BOT = {
    "angle": "rad|deg",
    "rate": "rad/s|deg/s",
    "speed": "m/s",
    "steer": "rad|deg|us|share",
    "shaft": "us|%|share|rpm",
    "wind": "m/s",
    "geo": "deg|1e7",
    "length": "m",
}
CREWS: dict[str, Crew] = {
    "tank, English": Crew({"time": "Time|t|TIME", "x": "X|x_c|Carriage X", "y": "Y|y_c|Carriage Y", "psi": "Heading|psi|Yaw", "u": "u|Surge vel", "v": "v|Sway vel", "r": "r|Yaw rate", "phi": "Roll|phi", "theta": "Pitch|theta", "delta": "Rudder angle|delta|Rud", "act.delta": "Rudder meas|delta_m", "n": "Prop revs|n_{}|RPS {}", "load": "Motor current {}|I_{}"}, TANK, "rudder twin", (1.5, 8), "ned zup", "seconds", "T_air:20.1:0.1|Fx:2.3:0.6|wave probe:0.01:0.02|Trig:0:0", "plain", "runs runs restart one", speeds="u,v|u,v|", files="csv tsv mat"),
    "tank, Japanese": Crew({"time": "時間|Time", "x": "X座標|X", "y": "Y座標|Y", "psi": "方位角|ψ|船首方位", "u": "前後速度|u", "v": "左右速度|v", "r": "回頭角速度|r", "delta": "舵角|δ", "act.delta": "実舵角", "n": "プロペラ回転数|n", "phi": "横揺れ角|φ"}, TANK, "rudder", (2, 6), "ned", "seconds", "水温:18:0.1|波高:0.0:0.02", "plain", "runs one restart", speeds="u,v|", files="csv tsv"),
    "tank, German by hand": Crew({"time": "Zeit|t", "x": "x-Position|x", "y": "y-Position|y", "psi": "Kurswinkel|Gierwinkel|psi", "u": "Längsgeschw.|u", "v": "Quergeschw.|v", "r": "Drehrate|Giergeschwindigkeit", "delta": "Ruderwinkel Soll|Ruder", "act.delta": "Ruderwinkel Ist", "n": "Drehzahl|n Prop {}", "load": "Motorstrom {}"}, TANK, "rudder twin", (2, 8), "ned", "seconds", "Temp:18.2:0.1|Bemerkung:0:0", "plain", "runs one pause", "BB StB", ",", "u,v|u,v|", "csv xlsx"),
    "pilot launch survey": Crew({"time": "UTC|Time|DateTime", "lat": "Latitude|Lat|POS Lat", "lon": "Longitude|Lon|POS Lon", "north": "Northing|Grid N", "east": "Easting|Grid E", "psi": "Heading|Gyro|True Hdg", "sog": "SOG|Speed|Vel", "cog": "COG|CMG|Track", "r": "ROT|Turn Rate|Heading Rate", "phi": "Roll", "theta": "Pitch", "n": "{} Eng RPM|{} Shaft RPM|Shaft {}", "delta": "Rudder|Helm|Rudder Angle", "load": "Fuel {}"}, SURVEY, "twin rudder", (7, 25), "geo utm", "iso two us-date time gps-week day-of-year", "Heave:0:0.1|Depth:23.4:2|HDOP:0.8:0.1|SV:11:1|XTE:0:2.5|Event:0:0", files="csv txt tsv", sides="Port Stbd"),
    "harbour tug": Crew({"time": "Timestamp|Time", "lat": "LAT|Position.Lat|GPS1 Latitude", "lon": "LON|Position.Lon|GPS1 Longitude", "psi": "Gyro1|HDG|Gyro Heading", "sog": "SOG|GPS1 Speed", "cog": "COG|GPS1 Course", "r": "ROT|Rate of turn", "n": "ASD {} RPM|{} thruster speed|Z-drive {} RPM", "alpha": "ASD {} angle|{} thruster azimuth|Z-drive {} angle", "act.alpha": "{} thruster azimuth fb", "load": "ME {} load|{} engine load"}, SEA, "azimuth", (20, 40), "geo", "iso two epoch local dots", "Towline force:0.1:0.3|Winch length:40:0|Firefighting:0:0|Fuel rate:120:14", sides="PS SB"),
    "container ship VDR": Crew({"time": "Time UTC|TIME|UTC", "lat": "GPS.LAT|Lat|Own Ship Latitude", "lon": "GPS.LON|Lon|Own Ship Longitude", "psi": "GYRO.HDG|HDG(T)|Heading True", "sog": "GPS.SOG|SOG", "cog": "GPS.COG|COG", "r": "ROT|GYRO.ROT", "n": "ENG.RPM|M/E RPM|Shaft RPM", "delta": "RUD.ORDER|Rudder Order|RUDDER ORD", "act.delta": "RUD.RESP|Rudder Response|RUDDER ACT", "aws": "ANEM.SPD|Rel Wind Speed", "awa": "ANEM.DIR|Rel Wind Dir", "stw": "LOG.STW|Speed Log (water)", "set": "AP.SETHDG|Heading to steer"}, SEA, "rudder", (150, 370), "geo", "iso two local time yyyymmdd", "DEPTH:88:4|DOORS:0:0|ALARMS:2:0|Hull stress:31:4", layouts="one hours hours sparse pause channels", speeds="sog,cog|sog,cog|sog"),
    "ferry, Norwegian": Crew({"time": "Tid|Tidspunkt|Klokkeslett", "lat": "Breddegrad|Bredde", "lon": "Lengdegrad|Lengde", "psi": "Kurs gyro|Heading|Gyrokurs", "sog": "Fart over grunn|Fart", "cog": "Kurs over grunn|COG", "r": "Svinghastighet|ROT", "n": "Turtall {}|Propell {} turtall", "alpha": "Azipull {} vinkel|Vinkel {}", "delta": "Rorvinkel|Ror", "aws": "Relativ vindhastighet", "awa": "Relativ vindretning", "load": "Effekt {}"}, SEA | {"rate": "deg/min|deg/s"}, "azimuth twin rudder", (30, 130), "geo", "dots iso two", "Batteri SOC:81:0|Dybde:120:14|Passasjerer:88:0", sides="BB SB", decimal=",", files="csv csv xlsx"),
    "sailing school RIB": Crew({"time": "time|Timestamp", "lat": "latitude|lat", "lon": "longitude|lng|long", "psi": "heading|compass|hdg", "sog": "speed|gps speed", "cog": "course|track|gps course", "r": "gyro z|yaw rate", "n": "engine rpm|throttle|rpm", "delta": "steering angle|wheel|tiller"}, {**SEA, "rate": "deg/s", "speed": "kn|km/h|m/s", "shaft": "rpm|%", "geo": "deg"}, "rudder", (4.5, 9), "geo", "epoch ms iso ampm", "altitude:3:2|satellites:12:1|accuracy:2.1:0.4", "snake camel", "one runs channels pause"),
    "USV, differential": Crew({"time": "time|t|stamp", "lat": "lat|latitude|gps_lat", "lon": "lon|longitude|gps_lon", "x": "x|pos_x|odom_x", "y": "y|pos_y|odom_y", "psi": "yaw|heading|psi", "u": "u|vel_surge|vx_body", "v": "v|vel_sway|vy_body", "sog": "speed|ground_speed", "cog": "course|cog", "r": "yaw_rate|r|gyro_z", "n": "{}_cmd|{}_thruster|motor_{}|thrust_{}|pwm_{}", "vn": "vel_n|vn", "ve": "vel_e|ve", "set": "desired_heading|psi_ref"}, BOT, "differential", (0.8, 6), "geo ned ned", "epoch seconds ms ns iso", "batt_v:15.9:0.2|current_a:6:2.5|cpu_temp:52:1|mode:3:0|wp_idx:4:0", "snake camel", speeds="u,v|sog,cog|vn,ve|", files="csv csv parquet mat", sides="left right"),
    "USV, newtons": Crew({"time": "t|time", "lat": "lat", "lon": "lon", "north": "north|N|x_n", "east": "east|E|y_e", "psi": "psi|yaw", "u": "u|surge", "v": "v|sway", "r": "r|yaw_rate", "force": "F_{}|thrust_{}|T_{}", "phi": "phi|roll"}, {**BOT, "force": "N"}, "force", (0.8, 6), "ned geo", "seconds epoch", "soc:77:0|latency:0.02:0.01", "snake", "one runs restart column", "left right", speeds="u,v|u,v|"),
    "ArduPilot export": Crew({"time": "timestamp", "lat": "GPS.Lat|GLOBAL_POSITION_INT.lat", "lon": "GPS.Lng|GLOBAL_POSITION_INT.lon", "psi": "ATT.Yaw|ATTITUDE.yaw", "sog": "GPS.Spd|VFR_HUD.groundspeed", "cog": "GPS.GCrs|GPS_RAW_INT.cog", "r": "IMU.GyrZ|ATTITUDE.yawspeed", "phi": "ATT.Roll|ATTITUDE.roll", "delta": "RCOU.C1|SERVO_OUTPUT_RAW.servo1_raw", "n": "RCOU.C3|SERVO_OUTPUT_RAW.servo3_raw"}, {**BOT, "steer": "us", "shaft": "us", "rate": "rad/s"}, "rudder", (0.8, 5), "geo", "us epoch ms", "BAT.Volt:12.6:0.2|BAT.Curr:8:2|GPS.HDop:0.8:0.1|GPS.NSats:14:1|MAG.MagX:180:25|IMU.AccX:0:0.3", "own", "one sparse channels runs"),
    "ROS export": Crew({"time": "time|%time|header.stamp", "lat": "field.latitude|/fix/latitude", "lon": "field.longitude|/fix/longitude", "x": "field.pose.pose.position.x|/odom/pose/position/x", "y": "field.pose.pose.position.y|/odom/pose/position/y", "psi": "yaw|/imu/yaw|field.yaw", "u": "field.twist.twist.linear.x|/odom/twist/linear/x", "v": "field.twist.twist.linear.y|/odom/twist/linear/y", "r": "field.twist.twist.angular.z|/imu/angular_velocity/z", "n": "/thrusters/{}/cmd|field.{}_thrust_cmd|{}_motor.data"}, {**BOT, "angle": "rad", "rate": "rad/s", "geo": "deg"}, "differential", (0.8, 5), "ros ros geo", "ns epoch nsecs", "field.header.seq:400:0|field.covariance0:0.1:0|/imu/linear_acceleration/x:0:0.2", "own", "one channels sparse runs", "left right", speeds="u,v|"),
    "research vessel, DP": Crew({"time": "Time|Date/Time", "lat": "DP Latitude|Pos_Lat", "lon": "DP Longitude|Pos_Lon", "north": "North pos|Northing", "east": "East pos|Easting", "psi": "Heading|Gyro avg|Hdg", "sog": "Speed over ground", "cog": "Course over ground", "u": "Surge speed|Vel fwd", "v": "Sway speed|Vel stbd", "r": "Rate of turn|Yaw rate", "n": "Main prop {} RPM|Thr {} RPM fb", "delta": "Rudder {} fb|Rudder {} angle", "alpha": "Thr {} azimuth fb|Azi {} angle", "tws": "True wind speed|Wind speed", "wind_from": "True wind direction|Wind dir", "set": "Heading setpoint|Hdg SP", "load": "Thr {} power"}, SURVEY, "azimuth twinrudders", (40, 120), "geo utm ned", "iso dots two excel", "Heave:0:0.3|Draught:5.2:0.01|Mode:2:0|Sea temp:9.8:0.05|Salinity:34.6:0.02", sides="PORT STBD", speeds="u,v|sog,cog|sog,cog", files="csv tsv xlsx"),
    "fishing vessel": Crew({"lat": "latitude", "lon": "longitude", "psi": "heading", "sog": "sog", "cog": "cog", "r": "rot", "delta": "rudder", "n": "rpm"}, {**SEA, "geo": "deg"}, "rudder", (9, 35), files="nmea", layouts="one one", speeds="sog,cog", clocks="iso"),
    "barge, Dutch": Crew({"time": "Tijd|Tijdstip|Datum tijd", "lat": "Breedtegraad|Breedte", "lon": "Lengtegraad|Lengte", "north": "RD Y|Y", "east": "RD X|X", "psi": "Koers|Heading|Voorliggende koers", "sog": "Snelheid|Vaart over de grond", "cog": "Grondkoers|Koers over de grond", "r": "Bochtsnelheid|Bochtaanwijzer", "n": "Toerental {}|Schroef {} toeren", "delta": "Roerhoek|Roer|Roerstand", "load": "Verbruik {}"}, {**SEA, "speed": "km/h|km/h|kn"}, "rudder twin", (38, 135), "geo utm", "dots iso two", "Diepgang:2.8:0.01|Waterdiepte:4.5:0.6|Boegschroef uren:881:0", sides="BB SB", decimal=","),
    "training ship, French": Crew({"time": "Heure|Date heure|Horodatage", "lat": "Latitude|Lat", "lon": "Longitude|Long", "psi": "Cap|Cap vrai|Cap gyro", "sog": "Vitesse fond|Vitesse", "cog": "Route fond|Route", "r": "Taux de giration|Vitesse de lacet", "n": "Tours hélice {}|Régime {}", "delta": "Angle de barre|Barre", "aws": "Vitesse vent apparent", "awa": "Angle vent apparent", "set": "Cap ordonné", "load": "Puissance {}"}, SEA | {"rate": "deg/min|deg/s"}, "rudder twin", (25, 110), "geo", "slash iso two", "Sonde:41:3|Baromètre:1014:0.2|Officier:0:0", sides="BD TD", decimal=",", files="csv csv xlsx"),
    "patrol boat, Spanish": Crew({"time": "Hora|Fecha y hora|Tiempo", "lat": "Latitud|Lat", "lon": "Longitud|Lon", "psi": "Rumbo|Rumbo verdadero|Proa", "sog": "Velocidad|Velocidad fondo", "cog": "Rumbo fondo|Derrota", "r": "Velocidad de giro|Régimen de giro", "n": "RPM {}|Revoluciones eje {}", "delta": "Ángulo de timón|Timón", "phi": "Balance", "theta": "Cabeceo"}, SEA | {"rate": "deg/s|deg/min"}, "twin rudder", (12, 60), "geo", "slash iso time", "Profundidad:30:3|Combustible:64:0.1|Estado:1:0", sides="babor estribor"),
    "coast guard, Polish": Crew({"time": "Czas|Data i czas", "lat": "Szerokość|Szer. geogr.", "lon": "Długość|Dł. geogr.", "psi": "Kurs żyro|Kurs", "sog": "Prędkość|Prędkość nad dnem", "cog": "KDd|Kąt drogi", "r": "Prędkość kątowa|Prędkość zwrotu", "n": "Obroty {}|Obroty śruby {}", "delta": "Wychylenie steru|Ster", "load": "Moc {}"}, SEA | {"rate": "deg/s|deg/min"}, "rudder twin", (15, 80), "geo", "iso dots two", "Głębokość:18:2|Przechył:1.0:0.8", sides="LB PB", decimal=","),
    "ferry, Italian": Crew({"time": "Ora|Data e ora", "lat": "Latitudine|Lat", "lon": "Longitudine|Lon", "psi": "Prua|Prora vera|Prua giro", "sog": "Velocità al fondo|Velocità", "cog": "Rotta vera|Rotta", "r": "Velocità di accostata|ROT", "n": "Giri motore {}|Giri elica {}", "delta": "Angolo timone|Timone", "load": "Carico motore {}"}, SEA, "twin rudder", (30, 180), "geo", "slash iso two", "Fondale:60:5|Passeggeri:312:0", sides="sx dx", decimal=","),
    "coaster, Turkish": Crew({"time": "Zaman|Tarih saat", "lat": "Enlem", "lon": "Boylam", "psi": "Pruva|Baş açısı|Gerçek pruva", "sog": "Yere göre hız|Hız", "cog": "Yere göre rota|Rota", "r": "Dönüş hızı|Dönme oranı", "n": "Makine devri|Şaft devri", "delta": "Dümen açısı|Dümen", "load": "Güç"}, SEA, "rudder", (60, 140), "geo", "dots iso two", "Derinlik:55:4|Yakıt:41:0.1", sides="iskele sancak"),
    "students' Arduino": Crew({"time": "Time|t", "lat": "Lat|GPSlat|latitude", "lon": "Lng|GPSlng|longitude", "psi": "Heading|Yaw|compass", "sog": "Speed|GPSspeed", "cog": "Course|GPScourse", "r": "GyroZ|gz", "n": "Motor|throttle|ESC {}|Motor{}", "delta": "Servo|rudderServo|Rudder", "phi": "Roll"}, {**BOT, "angle": "deg", "rate": "deg/s|rad/s", "steer": "us|deg", "shaft": "us|%", "geo": "deg"}, "rudder differential", (0.6, 2.5), "geo", "ms ms seconds time", "Vbat:7.8:0.1|AccX:0.1:0.3|AccY:0.0:0.3|MagX:120:20|Sats:9:1|loop:12:1", "plain camel", "one runs pause", "L R", speeds="sog,cog|sog|", files="csv txt tsv"),
    "MATLAB export": Crew({"time": "t|time|tout", "north": "xN|North|pos_N", "east": "yE|East|pos_E", "psi": "psi|heading|yaw", "u": "u|uBody", "v": "v|vBody", "r": "r|yawRate", "delta": "delta|rudder|rudAngle", "act.delta": "deltaMeas|rudderFb", "n": "n{}|rpm{}|shaftSpeed{}", "aws": "Uaw|windSpeedRel", "awa": "gammaW|windAngleRel"}, TANK | {"length": "m"}, "rudder twin", (3, 250), "ned", "seconds datenum", "Zforce:0:30|flag:1:0|cpuLoad:31:2", "own", "one runs", "P S", speeds="u,v|u,v|", files="mat mat csv"),
    "simulator output": Crew({"time": "Time|SimTime|Simulation time", "x": "X-coordinate|PosX|x", "y": "Y-coordinate|PosY|y", "north": "North|Y pos north", "east": "East|X pos east", "psi": "Heading|Course angle|Hdg", "u": "Longitudinal speed|u", "v": "Lateral speed|Transverse speed", "r": "Rate of turn|Yaw velocity", "sog": "Ground speed", "cog": "Course over ground", "delta": "Rudder angle|Rudder 1 actual", "act.delta": "Rudder 1 feedback", "n": "Propeller {} RPM|RPM {}|Engine revs {}", "tws": "Wind speed", "wind_from": "Wind direction"}, {**SURVEY, "length": "m"}, "rudder twin", (30, 330), "ned enu", "seconds time seconds", "UKC:4.1:0.3|Tug1 force:0:0|Squat:0.3:0.02|Current speed:0:0", "plain snake", "one runs runs", speeds="u,v|u,v|sog,cog", files="csv tsv"),
    "GNSS and IMU box": Crew({"time": "GPSTime|UTC time|TOW", "lat": "Latitude|lat", "lon": "Longitude|lon", "north": "N|UTM N", "east": "E|UTM E", "psi": "Heading|Yaw|azimuth", "vn": "VelN|V-North|North Velocity", "ve": "VelE|V-East|East Velocity", "r": "GyroZ|AngRateZ|Yaw Rate", "phi": "Roll", "theta": "Pitch", "sog": "HSpeed", "cog": "TrackAngle"}, {"angle": "deg", "rate": "deg/s|rad/s", "speed": "m/s", "geo": "deg|rad", "length": "m"}, "bare", (3, 60), "geo utm", "seconds gps-week s-of-week iso", "Height:44:0.1|StdN:0.02:0.003|StdE:0.02:0.003|AccX:0:0.2|Ratio:3.1:0.4|NumSat:17:1", "plain camel snake", "one runs hours", speeds="vn,ve|vn,ve|sog,cog", files="csv txt"),
    "coastal trials, Chinese": Crew({"time": "时间|日期时间", "lat": "纬度", "lon": "经度", "psi": "船首向|艏向|航向角", "sog": "航速|对地航速", "cog": "航迹向|对地航向", "r": "转首角速度|转艏率", "n": "主机转速|螺旋桨转速", "delta": "舵角|舵令", "act.delta": "实际舵角", "tws": "风速", "wind_from": "风向"}, SEA | {"rate": "deg/s|deg/min"}, "rudder", (40, 300), "geo", "iso slash two", "水深:35:2|吃水:8.4:0.01", files="csv xlsx"),
    "icebreaker, Russian": Crew({"time": "Время|Дата и время", "lat": "Широта", "lon": "Долгота", "psi": "Курс|Курс истинный", "sog": "Скорость|Скорость относительно грунта", "cog": "Путевой угол|ПУ", "r": "Угловая скорость|Скорость поворота", "n": "Обороты {}|Частота вращения {}", "delta": "Угол перекладки руля|Руль", "load": "Мощность {}"}, SEA | {"rate": "deg/s|deg/min"}, "rudder twin", (40, 170), "geo", "dots iso two", "Глубина:70:4|Лёд:0:0", sides="ЛБ ПБ", decimal=","),
    "yard trials, Korean": Crew({"time": "시간|시각", "lat": "위도", "lon": "경도", "psi": "선수각|선수방위", "sog": "대지속력|선속", "cog": "대지침로|침로", "r": "회두각속도", "n": "주기관 회전수|축회전수", "delta": "타각", "act.delta": "실제타각", "aws": "상대풍속", "awa": "상대풍향"}, SEA | {"rate": "deg/s|deg/min"}, "rudder", (60, 370), "geo", "iso two", "수심:60:2|흘수:9.1:0.01", files="csv xlsx"),
    "workboat, Finnish": Crew({"time": "Aika|Aikaleima", "lat": "Leveysaste|Lev", "lon": "Pituusaste|Pit", "psi": "Suunta|Ohjaussuunta|Keula", "sog": "Nopeus|Nopeus pohjan suhteen", "cog": "Kulkusuunta|Suunta pohjan suhteen", "r": "Kääntymisnopeus|Kulmanopeus", "n": "Kierrosluku {}|Potkuri {} rpm", "delta": "Peräsinkulma|Peräsin", "load": "Teho {}"}, SEA | {"rate": "deg/s|deg/min"}, "rudder twin", (8, 60), "geo", "dots iso two", "Syvyys:14:2|Akku:25.6:0.2", sides="vasen oikea", decimal=","),
}  # fmt: skip
QUANTITY = {
    "r": "rate",
    "u": "speed",
    "v": "speed",
    "vn": "speed",
    "ve": "speed",
    "sog": "speed",
    "stw": "speed",
    "aws": "wind",
    "tws": "wind",
    "delta": "steer",
    "alpha": "steer",
    "n": "shaft",
    "force": "force",
    "north": "length",
    "east": "length",
}  # else an angle
UNITS = {
    "deg": "deg|°|degrees|DEG",
    "rad": "rad",
    "deg/s": "deg/s|°/s|dps",
    "rad/s": "rad/s",
    "deg/min": "deg/min|°/min",
    "m/s": "m/s|mps",
    "kn": "kn|kts|knots|kt",
    "km/h": "km/h|kmh",
    "rpm": "rpm|RPM|1/min",
    "rev/s": "rps|Hz|1/s",
    "%": "%|pct",
    "us": "us|µs",
    "m": "m",
    "cm": "cm",
    "N": "N",
}
NOISE = {
    "angle": 0.004,
    "rate": 0.002,
    "speed": 0.04,
    "wind": 0.4,
    "steer": 0.002,
    "shaft": 0.01,
    "force": 0.3,
    "length": 0.3,
}  # SI, of a fair sensor of a ship
WRAPS = {
    ("deg", 0): (0.0, 360.0),
    ("deg", 1): (-180.0, 180.0),
    ("rad", 0): (0.0, 2 * np.pi),
    ("rad", 1): (-np.pi, np.pi),
}
PERIODS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)  # s
HOLES = ("", "", "NaN", "---", "-999", "N/A", "9999")


def clock_cells(kind: str, word: str, t: Array, start: datetime.datetime, decimals: int) -> dict[str, list[str]]:
    """The cells of the clock of a kind, of instants t (N,) [s] since the start of the log."""
    dates = [start + datetime.timedelta(seconds=round(float(one), decimals)) for one in t]
    since = start.timestamp()
    tail = [f"{one.microsecond / 1e6:.{decimals}f}"[1:] for one in dates]
    written = {"iso": "%Y-%m-%dT%H:%M:%S", "local": "%Y-%m-%d %H:%M:%S", "dots": "%d.%m.%Y %H:%M:%S", "slash": "%d/%m/%Y %H:%M:%S",
               "us-date": "%m/%d/%Y %H:%M:%S", "time": "%H:%M:%S", "yyyymmdd": "%Y%m%d%H%M%S"}  # fmt: skip
    if kind in written:
        zone = "Z" if kind == "iso" else ""
        return {word: [f"{one:{written[kind]}}{end}{zone}" for one, end in zip(dates, tail, strict=True)]}
    match kind:
        case "two":
            return {
                f"Date {word}": [f"{one:%Y-%m-%d}" for one in dates],
                word: [f"{one:%H:%M:%S}{end}" for one, end in zip(dates, tail, strict=True)],
            }
        case "ampm":
            return {word: [f"{one:%m/%d/%Y %I:%M:%S}{end} {one:%p}" for one, end in zip(dates, tail, strict=True)]}
        case "nsecs":
            whole = np.floor(t + since)
            return {
                f"{word}.secs": [f"{one:.0f}" for one in whole],
                f"{word}.nsecs": [f"{(one + since - full) * 1e9:.0f}" for one, full in zip(t, whole, strict=True)],
            }
        case "gps-week":
            week = np.floor((t + since - 315964800) / 604800)
            return {
                "Week": [f"{one:.0f}" for one in week],
                word: [f"{one:.3f}" for one in t + since - 315964800 - week * 604800],
            }
        case "day-of-year":
            return {
                "Year": [f"{one.year}" for one in dates],
                "DOY": [f"{one:%j}" for one in dates],
                word: [f"{one:%H:%M:%S}{end}" for one, end in zip(dates, tail, strict=True)],
            }
    scale, origin, places = {
        "seconds": (1.0, 0.0, 3), "epoch": (1.0, since, 3), "ms": (1e3, 4012.0, 0), "us": (1e6, 61.5e6, 0), "ns": (1e9, since * 1e9, 0),
        "s-of-week": (1.0, 302400.0, 3), "excel": (1 / 86400, since / 86400 + 25569, 8), "datenum": (1 / 86400, since / 86400 + 719529, 9),
    }[kind]  # fmt: skip
    if kind == "ns":
        return {
            word: [
                f"{int(since)}{one:09d}" if one < 10**9 else str(int(since) * 10**9 + one)
                for one in np.round(t * 1e9).astype(int)
            ]
        }
    return {word: [f"{one:.{places}f}" for one in t * scale + origin]}


def styled(style: str, name: str) -> str:
    """A name in a style of writing; "plain" and "own" leave it."""
    parts = [one for one in re.split(r"[ ._/()]+", name) if one]
    if style == "snake":
        return "_".join(one.lower() for one in parts)
    return (
        parts[0].lower() + "".join(one.capitalize() for one in parts[1:])
        if style == "camel" and len(parts) > 1
        else name
    )


def voyage(
    rng: np.random.Generator, length: float, craft: str, rows: int, geo: tuple[float, float], idle: bool
) -> pd.DataFrame:
    """Record of one motion at jittered instants of a round period [SI], with positions on the Earth and forces."""
    kind = "differential" if craft in ("differential", "force") else craft
    fine = move(rng, length, kind, 60.0).iloc[:rows]
    step = float(fine["t"].iloc[1])
    period = min(PERIODS, key=lambda one: abs(np.log(one / step)))
    count = int(fine["t"].iloc[-1] / period)
    t = period * np.arange(count) + rng.uniform(0, 0.1 * period * (rng.random() < 0.4), count)
    angles = ("cog", "awa", "twa", "wind_from")
    columns = {name: np.interp(t, fine["t"], np.unwrap(fine[name]) if name in angles else fine[name]) for name in fine}
    record = pd.DataFrame(columns).assign(t=t)
    if idle:  # alongside, before it sails
        still = record.iloc[[0] * int(rng.integers(60, 200))].copy()
        names = [
            "u",
            "v",
            "vn",
            "ve",
            "r",
            "sog",
            "stw",
            *(one for one in still if one.endswith((".n", ".delta", ".alpha"))),
        ]
        still[names], still["cog"] = 0.0, rng.uniform(0, 6.28, len(still))
        record = pd.concat([still, record], ignore_index=True)
        record["t"] = [*(period * np.arange(len(still))), *(t + period * len(still))]
    lat, lon, _ = ned2geodetic(record["north"], record["east"], 0.0, *geo, 0.0)
    force = {
        f"{side}.force": 8 * length**2 * np.sign(record[f"{side}.n"]) * (record[f"{side}.n"] / record["n_max"]) ** 2
        for side in ("port", "starboard")
    }
    shaft = {"load.main": 100 * (record["main.n"] / record["n_max"]) ** 3}
    return record.assign(
        lat=np.radians(lat),
        lon=np.radians(lon),
        **force,
        **shaft,
        **{f"load.{one}": 100 * (record[f"{one}.n"] / record["n_max"]) ** 3 for one in ("port", "starboard")},
    )


def columns_of(
    rng: np.random.Generator, crew: Crew, craft: str, record: pd.DataFrame, length: float
) -> tuple[list[Column], dict[str, Any]]:
    """What this crew logs of this craft, in the words and units that it took for good, and the story of it."""
    pick: Callable[[Sequence[Any]], Any] = lambda many: many[int(rng.integers(len(many)))]  # noqa: E731
    style, written, frame = (
        pick(crew.styles.split()),
        pick(["[{}]", "({})", ", {}", "_{}", "row", ""]),
        pick(crew.frames.split()),
    )
    units = {one: pick(many.split("|")) for one, many in crew.units.items()}
    if not written:  # lengths in cm are not known where nothing says so
        units["length"] = "m"
    quality, n_max, signs = (
        pick([0.2, 1.0, 2.5]),
        float(record["n_max"].iloc[0]),
        {one: pick([1, 1, 1 if crew.files == "nmea" else -1]) for one in ("delta", "alpha")},
    )
    compass = pick([0, 0, 0, 1, 0 if frame == "geo" else 2])  # 0..360, -180..180, unwrapped
    axes = FRAMES.get(frame, FRAMES["ned"])
    sides = dict(zip(("port", "starboard", "main"), (*crew.sides.split(), ""), strict=True))
    late = rng.uniform(0.3, 1.0) * (rng.random() < 0.2) * (frame in ("geo", "utm"))
    variant = int(rng.integers(6))
    chosen: dict[str, str] = {}  # key of words -> one of its words
    columns: list[Column] = []

    def add(signal: str, key: str = "", side: str = "main", **more: Any) -> None:
        key = key or signal
        if key not in crew.words:
            return
        many = crew.words[key].split("|")
        word = chosen.setdefault(key, many[variant % len(many)] if style == "own" else pick(many))
        if "{}" not in word and side != "main":
            word = f"{{}} {word}" if style != "own" else f"{word}_{{}}"
        name = styled(style, re.sub(r"[ _]$|(?<= ) |^[ _]", "", word.format(sides[side])).strip())
        quantity = QUANTITY.get(signal, QUANTITY.get(key.removeprefix("act."), "angle"))
        unit = more.pop("unit", units.get(quantity, "deg"))
        sign = more.pop("sign", 1)
        scale = sign * PER_SI.get(unit, 1.0)
        if unit in SHARES:
            full, zero = SHARES[unit]
            scale, more["offset"] = sign * full / (n_max if quantity == "shaft" else np.radians(35)), zero
        spelt = (
            chosen.setdefault(f"unit {unit}", pick(UNITS[unit].split("|")))
            if unit in UNITS and signal[:3] not in ("lat", "lon") and crew.files != "nmea" and style != "own"
            else ""
        )
        header = (
            f"{name} [{spelt}]"
            if spelt and written == "row"
            else f"{name}{' ' * (written[:1] in '[(')}{written.format(spelt)}"
            if spelt and written
            else name
        )
        size = min(1.0, length / 20) if quantity in ("length", "speed", "force") else 1.0
        size *= 0.2 if quantity == "length" and frame != "utm" else 1.0
        more = {
            "noise": abs(scale)
            * NOISE[quantity]
            * quality
            * size
            * (float(record[signal].abs().max()) / 300 + 0.01 if quantity in ("shaft", "force") else 1.0),
            **more,
        }
        places = {
            "deg": 2,
            "deg/min": 1,
            "deg/s": 3,
            "rad": 4,
            "rad/s": 5,
            "rpm": 1,
            "rev/s": 3,
            "us": 0,
            "%": 1,
            "share": 3,
            "kn": 2,
            "km/h": 1,
            "cm": 1,
        }.get(unit, 3)
        columns.append(Column(header, signal, unit, **{"scale": scale, "decimals": places, **more}))

    north = "north" if "north" in crew.words and frame in ("ned", "utm", "enu") else ""
    if frame == "geo":
        for signal in ("lat", "lon"):
            kind = units.get("geo", "deg")
            scale = {"rad": 1.0, "1e7": 1e7 * 180 / np.pi}.get(kind, 180 / np.pi)
            noise = quality * NOISE["length"] * min(1.0, length / 20) / 6.4e6 * scale
            add(signal, unit=kind, decimals={"1e7": 0, "rad": 10}.get(kind, 7), scale=scale, noise=noise, late=late)
    elif north:
        origin = {"north": 5_934_000.0, "east": 486_000.0} if frame == "utm" else {"north": 0.0, "east": 0.0}
        for signal in ("east", "north") if frame in ("enu", "utm") else ("north", "east"):
            add(signal, unit="m", offset=origin[signal], late=late)
    else:
        for signal, sign, key in zip(axes[::2][:2], axes[1::2][:2], ("x", "y"), strict=True):
            add(str(signal), key, sign=sign, late=late)
    angle = units["angle"]
    turn = {"ros": np.pi / 2}.get(frame, 0.0)
    add(
        "psi",
        sign=axes[4],
        offset=turn * PER_SI[angle],
        wrap=WRAPS.get((angle, compass)),
        late=rng.uniform(0.2, 0.6) * (rng.random() < 0.1),
    )
    speeds = [one for one in pick(crew.speeds.split("|")).split(",") if one]
    for signal in speeds:
        add(
            signal,
            late=late * (signal not in "uv"),
            **({"wrap": WRAPS[units["angle"], 0]} if signal == "cog" else {"sign": axes[4]} if signal == "v" else {}),
        )
    if rng.random() < 0.75 or crew.files == "nmea":
        add("r", sign=axes[4])
    for signal in (one for one in ("phi", "theta", "stw") if rng.random() < 0.5):
        add(signal)
    for signal in (
        one for one in ("aws,awa", "tws,wind_from", "set") if rng.random() < 0.4 and one.split(",")[0] in crew.words
    ):
        for part in signal.split(","):
            add(part, **({"wrap": WRAPS[angle, 0]} if part != "aws" and part != "tws" else {}))
    pair = ("port", "starboard")
    screws = pair if craft in ("twin", "twinrudders", "azimuth", "differential", "force") else ("main",)
    if craft != "bare":
        what = "force" if craft == "force" else "n"
        for side in screws:
            add(f"{side}.{what}", what, side)
        both = rng.random() < 0.5
        if craft == "azimuth":
            for side in pair:
                add(f"{side}.alpha", "alpha", side, sign=signs["alpha"], wrap=WRAPS.get((units["steer"], pick([0, 1]))))
        elif craft in ("twin", "rudder", "twinrudders"):
            for side in pair if craft == "twinrudders" else ("rudder",):
                for way in ("", "actual.") if both and "act.delta" in crew.words else ("",):
                    add(
                        f"{way}{side}.delta",
                        "act.delta" if way else "delta",
                        side if side != "rudder" else "main",
                        sign=signs["delta"],
                    )
        if rng.random() < 0.5:
            for side in screws:
                add(f"load.{side}", "load", side, unit="", noise=1.0, decimals=1)
    for item in (one for one in crew.junk.split("|") if rng.random() < 0.6):
        name, mean, spread = item.rsplit(":", 2)
        columns.append(Column(styled(style, name), "", "", 0.0, float(mean), noise=float(spread), decimals=2))
    if style != "own" and rng.random() < 0.4:
        columns = [columns[k] for k in rng.permutation(len(columns))]
    return columns, {
        "frame": frame,
        "units": units,
        "written": written,
        "style": style,
        "compass": compass,
        "late": round(late, 2),
    }


def cells_of(rng: np.random.Generator, column: Column, record: pd.DataFrame, decimal: str) -> list[str]:
    """The cells of a column; those of a latitude or a longitude as degrees and minutes, too."""
    if column.unit not in ("ddmm", "ddmm N", "dms"):
        return cells(rng, column, record, decimal)
    true = np.interp(record["t"] - column.late, record["t"], np.degrees(record[column.signal]))
    value = true + column.noise * rng.normal(size=len(record))
    whole, minutes = np.floor(np.abs(value)).astype(int), np.abs(value) % 1 * 60
    letters = np.where(value >= 0, *(("N", "S") if column.signal == "lat" else ("E", "W")))
    shape = {"ddmm": "{:02d}{:08.5f}", "ddmm N": "{:02d}{:08.5f} {}", "dms": "{:d}°{:07.4f}'{}"}[column.unit]
    signs = np.where((value < 0) & (column.unit == "ddmm"), "-", "")
    return [sign + shape.format(*one) for sign, *one in zip(signs, whole, minutes, letters, strict=True)]


def nmea_lines(rng: np.random.Generator, record: pd.DataFrame, start: datetime.datetime) -> list[str]:
    """Sentences of NMEA 0183 with their checksums, as a logger on board takes them from the line."""
    lines = []
    psi, lat, lon = np.degrees(record["psi"]) % 360, np.degrees(record["lat"]), np.degrees(record["lon"])
    for k in range(len(record)):
        now = start + datetime.timedelta(seconds=float(record["t"].iloc[k]))
        spot = ",".join(
            f"{int(abs(x)):0{w}d}{abs(x) % 1 * 60:08.5f},{'NS'[int(x < 0)] if w == 2 else 'EW'[int(x < 0)]}"
            for x, w in ((lat[k], 2), (lon[k], 3))
        )
        speed, course = (
            record["sog"].iloc[k] * 3600 / 1852 + rng.normal() * 0.03,
            np.degrees(record["cog"].iloc[k]) % 360,
        )
        lines += [f"GPRMC,{now:%H%M%S}.{now.microsecond // 10000:02d},A,{spot},{speed:.2f},{course:.1f},{now:%d%m%y},,,A", f"HEHDT,{psi[k]:.1f},T", f"TIROT,{np.degrees(record['r'].iloc[k]) * 60:.1f},A",
                  f"IIRSA,{np.degrees(record['rudder.delta'].iloc[k]):.1f},A,,", f"IIRPM,S,0,{record['main.n'].iloc[k] * 60:.1f},100,A"]  # fmt: skip
    sums = [int(np.bitwise_xor.reduce(np.frombuffer(one.encode(), dtype=np.uint8))) for one in lines]
    return [f"${one}*{total:02X}" for one, total in zip(lines, sums, strict=True)]


def draw_folder(seed: int, parent: Path) -> Folder:
    """Draw a crew, its craft and its motion, and write its raw folder under a parent."""
    rng = np.random.default_rng([seed, 4711])
    pick: Callable[[Sequence[Any]], Any] = lambda many: many[int(rng.integers(len(many)))]  # noqa: E731
    team = pick(list(CREWS))
    crew = CREWS[team]
    craft, length = pick(crew.crafts.split()), float(np.exp(rng.uniform(*np.log(crew.length))))
    layout, kind, clock = pick(crew.layouts.split()), pick(crew.files.split()), pick(crew.clocks.split())
    if kind in ("xlsx", "mat", "parquet", "nmea") and layout not in ("one", "runs"):
        layout = "one"
    if layout in ("pause", "hours") and clock in ("seconds", "ms", "us", "time", "s-of-week"):
        layout = "one"
    if layout == "restart" and clock not in ("seconds", "ms"):
        layout = "column"
    geo = (float(rng.uniform(-45, 65)), float(rng.uniform(-120, 150)))
    record = voyage(rng, length, craft, int(rng.integers(1500, 4500)), geo, layout == "one" and rng.random() < 0.25)
    columns, story = columns_of(rng, crew, craft, record, length)
    start = datetime.datetime(2024, 1, 1, tzinfo=UTC) + datetime.timedelta(seconds=round(rng.uniform(0, 5e7)))
    folder = parent / f"crew_{seed}"
    folder.mkdir()
    decimals = 3 if layout == "sparse" else pick([3, 2]) if float(record["t"].iloc[1]) < 0.9 else pick([0, 0, 1])
    word = styled(story["style"], pick(crew.words.get("time", "time").split("|")))
    decimal = crew.decimal if kind == "csv" else "."
    separator = (
        ";"
        if decimal == ","
        else {"csv": pick([",", ",", ";"]), "tsv": "\t", "txt": pick([",", "\t", " "])}.get(kind, ",")
    )
    if separator == " ":
        columns = [dataclasses.replace(one, header=one.header.replace(" ", "_")) for one in columns]
        word, clock = (
            word.replace(" ", "_"),
            {"dots": "iso", "local": "iso", "slash": "iso", "us-date": "iso", "ampm": "iso", "two": "iso"}.get(
                clock, clock
            ),
        )
    encoding = pick(
        ["utf-8", "utf-8", "utf-8-sig", "utf-16"]
        if any(ord(one) > 255 for column in columns for one in column.header) or "µ" in str(columns)
        else ["utf-8", "utf-8", "cp1252"]
    )
    hole, holes = pick(HOLES), pick(["", "", "cells", "stretch", "rows"])
    quoted, unit_row = (
        rng.random() < 0.15,
        story["written"] == "row" and kind in ("csv", "tsv", "xlsx", "txt") and separator != " ",
    )
    preamble = (
        pick(
            [
                [],
                [],
                [],
                [f"# {team}", "# logger v2.31"],
                [f"Vessel{separator}{team.split(',')[0]}", f"Trial{separator}{seed}", ""],
                ["Created by DAQ 7.2", "", "=== DATA ==="],
            ]
        )
        if kind in ("csv", "tsv", "txt")
        else []
    )
    ends = "\r\n" if rng.random() < 0.4 else "\n"
    count = pick([3, 4, 5]) if layout in ("runs", "pause", "restart", "column", "hours") else 1
    cuts = np.linspace(0, len(record), count + 1).astype(int)
    gap = 0 if layout == "hours" else max(1, int(0.05 * len(record) / count))
    pieces = [
        record.iloc[low : high - gap * (count > 1)].reset_index(drop=True) for low, high in itertools.pairwise(cuts)
    ]

    def table(piece: pd.DataFrame, group: Sequence[Column], later: float, more: Mapping[str, str]) -> pd.DataFrame:
        t = piece["t"].to_numpy() + later
        if clock in ("seconds", "ms", "us") and layout in ("runs", "restart", "column"):
            t = t - t[0]
        written = clock_cells(clock, word, np.asarray(t), start, decimals)
        if clock in ("seconds", "epoch", "excel", "datenum", "s-of-week"):
            written = {name: [one.replace(".", decimal) for one in many] for name, many in written.items()}
        out = pd.DataFrame(
            {
                **written,
                **{name: [text] * len(t) for name, text in more.items()},
                **{one.header: cells_of(rng, one, piece, decimal) for one in group},
            }
        )
        headers = [one.header for one in group]
        if holes == "cells":
            for header in headers:
                out.loc[rng.random(len(out)) < 0.01, header] = hole
        elif holes == "stretch" and len(out) > 200:
            low = int(rng.integers(len(out) - 100))
            out.loc[low : low + int(rng.integers(5, 40)), pick(headers)] = hole
        elif holes == "rows":
            out = out[rng.random(len(out)) > 0.01]
        return out

    def lines(one: pd.DataFrame) -> list[str]:
        names = [re.sub(r" \[[^\]]*\]$", "", name) if unit_row else name for name in map(str, one)]
        heads = (
            [names, [(re.findall(r" \[([^\]]*)\]$", name) or [""])[0] for name in map(str, one)]]
            if unit_row
            else [names]
        )
        shown = [[f'"{cell}"' if quoted or separator in cell else cell for cell in row] for row in heads]
        return [separator.join(row) for row in shown] + [separator.join(row) for row in one.to_numpy(dtype=str)]

    def write(path: str, tables: Sequence[pd.DataFrame]) -> None:
        place = folder / path
        place.parent.mkdir(exist_ok=True)
        number = tables[0].map(
            lambda cell: (
                float(cell) if re.fullmatch(r"-?\d+(\.\d+)?", cell) else cell if cell and cell != hole else np.nan
            )
        )
        match kind:
            case "xlsx":
                head = (
                    [[(re.findall(r" \[([^\]]*)\]$", name) or [""])[0] for name in map(str, number)]]
                    if unit_row
                    else []
                )
                plain = (
                    [re.sub(r" \[[^\]]*\]$", "", name) for name in map(str, number)]
                    if unit_row
                    else [*map(str, number)]
                )
                pd.DataFrame([*head, *number.to_numpy(dtype=object).tolist()], columns=plain).to_excel(
                    place, index=False
                )
            case "mat":
                savemat(
                    place,
                    {
                        re.sub(r"\W+", "_", name).strip("_"): pd.to_numeric(number[name], errors="coerce").to_numpy()
                        for name in number
                    },
                )
            case "parquet":
                number.to_parquet(place)
            case "nmea":
                place.write_text(ends.join(nmea_lines(rng, pieces[0], start)), encoding="ascii", newline="")
            case _:
                text = [*preamble, *lines(tables[0])]
                for later in tables[1:]:
                    text += lines(later)[1 + unit_row :]
                place.write_text(ends.join(text) + ends, encoding=encoding, newline="", errors="replace")

    if kind == "mat":
        columns = [dataclasses.replace(one, header=re.sub(r"\W+", "_", one.header).strip("_")) for one in columns]
    stem, ending = pick(["log", "data", "export", "rec", "trial"]), {"nmea": "log"}.get(kind, kind)
    files: list[LogFile] = []
    if layout in ("runs", "hours"):
        for k, piece in enumerate(pieces):
            path = f"{stem}_{k + 1:02d}.{ending}"
            write(path, [table(piece, columns, 3600.0 * k * (layout == "runs"), {})])
            files.append(LogFile(path, (str(k),) if layout == "runs" else ()))
    elif layout in ("channels", "sparse"):
        steering = [
            one
            for one in columns
            if one.signal.endswith((".n", ".delta", ".alpha", ".force")) or one.signal.startswith("load")
        ]
        moving = [one for one in columns if one.signal in ("lat", "lon", "north", "east", "sog", "cog", "vn", "ve")]
        rest = [one for one in columns if one not in (*steering, *moving)]
        groups = [
            (name, group, piece)
            for name, group, take, first in (
                ("gps", moving, 2, 1),
                ("motion", rest, 1, 0),
                ("machinery", steering, 2, 0),
            )
            if group
            for piece in [pieces[0].iloc[first::take].reset_index(drop=True)]
        ]
        if layout == "channels":
            for name, group, piece in groups:
                write(f"{name}.{ending}", [table(piece, group, 0.0, {})])
                files.append(LogFile(f"{name}.{ending}"))
        else:
            joined = pd.concat(
                [
                    table(piece, group, 0.001 * k, {}).assign(order=piece["t"] + 0.001 * k)
                    for k, (_, group, piece) in enumerate(groups)
                ]
            )
            write(f"{stem}.{ending}", [joined.sort_values("order").drop(columns="order").fillna("")])
            files.append(LogFile(f"{stem}.{ending}"))
    else:
        label = {styled(story["style"], pick(["Run", "Test no", "Trial", "Leg"])): ""} if layout == "column" else {}
        tables = [
            table(piece, columns, 1800.0 * k * (layout != "restart"), {name: str(k + 1) for name in label})
            for k, piece in enumerate(pieces)
        ]
        write(f"{stem}.{ending}", tables)
        files.append(
            LogFile(f"{stem}.{ending}", tuple(str(k) for k in range(count)) if layout in ("restart", "column") else ())
        )
    extra = pick(["", "", "", "README.txt", "run_list.csv", "photo.jpg"])
    if extra:
        (folder / extra).write_text(
            {"run_list.csv": "run,wind,remark\n1,SW 3,ok\n2,SW 4,\n3,SW 4,repeat\n"}.get(extra, "see the report\n"),
            encoding="utf-8",
        )
    story = {"team": team, "craft": craft, "layout": layout, "clock": clock, "kind": kind, **story, "holes": f"{holes} {hole}", "sep": separator,
             "encoding": encoding, "preamble": len(preamble), "extra": extra, "quoted": quoted, "length": round(length, 1)}  # fmt: skip
    return Folder(seed, folder, {"length": length}, tuple(files), tuple(columns), story)


if __name__ == "__main__":
    main(draw_folder)
