"""Estimates parameters of the testbed from measurements: the values with which the FMU, driven by the measured motor
angles, comes closest to the measurements. Sensor offsets and the state at the first row are estimated, too.

Each FILE is one experiment, a CSV table with the columns
  time, theta1, theta2        and, if logged, the motors' rates omega1, omega2
  tau1 tau2 theta3 theta4 pitch roll pitch_rate roll_rate      any of these; cells may be empty
Units are in the header, as in `pitch [deg]` or `tau1_mNm`, or in --units; otherwise SI: s, rad, rad/s, N.m. Rows may
be uneven; lines above the header that start with # are comments.

Exit status: 0; 1 for an error or undetermined parameters; 3 if the FMU does not explain the data.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from prw.columns import UNITS, factor
from prw.commands.options import (
    Named,
    add_paths,
    add_reading_options,
    add_task_options,
    bounds,
    call,
    integer,
    listed,
    number,
    show,
    spread,
)
from prw.errors import DoesNotFit, UserError, need
from prw.identification import identify
from prw.identification.kinds import KINDS

HELP = "estimate parameters from measurements"
EXAMPLES = """\
examples:
  prw identify run1.csv run2.csv                     k1, k2, c1, c2, c3 from two experiments together
  prw identify run.csv --units pitch=deg,roll=deg    if the header has no units
  prw identify run.csv --prior J3=10% --prior H3=10% inertias too, known to 10 % (one sigma)
  prw identify run.csv --estimate k1,k2 --set c3=0.3 two of them, c3 held at another value
then:
  prw simulate motors.csv --parameters out/identified/identified.json
"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help="CSV table of one experiment")
    add_task_options(parser)
    parser.add_argument(
        "--prior",
        dest="priors",
        action=Named,
        read=spread,
        metavar="NAME=[VALUE:]PERCENT%",
        help="prior knowledge of a parameter, one sigma; VALUE in SI (default: its start value). The parameter is "
        "then estimated, too. May be repeated",
    )
    parser.add_argument(
        "--bounds",
        action=Named,
        read=bounds,
        metavar="NAME=LOW:HIGH",
        help="range of a parameter in SI (default: a factor of 100 about its start value). May be repeated",
    )
    add_reading_options(parser)
    parser.add_argument(
        "--quantum",
        metavar="ANGLE",
        help="resolution of the motors' encoders, as in 0.036deg or 0.000628rad (default: found in the data)",
    )
    channels = {
        "delay": "come late",
        "lag": "lag, to first order",
        "gain": "read too much or too little",
        "drift": "drift slowly",
        "fading": "lose gain during the recording",
    }
    places = {
        "friction": "places with dry friction (N.m)",
        "backlash": "springs with backlash (rad), or the motors",
        "clearance": "couplings that let go in a gap (rad)",
        "cubic": "springs with the torque k (twist + cubic twist^3), cubic in 1/rad2",
        "asymmetry": "parameters that differ between the sides; the estimate is then the value of side 1",
        "viscous": "places with viscous friction (N.m.s/rad)",
        "softening": "springs that lose stiffness during the recording; the estimate is then the value at its beginning",
        "turned": "inertial sensors that are turned from pitch towards roll",
        "crosstalk": "torques to which the other one adds a share",
    }
    effects = {
        kind: ("NAMES", f"channels that may {effect}, separated by commas; the {kind} is estimated, too")
        for kind, effect in channels.items()
    } | {
        kind: ("PLACES", f"{what}; the size is estimated, too: {', '.join(KINDS[kind].places)}")
        for kind, what in places.items()
    }
    for kind, (metavar, explained) in effects.items():
        parser.add_argument(f"--{kind}", type=listed, default="", metavar=metavar, help=explained)
    parser.add_argument(
        "--hum",
        action=Named,
        read=number,
        metavar="NAME=HERTZ",
        help="channel with hum, as in tau1=50, which is subtracted. May be repeated",
    )
    parser.add_argument(
        "--robust",
        action="store_true",
        help="values that are more than 4 standard deviations from the model, such as spikes, count less",
    )
    parser.add_argument(
        "--follow",
        type=_steps,
        nargs="?",
        const=3,
        default=0,
        metavar="STEPS",
        help="follow the first cause that is found, step by step, at most %(const)s or STEPS times, and list what was assumed",
    )
    parser.add_argument(
        "--write-anyway", action="store_true", help="write parameters even if the FMU does not explain the data"
    )
    parser.add_argument("--no-offsets", dest="offsets", action="store_false", help="the sensors have no offsets")
    parser.add_argument(
        "--starts", type=integer, default=6, metavar="N", help="starting points of the search (default: %(default)s)"
    )
    parser.add_argument("--seed", type=integer, default=0, help="of the random starting points (default: %(default)s)")
    add_paths(parser, "directory of report.html, report.json, identified.json and identified.ssv", "identified")


def run(arguments: argparse.Namespace) -> None:
    """Carry out `prw identify`. Raises UserError with a message of one line."""
    need("scipy", "jinja2", "matplotlib", "threadpoolctl")
    found = call(identify, arguments, quantum=_quantum(arguments.quantum))
    report, numbers_, parameters, ssv = (
        arguments.out / name for name in ("report.html", "report.json", "identified.json", "identified.ssv")
    )
    found.report(report, command=True)
    found.to_json(numbers_)
    print(found.summary(command=True))
    # Parameters are written only if they are determined, and if the model fits or --write-anyway is given. Otherwise old files
    # are removed, so that they are never next to a new report.
    wrong = not found.fits and not arguments.write_anyway
    if wrong or found.undetermined:
        parameters.unlink(missing_ok=True)
        ssv.unlink(missing_ok=True)
        show(f"wrote       {report}, {numbers_}")
    if wrong:
        channels = ", ".join(dict.fromkeys(misfit.channel for misfit in found.verdict.misfits))
        causes = found.diagnosis_in(command=True)
        perhaps = f"; perhaps {causes[0]}" if causes else ""
        left = f"; besides, {'; '.join(found.undetermined)}" if found.undetermined else ""
        raise DoesNotFit(
            f"the FMU does not explain the data ({channels}){perhaps}{left}. {report} has the rest; identified.json was "
            "not written (--write-anyway writes it)"
        )
    if found.undetermined:
        raise UserError(
            f"{'; '.join(found.undetermined)}. Remedies: {'; or '.join(found.advice)}. {report} has the rest; "
            "identified.json was not written"
        )
    found.to_parameters(parameters)
    found.to_ssv(ssv)
    show(f"wrote       {report}, {numbers_}, {parameters}, {ssv}")
    if not found.fits:
        raise DoesNotFit("the FMU does not explain the data; the parameters that were written are not reliable")
    show(f"next        look at the report; then: prw simulate {arguments.files[0]} --parameters {parameters}")


def _steps(string: str) -> int:
    try:
        return integer(string)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{string!r} is not a number of steps; put files before --follow, or give the number"
        ) from None


def _quantum(string: str | None) -> float:
    if string is None:
        return 0.0
    match = re.fullmatch(r"\s*([-+.\deE]+)\s*(\D.*)", string)
    try:
        if match:
            return number(match[1]) * factor("theta1", match[2])
    except ValueError:
        pass
    raise UserError(
        f"write an angle above 0 and its unit, as in 0.036deg; units are {', '.join(UNITS['angle'])}",
        argument="quantum",
        given=string,
    )
