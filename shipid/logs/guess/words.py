"""The words that names of columns are made of, in a few languages, and how well a name fits each meaning.

`GPS_Lat` is gps, lat; `ShaftRPM_port` is shaft, rpm, port. Units, sides, sensors and numbers are set aside; a name fits
by the share of its other parts that a phrase of the meaning explains.
"""

from __future__ import annotations

import re
import unicodedata
from functools import cache

from shipid.logs.amounts import UNIT_WORDS, is_known, without_prefix
from shipid.logs.mapping import UNITS
from shipid.physics.signals import SIGNALS

CONCEPTS = {
    "latitude": "lati plat breite breitengrad bredde breddegrad breddgrad latitud latitudine breedtegraad breedte "
    "enlem leveysaste leveys szerokosc sirina zemepisna sirka laiuskraad lintang",
    "longitude": "lon longi plon lng laenge laengengrad laengdgrad lengde lengdegrad lengtegraad lengte longitud "
    "longitudine boylam pituusaste pituus dlugosc duzina dolzina delka pikkuskraad bujur",
    "north": "northing nord nordwert hochwert norte noord",
    "east": "easting ost oest oestlig este leste oost rechtswert",
    "pos": "position posicion posisjon posizione posicao positie lage stand stellung stilling ausschlag utslag",
    "angle": "ang angulo angolo winkel vinkel hoek",
    "direction": "dir direccion direzione direcao richtung richting retning riktning",
    "heading": "hdg hdt hehdt head cap koers rumbo rumo rwk keulasuunta suunta keula pramac haluan",
    "prow": "proa prua prora stevn staev aproamento pruva",
    "course": "kurs kurz kurss kurssi",
    "track": "route rotta derrota bahn rota kulkusuunta",
    "gyro": "kreisel zyro",
    "compass": "kompass kompas compas bussola aguja",
    "magnetic": "mag magnet magnetisch magnetique magnetico magnetisk",
    "steered": "steuer styrt styret styrd",
    "ground": "grund grunn bunden fond fondo fundo sol grond dnem dnie pohjan yere dnom",
    "over": "ueber ue sobre suhteen nad gore",
    "through": "durch durchs gjennom door genom gennem",
    "water": "wasser vann vannet vand vatten eau agua acqua",
    "speed": "vel velocity velocities spd geschwindigkeit geschw hastighet hastighed fart fahrt vaart vitesse "
    "velocidad velocidade velocita snelheid predkosc nopeus hiz hizi brzina hitrost rychlost viteza kecepatan",
    "logg": "loch corredera solcometro",
    "surge": "jag cavalement",
    "sway": "svai embardee",
    "ahead": "avance avanzo avant axiale voraus",
    "fwd": "forward",
    "long": "laengs langs langskips laengskepps langskepps langsscheepse longitudinal longitudinale longit",
    "trans": "quer tvers tvaers tverr tverrskips tvaerskepps dwars dwarsscheepse transversal transversale "
    "trasversale transverse transv laterale athwart",
    "lat": "lateral",
    "drift": "deriva scarroccio derive",
    "turn": "dreh sving svinge wende draai dreie drei dreje giration giro accostata virata rotasjons bocht zwrotu "
    "katowa donus donme kaantymis okretanja zataceni",
    "yaw": "gier gir giring girings lacet guinada imbardata",
    "rate": "taux razon regimen rateo taxa orani",
    "roll": "heel kraengung kraengungs rull rullning krengning krengnings krenge krangning krangnings gite roulis "
    "escora balance sbandamento rollio slagzij helling rol slingering schlagseite",
    "trim": "trimm tangage assiette cabeceo beccheggio assetto nick stampf",
    "wind": "vind vent viento vento wiatr wiatru ruzgar tuuli tuulen vjetar",
    "true": "vrai vraie vero vera verdadero sann wahr wahrer ware",
    "relative": "rel relatif relativo relativa relativer relativ app apparent apparente aparente scheinbar "
    "scheinbarer schijnbare",
    "rudder": "rud rudders ruder ror roer roder timon timone leme barre barra gouvernail safran pala dumen ster "
    "steru perasin kormilo kormila krmilo kormidlo carma kemudi",
    "azimuth": "azi azimut azimutale azimute asimut azipod schottel srp asd gondel ruderpropeller azipull aquamaster",
    "thruster": "thr thrusters strahler propulsor propulseur",
    "propeller": "prop propell propel helice elica schroef schrauben schraube sruba sruby pervane potkuri vijak vijka",
    "shaft": "arbre eje asse aksel axel welle wellen saft walu akseli osovina",
    "motor": "moteur motore silnik silnika makine kone stroja",
    "rpm": "rps revs rev revolutions revoluciones umdrehungen omdreininger omdreinings omdrejninger omdrejnings "
    "tours astoerental giri vueltas toeren tur varv turns regime rotacoes obroty obrotow devir devri kierrosluku "
    "okretaji otacky turatie putaran",
    "number": "zahl tall tal",
    "cpp": "steigung stigning spoed paso passo",
    "force": "kraft kracht styrke staerke",
    "thrust": "schub skyve skyvekraft poussee empuje spinta stuw",
    "torque": "drehmoment dreiemoment akselmoment couple coppia koppel",
    "moment": "momento",
    "power": "puissance potencia potenza vermogen leistung effekt moc mocy guc teho snaga vykon",
    "fuel": "verbrauch kraftstoff consommation carburant consumo combustible carburante brandstof drivstoff forbruk",
    "depth": "profondeur profundidad profundidade sonda profondita diepte dybde djup tiefe echolot ekkolodd sounder "
    "glebokosc derinlik syvyys dubina",
    "draft": "draught tirant calado pescaggio immersione tiefgang tauchung",
    "temp": "temperature temperatura temperatuur temperatur",
    "battery": "batterie bateria batteria",
    "pressure": "trykk druck pression",
    "heave": "hiv pilonnement arfada sussulto",
    "pump": "pumps pumpe pompe bomba pomp",
    "ship": "schiffs skips navire buque nave",
    "bow": "etrave baug",
    "deg": "degrees",
}
"""Concept -> words for it in ten languages, and fewer in Polish, Finnish, Turkish, Croatian, Czech and others."""
_CONCEPT_OF_WORD = {word: concept for concept, words in CONCEPTS.items() for word in words.split()}
PHRASES: dict[str, str] = {
    "latitude": "lat, latitude, phi gps",
    "longitude": "long, longitude, lambda, lambda gps",
    "north": "n, north, x north, y north, x 0, x n, x ned, x earth, eta 1, x e, utm n, utm north, utm y, xn, ned n, "
    "ned north, delta north, dist north",
    "east": "e, east, x east, y east, est, y 0, y n, y ned, y earth, eta 2, y e, utm e, utm east, utm x, ye, ned e, "
    "ned east, delta east, dist east",
    "x": "x, x 0, xpos, posx, x coordinate, enu x",
    "y": "y, y 0, ypos, posy, y coordinate, enu y",
    "psi": "psi, heading, gyro, compass, yaw, yaw 0, prow, bow angle, bow direction, ahead course, ahead direction, "
    "eta 3, eta 6, theta z, course, steered course, rw course",
    "speed": "speed, speed over ground, speed ground, sog, u, v, vg, v g, fug, fueg, uog, vog, fog, speed og, abs "
    "speed, total speed",
    "course": "course, course over ground, course ground, heading over ground, heading ground, cog, crs, track, "
    "track angle, track over ground, track ground, chi, kueg, kug, kog, tmg, course og, course made good, track made "
    "good, beholden course, heading efectivo",
    "u": "u, u g, vx, surge, surge speed, long speed, fwd speed, ahead speed, x speed, u speed, v x, v long, v fwd, v "
    "surge, nu 1, x dot, u body, linear x",
    "v": "v, v g, vy, sway, sway speed, trans speed, lat speed, drift speed, starboard speed, stbd speed, y speed, v "
    "speed, v y, v trans, v lat, v stbd, v sway, nu 2, y dot, v body, linear y",
    "velocity_north": "vn, vx, v n, v north, north speed, n speed, ned n speed, enu y speed, x speed, v x, x dot",
    "velocity_east": "ve, vy, v e, v east, east speed, est speed, e speed, ned e speed, enu x speed, y speed, v y, y "
    "dot",
    "r": "r, rot, turn, turn rate, turn speed, yaw rate, yaw speed, heading rate, gyro rate, gyro z, w z, omega z, "
    "psi dot, yaw dot, gyro, nu 3, nu 6, angle speed z, angular speed z, angular z, d psi, turn zeiger",
    "phi": "phi, roll, eta 4, slag side, trans neigung",
    "theta": "theta, pitch, trim, stamp, eta 5, long neigung",
    "p": "p, roll rate, nu 4, gyro x, omega x",
    "q": "q, pitch rate, nu 5, gyro y, omega y",
    "V_w": "wind, wind speed, wind force, tws, aws, v w, v wind",
    "beta_w": "wind direction, wind angle, wind from, twd, twa, awa, beta w, gamma w",
    "delta": "delta, rudder, rsa, helm, dr, d r, delta r, flap angle, steering angle, steering gear angle",
    "alpha": "alpha, alpha t, azimuth, pod, outboard, z drive, thruster angle, thruster direction, thruster "
    "orientation, tilt angle, thrust angle, nozzle angle, drive angle, stern drive angle, sterndrive angle, zdrive "
    "angle, jet angle, waterjet angle",
    "n": "n, rpm, shaft, propeller, engine, shaft speed, propeller speed, engine speed, motor speed, thruster speed, "
    "rotation speed, turn number, n p, erpm, e rpm, electrical rpm, electric rpm, elec rpm",
    "pitch": "cpp, propeller pitch, propeller cpp, propeller pas, pitch ratio, p d",
    "thrust": "thrust, t n, t propeller, thrust p",
    "torque": "torque, q, turn moment, vrid moment, shaft moment, par motor, par shaft, par propeller",
    "normal_force": "rudder force, normal force, f n, fn",
}
"""Meaning -> phrases of concepts in any order. The names of `SIGNALS` count, too."""
BESIDE = {
    "psi": "angle direction course heading yaw gyro compass magnetic",
    **dict.fromkeys(("r", "phi", "theta"), "angle"),
    "beta_w": "angle direction",
    "delta": "angle",
    "alpha": "angle direction steering azimuth thruster pod",
    "n": "shaft propeller engine motor main me thruster pod azimuth esc number minute as n",
    "pitch": "pitch cpp",
    "thrust": "propeller shaft force",
    "torque": "propeller shaft",
    "normal_force": "rudder normal",
}
"""Meaning -> concepts that say nothing else where they stand beside one of its phrases."""
OTHERS = (
    "stamp secs, stamp nsec, stamp nsecs, stamp nanosec, battery, battery voltage, voltage, current, sat, sats, "
    "satellites, num sat, nsat, ukc, under keel clearance, wave, wave probe, wave gauge, wave height, surface speed, "
    "superficie speed, water speed, speed through water, stw, vbw, fdw, v log, log speed, logg, logg speed, doppler "
    "log, moment, torque rudder, moment rudder, power, bow thruster power, shaft power, motor power, engine load, "
    "engine torque, kw, load, fuel, fuel rate, fuel flow, rack, fuel rack, depth, water depth, depth m, draft, draft "
    "fwd, draft aft, draft water, diep gang, temp, air temp, water temp, bow thruster, stern thruster, tunnel "
    "thruster, propeller prow, heave, tauch bewegung, pump, rudder pump, steering pump, steering gear pump, rudder "
    "motor, rudder limit, drift, drift angle, set, marker, mark, event, sample, cpu, cpu load, disk, pressure, "
    "lufttrykk, humidity, sea state, autopilot, hdop, pdop, vdop, acc, acc x, acc y, acc z, acceleration, a x, a y, "
    "a z, roll acc, pitch acc, x force, y force, force, mass, height, altitude, alt, z, age, quality, status, mode, "
    "alarm, xte, cross track error, dist, distance, waypoint, index, row, count, id, no, nr, variation, magnetic "
    "variation, deviation, geoid, current speed, current direction, ae rpm, aux engine rpm, auxiliary engine rpm, "
    "generator rpm"
)
"""Phrases of columns that no dataset takes."""
_MEANING_PHRASES = {
    meaning: tuple(frozenset(phrase.split()) for phrase in text.split(","))
    for meaning, text in {**PHRASES, "": OTHERS}.items()
}
ORDERS = frozenset(
    (
        "befehl c cmd command commanded d demand des desired goal oensket onsket ord order ordered ordre ref "
        "reference req request set setpoint setpunkt setting soll sp target want wanted vorgabe sollwert consigne "
        "commande ordonne ordonnee demande demandee orden ordenado ordenada consigna mando comandado comando "
        "comandato comandata ordine ordinato ordinata setpunt gewenst gewenste bevel satt bestilt kommando "
        "kommandert kommanderet beordret oenskad boervaerde stellbefehl"
    ).split()
)
"""Parts that say what is ordered, not what is."""
WIND_WORDS = {"true": {"true", "tws", "twd", "real", "reale"}, "apparent": {"aws", "awa", "relative"}}
"""Parts that say which wind a column has. `twa` does not: it is the true wind, from the bow."""
SOURCES = frozenset(
    (
        "attitude field header local msg orientation pose quat quaternion twist act actual answer ahrs avg data deg "
        "dgnss dgps est estimated fb feedback filt filtered geogr gga gnss gpgga gprmc gps imu ins ist m mean meas "
        "measured measurement mru nav navigation odom of own pos raw relative response rtk sensor ship signal sim "
        "standort t the true val value vehicle vessel voorliggende vtg wert gemessen istwert rueckmeldung "
        "rechtweisend reel reelle mesure mesuree effectif retour medido medida real efectivo misurato misurata "
        "effettivo reale gemeten werkelijk maalt virkelig faktisk tilbakemelding aervaerde ligne de du des do da no "
        "le la les el del della di van der den het al sul sur"
    ).split()
)
"""Parts that say where a value comes from, and nothing of what it is."""
UNIT_PARTS = frozenset(
    (
        "cm cmps cms deg degs dpm dps feet ft grad kmh kn knm kw nm knots kt kts min mm mmps mms mph mps ms nmi pct "
        "rad rads sec"
    ).split()
)
"""Parts that are a unit at the end of a name."""
_SIDES = {
    "port": "iskele lewa lewy lewej vasen lijevo lijevi "
    "port ps bb bab br babord backbord p prt portside left babor bakboord bagbord sinistra sx links gauche "
    "bd bombordo",
    "starboard": "sancak prawa prawy prawej oikea desno desni "
    "starboard stbd sb tri er stb styrbord steuerbord s strbd right star tribord trib td tb estribor "
    "dritta dx stuurboord rechts droite be estibordo",
    "stern": "stern",
    "bow": "bow",
    "fore": "fore fwd",
    "aft": "aft",
    "main": "main",
}
SIDE_WORDS = {side: frozenset(words.split()) for side, words in _SIDES.items()}
"""Side or place of a component -> words for it."""
MAGNETIC = frozenset(["magnetic", "compass"])
"""Parts that say that a heading is that of a magnetic compass."""
NOT_MAGNETIC = frozenset("gyro sat satellite gps gnss rtk fog".split())
"""Parts that say that a compass is another one."""
RUN_WORDS = frozenset(
    (
        "run runs test trial trials versuch lauf messfahrt messlauf essai essais passe prueba ensayo corrida prova "
        "corsa proef proefvaart forsoek forsok kjoering koersel koring manoeuvre maneuver manoever manoevre maniobra "
        "manovra manoeuver experiment exp case rec recording sequence leg"
    ).split()
)
"""Parts that say that a column holds the run."""
RUN_NUMBERS = frozenset(
    "no nr num number nummer numero numer id name navn naam nom nombre nome code index label".split()
)
_LETTERS = {"ψ": "psi", "δ": "delta", "φ": "phi", "ϕ": "phi", "θ": "theta", "χ": "chi", "α": "alpha", "ω": "omega"}
_LETTERS |= {"β": "beta", "ä": "ae", "ö": "oe", "ü": "ue", "ø": "oe", "å": "aa", "æ": "ae", "ß": "ss", "Ψ": "psi"}
_LETTERS |= {
    "Ä": "Ae",
    "Ö": "Oe",
    "Ü": "Ue",
    "Ø": "Oe",
    "Å": "Aa",
    "λ": "lambda",
    "°": " deg ",
    "ı": "i",
    "ł": "l",
    "đ": "d",
    "œ": "oe",
}
TRANSLATED = {
    "latitude": "緯度 纬度 위도 широта",
    "longitude": "経度 經度 经度 경도 долгота",
    "heading": "船首方位角 船首方位 船首角 方位角 方位 艏向角 艏向 船艏向 船首向 首向 航向角 "
    "선수방위각 선수방위 선수각 헤딩 방위각",
    "gyro": "ジャイロ 陀螺 罗经 자이로 гирокомпас",
    "magnetic": "磁気 磁 자기 магнитный",
    "kurs": "針路 航向 침로 курс",
    "course over ground": "対地針路 对地航向 對地航向 航迹向 航迹角 대지침로 путевой_угол",
    "speed": "船速 速力 速度 航速 선속 속력 속도 скорость",
    "speed over ground": "対地速力 対地速度 対地船速 对地航速 对地速度 對地航速 대지속력 대지속도",
    "speed through water": "対水速力 対水速度 対水船速 对水航速 对水速度 대수속력 대수속도",
    "surge speed": "前後速度 纵向速度 纵荡速度 종방향속도 전후속도",
    "sway speed": "左右速度 横方向速度 横向速度 横荡速度 횡방향속도 좌우속도",
    "yaw rate": "回頭角速度 旋回角速度 回頭率 旋回率 回頭速度 旋回速度 ヨーレート ヨー角速度 转艏角速度 转首角速度 "
    "艏摇角速度 首摇角速度 回转角速度 转头角速度 转向角速度 转向率 转艏率 艏摇率 회두각속도 선회각속도 선회율 회두율 "
    "угловая_скорость скорость_поворота",
    "rudder angle": "舵角 타각 угол_перекладки_руля угол_руля положение_руля",
    "rudder": "ラダー 舵 러더 руль",
    "rudder order": "舵令 명령타 지령타",
    "propeller": "プロペラ 螺旋桨 螺旋槳 推进器 프로펠러 винта",
    "engine": "エンジン 機関 发动机 엔진",
    "main engine": "主機 主机 主機関 주기관 주기 гд",
    "shaft": "軸 轴 축 вала",
    "rpm": "回転数 回転速度 转速 轉速 회전수 회전속도 частота_вращения обороты",
    "thruster": "スラスタ スラスター 侧推 쓰러스터 스러스터",
    "bow thruster": "バウスラスタ バウスラスター 艏侧推 선수쓰러스터 바우스러스터",
    "azimuth": "アジマス 全回转 아지무스",
    "wind speed": "風速 风速 풍속 скорость_ветра",
    "wind direction": "風向 风向 풍향 направление_ветра",
    "true wind speed": "真風速 真风速 진풍속",
    "true wind direction": "真風向 真风向 진풍향",
    "relative": "相対 相对 相對 상대",
    "true": "真 绝对 истинный истинная",
    "roll": "横揺れ角 横揺れ ロール角 ロール 横摇角 横摇 横倾角 횡동요각 횡동요 롤 крен",
    "pitch angle": "縦揺れ角 縦揺れ ピッチ角 纵摇角 纵摇 纵倾角 종동요각 종동요 дифферент",
    "roll rate": "横揺れ角速度 横摇角速度 횡동요각속도",
    "pitch rate": "縦揺れ角速度 纵摇角速度 종동요각속도",
    "acceleration": "加速度 가속도 ускорение",
    "current speed": "流速 潮流 海流 유속 조류 течения",
    "value": "の 的 의 値 值 값 計 计 データ 数据 信号 신호 センサ センサー 传感器 센서",
    "thrust": "推力 スラスト 추력",
    "torque": "トルク 扭矩 转矩 토크",
    "power": "馬力 出力 功率 출력 마력 мощность",
    "depth": "水深 수심 глубина",
    "draft": "喫水 吃水 흘수 осадка",
    "time": "時刻 時間 日時 日付 时间戳 时间 时刻 日期 시간 시각 일시 날짜 время дата",
    "order": "指令 命令 設定 设定 명령 지령 задание",
    "actual": "実 实际 실제 фактический",
    "angle": "角度 角 각도 угол",
    "port": "左舷 左 좌현 левый левого",
    "starboard": "右舷 右 우현 правый правого",
}
"""Known words -> words of East Asian scripts and of Cyrillic, `_` for a blank in them."""
WIDE = str.maketrans("（）［］【】〔〕／，：％　", "()[][][]/,:% ")
"""Signs of East Asian width, as they are written elsewhere."""
WHOLE = dict.fromkeys(
    (
        "bt bowthruster bowthr bugstrahler bugstrahlruder querstrahler querstrahlruder boegschroef baugpropell "
        "baugtruster baugthruster bovpropel bovpropell bogpropeller"
    ).split(),
    ("bow", "thruster"),
)
WHOLE |= dict.fromkeys(("heckstrahler", "heckstrahlruder", "hekschroef", "hekkpropell"), ("stern", "thruster"))
WHOLE |= {"propellerpm": ("propeller", "rpm"), "kulmanopeus": ("turn", "speed")}
"""Words that are cut into parts of another language."""
_OF_SHAFT = re.compile(rf"k?({UNIT_WORDS['rpm']})|rps|rev/s")
"""Units of a shaft speed, in lower case, that no other quantity has."""
_EDGE = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[A-Za-z])(?=\d)|(?<=\d)(?=[A-Za-z])")
_AFTER = re.compile(r"(?:\s+/\s*|,\s*)([^\s,]{1,9})\s*$")
_SPELT = re.compile(
    r"(?:[_ ]|(?<=[a-z]))(?:([A-Za-z][a-z]*)[_ ]?[Pp]er[_ ]?([A-Za-z][a-z]*)|(?<=[_ ])newtons?)(?![a-z])"
)
NO_VALUE = re.compile(
    r"[-–—*.?_/# ]*|#?n[/.]?a\.?|null|none|nil|-?nan(\(ind\))?|[+-]?inf(inity)?|-?1\.#(ind|q?nan|inf)\d*|no ?data|"
    r"missing"
)
"""What logs write in a cell without a value, in lower case."""
LONGEST_WORD = 80  # letters: a longer one is not cut
_TYPE = re.compile(r"^(?:lr|[a-z])(?=[A-Z]\w)")
QUANTITIES = {"m/s": "speed", "rad/s": "rate"}
"""SI unit -> the word that a unit in a name stands for: `langs_kn` is a speed ahead, `giring [deg/min]` a yaw rate."""
LEAST = 0.45  # share of a name that a phrase explains, before the name counts as fitting


@cache
def _plain_name(name: str) -> str:
    """A name with the signs of others, and a unit that is spelt out in brackets: `prop_rev_per_s` is `prop [rev/s]`."""

    def in_brackets(found: re.Match[str]) -> str:
        unit = f"{found[1]}/{found[2]}" if found[1] else "N"
        return f" [{unit}] " if is_known(unit) else found[0]

    return _SPELT.sub(in_brackets, name.translate(WIDE))


@cache
def name_parts(name: str) -> tuple[str, ...]:
    """The parts of a name in lower case, without text in brackets; accents and Greek are spelt out."""
    name = _plain_name(name)
    bare = re.sub(r"[\[(][^\])]*[\])]?", " ", _AFTER.sub("", name))
    if not bare.isascii():
        bare = _translation_table()[0].sub(_translate, unicodedata.normalize("NFKC", bare))
        bare = re.sub(r"[\u0400-\uffff]+", " unknownword ", bare)
    bare = re.sub(r"\b([MA])/E\b", r"\1E", bare)  # main or auxiliary engine, and no electrical speed
    text = unicodedata.normalize("NFKD", "".join(_spell_letter(bare, place) for place in range(len(bare))))
    text = "".join(letter for letter in text if not unicodedata.combining(letter))
    whole = [word for word in re.split(r"[^A-Za-z0-9]+", text) if word]
    words = [
        part.lower()
        for word in whole
        for part in ([word] if word.lower() in _known_words() | UNIT_PARTS else _EDGE.split(word.replace("StB", "Stb")))
    ]
    return tuple(_CONCEPT_OF_WORD.get(part, part) for word in words for part in _split_word(word))


@cache
def _translation_table() -> tuple[re.Pattern[str], dict[str, str]]:
    """A regular expression of all words of other scripts, longer ones first, and word -> known words."""
    pairs = [(word.replace("_", " "), known) for known, words in TRANSLATED.items() for word in words.split()]
    words = {unicodedata.normalize("NFKC", word): known for word, known in pairs}
    longest = sorted(words, key=lambda word: -len(word))
    return re.compile("|".join(map(re.escape, longest)), re.IGNORECASE), words


def _translate(found: re.Match[str]) -> str:
    return f" {_translation_table()[1][found[0].lower()]} "


def known_words(text: str) -> int:
    """How many different words of other scripts are in a text: few if it is read in a wrong encoding."""
    return len({*_translation_table()[0].findall(text)})


def _spell_letter(text: str, place: int) -> str:
    """A letter of a text without accent, as capitals within capitals: Ü is Ue in Über, UE in FÜG."""
    letter = text[place]
    spelt = _LETTERS.get(letter, letter)
    around = text[max(0, place - 1) : place] + text[place + 1 : place + 2]
    return spelt.upper() if letter.isupper() and any(other.isupper() for other in around) else spelt


def units_in_name(name: str) -> list[str]:
    """What a name has in brackets, after a blank and a slash as in `Schub / kN`, or after a comma."""
    name = _plain_name(name)
    after = _AFTER.search(name)
    return [*re.findall(r"[\[(]([^\])]*)[\])]", name), *([after.group(1).strip()] if after else [])]


def unit_in_name(name: str, si: str) -> str | None:
    """The unit in a name, in brackets or at its end; None if there is none that converts to the SI unit `si`."""
    return _unit_and_factor(name, si)[0]


def factor_in_name(name: str) -> float:
    """What the prefix of a unit in a name multiplies it by, 1000 of `Engine [krpm]`; 1 where there is none."""
    return next((factor for si in ("rad", "rad/s", "rev/s") if (factor := _unit_and_factor(name, si)[1]) != 1.0), 1.0)


@cache
def _unit_and_factor(name: str, si: str) -> tuple[str | None, float]:
    inside = units_in_name(name)
    bare = re.sub(r"[\[(].*", "", name).strip()
    parts = [part for part in re.split(r"[_ ]|(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", bare) if part]
    alone = len(parts) < 2 and si != "rev/s"
    ends = [] if alone else ["_".join(parts[-2:]), *parts[-1:]]
    if si == "rev/s" and not inside and re.search("rpm|rps", bare.lower()):
        ends.append("rpm" if "rpm" in bare.lower() else "rps")
        ends = ["krpm"] if re.search("(?<![a-z])krpm", bare.lower()) else ends
    if si in ("N", "N m") and (force := re.search(r"[kK]?N[mM]?$", bare)):  # `thrust_kN` is cut before the N
        ends = [force[0]]
    for candidate, factor in map(without_prefix, [*reversed(inside), *ends]):
        for unit, expected in UNIT_WORDS.items():
            if (unit in UNITS[si] or (unit == "%" and si == "rev/s")) and re.fullmatch(
                expected, candidate.strip().lower()
            ):
                return unit, factor
    return None, 1.0


def shaft_unit(name: str) -> str:
    """The unit of a shaft speed that a name has, set off or as its last word; empty where it has none."""
    said = units_in_name(name) or re.split(r"[_ ]", _plain_name(name).strip())[-1:]
    return next((unit for unit in said if _OF_SHAFT.fullmatch(unit.strip().lower())), "")


def is_note(text: str) -> bool:
    """Whether a text in brackets has a word that says a quantity, a side, a source or an order, and so is no unit."""
    known = _known_words() | MAGNETIC | NOT_MAGNETIC
    return bool(known & {*name_parts(text)}) or side_in_name(f"x {text}") is not None


def wind_kind(name: str) -> str:
    """Whether the name of a column of wind says `true` or `apparent`; empty where it says neither, or both."""
    parts = set(name_parts(name))
    kinds = [kind for kind, words in WIND_WORDS.items() if parts & words]
    return kinds[0] if len(kinds) == 1 else ""


@cache
def _known_words() -> frozenset[str]:
    phrases = " ".join([*PHRASES.values(), OTHERS, *CONCEPTS, *CONCEPTS.values()])
    words = {*phrases.replace(",", " ").split()}
    return frozenset(word for word in words | ORDERS | SOURCES | RUN_WORDS if len(word) > 2)


def is_known_word(word: str) -> bool:
    """Whether a word says a quantity, a source, an order or a run in one of the languages, alone or in parts."""
    return any(part in _known_words() or len(part) < 2 for part in name_parts(word))


@cache
def _split_word(word: str) -> tuple[str, ...]:
    """Cut a word that is no known one into known words, such as `ruderwinkel`; return it whole where it cannot be."""
    known = _known_words() | {one for words in SIDE_WORDS.values() for one in words if len(one) > 3}
    if word in WHOLE:
        return WHOLE[word]
    if word in known or not 6 <= len(word) <= LONGEST_WORD:
        return (word,)
    best: dict[int, tuple[str, ...]] = {0: ()}
    for end in range(1, len(word) + 1):
        options = [(*before, word[start:end]) for start, before in best.items() if word[start:end] in known]
        if options:
            best[end] = min(options, key=len)
    return best.get(len(word), (word,))


ENGINES = frozenset("engine engines motor motors moteur moteurs motore motori me maskin".split())


def is_electrical(name: str) -> bool:
    """Whether a name says the electrical speed of a motor: that of its shaft times its pairs of poles."""
    joined = "_".join(name_parts(name))
    return bool(re.search(r"(^|_)(erpm|e_rpm|elec(tr(ic(al)?)?)?_rpm|eldrehzahl)(_|$)", joined))


def is_engine(name: str) -> bool:
    """Whether a name says that a speed is that of an engine, which may drive its shaft through a gear."""
    return not ENGINES.isdisjoint(name_parts(name))


def is_order(name: str) -> bool:
    """Whether a name says that its column is an order or a set point, not what was measured."""
    parts = name_parts(name)
    return len(parts) > 1 and bool(ORDERS & set(parts[1:] if len(parts[0]) == 1 else parts))


def may_be_measured(name: str) -> str:
    """The name without the words ref and reference where only they say that it is a set point, else nothing."""
    left = " ".join(part for part in name_parts(name) if part not in ("ref", "reference"))
    return left if is_order(name) and not is_order(left) else ""


def is_run(name: str) -> bool:
    """Whether a name says that its column holds the run: `Run`, `test no`, `Versuch`."""
    parts = set(name_parts(name)) - RUN_NUMBERS
    return bool(parts) and parts <= RUN_WORDS


def is_magnetic(name: str) -> bool:
    """Whether a name says that a heading is that of a magnetic compass, in brackets, too: Hdg (mag), Hdg [deg M]."""
    words = {word for text in (name, *units_in_name(name)) for word in name_parts(text)}
    if words & NOT_MAGNETIC:
        return False
    return bool(words & MAGNETIC or re.search(r"(deg|°) ?\(?M\b", name))


def side_in_name(name: str) -> str | None:
    """The side or place in a name, such as `port`; None if there is none."""
    bare = re.sub(r"[\[(][^\])]*[\])]?", " ", _AFTER.sub("", _plain_name(name)))  # 1/s is no starboard
    parts = set(name_parts(name)) | set(re.split(r"[\W\d_]+", bare.lower()))
    for side, words in SIDE_WORDS.items():
        if len(parts - {""}) > 1 and words & parts:
            return side
    return None


def how_much_says(name: str, command: str) -> int:
    """How many parts of a command's component a name has that says its signal: `rpm_bow_aft` two of `bow_aft.n`."""
    component, _, signal = command.rpartition(".")
    said, parts = set(name_parts(component)), [part for part in name_parts(name) if part not in UNIT_PARTS - {signal}]
    if not said or not said <= set(parts):
        return 0
    left = [part for part in parts if part not in said]
    if any(part.isdigit() for part in left):  # one of several
        return 0
    rest = [part for part in left if part not in SOURCES | ORDERS]
    known = rest == [signal] or meaning_scores(" ".join(left) if rest else name).get(signal, 0.0) >= LEAST
    return len(said) if known else 0


def number_in_name(name: str) -> int | None:
    """The last number among the parts of a name; None if there is none."""
    return next((int(part) for part in reversed(name_parts(name)) if part.isdigit()), None)


@cache
def meaning_scores(name: str) -> dict[str, float]:
    """How well a name fits each meaning, 0 to 1: `{"psi": 1.0}`; the empty meaning is a column of no use.

    A type before the name, as `f` and `lr` of `fPosN` and `lrSpeed` in controllers, says nothing.
    """
    best, bare = _scores_of_name(name), _TYPE.sub("", name)
    scores = _scores_of_name(bare) if bare != name else {}
    clear = name.startswith(("f", "lr")) or max(scores.values(), default=0.0) > max(best.values(), default=0.0) + 0.05
    return scores if scores and clear else best


def _scores_of_name(name: str) -> dict[str, float]:
    parts = list(name_parts(name))
    said = {what for si, what in QUANTITIES.items() if unit_in_name(name, si) is not None} - {*parts}
    order = is_order(name)
    aside = SOURCES.union(*SIDE_WORDS.values(), ORDERS if order else ())
    while len(parts) > 1 and parts[-1] in UNIT_PARTS:
        parts.pop()
    content = [part for part in parts if part not in aside and not part.isdigit()]
    meanings: dict[str, float] = {}
    for meaning, phrases in _MEANING_PHRASES.items():
        beside = {*BESIDE.get(meaning, "").split()} & {*parts}
        best = max(
            _phrase_share(phrase, beside, [*parts, *said], content, aside) for phrase in phrases if phrase - said
        )
        row = SIGNALS.get(meaning)
        if order and row is not None and row.role != "command":
            best = 0.0
        if best >= LEAST:
            meanings[meaning] = best
    for meaning, row in SIGNALS.items():
        if row.names and meaning not in meanings and not order and re.fullmatch(row.names, "_".join(parts)):
            meanings[meaning] = 0.9
            if meaning not in PHRASES:  # a row of the table that is new: `OTHERS` names it as no quantity
                meanings.pop("", None)
    tunnel = "thruster" in parts and {"bow", "stern"} & set(parts)
    if (tunnel or "alpha" in meanings) and shaft_unit(name):  # of a unit, in revolutions: its speed, not its angle
        meanings = {"n": 1.0}
    if tunnel:  # nothing that moves with the ship
        return {meaning: fit for meaning, fit in meanings.items() if meaning in ("", "n", "pitch", "side_force")}
    return meanings


def _phrase_share(
    phrase: frozenset[str], beside: set[str], parts: list[str], content: list[str], aside: frozenset[str]
) -> float:
    """The share of the letters of a name that a phrase and words beside it explain; 0 if it lacks a word."""
    if not phrase <= {*parts}:
        return 0.0
    letters = sum(map(len, phrase | beside))
    extra = sum(len(part) for part in content if part not in phrase | beside)
    known_aside = 0.02 * sum(part in aside and part not in phrase | beside for part in parts)
    return letters / (letters + extra) - known_aside
