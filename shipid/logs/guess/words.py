"""The words that names of columns are made of, in a few languages, and how well a name fits each meaning.

`GPS_Lat` is gps, lat; `ShaftRPM_port` is shaft, rpm, port. Units, sides, sensors and numbers are set aside; a name fits
by the share of its other parts that a phrase of the meaning explains.
"""

from __future__ import annotations

import re
import unicodedata
from functools import cache

from shipid.logs.amounts import UNIT_WORDS, is_known
from shipid.physics.signals import SIGNALS

PHRASES: dict[str, str] = {
    "latitude": (
        "lat, lati, plat, phi gps, latitude, breite, breitengrad, bredde, breddegrad, latitud, latitudine, "
        "geogr breite, breedtegraad, breedte, geogr bredde, ligne latitude, latitude gps"
    ),
    "longitude": (
        "lon, longi, plon, lambda gps, lambda, long, lng, longitude, laenge, laengengrad, lengde, lengdegrad, "
        "longitud, longitudine, geogr laenge, lengtegraad, geogr lengde, longitude gps"
    ),
    "north": (
        "x north, y north, "
        "n, north, northing, pos north, pos n, north pos, x 0, x n, x ned, x earth, eta 1, x e, nord, nordwert, "
        "hochwert, utm n, utm north, utm y, nord pos, norte, xn, ned x, ned n, ned north, delta north, dist north"
    ),
    "east": (
        "x east, y east, "
        "est, e, east, easting, pos east, pos e, east pos, y 0, y n, y ned, y earth, eta 2, y e, ost, ostwert, "
        "rechtswert, utm e, utm east, utm x, oest, oestlig, este, ye, ned y, ned e, ned east, delta east, dist "
        "east"
    ),
    "x": ("xpos, posx, x, pos x, x pos, odom x, x coordinate, enu x, local x"),
    "y": ("ypos, posy, y, pos y, y pos, odom y, y coordinate, enu y, local y"),
    "psi": (
        "magnet kompass, magnetic heading, magnetic compass, psi, heading, hdg, hdt, head, gyro, compass, "
        "kompass, kreisel kurs, kreisel, steuer kurs, vorauskurs, yaw, yaw angle, yaw pos, yaw 0, gier winkel, "
        "gir vinkel, kurs vinkel, baug retning, ship heading, gyro heading, compass heading, gyro hdg, kurs, "
        "course, eta 3, eta 6, theta z, rumbo, cap, styrt kurs, hehdt, bow angle, kurs winkel, rw kurs, rwk, "
        "kompass kurs, gyro kurs, cap vrai, cap compas, cap gyro, cap navire, cap magnetique, rumbo verdadero, "
        "rumbo aguja, proa, prua, prora, prua vera, prua bussola, koers, voorliggende koers, kompas koers, gyro "
        "koers, styret kurs, styrd kurs, kompas kurs, lacet, angle lacet, angulo guinada, guinada, imbardata, "
        "gier hoek, stevn"
    ),
    "speed": (
        "sog, speed, spd, speed over ground, ground speed, ship speed, u, v, fahrt, fahrt ueber grund, fahrt ue "
        "grund, fueg, fug, geschwindigkeit, fart, fart over grunn, vtg sog, vg, v g, velocity, groundspeed, vitesse, "
        "velocidad, uog, speed og, hastighet, gps speed, abs speed, total speed, vitesse fond, vitesse navire, "
        "vitesse sol, velocidad fondo, velocidad sobre fondo, velocidad buque, vel fondo, velocita, velocita fondo, "
        "velocita nave, snelheid, snelheid over grond, grond snelheid, vaart over grond, vog, fart over grund, fart "
        "over bunden, fog, schiffs geschwindigkeit, grund geschwindigkeit, skips fart"
    ),
    "course": (
        "cog, course, crs, track, course over ground, track angle, kurs ueber grund, kurs ue grund, kueg, kug, kurs, "
        "kurs over grunn, chi, vtg cog, course og, tmg, course made good, track made good, ground course, bahn winkel, "
        "route fond, route, route vraie, route sur fond, rumbo fondo, rumbo sobre fondo, rumbo efectivo, derrota, "
        "rotta, rotta vera, rotta fondo, grond koers, koers over grond, kog, kurs over grund, kurs over bunden, "
        "beholden kurs, kurs grund"
    ),
    "u": (
        "u, surge, surge vel, surge speed, v long, long speed, long vel, speed long, vel x, v x, nu 1, speed fwd, "
        "fwd speed, forward speed, speed forward, forward vel, ahead speed, speed ahead, laengs geschwindigkeit, "
        "v laengs, fahrt laengs, jag hastighet, fart langs, x dot, body u, u body, v fwd, vel long, long fart, "
        "speed x, v surge, vitesse long, vitesse avance, vitesse axiale, vitesse avant, vitesse cavalement, "
        "cavalement, velocidad long, velocidad avance, velocita long, velocita avanzo, langs snelheid, "
        "langsscheepse snelheid, langs hastighet, langskips hastighet, langskips fart, laengs hastighet, u vel, "
        "vel u, linear x"
    ),
    "v": (
        "v, sway, sway vel, sway speed, v trans, trans speed, lat speed, lateral speed, speed trans, speed lat, "
        "vel y, v y, nu 2, speed stbd, speed starboard, transverse speed, quer geschwindigkeit, v quer, fahrt "
        "quer, svai hastighet, fart tvers, y dot, body v, v body, v lat, vel lat, v stbd, athwart speed, lateral "
        "vel, trans vel, tvers fart, drift speed, speed y, v sway, vitesse trans, vitesse embardee, vitesse "
        "laterale, velocidad trans, velocidad deriva, velocita trans, velocita deriva, velocita scarroccio, dwars "
        "snelheid, dwarsscheepse snelheid, tverr hastighet, tverrskips hastighet, tverrskips fart, tvaers "
        "hastighet, tvers hastighet, tverr fart, v vel, vel v, "
        "linear y"
    ),
    "velocity_north": (
        "vn, v n, v north, vel north, vel n, north vel, north speed, speed north, geschwindigkeit nord, v nord, "
        "hastighet nord, x dot, ned vel n, vel x, v x, speed n, enu vel y, nord fart, vitesse nord, velocidad "
        "norte, velocita nord, snelheid noord"
    ),
    "velocity_east": (
        "ve, v e, v east, vel east, vel e, east vel, east speed, speed east, geschwindigkeit ost, v ost, "
        "hastighet oest, v oest, y dot, ned vel e, vel y, v y, speed e, enu vel x, oest fart, vitesse est, "
        "velocidad este, velocita est, snelheid oost"
    ),
    "r": (
        "rotasjons hastighet, rotasjons fart, r, rot, turn, yaw rate, rate of turn, turn rate, rate turn, gyro z, gyro "
        "rate, w z, omega z, psi dot, nu 6, nu 3, yaw vel, yaw speed, dreh rate, dreh geschwindigkeit, gier "
        "geschwindigkeit, gier rate, giring hastighet, sving rate, gir rate, girrate, ang vel z, angular velocity "
        "z, heading rate, hdg rate, wende geschwindigkeit, d psi, gir hastighet, taux giration, vitesse giration, "
        "vitesse lacet, taux lacet, giration, velocidad giro, velocidad guinada, razon giro, regimen giro, "
        "velocita accostata, velocita imbardata, velocita virata, rateo accostata, rateo virata, draai snelheid, "
        "gier snelheid, sving hastighet, dreie hastighet, dreie rate, svinge rate, drei hastighet, girings "
        "hastighet, dreje hastighed, dreje rate, wende rate, wende zeiger, gyro rate z, yaw dot, "
        "angular z"
    ),
    "phi": (
        "phi, roll, roll angle, heel, heel angle, roll winkel, kraengung, rull, krengning, eta 4, gite, angle "
        "gite, roulis, angle roulis, escora, angulo escora, balance, sbandamento, angolo sbandamento, rollio, "
        "slagzij, helling, helling hoek, rol hoek, slingering, krenge vinkel, krengnings vinkel, slag side, rull "
        "vinkel, krangning, krangnings vinkel, kraengungs winkel, kraengung winkel, schlagseite, quer neigung"
    ),
    "theta": (
        "theta, pitch, pitch angle, trim, trim angle, stampf winkel, trimm, stamp, eta 5, tangage, angle tangage, "
        "assiette, cabeceo, beccheggio, assetto, angolo beccheggio, stamp hoek, stamp vinkel, trim winkel, nick "
        "winkel, laengs neigung"
    ),
    "p": ("p, roll rate, nu 4, gyro x, omega x"),
    "q": ("q, pitch rate, nu 5, gyro y, omega y"),
    "V_w": (
        "wind, wind speed, wind spd, wind vel, tws, true wind speed, v w, v wind, wind geschwindigkeit, vind "
        "hastighet, vind fart, wind force, aws, rel wind speed, app wind speed, apparent wind speed, relative "
        "wind speed, vent, vitesse vent, viento, velocidad viento, vento, velocita vento, wind snelheid, wind "
        "kracht, vind, vind styrke, vind hastighed, wind staerke"
    ),
    "beta_w": (
        "wind direction, wind dir, wind angle, twd, twa, true wind direction, beta w, gamma w, wind richtung, "
        "vind retning, wind from, awa, rel wind angle, app wind angle, apparent wind angle, relative wind angle, "
        "rel wind dir, relative wind direction, wind winkel, direction vent, dir vent, angle vent, direccion "
        "viento, dir viento, angulo viento, direzione vento, dir vento, angolo vento, wind richting, wind hoek, "
        "vind riktning, vind vinkel"
    ),
    "delta": (
        "delta, rudder, rudder angle, rudder position, rudder pos, rsa, rud, rud ang, rud angle, helm, helm "
        "angle, ruder, ruder winkel, ruder lage, ror, ror vinkel, delta r, dr, d r, rudder ang, timon, flap "
        "angle, steering angle, barre, angle barre, position barre, gouvernail, angle gouvernail, safran, angle "
        "safran, angulo timon, pala, angulo pala, timone, angolo timone, barra, angolo barra, roer, roer hoek, "
        "roer stand, ror utslag, ror stilling, roder, roder vinkel, ruder ausschlag, ruder stellung, ruder stand, "
        "steering gear angle"
    ),
    "alpha": (
        "alpha, azimuth, azi, azimuth angle, azi angle, azi ang, azipod, azipod angle, pod angle, pod, thruster "
        "angle, thruster azimuth, azimut, azimut winkel, gondel winkel, schottel winkel, asimut, asimut vinkel, "
        "alpha t, nozzle angle, thrust angle, thruster direction, pod azimuth, azimuth vinkel, azi dir, angle "
        "azimut, angle propulseur, angulo azimut, angolo azimut, ruderpropeller winkel, azimut hoek, azimuth "
        "hoek, azimuth winkel, pod winkel, srp, srp angle, srp winkel, outboard, outboard angle, outboard steering "
        "angle, drive angle, stern drive angle, sterndrive angle, jet angle, waterjet angle, asd, asd angle, z "
        "drive, z drive angle, zdrive angle"
    ),
    "n": (
        "n, rpm, shaft, shaft rpm, shaft speed, prop rpm, propeller rpm, propeller speed, prop speed, engine rpm, "
        "me rpm, main engine rpm, engine speed, main engine speed, revs, rev, prop revs, propeller revs, dreh "
        "zahl, propeller dreh zahl, wellen dreh zahl, motor dreh zahl, tur tall, propell tur tall, aksel tur "
        "tall, rps, n p, n prop, thruster rpm, thruster speed, thruster dreh zahl, thruster tur tall, thruster "
        "toeren tal, thruster giri, thruster regime, thruster vitesse, thruster revs, thruster n, pod rpm, "
        "revolutions, shaft revolutions, n shaft, motor speed, motor rpm, n engine, propeller, prop, engine, azi "
        "rpm, azimuth rpm, umdrehungen, revoluciones, turns, vitesse arbre, vitesse helice, vitesse rotation, "
        "vitesse rotation helice, regime, regime arbre, regime helice, regime moteur, tours helice, tours arbre, "
        "tours minute, tours, helice, arbre helice, rpm eje, rpm helice, velocidad eje, velocidad helice, "
        "revoluciones eje, revoluciones helice, revoluciones motor, vueltas, giri, giri elica, giri asse, giri "
        "motore, velocita asse, velocita elica, elica, toeren tal, toeren, schroef toeren tal, as toeren tal, "
        "schroef toeren, schroef, propell omdreininger, omdreininger, omdreinings tall, motor tur tall, "
        "omdrejninger, omdrejnings tal, propel omdrejninger, varv tal, propeller varv tal, axel varv tal, "
        "erpm, motor erpm, esc erpm, shaft erpm, thruster erpm, e rpm, electrical rpm, electric rpm, elec rpm, "
        "schrauben dreh zahl, schrauben welle, welle, wellen rpm, propell rpm, aksel rpm, shaft revs, shaft rev"
    ),
    "pitch": (
        "cpp, cpp pitch, prop pitch, propeller pitch, pitch ratio, p d, pas helice, propeller steigung, steigung, "
        "propell stigning, stigning, schroef spoed, spoed, paso helice, passo elica"
    ),
    "thrust": (
        "thrust, t n, t prop, propeller thrust, prop thrust, shaft thrust, thrust p, schub, propeller "
        "schub, wellen schub, schub kraft, skyvekraft, skyve kraft, poussee, poussee helice, empuje, empuje "
        "helice, spinta, spinta elica, stuw kracht, thrust force"
    ),
    "torque": (
        "torque, q, q prop, shaft torque, propeller torque, prop torque, dreh moment, drehmoment, wellen "
        "drehmoment, wellen moment, dreiemoment, dreie moment, akselmoment, vrid moment, couple, couple arbre, "
        "couple helice, par motor, par eje, par helice, coppia, koppel, moment shaft"
    ),
    "normal_force": (
        "rudder force, rudder normal force, normal force, f n, fn, ruder normalkraft, ruder kraft, rorkraft"
    ),
}
"""Meaning -> phrases, parts of a name separated by blanks, without accents. The names of `SIGNALS` count, too."""
OTHERS = (
    "stamp secs, stamp nsec, stamp nsecs, stamp nanosec, "
    "battery voltage, sat, ukc, under keel clearance, wave probe, wave gauge, vitesse surface, vitesse eau, "
    "vitesse loch, loch, velocidad corredera, corredera, velocidad superficie, velocita acqua, solcometro, log "
    "snelheid, snelheid door water, vaart door water, fart gennem vand, fart genom vatten, fart gjennom vannet, "
    "logg fart, logg, fahrt durch wasser, log geschwindigkeit, water speed, momento, puissance, potencia, "
    "potenza, vermogen, wellen leistung, motor leistung, engine load, kw, verbrauch, kraftstoff, consommation, "
    "carburant, consumo, combustible, carburante, brandstof, drivstoff, forbruk, fuel rack, rack, profondeur, "
    "profundidad, sonda, profondita, diepte, vann dybde, djup, tiefe, echolot, ekkolodd, sounder, tirant eau, "
    "tirant, calado, pescaggio, immersione, diep gang, temperatura, temperatuur, temperature eau, bow thruster, "
    "stern thruster, elica prua, helice proa, bow thruster power, pilonnement, arfada, sussulto, tauch bewegung, "
    "rudder pump, rudder pumps, steering pump, steering gear pump, ruder pumpe, pompe barre, bomba timon, roer "
    "pomp, ror pumpe, rudder motor, rudder limit, rudder torque, ruder moment, pump, pumpe, pompe, drift angle, "
    "drift winkel, derive, marker, mark, event, sample, cpu load, cpu, disk, battery, batterie, bateria, "
    "lufttrykk, luft druck, pression, sea state, autopilot, stw, log speed, speed log, doppler log, speed through "
    "water, v log, vbw, log spd, fahrt durchs wasser, fdw, fart gjennom vann, power, shaft power, leistung, "
    "effekt, moment, fuel, fuel rate, fuel flow, depth, water depth, wasser tiefe, dybde, draft, draught, draft "
    "fwd, draft aft, draught aft, draught fwd, tiefgang, tauchung, temp, temperature, air temp, temperatur, water "
    "temp, hdop, pdop, vdop, num sat, nsat, sats, satellites, heave, hiv, acc, acc x, acc y, acc z, acceleration, "
    "a x, a y, a z, pressure, humidity, voltage, current, set, drift, load, wave, wave height, height, altitude, "
    "alt, age, quality, status, mode, alarm, xte, cross track error, dist, distance, waypoint, index, row, count, "
    "id, no, nr, tunnel thruster, roll acc, pitch acc, x force, y force, variation, deviation, magnetic "
    "variation, geoid, force, mass, current speed, current direction, z, depth m, engine torque, ae rpm, aux "
    "engine rpm, auxiliary engine rpm, generator rpm"
)
"""Phrases of columns that no dataset takes."""
ORDERS = frozenset(
    (
        "befehl c cmd command commanded d demand des desired goal oensket onsket ord order ordered ordre ref "
        "reference req request set setpoint setpunkt setting soll sp target want wanted vorgabe sollwert consigne "
        "commande ordonne ordonnee demande demandee orden ordenado ordenada consigna mando comandado comando "
        "comandato comandata ordine ordinato ordinata setpunt gewenst gewenste bevel satt bestilt kommando kommandert "
        "kommanderet beordret oenskad boervaerde stellbefehl"
    ).split()
)
"""Parts that say what is ordered, not what is."""
WIND_WORDS = {
    "true": "true tws twd vrai vero verdadero real reale ware wahr wahrer sann",
    "apparent": "aws awa app apparent rel relative relatif relativo apparente aparente scheinbar scheinbarer "
    "schijnbare relativ",
}
"""Parts that say which wind a column has. `twa` does not: it is the true wind, from the bow."""
SOURCES = frozenset(
    (
        "attitude field header msg orientation pose quat quaternion twist "
        "act actual answer apparent ahrs angle avg data deg dgnss dgps est estimated fb feedback filt filtered gga "
        "gnss gpgga gprmc gps ground imu ins ist m mean meas measured measurement mru nav navigation odom of own pos "
        "posicion posisjon position raw rel response rtk sensor ship signal sim standort t the true val value vessel "
        "vtg wert gemessen istwert rueckmeldung rechtweisend reel reelle mesure mesuree effectif retour vrai vraie "
        "medido medida real efectivo misurato misurata effettivo reale vero vera verdadero gemeten werkelijk ware "
        "maalt virkelig faktisk tilbakemelding sann aervaerde wahr wahrer relatif relativo relativa relativer "
        "apparente aparente scheinbar scheinbarer schijnbare relativ de du des le la les el del della di van der den "
        "het al sul sur"
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
SIDE_WORDS = {
    "port": "port|ps|bb|bab|br|babord|backbord|p|prt|portside|left|babor|bakboord|bagbord|sinistra|sx|links|gauche|bd",
    "starboard": "starboard|stbd|sb|tri|er|stb|styrbord|steuerbord|s|strbd|right|star|tribord|trib|td|tb|"
    "estribor|dritta|dx|stuurboord|rechts|droite",
    "stern": "stern",
    "bow": "bow",
    "fore": "fore|fwd",
    "aft": "aft",
    "main": "main",
}
MAGNETIC = frozenset(
    "mag magnet magnetic magnetisch magnetique magnetico magnetisk compass compas kompass aguja bussola".split()
)
"""Parts that say that a heading is that of a magnetic compass."""
NOT_MAGNETIC = frozenset("gyro kreisel sat satellite gps gnss rtk fog".split())
"""Parts that say that a compass is another one."""
RUN_WORDS = frozenset(
    (
        "run runs test trial trials versuch lauf messfahrt messlauf essai essais passe prueba ensayo corrida prova "
        "corsa proef proefvaart forsoek forsok kjoering koersel koring manoeuvre maneuver manoever manoevre "
        "maniobra manovra manoeuver experiment exp case rec recording sequence leg"
    ).split()
)
"""Parts that say that a column holds the run."""
RUN_NUMBERS = frozenset(
    "no nr num number nummer numero numer id name navn naam nom nombre nome code index label".split()
)
_LETTERS = {"ψ": "psi", "δ": "delta", "φ": "phi", "ϕ": "phi", "θ": "theta", "χ": "chi", "α": "alpha", "ω": "omega"}
_LETTERS |= {"β": "beta", "ä": "ae", "ö": "oe", "ü": "ue", "ø": "oe", "å": "aa", "æ": "ae", "ß": "ss", "Ψ": "psi"}
_LETTERS |= {"Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "Ø": "Oe", "Å": "Aa", "λ": "lambda", "°": " deg "}
SYNONYMS = {"velocity": "vel", "position": "pos", "pos": "pos", "longitudinal": "long", "transversal": "trans"}
SYNONYMS |= {"longitudinale": "long", "transversale": "trans", "propulseur": "thruster"}
SYNONYMS |= {
    "etrave": "bow",
    "transv": "trans",
    "longit": "long",
    "thr": "thruster",
    "thrusters": "thruster",
    "strahler": "thruster",
    "propulsor": "thruster",
}
SYNONYMS |= {"geschw": "geschwindigkeit"}
SYNONYMS |= {"rps": "rpm"}  # the unit is read from the name itself
SYNONYMS |= {"transverse": "trans", "lateral": "lat", "forward": "fwd", "velocities": "vel", "degrees": "deg"}
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
LEAST = 0.45  # share of a name that a phrase explains, before the name counts as fitting


@cache
def _plain_name(name: str) -> str:
    """A name with the signs of others, and a unit that is spelt out in brackets: `prop_rev_per_s` is `prop [rev/s]`."""

    def in_brackets(found: re.Match[str]) -> str:
        unit = f"{found[1]}/{found[2]}" if found[1] else "N"
        return f" [{unit}] " if is_known(unit) else found[0]

    return _SPELT.sub(in_brackets, name.translate(WIDE))


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
    return tuple(SYNONYMS.get(part, part) for word in words for part in _split_word(word))


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
    kinds = [kind for kind, words in WIND_WORDS.items() if parts & set(words.split())]
    return kinds[0] if len(kinds) == 1 else ""


@cache
def _known_words() -> frozenset[str]:
    phrases = [*PHRASES.values(), OTHERS]
    words = {word for phrase in phrases for word in phrase.replace(",", " ").split()}
    return frozenset(word for word in words | ORDERS | SOURCES | RUN_WORDS | set(SYNONYMS) if len(word) > 2)


@cache
def _split_word(word: str) -> tuple[str, ...]:
    """Cut a word that is no known one into known words, such as `ruderwinkel`; return it whole where it cannot be."""
    known = _known_words()
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


@cache
def _meaning_phrases() -> dict[str, tuple[tuple[str, ...], ...]]:
    def cut(text: str) -> tuple[tuple[str, ...], ...]:
        return tuple(tuple(SYNONYMS.get(word, word) for word in phrase.split()) for phrase in text.split(","))

    return {meaning: cut(text) for meaning, text in PHRASES.items()} | {"": cut(OTHERS)}


def is_electrical(name: str) -> bool:
    """Whether a name says the electrical speed of a motor: that of its shaft times its pairs of poles."""
    parts = name_parts(name)
    joined = "_".join(parts)
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
    words = {word for unit in units_in_name(name) for word in re.split(r"[^a-z]+", unit.lower())} | {*name_parts(name)}
    if words & NOT_MAGNETIC:
        return False
    return bool(words & MAGNETIC or re.search(r"(deg|°) ?\(?M\b", name))


def side_in_name(name: str) -> str | None:
    """The side or place in a name, such as `port`; None if there is none."""
    bare = re.sub(r"[\[(][^\])]*[\])]?", " ", _AFTER.sub("", _plain_name(name)))  # 1/s is no starboard
    parts = set(name_parts(name)) | set(re.split(r"[^a-z]+", bare.lower()))
    for side, words in SIDE_WORDS.items():
        if len(parts - {""}) > 1 and set(words.split("|")) & parts:
            return side
    return None


@cache
def words_of_side(side: str) -> frozenset[str]:
    """The words that say a side, such as `port`."""
    return frozenset(SIDE_WORDS[side].split("|"))


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
    """How well a name fits each meaning, 0 to 1: `{"psi": 1.0}`; the empty meaning is a column of no use."""
    parts = list(name_parts(name))
    order = is_order(name)
    aside = (
        {word for words in SIDE_WORDS.values() for word in words.split("|")} | SOURCES | (ORDERS if order else set())
    )
    while len(parts) > 1 and parts[-1] in UNIT_PARTS:
        parts.pop()
    content = [part for part in parts if part not in aside and not part.isdigit()]
    meanings: dict[str, float] = {}
    for meaning, phrases in _meaning_phrases().items():
        best = max((_phrase_share(phrase, parts, content, aside) for phrase in phrases), default=0.0)
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


def _phrase_share(phrase: tuple[str, ...], parts: list[str], content: list[str], aside: set[str]) -> float:
    """The share of the letters of a name that a phrase explains; 0 if the name lacks a word of it."""
    if not set(phrase) <= set(parts):
        return 0.0
    left = [part for part in content if part not in phrase]
    letters = sum(len(word) for word in phrase)
    extra = sum(len(part) for part in left)
    known_aside = 0.02 * sum(part in aside and part not in phrase for part in parts)
    return letters / (letters + extra) - known_aside
