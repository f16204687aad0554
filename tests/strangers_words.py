"""Words, units and habits of the teams that write raw files: what each signal is called in five languages."""

from __future__ import annotations

from shipid.units import DEGREE, KNOT

UNITS = {  # per SI unit
    "s": 1.0, "m": 1.0, "deg": 1 / DEGREE, "rad": 1.0, "m/s": 1.0, "kn": 1 / KNOT, "km/h": 3.6, "deg/s": 1 / DEGREE,
    "deg/min": 60 / DEGREE, "rad/s": 1.0, "rpm": 60.0, "rps": 1.0, "N": 1.0, "kN": 1e-3, "Nm": 1.0, "kNm": 1e-3,
}  # fmt: skip
LANGUAGES = {"basin": "en en de no", "yard": "en en de fr es no", "autonomy": "si si en", "logger": "en en de no fr"}
WORDS: dict[str, dict[str, str]] = {  # signal -> language -> words; "si": short names as in equations and programs
    "time": {"en": "Time|time|t|Elapsed time|Timestamp", "de": "Zeit|Messzeit", "no": "Tid", "fr": "Temps|Heure",
             "es": "Tiempo|Hora", "si": "t|time|timestamp|stamp"},
    "date": {"en": "Date", "de": "Datum", "no": "Dato", "fr": "Date", "es": "Fecha", "si": "date"},
    "run": {"en": "Run|Test no|run_id", "de": "Versuch", "no": "Forsok", "fr": "Essai", "es": "Prueba", "si": "run"},
    "north": {"en": "North|Northing|N|pos_north", "de": "Nord|Hochwert", "no": "Nord", "fr": "Nord", "es": "Norte"},
    "east": {"en": "East|Easting|E|pos_east", "de": "Ost|Rechtswert", "no": "Ost", "fr": "Est", "es": "Este"},
    "axis x": {"en": "X|x|x_pos|Xpos", "si": "x|pos_x|x0"}, "axis y": {"en": "Y|y|y_pos|Ypos", "si": "y|pos_y|y0"},
    "lat": {"en": "lat|Latitude|GPS Lat|LAT", "de": "Breite|Lat", "no": "Breddegrad", "fr": "Latitude",
            "es": "Latitud"},
    "lon": {"en": "lon|Longitude|GPS Lon|LON", "de": "Länge|Lon", "no": "Lengdegrad", "fr": "Longitude",
            "es": "Longitud"},
    "psi": {"en": "Heading|heading_true|HDG|Gyro heading|Yaw", "de": "Kurs|Heading|Kurswinkel", "no": "Kurs|Heading",
            "fr": "Cap", "es": "Rumbo", "si": "psi|yaw|heading"},
    "magnetic": {"en": "Heading mag|Compass", "de": "Magnetkompass", "fr": "Cap compas", "si": "heading_mag"},
    "u": {"en": "Surge velocity|u|Vx|Long. speed|speed_long", "de": "Vx|Längsgeschwindigkeit", "fr": "Vitesse long.",
          "si": "u|vx|surge_vel|vel_x"},
    "v": {"en": "Sway velocity|v|Vy|Transv. speed|speed_trans", "de": "Vy|Quergeschwindigkeit", "fr": "Vitesse transv.",
          "si": "v|vy|sway_vel|vel_y"},
    "vn": {"en": "V_north|vel N", "si": "vn|v_north|vel_n"}, "ve": {"en": "V_east|vel E", "si": "ve|v_east|vel_e"},
    "r": {"en": "ROT|Rate of turn|yaw rate|Yaw velocity|rot", "de": "Drehrate|Gierrate|Drehgeschwindigkeit",
          "no": "Rotasjonshastighet|ROT", "fr": "Taux de giration", "es": "Velocidad de giro|ROT",
          "si": "r|yaw_rate|psi_dot|wz"},
    "sog": {"en": "SOG|Speed over ground|GPS speed|sog", "de": "FüG|Fahrt über Grund|SOG", "no": "Fart|SOG",
            "fr": "Vitesse fond|SOG", "es": "Velocidad|SOG", "si": "sog|speed|U"},
    "cog": {"en": "COG|Course over ground|cog", "de": "KüG|Kurs über Grund", "no": "COG", "fr": "Route fond|COG",
            "es": "COG", "si": "cog|course"},
    "stw": {"en": "STW|Speed log|Water speed", "de": "FdW|Fahrt durchs Wasser", "no": "STW", "fr": "Loch",
            "es": "Corredera", "si": "stw"},
    "delta": {"en": "Rudder|Rudder angle|rudder_angle|RUD", "de": "Ruderwinkel|Ruder|Ruderlage", "no": "Ror|Rorvinkel",
              "fr": "Angle de barre|Barre", "es": "Timon|Angulo timon", "si": "delta|rudder|rud"},
    "alpha": {"en": "Azimuth|Azimuth angle|Pod angle|AZI", "de": "Azimutwinkel|Ruderpropeller Winkel",
              "no": "Asimut|Azimuth", "fr": "Azimut", "es": "Azimut", "si": "alpha|azimuth|azi"},
    "n": {"en": "RPM|Shaft speed|Prop speed|N_prop|Shaft RPM", "de": "Drehzahl|Propellerdrehzahl|Wellendrehzahl",
          "no": "Turtall|Propellturtall", "fr": "Vitesse arbre|Régime", "es": "RPM|Revoluciones",
          "si": "n|rpm|n_prop|shaft"},
    "bow": {"en": "Bow thruster|BT speed|Bow thr.", "de": "Bugstrahler Drehzahl|Querstrahler", "no": "Baugpropell",
            "fr": "Propulseur étrave", "es": "Helice de proa", "si": "n_bow|bow_thruster|bt"},
    "thrust": {"en": "Thrust|T_prop", "de": "Schub", "no": "Skyvekraft", "fr": "Poussée", "es": "Empuje", "si": "T"},
    "torque": {"en": "Torque|Q_prop|Shaft torque", "de": "Drehmoment", "no": "Moment", "fr": "Couple", "es": "Par",
               "si": "Q"},
    "V_w": {"en": "Wind speed|TWS|True wind speed", "de": "Windgeschwindigkeit", "no": "Vindhastighet",
            "fr": "Vent vitesse", "es": "Viento", "si": "wind_speed|tws"},
    "wind_from": {"en": "Wind dir|TWD|True wind direction", "de": "Windrichtung", "no": "Vindretning",
                  "fr": "Vent direction", "es": "Direccion viento", "si": "wind_dir|twd"},
    "aws": {"en": "Rel. wind speed|AWS|Apparent wind speed", "de": "rel. Windgeschwindigkeit", "fr": "Vent apparent",
            "si": "aws"},
    "awa": {"en": "Rel. wind dir|AWA|Apparent wind angle", "de": "rel. Windrichtung", "fr": "Vent apparent angle",
            "si": "awa"},
    "phi": {"en": "Roll|Heel", "de": "Rollwinkel|Krängung", "no": "Rull", "fr": "Roulis", "es": "Balance",
            "si": "roll|phi"},
    "theta": {"en": "Pitch|Trim", "de": "Stampfwinkel|Trimm", "no": "Stamp", "fr": "Tangage", "es": "Cabeceo",
              "si": "pitch|theta"},
}  # fmt: skip
IDLE = (  # word, unit, level, scatter
    ("Battery voltage", "V", 24.6, 0.1), ("Sat", "", 11.0, 0.8), ("HDOP", "", 0.9, 0.05), ("GPS quality", "", 4.0, 0.0),
    ("Air temp", "degC", 14.0, 0.1), ("Depth", "m", 61.0, 1.5),
    ("Shaft power", "kW", 900.0, 30.0), ("Mode", "", 2.0, 0.0),
    ("UKC", "m", 40.0, 1.0), ("Rudder pump 1", "", 1.0, 0.0),
    ("Wave probe 3", "mm", 0.0, 2.0), ("CPU load", "%", 31.0, 4.0),
    ("Acc Z", "m/s2", 9.81, 0.03), ("Fuel rack", "%", 63.0, 1.0), ("Marker", "", 0.0, 0.0), ("Sample", "", 0.0, -1.0),
)  # fmt: skip
SPELLED = {
    "deg": "deg|°|deg|degrees", "kn": "kn|kts|knots|kn", "rpm": "rpm|1/min|RPM|min-1", "deg/s": "deg/s|°/s|deg/s",
    "deg/min": "deg/min|°/min|deg/min", "rps": "rps|1/s|Hz", "s": "s|sec|s", "km/h": "km/h",
}  # fmt: skip
DATES = {"de": "%d.%m.%Y", "no": "%d.%m.%Y", "fr": "%d/%m/%Y", "es": "%d/%m/%Y"}
GERMAN = {"deg": "Grad", "deg/s": "Grad/s", "deg/min": "Grad/min", "kn": "kn", "rpm": "1/min"}
JOINED = {"m/s": "mps|m_s|ms", "deg/s": "deg_s|degps|dps", "deg/min": "deg_min|dpm", "rad/s": "rad_s|radps",
          "kn": "kn|kts|kt"}  # fmt: skip
SIDES = {
    "en": "port stbd|PS SB|Port Starboard|P S", "de": "Bb Stb|BB StB", "no": "BB SB|babord styrbord",
    "fr": "bd td|BAB TRI",
    "es": "babor estribor|BR ER", "si": "port stbd|p s|left right|1 2",
}  # fmt: skip
ROLES = {"en": ("order|cmd|set|command", "|act|fb|feedback"), "de": ("Soll", "Ist|"), "no": ("ordre|satt", "|målt"),
         "fr": ("consigne", "|mesure"), "es": ("orden", "|real"), "si": ("cmd|ref|des", "|meas|act")}  # fmt: skip
CODES = {
    "zigzag": ("ZZ", "zigzag", "Zickzack"), "circle": ("TC", "turning_circle", "Drehkreis"),
    "random": ("RND", "free", "Fahrt"),
    "acceleration": ("ACC", "acceleration", "Beschleunigung"), "coasting": ("INERTIA", "coasting", "Ausgleiten"),
    "straight": ("ST", "straight", "Geradeaus"), "crash stop": ("CS", "crash_stop", "Nothalt"),
    "pull-out": ("PO", "pullout", "Pullout"), "slowing down": ("DEC", "decel", "Verzoegerung"),
}  # fmt: skip
