"""FMUs of vessels and predictors: what a tool that imports them sees."""

from __future__ import annotations

import ctypes
import logging
import os
import platform
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shipid.data.windows import Instants
from shipid.engine.casadi import memory_along
from shipid.engine.rollout import rollout
from shipid.errors import ShipidError
from shipid.export.c import c_name
from shipid.export.fmu import model_description, predictor_unit, vessel_unit, write_fmu
from shipid.export.model import build_model
from shipid.export.write import export_vessel
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.physics import Physics
from shipid.predictor import Predictor
from shipid.vessel.load import check_document, load_vessel
from tests.conftest import variety
from tests.export.compiled import SANITIZERS, compile_, compiler
from tests.export.strange import drawn

SECONDS = 60.0


@pytest.fixture(scope="module")
def ship(tmp_path_factory):
    compiler()
    file = tmp_path_factory.mktemp("fmu") / "ship.fmu"
    assert write_fmu(vessel_unit(variety()["actuators"], "ship", "rk4"), file)
    return file


@pytest.fixture(scope="module")
def predictor():
    physics = Physics(load_vessel("mariner"), 6, 5.0, "rk4")
    return Predictor(physics, "alone", UnchangedPath({}), {"u": (0.0, 8.0)}, {}, "known")


@pytest.fixture(scope="module")
def aboard(predictor, tmp_path_factory):
    compiler()
    file = tmp_path_factory.mktemp("fmu") / "path.fmu"
    assert write_fmu(predictor_unit(build_model(predictor), "path"), file)
    return file


def test_the_description_names_every_variable(ship):
    with zipfile.ZipFile(ship) as archive:
        assert {"modelDescription.xml", "sources/ship.c", "sources/ship.h"} <= set(archive.namelist())
        root = ET.fromstring(archive.read("modelDescription.xml"))
        source = archive.read("sources/ship.c").decode()
    vessel = variety()["actuators"]
    variables = {entry.get("name"): entry for entry in root.iter("ScalarVariable")}
    assert {"port.n", "V_w", "load.X", "psi", "actual.port.alpha", "solver.step", "status"} <= set(variables)
    mass = variables["inertia.m"]
    assert mass.get("causality") == "parameter"
    assert float(mass.find("Real").get("start")) == vessel.parameters["inertia.m"]
    assert mass.find("Real").get("unit") == "kg"
    assert all(entry.get("description") for entry in variables.values())
    assert root.get("guid") in source


def test_any_name_of_a_ship_is_one_of_xml():
    """Before, no tool could read an FMU of a ship whose name has a control character."""
    vessel = load_vessel("mariner")
    odd = check_document({**vessel.document, "name": 'a\x07b\n<"ø🚢&'}, "odd.toml")
    root = ET.fromstring(model_description(vessel_unit(odd, "ship", "rk4"), "{1}").encode())
    assert root.get("modelName") == 'a\ufffdb\n<"ø🚢&'


def test_what_is_calculated_at_the_start_is_not_said_to_be_known(ship, aboard):
    """Before, a tool that sets every start value, as FMI allows, began with other actuators than one that does not."""
    for file, wanted in ((ship, {"actual.port.n": "approx", "u": "exact", "status": "exact"}),
                         (aboard, {"x[1]": "calculated", "status": "calculated", "alarm": "calculated"})):  # fmt: skip
        with zipfile.ZipFile(file) as archive:
            root = ET.fromstring(archive.read("modelDescription.xml"))
        every = list(root.iter("ScalarVariable"))
        initial = {entry.get("name"): entry.get("initial") for entry in every}
        assert {name: initial[name] for name in wanted} == wanted
        unknown = [every[int(one.get("index")) - 1] for one in root.find("ModelStructure/InitialUnknowns")]
        outputs = [entry for entry in every if entry.get("causality") == "output"]
        assert unknown == [entry for entry in outputs if entry.get("initial") != "exact"]
        for entry in every:
            assert ("start" in entry[0].attrib) == (entry.get("initial") != "calculated")


CALLS_OUT_OF_ORDER = """
#include "ship.c"
#define NO(call) if ((call) != fmi2Error) return __LINE__
#define YES(call) if ((call) != fmi2OK) return __LINE__
int main(void)
{
    const fmi2ValueReference last = NUM_REALS - 1;
    const double step = 0.2;
    fmi2CallbackFunctions call = {0, 0, 0, 0, 0};
    fmi2Component c = fmi2Instantiate("a", fmi2CoSimulation, guid, "", &call, 0, 0);
    fmi2FMUstate state = 0;
    if (!c) return __LINE__;
    NO(fmi2DoStep(c, 0, 0.1, 0));
    NO(fmi2ExitInitializationMode(c));
    NO(fmi2Terminate(c));
    YES(fmi2SetupExperiment(c, 0, 0, 3, 0, 0));
    YES(fmi2EnterInitializationMode(c));
    NO(fmi2SetupExperiment(c, 0, 0, 4, 0, 0));
    NO(fmi2EnterInitializationMode(c));
    NO(fmi2Terminate(c));
    YES(fmi2ExitInitializationMode(c));
    NO(fmi2SetupExperiment(c, 0, 0, 4, 0, 0));
    YES(fmi2SetReal(c, &last, 1, &step));
    YES(fmi2DoStep(c, 3, 0.1, 0));
    YES(fmi2GetFMUstate(c, &state));
    YES(fmi2DoStep(c, 3.1, 0.1, 0));
    YES(fmi2SetFMUstate(c, state));
    YES(fmi2DoStep(c, 3.1, 0.1, 0));
    YES(fmi2FreeFMUstate(c, &state));
    YES(fmi2Terminate(c));
    NO(fmi2SetReal(c, &last, 1, &step));
    NO(fmi2Terminate(c));
    YES(fmi2Reset(c));
    YES(fmi2EnterInitializationMode(c));
    fmi2FreeInstance(c);
    return 0;
}
"""


@cache
def sanitized(unit):
    """Folder of the sources of an FMU, the ones by CasADi compiled with sanitizers."""
    folder = unit.with_suffix("")
    with zipfile.ZipFile(unit) as archive:
        archive.extractall(folder)
    equations = ("-shared", "-fPIC", "-o", "equations.so", f"{unit.stem}_casadi.c")
    compile_([compiler()], folder / "sources", *SANITIZERS, *equations)
    return folder / "sources"


def run_c(unit, source):
    """Compile a main program with the sources of an FMU, with sanitizers; it returns the line that fails, else 0."""
    folder = sanitized(unit)
    (folder / "main.c").write_text(source)
    compile_([compiler()], folder, *SANITIZERS, "-o", "main", "main.c", f"{unit.stem}_casadi.o")
    result = subprocess.run([folder / "main"], capture_output=True, text=True)
    assert (result.returncode, result.stderr[:1000]) == (0, "")


def test_calls_out_of_order_are_refused(ship):
    run_c(ship, CALLS_OUT_OF_ORDER)


ABOVE_ZERO = """
#include "ship.c"
static char said[300];
static void hear(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category,
    fmi2String format, ...)
{
    va_list arguments;
    (void)e, (void)name, (void)status, (void)category;
    va_start(arguments, format);
    vsnprintf(said, sizeof said, format, arguments);
    va_end(arguments);
}
int main(void)
{
    static const char *const names[] = {@NAMES@};
    static const fmi2ValueReference places[] = {@PLACES@};
    const double wrong[] = {0, -1}, right = 1;
    fmi2CallbackFunctions call = {hear, 0, 0, 0, 0};
    fmi2Component c = fmi2Instantiate("a", fmi2CoSimulation, guid, "", &call, 0, 0);
    size_t i, k;
    if (!c) return __LINE__;
    for (i = 0; i < sizeof places / sizeof *places; ++i) {
        for (k = 0; k < 2; ++k) {
            said[0] = 0;
            if (fmi2SetReal(c, &places[i], 1, &wrong[k]) != fmi2Discard) return __LINE__;
            if (!strstr(said, names[i]) || !strstr(said, "must be above 0")) return __LINE__;
        }
        if (fmi2SetReal(c, &places[i], 1, &right) != fmi2OK) return __LINE__;
    }
    fmi2FreeInstance(c);
    return 0;
}
"""


def test_a_number_that_must_be_above_zero_is_refused_by_name_and_has_a_min(ship):
    """What Python refuses: before, a mass of 0 or less gave a motion, and every step was fine."""
    with zipfile.ZipFile(ship) as archive:
        root = ET.fromstring(archive.read("modelDescription.xml"))
    entries = {one.get("name"): one for one in root.iter("ScalarVariable") if one.find("Real") is not None}
    least = {name: one.find("Real").get("min") for name, one in entries.items()}
    limited = [name for name, value in least.items() if value is not None]
    assert {"inertia.m", "inertia.I_z", "constants.rho"} <= set(limited)
    assert all(float(least[name]) > 0 for name in limited)
    for name in limited:
        with pytest.raises(ShipidError, match="above 0"):
            variety()["actuators"].with_values({name: 0.0})
    names, places = '"' + '", "'.join(limited) + '"', ", ".join(entries[n].get("valueReference") for n in limited)
    run_c(ship, ABOVE_ZERO.replace("@NAMES@", names).replace("@PLACES@", places))


BEYOND_THE_STOP = """
#include "ship.c"
#define NO(call) if ((call) != fmi2Error) return __LINE__
#define YES(call) if ((call) != fmi2OK) return __LINE__
int main(void)
{
    fmi2CallbackFunctions call = {0, 0, 0, 0, 0};
    fmi2Component c = fmi2Instantiate("a", fmi2CoSimulation, guid, "", &call, 0, 0);
    int k;
    if (!c) return __LINE__;
    NO(fmi2SetupExperiment(c, 0, 0, 3, 1, 2));
    NO(fmi2SetupExperiment(c, 0, 0, 3, 1, NAN));
    YES(fmi2SetupExperiment(c, 0, 0, 3, 1, 4));
    YES(fmi2EnterInitializationMode(c));
    YES(fmi2ExitInitializationMode(c));
    for (k = 0; k < 10; ++k) YES(fmi2DoStep(c, 3 + 0.1 * k, 0.1, 0)); /* to 4, but for rounding */
    NO(fmi2DoStep(c, 4, 0.1, 0));
    NO(fmi2DoStep(c, 3.9, 0.2, 0));
    YES(fmi2Reset(c));
    YES(fmi2EnterInitializationMode(c));
    YES(fmi2ExitInitializationMode(c));
    YES(fmi2DoStep(c, 4, 0.1, 0)); /* no stop was set */
    fmi2FreeInstance(c);
    return 0;
}
"""


def test_no_step_goes_beyond_the_stop_time(ship):
    """As FMI 2.0 asks; before, the stop time was not looked at."""
    run_c(ship, BEYOND_THE_STOP)


WITHOUT_A_COMPONENT = """
#include "path.c"
#define NO(call) if ((call) == fmi2OK) return __LINE__
#define YES(call) if ((call) != fmi2OK) return __LINE__
int main(void)
{
    const fmi2ValueReference first = 0;
    const fmi2Integer order = 1;
    fmi2Real number = 0;
    fmi2Integer whole = 0;
    fmi2Boolean truth = 0;
    fmi2String text = "";
    fmi2Status status;
    size_t size = 0;
    fmi2CallbackFunctions call = {0, 0, 0, 0, 0};
    fmi2Component c = fmi2Instantiate("a", fmi2CoSimulation, guid, "", &call, 0, 0);
    fmi2FMUstate state = 0, other = 0;
    fmi2Byte bytes[8] = {0};
    if (!c) return __LINE__;
    YES(fmi2GetFMUstate(c, &state));
    fmi2FreeInstance(0);
    NO(fmi2SetDebugLogging(0, 1, 0, 0));
    NO(fmi2SetupExperiment(0, 0, 0, 0, 0, 0));
    NO(fmi2EnterInitializationMode(0));
    NO(fmi2ExitInitializationMode(0));
    NO(fmi2Terminate(0));
    NO(fmi2Reset(0));
    NO(fmi2GetReal(0, &first, 1, &number));
    NO(fmi2SetReal(0, &first, 1, &number));
    NO(fmi2GetInteger(0, &first, 1, &whole));
    NO(fmi2SetInteger(0, &first, 1, &whole));
    NO(fmi2GetBoolean(0, &first, 1, &truth));
    NO(fmi2SetBoolean(0, &first, 1, &truth));
    NO(fmi2GetString(0, &first, 1, &text));
    NO(fmi2SetString(0, &first, 1, &text));
    NO(fmi2GetFMUstate(0, &other));
    NO(fmi2SetFMUstate(0, state));
    NO(fmi2FreeFMUstate(0, &state));
    NO(fmi2SerializeFMUstate(0, state, bytes, sizeof bytes));
    NO(fmi2DeSerializeFMUstate(0, bytes, sizeof bytes, &other));
    NO(fmi2GetDirectionalDerivative(0, &first, 1, &first, 1, &number, &number));
    NO(fmi2SetRealInputDerivatives(0, &first, 1, &order, &number));
    NO(fmi2GetRealOutputDerivatives(0, &first, 1, &order, &number));
    NO(fmi2DoStep(0, 0, 1, 0));
    NO(fmi2CancelStep(0));
    NO(fmi2GetStatus(0, fmi2DoStepStatus, &status));
    NO(fmi2GetRealStatus(0, fmi2LastSuccessfulTime, &number));
    NO(fmi2GetIntegerStatus(0, fmi2DoStepStatus, &whole));
    NO(fmi2GetBooleanStatus(0, fmi2Terminated, &truth));
    NO(fmi2GetStringStatus(0, fmi2PendingStatus, &text));
    NO(fmi2SetFMUstate(c, 0));
    NO(fmi2SerializedFMUstateSize(c, state, &size));
    YES(fmi2FreeFMUstate(c, &state));
    fmi2FreeInstance(c);
    return 0;
}
"""


REFUSED_ROW = """
#include "path.c"
int main(void)
{
    const fmi2ValueReference first = 0, u = 3, instant = NUM_REALS_BEFORE;
    const double fast = 9; /* limits: 0 to 8 m/s */
    double at = 0;
    fmi2Integer status = 0;
    fmi2Boolean alarm = 0, ended = 1;
    fmi2CallbackFunctions call = {0, 0, 0, 0, 0};
    fmi2Component c = fmi2Instantiate("a", fmi2CoSimulation, guid, "", &call, 0, 0);
    if (!c || fmi2EnterInitializationMode(c) || fmi2SetReal(c, &u, 1, &fast) || fmi2ExitInitializationMode(c)) return 1;
    if (fmi2DoStep(c, 5, 1, 0) || fmi2GetBooleanStatus(c, fmi2Terminated, &ended) || ended) return 2;
    if (fmi2DoStep(c, 4, 1, 0) != fmi2Discard || fmi2GetBooleanStatus(c, fmi2Terminated, &ended) || !ended) return 2;
    if (fmi2GetReal(c, &instant, 1, &at) || fmi2GetInteger(c, &first, 1, &status)) return 3;
    if (fmi2GetBoolean(c, &first, 1, &alarm)) return 4;
    if (fmi2DoStep(c, 6, 1, 0) || fmi2GetBooleanStatus(c, fmi2Terminated, &ended) || ended) return 6;
    fmi2FreeInstance(c);
    return at > 4.9 && alarm && status == path_OUTSIDE ? 0 : 5;
}
"""


def test_a_row_that_is_refused_leaves_the_alarm_of_the_path_that_is_there(predictor, aboard):
    """Before, the alarm of a path outside of the training was gone after a row whose time did not go on."""
    places = {
        variable.name: place for place, variable in enumerate(predictor_unit(build_model(predictor), "path").variables)
    }
    assert places["u"] == 3
    run_c(aboard, REFUSED_ROW.replace("NUM_REALS_BEFORE", str(places["instant"])))


def test_no_component_and_no_state_are_refused(aboard):
    run_c(aboard, WITHOUT_A_COMPONENT)


@pytest.mark.parametrize("program", ["g++", "clang++"])
def test_a_compiler_of_cplusplus_takes_the_sources(program, ship, aboard, tmp_path):
    """Before, g++ refused a member with the name of a variable, and no tool would have found a function by its name."""
    if shutil.which(program) is None:
        pytest.skip(f"no {program}")
    for unit in (ship, aboard):
        with zipfile.ZipFile(unit) as archive:
            archive.extractall(tmp_path)
        command = [
            program,
            "-x",
            "c++",
            "-Wall",
            "-Wextra",
            "-Wpedantic",
            "-Werror",
            "-shared",
            "-fPIC",
        ]
        command += [f"{unit.stem}.c", f"{unit.stem}_casadi.c", "-o", "unit.so"]
        result = subprocess.run(command, cwd=tmp_path / "sources", capture_output=True, text=True)
        assert result.returncode == 0, result.stderr[:1000]
        version = ctypes.CDLL(str(tmp_path / "sources" / "unit.so")).fmi2GetVersion
        version.restype = ctypes.c_char_p
        assert version() == b"2.0"


def test_a_name_that_is_a_word_of_c_compiles(predictor, tmp_path):
    compiler()
    assert write_fmu(predictor_unit(build_model(predictor), c_name("double")), tmp_path / "a.fmu")


@pytest.mark.parametrize("system", ["Linux", "Windows"])
def test_an_fmu_without_a_binary_is_said_to_be_one(system, tmp_path, monkeypatch, caplog):
    """Before, nobody knew until a tool that does not compile refused it."""
    compiler()
    monkeypatch.setattr(platform, "system", lambda: system)
    monkeypatch.setattr(platform, "machine", lambda: "x86_64")
    with caplog.at_level(logging.WARNING):
        export_vessel(load_vessel("otter"), "fmu", tmp_path / "ship.fmu")
    said = "ship.fmu has no binary for Windows x86_64: the tool that imports it must compile its sources"
    assert [record.getMessage().rpartition("/")[2] for record in caplog.records] == [said] * (system == "Windows")


@pytest.mark.slow
def test_a_compiler_that_fails_is_one_line_and_leaves_no_file(tmp_path, monkeypatch):
    tool, noted = tmp_path / "gcc", tmp_path / "noted"
    tool.write_text(f"#!/bin/sh\ntouch $TMPDIR/left.s; printf %s $TMPDIR > {noted}; printf 'no \\377' >&2; exit 1\n")
    tool.chmod(0o700)
    monkeypatch.setattr("shipid.export.fmu.find_compiler", lambda: str(tool))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with pytest.raises(ShipidError, match="the C compiler failed"):
        write_fmu(vessel_unit(variety()["actuators"], "ship", "rk4"), tmp_path / "ship.fmu")
    assert not os.path.exists(noted.read_text())
    assert sorted(place.name for place in tmp_path.iterdir()) == ["gcc", "noted"]


def test_an_importer_finds_no_fault(ship, aboard):
    validation = pytest.importorskip("fmpy.validation")
    for file in (ship, aboard):
        assert validation.validate_fmu(str(file)) == []


def start_values():
    vessel = variety()["actuators"]
    commands = {"port.n": 2.0, "starboard.n": 2.2, "port.alpha": 0.2, "starboard.alpha": 0.1}
    return vessel, {"u": 4.0, "psi": 0.3}, commands, {"V_w": 6.0, "beta_w": 1.0}


@pytest.mark.slow
def test_a_minute_of_a_vessel_is_that_of_python(ship, tmp_path):
    """As it comes, and from its sources compiled again by the importer."""
    fmpy = pytest.importorskip("fmpy")
    vessel, state, commands, weather = start_values()
    mass = 1.1 * vessel.parameters["inertia.m"]
    values = {**state, **commands, **weather, "inertia.m": mass, "solver.step": 0.1}
    names = ("north", "east", "psi", "u", "v", "r")
    columns = {name: np.array([state.get(name, 0.0)]) for name in names}
    held = {name: np.array([value]) for name, value in {**commands, **weather}.items()}
    heavy = vessel.with_values({"inertia.m": mass})
    expected = rollout(heavy, columns, held, held, step=0.1, num_steps=600, method="rk4", engine="native", every=10)
    again = tmp_path / "again.fmu"
    again.write_bytes(ship.read_bytes())
    for file in (ship, again):
        if file == again:
            strict = ["--all-warnings", "--warning-as-error"]
            command = [sys.executable, "-m", "fmpy", "compile", *strict, str(again)]
            result = subprocess.run(command, capture_output=True, text=True)
            assert result.returncode == 0, result.stdout[-1000:] + result.stderr[-1000:]
        for step in (1.0, 0.5):
            output = fmpy.simulate_fmu(
                str(file), stop_time=SECONDS, step_size=step, output_interval=step, start_values=values, output=names
            )
            every = round(1.0 / step)
            for name in names:
                np.testing.assert_allclose(output[name][::every], expected[name][:, 0, 0], rtol=1e-12, atol=1e-12)


@pytest.mark.slow
def test_a_minute_of_a_predictor_is_that_of_python(aboard, predictor):
    """The rudder follows its orders from the first row on; the plan is that orders stay."""
    fmpy = pytest.importorskip("fmpy")
    t = np.arange(0.0, SECONDS + 1)
    u, delta = 6 + np.sin(t / 10), 0.2 * np.sin(t / 7)
    signals = np.rec.fromarrays([t, u, delta, np.full_like(t, 1.2)], names="time,u,rudder.delta,propeller.n")
    output = fmpy.simulate_fmu(
        str(aboard), stop_time=SECONDS, step_size=1.0, output_interval=1.0, input=signals,
        output=["x[6]", "y[6]", "x[1]", "instant", "alarm", "status"],
    )  # fmt: skip
    at = np.round(output["instant"]).astype(int)
    assert len(at) > 50
    orders = {"propeller.n": np.full(len(t), 1.2), "rudder.delta": delta}
    along = memory_along(predictor.vessel, orders, t)
    zero = np.zeros(len(at))
    columns = {"u": u[at], "v": zero, "r": zero, "psi": zero, **{name: values[at] for name, values in orders.items()}}
    planned = {name: np.tile(columns[name], (6, 1)) for name in orders}
    hidden = {name: values[at] for name, values in along.items()}
    expected = predictor.predict(Instants(columns, planned=planned, hidden=hidden))
    for name, k, axis in (("x[6]", 5, 0), ("y[6]", 5, 1), ("x[1]", 0, 0)):
        np.testing.assert_allclose(output[name], expected[k, :, axis], rtol=0, atol=1e-12)
    assert not output["alarm"].any()
    assert not output["status"].any()


class Instance:
    """One instance of an FMU through FMPy's low level, with its messages."""

    def __init__(self, file, folder, name="a"):
        fmpy = pytest.importorskip("fmpy")
        from fmpy.fmi2 import FMU2Slave

        self.description = fmpy.read_model_description(str(file))
        self.fmu = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.at = {v.name: v.valueReference for v in self.description.modelVariables if v.type == "Real"}

    def begin(self):
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        return self

    def set(self, **values):
        self.fmu.setReal([self.at[name] for name in values], list(values.values()))

    def get(self, *names):
        return self.fmu.getReal([self.at[name] for name in names])


@pytest.fixture
def folder(ship, tmp_path):
    with zipfile.ZipFile(ship) as archive:
        archive.extractall(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_wrong_values_are_refused_and_the_instance_goes_on(ship, folder):
    fmi = pytest.importorskip("fmpy.fmi1")
    one = Instance(ship, folder).begin()
    one.set(u=4.0)
    for value in (np.nan, np.inf):
        with pytest.raises(fmi.FMICallException):
            one.set(V_w=value)
    with pytest.raises(fmi.FMICallException):
        one.fmu.getReal([100000])
    for reference in (0, 2**32 - 1):  # a vessel has no alarm
        with pytest.raises(fmi.FMICallException):
            one.fmu.getBoolean([reference])
    one.fmu.exitInitializationMode()
    with pytest.raises(fmi.FMICallException):
        one.set(u=3.0)
    for step in (np.nan, -1.0):
        with pytest.raises(fmi.FMICallException):
            one.fmu.doStep(0.0, step)
    one.set(**{"load.X": 1e12})
    with pytest.raises(fmi.FMICallException):
        one.fmu.doStep(0.0, 1.0)
    assert one.get("u") == [4.0]
    assert one.fmu.getInteger([0]) == [4]
    one.set(**{"load.X": 0.0})
    one.fmu.doStep(0.0, 1.0)
    assert one.fmu.getInteger([0]) == [0]
    assert 3.0 < one.get("u")[0] < 4.5
    state = one.fmu.getFMUstate()
    one.fmu.doStep(1.0, 1.0)
    after = one.get("u", "north")
    one.fmu.setFMUstate(state)
    one.fmu.doStep(1.0, 1.0)
    assert one.get("u", "north") == after
    one.fmu.freeFMUstate(state)
    one.fmu.terminate()
    one.fmu.freeInstance()


@pytest.mark.slow
def test_an_actuator_begins_where_the_importer_says_else_at_its_order(ship, folder):
    _, state, commands, weather = start_values()
    one = Instance(ship, folder).begin()
    reached = [name for name in one.at if name.startswith("actual.")]
    assert reached
    chosen = {reached[0]: 0.05}
    for given in ({}, chosen, {}):  # the last after a reset
        one.set(**state, **commands, **weather, **given)
        one.fmu.exitInitializationMode()
        orders = {name: commands[name.removeprefix("actual.")] for name in reached}
        assert one.get(*reached) == list({**orders, **given}.values())
        one.fmu.reset()
        one.fmu.enterInitializationMode()
    one.fmu.freeInstance()


def test_an_actuator_begins_within_its_stops(ship, folder):
    """Before, the output was an order beyond them until the first step: a rudder at 3 rad that stops at 2."""
    one = Instance(ship, folder).begin()
    one.set(**{"port.alpha": 3.0, "starboard.alpha": -9.0, "starboard.n": 2.0})
    assert one.get("actual.port.alpha", "actual.starboard.alpha", "actual.starboard.n") == [2.0, -2.0, 2.0]
    one.set(**{"thruster.port.actuator.alpha.high": 2.5})
    one.fmu.exitInitializationMode()
    before = one.get("actual.port.alpha", "actual.starboard.alpha")
    one.fmu.doStep(0.0, 1.0)
    assert before == one.get("actual.port.alpha", "actual.starboard.alpha") == [2.5, -2.0]
    one.fmu.freeInstance()


@pytest.mark.slow
def test_outputs_of_the_initialisation_follow_what_has_been_set(ship, aboard, folder):
    """Before, a tool that read them there, as FMI allows, had paths of 0 m without an alarm."""
    with zipfile.ZipFile(aboard) as archive:
        archive.extractall(folder / "aboard")
    one = Instance(aboard, folder / "aboard").begin()
    for u in (4.0, 9.0):  # limits: 0 to 8 m/s
        one.set(**{"u": u, "propeller.n": 1.2, "rudder.delta": 0.1})
        alarm, path = one.fmu.getBoolean([0]), one.get("x[1]", "x[6]", "y[6]", "instant")
        assert alarm == [u > 8]
        assert 3 * u < path[0] < 6 * u
    one.fmu.exitInitializationMode()
    assert one.get("x[1]", "x[6]", "y[6]", "instant") == path
    assert one.fmu.getInteger([0]) == [2]
    one.fmu.freeInstance()
    two = Instance(ship, folder).begin()
    order = next(name for name in two.at if f"actual.{name}" in two.at)
    for value in (0.3, 0.2):
        two.set(**{order: value})
        assert two.get(f"actual.{order}") == [value]
    two.fmu.freeInstance()


@pytest.mark.slow
def test_the_band_of_a_predictor_is_that_of_python(tmp_path):
    """Its level is a parameter; one that cannot be promised gives a status and no band."""
    fmpy = pytest.importorskip("fmpy")
    strange = drawn("alone", 6, vessel="mariner")
    physics = Physics(load_vessel("mariner"), strange.predictor.physics.horizon, 5.0, "rk4")
    bands = replace(strange.predictor.bands, runs=10)
    predictor = Predictor(physics, "alone", UnchangedPath({}), {"u": (0.0, 8.0)}, {}, "held", bands=bands)
    file = tmp_path / "banded.fmu"
    assert write_fmu(predictor_unit(build_model(predictor), "banded"), file)
    assert pytest.importorskip("fmpy.validation").validate_fmu(str(file)) == []
    t = np.arange(0.0, 21.0)
    u, delta = 6 + np.sin(t / 10), np.full_like(t, 0.1)
    signals = np.rec.fromarrays([t, u, delta, np.full_like(t, 1.2)], names="time,u,rudder.delta,propeller.n")
    last = physics.horizon
    names = [f"{key}[{k}]" for key in ("along", "across", "ahead_x", "ahead_y") for k in (1, last)]
    for level in (0.9, 0.3, 0.95):
        output = fmpy.simulate_fmu(
            str(file), stop_time=20.0, step_size=1.0, output_interval=1.0, input=signals,
            output=[*names, "instant", "status"], start_values={"level": level},
        )  # fmt: skip
        if level == 0.95:
            assert (output["status"] == 32).all()
            assert np.isnan(output["along[1]"]).all()
            continue
        at = np.round(output["instant"]).astype(int)
        zero = np.zeros(len(at))
        columns = {"u": u[at], "v": zero, "r": zero, "psi": zero, "rudder.delta": delta[at], "V_w": zero}
        columns["propeller.n"] = np.full(len(at), 1.2)
        region = predictor.predict(Instants(columns), level=level).region
        for k in (1, last):
            np.testing.assert_allclose(output[f"along[{k}]"], region.along[k - 1], rtol=1e-10)
            np.testing.assert_allclose(output[f"across[{k}]"], region.across[k - 1], rtol=1e-10)
            np.testing.assert_allclose(output[f"ahead_x[{k}]"], region.ahead[k - 1, :, 0], rtol=0, atol=1e-10)
            np.testing.assert_allclose(output[f"ahead_y[{k}]"], region.ahead[k - 1, :, 1], rtol=0, atol=1e-10)
        assert not output["status"].any()
